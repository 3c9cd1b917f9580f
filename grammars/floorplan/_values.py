"""Quantities: literals with units and variables, as metres and radians."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal, TypeAlias

from grammars.diagnostics import did_you_mean
from grammars.floorplan._source import Findings, Node, with_article

Kind: TypeAlias = Literal["length", "angle"]

_LARGEST: Final = 1e6
_TO_SI: Final = {"m": 1.0, "rad": 1.0, "deg": math.pi / 180.0}
_UNIT_KIND: Final[dict[str, Kind]] = {"m": "length", "rad": "angle", "deg": "angle"}
_UNIT_ADVICE: Final = {"length": "lengths are in metres: m", "angle": "angles are in deg or rad"}


class Quantities:
    """Reads the quantities of one plan; broken ones are reported and read as ``None``."""

    def __init__(self, variables: Sequence[Node], findings: Findings) -> None:
        self._findings = findings
        self._variables: dict[str, list[Node]] = {}
        for variable in variables:
            self._variables.setdefault(variable.name, []).append(variable)
        for name, nodes in self._variables.items():
            for node in nodes[1:]:
                first = findings.source.at(nodes[0]).line
                findings.warn(node, f'variable "{name}" is already defined in line {first}')

    def length(self, node: Node) -> float | None:
        """Return a length in metres."""
        return self._read(node, "length")

    def angle(self, node: Node) -> float | None:
        """Return an angle in radians."""
        return self._read(node, "angle")

    def _read(self, node: Node, kind: Kind) -> float | None:
        value = self._variable(node, kind) if node.variable else self._literal(node, node, kind)
        if value is None:
            return None
        return -value if node.negated else value

    def _literal(self, node: Node, place: Node, kind: Kind) -> float | None:
        unit = node.unit or ("m" if kind == "length" else "rad")
        if _UNIT_KIND[unit] != kind:
            self._findings.error(
                place,
                f'expected {with_article(kind)}, not "{node.number} {unit}"',
                _UNIT_ADVICE[kind],
            )
            return None
        number = float(node.number)
        if abs(number) > _LARGEST:
            self._findings.error(place, f"{node.number} is too large", "the limit is 1000 km")
            return None
        if kind == "angle" and not node.unit and abs(number) > math.tau:
            self._findings.warn(
                place,
                f"{node.number} without a unit means radians",
                f'write "{node.number} deg" for degrees',
            )
        return number * _TO_SI[unit]

    def _variable(self, node: Node, kind: Kind) -> float | None:
        name = node.variable
        known = self._variables.get(name, [])
        if not known:
            hint = did_you_mean(name, self._variables) or f'define it: "var {name} = 1.0 m"'
            self._findings.error(node, f'unknown variable "{name}"', hint)
            return None
        if len(known) > 1:
            lines = " and ".join(str(self._findings.source.at(v).line) for v in known)
            self._findings.error(node, f'variable "{name}" is not unique: defined in lines {lines}')
            return None
        variable = known[0]
        if _UNIT_KIND[variable.unit] != kind:
            self._findings.error(
                node,
                f'expected {with_article(kind)}, but variable "{name}" is in {variable.unit}',
                _UNIT_ADVICE[kind],
            )
            return None
        return self._literal(variable, node, kind)
