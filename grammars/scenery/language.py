"""The textX side of the scenery language: text to parse tree, and syntax errors for people."""

from __future__ import annotations

import bisect
import difflib
import functools
import re
from pathlib import Path
from typing import Any, Final

from grammars.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.parsing import metamodel, offset_of
from grammars.quantity import parse_quantity
from grammars.scenery.units import NUMBER, UNIT

_GRAMMAR: Final = Path(__file__).with_name("scenery.tx")
_STARTERS: Final = (
    "object",
    "mover",
    "link",
    "joint",
    "state",
    "group",
    "parameter",
    "every",
    "all",
)
_COMMENT: Final = re.compile(r"//[^\n]*")
_UNITLESS: Final = re.compile(r'\b(?:leg\s+\d+|waypoint\s+(?:"[^"\n]*"|[\w-]+))')
"""Numbers of legs and names of waypoints, which look like quantities without a unit."""
_NUMBER: Final = re.compile(rf"(?<![\w.^])(?<!\d,)(?<!\[)({NUMBER})(?!\.)")
_UNIT: Final = re.compile(rf"[ \t]*({UNIT})")
_DECIMAL_COMMA: Final = re.compile(r",\d")
_WORD: Final = re.compile(r"[ \t]*([^\W\d_]+|°)(?!\w)")
_KEYWORDS: Final = """
    x y at turned from to mass and friction closer damped between along until every with up late in
    by is when again of starts frozen hinge sliding opening on recessed seen stays moves toggles
    goes except within probability are start stay move toggle go their its walks walk accelerating
    once back pausing facing yielding not round after deviation every begins
"""
_NOT_UNITS: Final = frozenset(_KEYWORDS.split())
_READABLE: Final = {
    "NameText": "a name",
    "NumberText": "a number",
    "UnitText": "a unit",
    "AxisName": "x or y",
    "INT": "a whole number",
    "EOF": "the end of the file",
    r"[^\d\W]\w*": "a name",
    r"an?\b": '"a"',
    r"robot's\s+footprint\b": '"robot\'s footprint"',
    r"back\s+and\s+forth\b": '"back and forth"',
    "WaypointName": "a waypoint",
}
"""What rules and patterns of the grammar are called in messages."""
_SHOWN: Final = 8
_UNSAID: Final = frozenset(
    {"are", "all", "start", "stay", "move", "toggle", "go", "their", "walk", "cylinder"}
)
"""Plural forms: accepted, but not suggested beside the singular."""


class Places:
    """Lines and columns of a text."""

    def __init__(self, text: str, file: str) -> None:
        self.text = text
        self.file = file
        self._starts = [0, *(m.end() for m in re.finditer("\n", text))]

    def at(self, position: int) -> Where:
        """Return the place of the character at ``position``."""
        line = bisect.bisect_right(self._starts, position)
        return Where(self.file, line, position - self._starts[line - 1] + 1)


@functools.cache
def _metamodel() -> Any:
    return metamodel(_GRAMMAR, autokwd=True)


def parse_tree(text: str, places: Places) -> Any:
    """Return the textX model of ``text``; raises :class:`InputError` with every unit problem.

    Units are looked at first: a missing or misspelt one would otherwise show up as a syntax error
    some words later.
    """
    from textx.exceptions import TextXError, TextXSyntaxError

    findings = _unit_findings(text, places)
    if findings:
        raise InputError(findings)
    try:
        return _metamodel().model_from_str(text)
    except TextXSyntaxError as error:
        raise InputError(_syntax_error(error, text, places)) from error
    except TextXError as error:
        where = Where(places.file, error.line or 0, error.col or 0)
        raise InputError(Diagnostic(where, str(error.message))) from error
    except RecursionError as error:
        raise InputError(Diagnostic(Where(places.file), "is nested too deeply")) from error


def _unit_findings(text: str, places: Places) -> list[Diagnostic]:
    blanked = _blank(_UNITLESS, _blank(_COMMENT, text))
    findings: list[Diagnostic] = []
    for match in _NUMBER.finditer(blanked):
        if blanked[: match.start()].rstrip().endswith("probability"):
            continue
        where = places.at(match.start())
        if _DECIMAL_COMMA.match(blanked, match.end()):
            findings.append(Diagnostic(where, "decimals are written with a point", "1.5, not 1,5"))
            continue
        unit = _UNIT.match(blanked, match.end())
        if unit is None:
            findings.append(_without_unit(match[1], _WORD.match(blanked, match.end()), where))
            continue
        try:
            parse_quantity(f"{match[1]} {unit[1]}", where)
        except InputError as error:
            findings.extend(error.diagnostics)
    return findings


def _blank(pattern: re.Pattern[str], text: str) -> str:
    return pattern.sub(lambda m: " " * len(m[0]), text)


def _without_unit(number: str, word: re.Match[str] | None, where: Where) -> Diagnostic:
    if word is not None and word[1] not in _NOT_UNITS:
        return Diagnostic(where, f'"{word[1]}" is not a unit known here', _unit_hint(word[1]))
    hint = f"write {number} m, {number} rad, {number} s, … as is meant"
    return Diagnostic(where, f"a unit is missing after {number}", hint)


def _unit_hint(word: str) -> str:
    if word.lower() == "nm":
        return "write N m, with a blank"
    known = ("rad", "deg", "cm", "mm", "min", "kg", "m", "s", "N", "N m", "m/s", "rad/s")
    longer = next((unit for unit in known if len(unit) > 1 and word.startswith(unit)), None)
    return f'did you mean "{longer}"?' if longer else did_you_mean(word, known)


def _syntax_error(error: Any, text: str, places: Places) -> Diagnostic:
    position = min(len(text), offset_of(text, error.line, error.col))
    rest = re.match(r"\w+|\S", text[position:])
    found = _quoted(rest[0]) if rest else "the end of the file"
    words = _expected(error)
    if not words and rest and rest[0] in (*_STARTERS, "except"):
        return Diagnostic(places.at(position), f"{found} cannot be a name", "take another word")
    message = f"expected {_listed(words)}, found {found}" if words else f"{found} is not expected"
    return Diagnostic(places.at(position), message, _syntax_hint(text, position, rest, words))


def _quoted(word: str) -> str:
    return f"'{word}'" if word == '"' else f'"{word}"'


def _expected(error: Any) -> list[str]:
    """Return what could stand there, words before signs."""
    names = dict.fromkeys(_spelled(rule) for rule in error.expected_rules or ())
    return sorted(filter(None, names), key=lambda name: not name.strip('"')[:1].isalnum())


def _listed(words: list[str]) -> str:
    if len(words) > _SHOWN:
        return ", ".join(words[:_SHOWN]) + ", …"
    return " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _spelled(rule: Any) -> str:
    pattern = str(getattr(rule, "to_match", ""))
    known = _READABLE.get(rule.rule_name) or _READABLE.get(pattern)
    if known or not pattern or pattern in _UNSAID or pattern.startswith(r"\/\/"):
        return known or ""
    return f'"{pattern}"'


def _syntax_hint(text: str, position: int, rest: re.Match[str] | None, expected: list[str]) -> str:
    """Compare the word found with those expected, and the first of its line with openings."""
    if rest is not None and rest[0] == "#":
        return "comments start with //"
    line = text[text.rfind("\n", 0, position) + 1 : position]
    first = re.match(r"\s*(\w+)", line)
    candidates = [
        (rest[0] if rest else "", [word.strip('"') for word in expected]),
        (first[1] if first else "", list(_STARTERS)),
    ]
    for word, known in candidates:
        if len(word) < 3 or word in known:
            continue
        if word.lower() in known:
            return f'write "{word.lower()}" in small letters'
        close = difflib.get_close_matches(word, known, 1, 0.75)
        if close:
            return f'did you mean "{close[0]}"?'
    return ""
