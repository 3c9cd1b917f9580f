"""From the text of a layer to its syntax tree; units and syntax errors told to people."""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from grammars.scenery._events import EVENT_RULES
from grammars.scenery._instances import INSTANCE_RULES
from grammars.scenery._objects import OBJECT_RULES
from grammars.scenery._reader import RULES
from grammars.scenery._sentences import SENTENCE_RULES
from grammars.scenery.measure import NUMBER
from grammars.text.diagnostics import (
    Diagnostic,
    InputError,
    SourceText,
    SyntaxNode,
    Where,
    did_you_mean,
)
from grammars.text.parsing import Language, SyntaxFault, listed
from grammars.text.quantity import parse_quantity
from grammars.text.units import UNIT

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
_GRAMMAR: Final = Path(__file__).with_name("scenery.tx")
_KEYWORD: Final = re.compile(r"'([^'\n]+)'|/((?:\\.|[^/\\\n])+)/")
"""A word in quotes, or a pattern, of the grammar."""
_VERBS: Final = r"\b(?:walks?|moves?|toggles?|goes|go|stays?|starts?|is)\b"
_EXPECTED_UNITS: Final = tuple(
    (re.compile(rf"{before}\s*$", re.DOTALL), units)
    for before, units in (
        (r"\bservo\s+at", ("deg/s", "m/s")),
        (r"\baccelerating\s+at", ("m/s^2",)),
        (rf"\bwalks?\b(?:(?!{_VERBS}).)*\bat", ("m/s",)),
        (rf"\bmoves?\b(?:(?!{_VERBS}).)*\bto\s+[^,\n]+?\s+at", ("s",)),
        (r"\b(?:pausing|after|every|until)", ("s",)),
        (r"\b(?:within|beyond|radius)", ("m",)),
        (r"\bmass", ("kg",)),
    )
)
"""Units of the number that follows such words, where they leave no doubt."""
_SENTENCE: Final = 400
"""So many characters before a number are looked at for such words."""
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


class _SceneryLanguage(Language):
    classes = (*RULES, *OBJECT_RULES, *INSTANCE_RULES, *SENTENCE_RULES, *EVENT_RULES)
    words = _READABLE
    token = re.compile(r"\w+|\S")

    def phrases(self, fault: SyntaxFault) -> Sequence[str]:
        """Return what could stand there, words before signs."""
        said = [self.words.get(key, f'"{key}"') for key in fault.expected if key not in _UNSAID]
        return sorted(dict.fromkeys(said), key=lambda name: not name.strip('"')[:1].isalnum())

    def message(self, fault: SyntaxFault) -> str:
        found = _quoted(fault.word) if fault.word else "the end of the file"
        words = self.phrases(fault)
        if words:
            many = len(words) > _SHOWN
            expected = ", ".join((*words[:_SHOWN], "…")) if many else listed(words)
            return f"expected {expected}, found {found}"
        return f"{found} {'cannot be a name' if _is_reserved(fault) else 'is not expected'}"

    def hint(self, fault: SyntaxFault) -> str:
        """Compare the word found with those expected, and the first of its line with openings."""
        expected = self.phrases(fault)
        if not expected and _is_reserved(fault):
            return "take another word"
        if fault.word == "#":
            return "comments start with //"
        line = fault.text[fault.text.rfind("\n", 0, fault.offset) + 1 : fault.offset]
        first = re.match(r"\s*(\w+)", line)
        candidates = [
            (fault.word, [word.strip('"') for word in expected]),
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


def _is_reserved(fault: SyntaxFault) -> bool:
    return fault.word in (*_STARTERS, "except")


def _quoted(word: str) -> str:
    return f"'{word}'" if word == '"' else f'"{word}"'


_LANGUAGE: Final = _SceneryLanguage(_GRAMMAR, autokwd=True)


@functools.cache
def _keywords() -> frozenset[str]:
    """Return the words of the grammar: what follows a number and is one of them is no unit."""
    texts = _KEYWORD.findall(_GRAMMAR.read_text(encoding="utf-8"))
    quoted = (word for word, _ in texts if word.isalpha())
    return frozenset(quoted).union(*(re.findall(r"[a-z]{2,}", pattern) for _, pattern in texts))


def parse_tree(source: SourceText) -> SyntaxNode:
    """Return the textX model of a text; raises :class:`InputError` with every unit problem.

    Units are looked at first: a missing or misspelt one would otherwise show up as a syntax error
    some words later.
    """
    findings = _unit_findings(source)
    if findings:
        raise InputError(findings)
    return _LANGUAGE.parse(source)


def _unit_findings(source: SourceText) -> list[Diagnostic]:
    blanked = _blank(_UNITLESS, _blank(_COMMENT, source.text))
    findings: list[Diagnostic] = []
    for match in _NUMBER.finditer(blanked):
        # The only number that needs no unit.
        if blanked[: match.start()].rstrip().endswith("probability"):
            continue
        where = source.where(match.start())
        if _DECIMAL_COMMA.match(blanked, match.end()):
            findings.append(Diagnostic(where, "decimals are written with a point", "1.5, not 1,5"))
            continue
        unit = _UNIT.match(blanked, match.end())
        if unit is None:
            word = _WORD.match(blanked, match.end())
            before = blanked[max(0, match.start() - _SENTENCE) : match.start()]
            findings.append(_without_unit(match[1], word, before, where))
            continue
        try:
            parse_quantity(f"{match[1]} {unit[1]}", where)
        except InputError as error:
            findings.extend(error.diagnostics)
    return findings


def _blank(pattern: re.Pattern[str], text: str) -> str:
    return pattern.sub(lambda m: " " * len(m[0]), text)


def _without_unit(number: str, word: re.Match[str] | None, before: str, where: Where) -> Diagnostic:
    if word is not None and word[1] not in _keywords():
        return Diagnostic(where, f'"{word[1]}" is not a unit known here', _unit_hint(word[1]))
    units = next((units for words, units in _EXPECTED_UNITS if words.search(before)), ())
    hint = f"write {number} m, {number} rad, {number} s, … as is meant"
    if units:
        hint = f"write {' or '.join(f'{number} {unit}' for unit in units)}"
    return Diagnostic(where, f"a unit is missing after {number}", hint)


def _unit_hint(word: str) -> str:
    if word.lower() == "nm":
        return "write N m, with a blank"
    known = ("rad", "deg", "cm", "mm", "min", "kg", "m", "s", "N", "N m", "m/s", "rad/s")
    longer = next((unit for unit in known if len(unit) > 1 and word.startswith(unit)), None)
    return f'did you mean "{longer}"?' if longer else did_you_mean(word, known)
