"""The schema of oracle layers: lines of a name and an oracle."""

from __future__ import annotations

import re
from typing import Any

from grammars.editor._keywords import literals
from grammars.editor._schema import DIALECT
from grammars.oracle import OBJECT_SIGNALS, SIGNALS, SignalKind, custom_oracle_names

_RULES = ("TemporalOperator", "AmountOperator", "StatisticOperator", "Reached")


def oracle_schema(title: str) -> dict[str, Any]:
    """Return the JSON Schema of an oracle layer; what a line says is checked as it begins."""
    rules = literals("grammars.oracle", "oracle.tx")
    operators = [word for rule in _RULES for word in rules[rule] if word.isalnum()]
    operators.remove("mission")
    operators += map(re.escape, custom_oracle_names())
    signals = [*map(_told, SIGNALS.values())]
    signals += [_told(kind, "<object>.") for kind in OBJECT_SIGNALS.values()]
    return {
        "$schema": DIALECT,
        "title": title,
        "description": "Oracles by name: what must hold for a run, one line each, with units. "
        "A line without a limit is a measure: reported, never red.",
        "type": "object",
        "minProperties": 1,
        "additionalProperties": False,
        "patternProperties": {r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$": {"$ref": "#/$defs/oracle"}},
        "$defs": {
            "oracle": {
                "type": "string",
                "description": "What must hold, and optionally when it is judged.\n\nSignals:\n"
                + "\n".join(signals),
                "pattern": rf"^\s*(?:{'|'.join(operators)})(?![A-Za-z0-9_])[^(]*\(.*\)",
                "errorMessage": f"an oracle begins with one of: {', '.join(operators)}",
                "examples": [
                    "always(loc.error <= 0.35 m)",
                    "never(contact)",
                    "eventually within 60 s (mission.leg == 2)",
                    "fraction(loc.inside_2sigma) >= 95 %",
                    "max(speed) <= 0.8 m/s when clearance < 0.1 m",
                    "reached(mission, 0.25 m)",
                ],
            }
        },
    }


def _told(kind: SignalKind, prefix: str = "") -> str:
    return f"- {prefix}{kind.name} [{kind.unit}]: {kind.doc}"
