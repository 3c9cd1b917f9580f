"""Reading of plans: text, syntax tree, and compilation with other values for variables."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from grammars.floorplan._attributes import LARGEST, ElementReader, PlanVariable
from grammars.floorplan._compile import compile_plan
from grammars.floorplan.model import FloorPlan
from grammars.text.diagnostics import (
    Findings,
    InputError,
    SourceText,
    SyntaxNode,
    Where,
    did_you_mean,
    raise_all,
    with_article,
)
from grammars.text.loops import repeated
from grammars.text.parsing import Language, SyntaxFault, without_comments
from grammars.text.quantity import parse_quantity
from grammars.text.sources import read_text

_ELEMENT_START: Final = re.compile(
    r"\b(?:(?:Space|Column|Divider|Entryway|Window)\s*[^\d\W]\w*\s*:|var\s*[^\d\W]\w*\s*=|Defaults\s*:)"
)

_ELEMENTS: Final = {"Space", "Column", "Divider", "Entryway", "Window"}
_WORDS: Final = {
    "ID": "a name",
    "Name": "a name",
    "REAL": "a number",
    "UNSIGNED": "a number",
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
_OPERATORS: Final = {"[+-]", "[*\\/]", "("}
_CONTINUATIONS: Final = {".", ",", "UNIT", "EOF"} | _OPERATORS
_AMOUNT: Final = {"REAL", "UNSIGNED", "ID", "Name", "-", "("}
_SPACE_ORDER: Final = "a space has shape, location, walls, features: in this order, each once"
_VERSION_1: Final = {
    "metres": "var n = 1.0 m",
    "degrees": "var n = 30 deg",
    "pose": "location: with wrt:, of:, translation: and rotation:",
    "from": '"wrt:" for the frame to place against',
    "to": '"of:" for the own frame',
    "Default": '"Defaults: walls: …" right after the plan\'s name',
    "wall": '"walls: thickness: … height: …"',
}
"""Words of version 1 of the language, each with the present form."""
_HINTS: Final = {
    **{
        word: f"this is version 1 of the FloorPlan language; version 2 has {form}"
        for word, form in _VERSION_1.items()
    },
    **dict.fromkeys(
        ("Room", "Corridor", "Hall", "Kitchen", "room"), 'rooms are written "Space NAME:"'
    ),
    **dict.fromkeys(
        ("Door", "Doorway", "Opening", "Gate", "door"),
        'a hole in a wall is written "Entryway NAME:"; a .scenery file hangs doors into it',
    ),
    **dict.fromkeys(("Wall",), "walls are not written: every edge of a space's shape is a wall"),
    "Pillar": 'it is written "Column NAME:"',
    "for": "a loop is written: for i in 1..6 { … }",
    "walls": _SPACE_ORDER,
    "shape": "every element starts with its shape, written once",
    "location": "the location follows the shape (and the height of a column or divider)",
    "aligned": 'walls face each other unless you write "not aligned"',
    "thickness": 'thickness is written inside "walls:" of a space or of Defaults',
    "frame": "frames cannot be named; every element publishes its own",
    "point": "origins cannot be named; every element publishes its own",
    "import": "a floor plan stands alone: it cannot import another file",
    "width": "a rectangle is written: Rectangle width=2 m, length=3 m",
    "#": "comments start with //",
    "/": "comments start with // and end with the line",
}
_SLIPS: Final = {
    r"rotation\s*: \S+$": "write rotation: z: 90 deg (in a wall y: …)",
    r"translation\s*: \S+$": "write translation: x: 1 m, y: 2 m",
    r"[xyz]\s*:[^:,]+ [xyz]$": "put a comma between x, y and z",
    r"\. walls?$": "write hall.walls[0]",
    r"walls\s*\[ \w+$": "walls count from 0; of a rectangle: 0 north (+y), 1 east, 2 south, 3 west",
}
"""Ends of a text, with the unexpected word, and the advice on it."""
_UNITS: Final = re.compile(r"(?:in|inch|inches|ft|feet|yards?|miles?|[A-Za-z]?m|rads|degs)$")


class _FloorPlanLanguage(Language):
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
        if "UNSIGNED" in keys:
            phrases.append("a number or a variable")
            keys -= _AMOUNT
        if phrases and len(keys) > 1:
            keys -= _CONTINUATIONS
        keys -= _OPERATORS
        return sorted({_WORDS.get(key, f'"{key}"') for key in keys}) + phrases

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
        slips = (advice for slip, advice in _SLIPS.items() if re.search(slip, f"{done} {word}"))
        if advice := next(slips, ""):
            return advice
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


def variables_of(tree: SyntaxNode, source: SourceText) -> tuple[PlanVariable, ...]:
    """Return the variables of a plan, in the order they are written."""
    return ElementReader(source).define(tree.variables, {})


def load_floorplan(path: str | Path) -> FloorPlan:
    """Read and compile a ``.fpm`` file (UTF-8).

    Raises :class:`InputError` with all errors; warnings are in the plan.
    """
    return read_floorplan(path).compile()


@dataclass(frozen=True, slots=True, eq=False)
class ParsedFloorPlan:
    """Parsed plan that can be compiled many times with different values."""

    source: SourceText
    _tree: SyntaxNode

    def compile(
        self,
        values: Mapping[str, object] | None = None,
        where: Where | None = None,
        places: Mapping[str, Where] | None = None,
    ) -> FloorPlan:
        """Return the plan, as :func:`load_floorplan` does.

        ``values`` replace values of variables; they are text such as ``"0.8 m"``, written at
        ``where``. ``places`` holds the exact place of a value, if known.
        """
        whole = where or Where(self.source.file)
        numbers = self._numbers(values, whole, places or {}) if values else {}
        return compile_plan(self._tree, self.source, numbers)

    def _numbers(
        self, values: Mapping[str, object], whole: Where, places: Mapping[str, Where]
    ) -> dict[str, float]:
        """Return values of variables in SI units; raises :class:`InputError` with all errors."""
        variables = {variable.name: variable for variable in self.variables}
        read: dict[str, float] = {}
        findings = Findings()
        for key, value in values.items():
            # Campaigns are YAML, where names are written with dashes.
            name = str(key).replace("-", "_")
            where = places.get(str(key), whole)
            variable = variables.get(name)
            if variable is None:
                hint = did_you_mean(name, variables) or "the plan has no variables"
                findings.error(where, f'plan {self._tree.name} has no variable "{key}"', hint)
                continue
            with findings.collecting():
                read[name] = _read_value(variable, value, where)
        raise_all(findings.all)
        return read

    @property
    def variables(self) -> tuple[PlanVariable, ...]:
        """The variables of the plan, in the order they are written."""
        return variables_of(self._tree, self.source)


def read_floorplan(path: str | Path) -> ParsedFloorPlan:
    """Read and parse a ``.fpm`` file; raises :class:`InputError` if it is not a plan."""
    source = repeated(SourceText(read_text(path, "the plan"), str(path)))
    return ParsedFloorPlan(source, parse_syntax(source))


def parse_floorplan(text: str, file: str = "<text>") -> FloorPlan:
    """Compile the text of a plan; diagnostics name it ``file``.

    Raises :class:`InputError` with all errors; warnings are in the plan.
    """
    source = repeated(SourceText(text, file))
    return compile_plan(parse_syntax(source), source)


def _read_value(variable: PlanVariable, value: object, where: Where) -> float:
    quantity, kind = parse_quantity(str(value), where), variable.dimension
    name = variable.name
    if quantity.dimension != kind:
        example = f"write {name}: {variable.text}"
        raise InputError.at(where, f"{name} is {with_article(kind)}, not {value}", example)
    if abs(quantity.value) > LARGEST:
        raise InputError.at(where, f"{name}: {value} is too large", "the limit is 1000 km")
    return quantity.value
