"""Parser from text to syntax tree, with syntax errors in the words of the language."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from grammars.floorplan._shapes import SHAPE_NODES
from grammars.text.diagnostics import SourceText, SyntaxNode
from grammars.text.parsing import Language, SyntaxFault, without_comments

_ELEMENT_START: Final = re.compile(
    r"\b(?:(?:Space|Column|Divider|Entryway|Window)\s*[^\d\W]\w*\s*:|var\s*[^\d\W]\w*\s*=|Defaults\s*:)"
)

_ELEMENTS: Final = {"Space", "Column", "Divider", "Entryway", "Window"}
_WORDS: Final = {
    "ID": "a name",
    "REAL": "a number",
    "INDEX": "a wall index (a whole number)",
    "UNIT": "a unit (such as m, cm or deg)",
    "AXIS": "an axis (x, y or z)",
    "PLAN": '"Floor plan"',
    "NOT_ALIGNED": '"not aligned"',
    "EOF": "the end of the file",
}
_GROUPS: Final = (
    (_ELEMENTS | {"var", "Defaults"}, "the next element"),
    ({"wrt", "of", "in", "translation", "rotation", "spaced", "NOT_ALIGNED"}, "a location part"),
    ({"Rectangle", "Circle", "Polygon"}, "a shape (Rectangle, Circle or Polygon)"),
)
_CONTINUATIONS: Final = {".", ",", "UNIT", "EOF"}
_SPACE_ORDER: Final = "a space has shape, location, walls, features: in this order, each once"
_HINTS: Final = {
    "walls": _SPACE_ORDER,
    "shape": "every element starts with its shape, written once",
    "location": "the location follows the shape (and the height of a column or divider)",
    "wall": 'the wall dimensions of a space are written "walls:"',
    "Default": 'wall defaults are written "Defaults:" and stand right after the plan\'s name',
    "from": 'the frame to place against is written "wrt:"',
    "aligned": 'walls face each other unless you write "not aligned"',
    "thickness": 'thickness is written inside "walls:" of a space or of Defaults',
    "frame": "frames cannot be named; every element publishes its own",
    "point": "origins cannot be named; every element publishes its own",
    "import": "a floor plan stands alone: it cannot import another file",
    "width": "a rectangle is written: Rectangle width=2 m, length=3 m",
    "#": "comments start with //",
    "/": "comments start with // and end with the line",
}
_UNITS: Final = re.compile(r"(?:in|inch|inches|ft|feet|yards?|miles?|[A-Za-z]?m|rads|degs)$")


class _FloorPlanLanguage(Language):
    classes = SHAPE_NODES
    words = _WORDS
    openers = frozenset(_ELEMENTS)

    def statement_starts(self, text: str) -> Sequence[int]:
        return [match.start() for match in _ELEMENT_START.finditer(without_comments(text))]

    def phrases(self, fault: SyntaxFault) -> Sequence[str]:
        keys = set(fault.expected)
        phrases: list[str] = []
        for members, phrase in _GROUPS:
            if len(keys & members) > 1:
                phrases.append(phrase)
                keys -= members
        if phrases and len(keys) > 1:
            keys -= _CONTINUATIONS
        return sorted(_WORDS.get(key, f'"{key}"') for key in keys) + phrases

    def hint(self, fault: SyntaxFault) -> str:
        word, done, rest = fault.word, fault.done, fault.rest
        if not done:
            return 'a plan starts with "Floor plan: NAME"'
        if re.search(r"\d,?$", done) and re.match(r"\d" if done[-1] == "," else r",\d", rest):
            return "decimals are written with a point: 1.5"
        if re.search(r"[\d.]$", done) and _UNITS.match(word):
            return "lengths are in m, cm or mm, angles in deg or rad"
        if re.match(r"[+-]?[\d.]+[^\W\d]", word):
            return "write a blank between a number and its unit: 4.0 m"
        if re.match(r"[-+*/]", word) and re.search(r"\w$", done):
            return "there is no arithmetic; write the number or a variable"
        if re.match(r"p\d$", word):
            return "walls are not written: every edge of a space's shape is a wall"
        if word in _HINTS:
            return _HINTS[word]
        keywords = sorted(set(fault.expected) - set(_WORDS))
        close = difflib.get_close_matches(word, keywords, n=1, cutoff=0.7)
        return f'did you mean "{close[0]}"?' if close else ""


_LANGUAGE: Final = _FloorPlanLanguage(Path(__file__).with_name("floorplan.tx"))


def parse_syntax(source: SourceText) -> SyntaxNode:
    """Return the syntax tree of ``source``.

    Raises :class:`InputError` with one diagnostic per element that cannot be read.
    """
    return _LANGUAGE.parse(source)
