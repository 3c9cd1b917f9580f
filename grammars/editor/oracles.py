"""JSON Schema of oracle layers, with the operators of the oracle grammar."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any, Final

from grammars.editor._schemas import DIALECT
from grammars.oracle import OBJECT_SIGNALS, SIGNALS, SignalDeclaration, custom_oracle_names

_RULES = ("TemporalOperator", "AmountOperator", "StatisticOperator", "Reached")
_RESPONSE: Final = r"whenever\s.*\sthen\s.*\swithin\s.*"
_TOKEN: Final = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)
      | '(?P<literal>(?:\\.|[^'\\])*)'
      | /(?P<regex>(?:\\.|[^/\\\n])+)/
      | (?P<rule>^\w+)(?=\s*:)""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)


@cache
def literals(package: str, grammar: str) -> Mapping[str, tuple[str, ...]]:
    """Return the quoted words and signs of a textX grammar file by rule, in file order.

    ``package`` holds the file ``grammar``: ``literals("grammars.oracle", "oracle.tx")``.
    """
    text = (files(package) / grammar).read_text(encoding="utf-8")
    by_rule: dict[str, list[str]] = {}
    rule = ""
    for match in _TOKEN.finditer(text):
        if match["rule"]:
            rule = match["rule"]
        elif match["literal"] is not None:
            by_rule.setdefault(rule, []).append(match["literal"])
    return MappingProxyType({rule: tuple(words) for rule, words in by_rule.items()})


def oracle_schema(title: str) -> dict[str, Any]:
    """Return the JSON Schema of an oracle layer; it checks the operator of each line."""
    rules = literals("grammars.oracle", "oracle.tx")
    operators = [word for rule in _RULES for word in rules[rule] if word.isalnum()]
    operators.remove("mission")
    operators += map(re.escape, custom_oracle_names())
    begin, begins = "|".join(operators), ", ".join(operators)
    signals = [*map(_signal_line, SIGNALS.values())]
    signals += [_signal_line(kind, "<object>.") for kind in OBJECT_SIGNALS.values()]
    return {
        "$schema": DIALECT,
        "title": title,
        "description": "Oracles by name: conditions of a run, one line each, with units. "
        "A line without a limit is a measure: reported, never red.",
        "type": "object",
        "minProperties": 1,
        "additionalProperties": False,
        "patternProperties": {r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$": {"$ref": "#/$defs/oracle"}},
        "$defs": {
            "oracle": {
                "type": "string",
                "description": "Condition, and optionally when it is judged.\n\nSignals:\n"
                + "\n".join(signals),
                "pattern": rf"^\s*(?:(?:{begin})(?![A-Za-z0-9_])[^(]*\(.*\)|{_RESPONSE})",
                "errorMessage": f"an oracle begins with one of: {begins}, whenever",
                "examples": [
                    "always(loc.error <= 0.35 m)",
                    "never(contact)",
                    "eventually within 60 s (mission.leg == 2)",
                    "whenever contact then speed <= 0.1 m/s within 2 s",
                    "fraction(loc.inside_2sigma) >= 95 %",
                    "max(speed) <= 0.8 m/s when clearance < 0.1 m",
                    "reached(mission, 0.25 m)",
                ],
            }
        },
    }


def _signal_line(kind: SignalDeclaration, prefix: str = "") -> str:
    return f"- {prefix}{kind.name} [{kind.unit}]: {kind.doc}"
