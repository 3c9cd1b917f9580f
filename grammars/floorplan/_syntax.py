"""From text to syntax tree, with syntax errors told in the words of the language."""

from __future__ import annotations

import difflib
import functools
import re
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from grammars.text.diagnostics import Diagnostic, InputError
from grammars.text.parsing import expected_keys, load_metamodel, offset_of
from grammars.text.source import SourceText, SyntaxNode, in_source_order

_GRAMMAR: Final = Path(__file__).with_name("floorplan.tx")
_MOST_ERRORS: Final = 20
_LONGEST: Final = 40

_ELEMENT_START: Final = re.compile(
    r"\b(?:(?:Space|Column|Divider|Entryway|Window)\s*[^\d\W]\w*\s*:|var\s*[^\d\W]\w*\s*=|Defaults\s*:)"
)
_COMMENT: Final = re.compile(r"//[^\n]*")
_TOKEN: Final = re.compile(r"[+-]?[\d.]*\d[\w.]*|\w+|\S")

_ELEMENTS: Final = {"Space", "Column", "Divider", "Entryway", "Window"}
_WORDS: Final = {
    "ID": "a name",
    "REAL": "a number",
    "INDEX": "a wall index (a whole number)",
    "UNIT": "a unit (m, rad or deg)",
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
_UNITS: Final = re.compile(
    r"(?:[munckd]?m|meters?|metres?|in|inch|inches|ft|feet|degrees?|radians?|rads?|°)$"
)


@functools.cache
def _metamodel() -> Any:
    return load_metamodel(_GRAMMAR)


def parse_syntax(source: SourceText) -> SyntaxNode:
    """Return the syntax tree of ``source``.

    Raises :class:`InputError` with one diagnostic per element that cannot be read: after a syntax
    error the element it lies in is blanked out and the rest is read again.
    """
    from textx import TextXSyntaxError

    text = source.text
    errors: list[Diagnostic] = []
    blocks = _blocks(text)
    while len(errors) < _MOST_ERRORS:
        try:
            tree = _metamodel().model_from_str(text)
        except TextXSyntaxError as error:
            offset = offset_of(text, error.line, error.col)
            errors.append(_explain(source, text, offset, error.expected_rules))
            block = next((b for b in reversed(blocks) if b[0] < offset), None)
            if block is None:
                break
            text = _blank(text, block)
            blocks.remove(block)
        else:
            if not errors:
                return tree
            break
    raise InputError(in_source_order(errors))


def _blocks(text: str) -> list[tuple[int, int]]:
    """Return start and end of every element, outside comments."""
    bare = _COMMENT.sub(lambda comment: " " * len(comment.group()), text)
    starts = [match.start() for match in _ELEMENT_START.finditer(bare)]
    return list(pairwise([*starts, len(text)]))


def _blank(text: str, block: tuple[int, int]) -> str:
    start, end = block
    return text[:start] + re.sub(r"[^\n]", " ", text[start:end]) + text[end:]


def _explain(source: SourceText, text: str, offset: int, rules: list[Any]) -> Diagnostic:
    found = _TOKEN.match(text, offset)
    word = found.group() if found else ""
    keys = expected_keys(rules, _WORDS)
    before = _COMMENT.sub(lambda comment: " " * len(comment.group()), text[:offset])
    done = before.rstrip()
    if done and "\n" in before[len(done) :] and not keys & _ELEMENTS:
        last = re.split(r"\s", done)[-1][-_LONGEST:]
        message = f'expected {_expected(keys)} after "{last}"'
        return Diagnostic(source.where(len(done)), message)
    shown = f'"{word[:_LONGEST]}"' if word else "the end of the file"
    message = f"unexpected {shown}; expected {_expected(keys)}"
    return Diagnostic(source.where(offset), message, _hint(word, done, text[offset:], keys))


def _expected(keys: set[str]) -> str:
    left = set(keys)
    phrases: list[str] = []
    for members, phrase in _GROUPS:
        if len(left & members) > 1:
            phrases.append(phrase)
            left -= members
    if phrases and len(left) > 1:
        left -= _CONTINUATIONS
    phrases = sorted(_WORDS.get(key, f'"{key}"') for key in left) + phrases
    return phrases[0] if len(phrases) == 1 else f"{', '.join(phrases[:-1])} or {phrases[-1]}"


def _hint(word: str, done: str, rest: str, keys: set[str]) -> str:
    if not done:
        return 'a plan starts with "Floor plan: NAME"'
    if re.search(r"\d,?$", done) and re.match(r"\d" if done[-1] == "," else r",\d", rest):
        return "decimals are written with a point: 1.5"
    if re.search(r"[\d.]$", done) and _UNITS.match(word):
        return "lengths are in metres (m), angles in deg or rad"
    if re.match(r"[+-]?[\d.]+[^\W\d]", word):
        return "write a blank between a number and its unit: 4.0 m"
    if re.match(r"[-+*/]", word) and re.search(r"\w$", done):
        return "there is no arithmetic; write the number or a variable"
    if re.match(r"p\d$", word):
        return "walls are not written: every edge of a space's shape is a wall"
    if word in _HINTS:
        return _HINTS[word]
    close = difflib.get_close_matches(word, sorted(keys - set(_WORDS)), n=1, cutoff=0.7)
    return f'did you mean "{close[0]}"?' if close else ""
