"""Reading arithmetic, with its dimensions checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from grammars.diagnostics import did_you_mean
from grammars.floorplan._source import Findings, Node, with_article
from grammars.variation._expressions import (
    ANGLE,
    LENGTH,
    PLAIN,
    UNITS,
    Attribute,
    Dimension,
    Expression,
    Measure,
    Number,
    Operation,
    Shared,
    dimension_name,
)
from grammars.variation._measures import distance, measurement, measures_of
from grammars.variation._plan import Element, Slot
from grammars.variation._targets import Targets

_LARGEST: Final = 1e6
_KIND: Final[Mapping[str, Dimension]] = {"length": LENGTH, "angle": ANGLE}
Typed: TypeAlias = tuple[Expression, Dimension]


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """Turns syntax trees into expressions; broken ones are reported and read as ``None``.

    ``shared`` maps named draws to their dimension; ``draws_only`` leaves out the sampled plan.
    """

    findings: Findings
    targets: Targets
    shared: Mapping[str, Dimension]
    draws_only: bool = False

    def read(self, node: Node) -> Typed | None:
        """Return a sum and its dimension."""
        typed = self._product(node.first)
        for tail in node.rest:
            other = self._product(tail.operand)
            typed = self._alike(tail, tail.operator, [typed, other])
        return typed

    def _product(self, node: Node) -> Typed | None:
        typed = self._factor(node.first)
        for tail in node.rest:
            other = self._factor(tail.operand)
            if typed is None or other is None:
                typed = None
                continue
            sign = 1 if tail.operator == "*" else -1
            (m, rad), (more_m, more_rad) = typed[1], other[1]
            dimension = (m + sign * more_m, rad + sign * more_rad)
            typed = Operation(tail.operator, (typed[0], other[0])), dimension
        return typed

    def _factor(self, node: Node) -> Typed | None:
        match type(node).__name__:
            case "Minus":
                typed = self._factor(node.operand)
                return None if typed is None else (Operation("neg", (typed[0],)), typed[1])
            case "Group":
                return self.read(node.expression)
            case "Call":
                return self._call(node)
            case "Literal":
                return self._literal(node)
        return self._reference(node)

    def _literal(self, node: Node) -> Typed | None:
        number = float(node.number)
        if number > _LARGEST:
            self.findings.error(node, f"{node.number} is too large")
            return None
        factor, dimension = UNITS[node.unit] if node.unit else (1.0, PLAIN)
        return Number(number * factor), dimension

    def _call(self, node: Node) -> Typed | None:
        if node.function == "distance":
            return self._distance(node)
        arguments = [self.read(argument) for argument in node.arguments]
        if node.function == "abs":
            if len(arguments) != 1:
                self.findings.error(node, "abs takes one number")
                return None
            return self._alike(node, "abs", arguments)
        return self._alike(node, node.function, arguments)

    def _alike(self, node: Node, operator: str, operands: Sequence[Typed | None]) -> Typed | None:
        """Combine operands of one dimension."""
        good = [operand for operand in operands if operand is not None]
        if len(good) != len(operands):
            return None
        dimension = good[0][1]
        for other in good[1:]:
            joined = joined_dimension((good[0][0], dimension), other)
            if joined is None:
                names = f"{dimension_name(dimension)} and {dimension_name(other[1])}"
                hint = "write its unit: 45 deg" if ANGLE in (dimension, other[1]) else ""
                self.findings.error(node, f"{names} do not go together", hint)
                return None
            dimension = joined
        return Operation(operator, tuple(e for e, _ in good)), dimension  # type: ignore[arg-type]

    def _distance(self, node: Node) -> Typed | None:
        paths = [_only_path(argument) for argument in node.arguments]
        if len(paths) != 2 or None in paths:
            hint = "distance(hall.pillar, door)"
            self.findings.error(node, "distance takes two elements of the plan", hint)
            return None
        if self._refuse_plan(node):
            return None
        found = [self.targets.element(path) for path in paths if path is not None]
        one, other = found
        if one is None or other is None:
            return None
        dimension, take = distance(one, other)
        return Measure(f"distance({one.address}, {other.address})", take), dimension

    def _refuse_plan(self, node: Node) -> bool:
        if self.draws_only:
            known = did_you_mean("", self.shared) or 'name one: "let wide = uniform(…)"'
            message = "values are made of distributions and named draws, not of the plan"
            self.findings.error(node, message, known)
        return self.draws_only

    def _reference(self, node: Node) -> Typed | None:
        words = node.path.parts
        name = words[0]
        if len(words) == 1 and name in self.shared:
            return Shared(name), self.shared[name]
        if self.draws_only:
            self._unknown_draw(node, ".".join(words))
            return None
        if len(words) == 1:
            return self._variable(node, name)
        found = self.targets.longest(node.path)
        if found is None:
            return None
        element, rest = found
        return self._of_element(node, element, rest)

    def _unknown_draw(self, node: Node, written: str) -> None:
        hint = did_you_mean(written, self.shared) if self.shared else ""
        if not hint.startswith("did"):
            hint = f'name it before: "let {written} = uniform(…)"' if "." not in written else (
                "values are made of distributions and draws named by let"
            )  # fmt: skip
        self.findings.error(node, f'there is no draw called "{written}"', hint)

    def _variable(self, node: Node, name: str) -> Typed | None:
        slot = self.targets.plan.variables.get(name)
        if slot is not None:
            return _attribute(slot)
        if name in self.targets.plan.elements:
            element = self.targets.plan.elements[name][0]
            known = ", ".join([*measures_of(element), *element.paths()])
            hint = f"it has: {known}"
            self.findings.error(node, f'"{name}" is {with_article(element.kind)}', hint)
            return None
        known_names = [*self.shared, *self.targets.plan.variables]
        hint = did_you_mean(name, known_names)
        self.findings.error(node, f'there is no draw or variable called "{name}"', hint)
        return None

    def _of_element(self, node: Node, element: Element, path: str) -> Typed | None:
        if path in measures_of(element):
            dimension, take = measurement(element, path)
            return Measure(f"{element.address}.{path}", take), dimension
        slot = self.targets.attribute(node, element, path, tuple(measures_of(element)))
        return None if slot is None else _attribute(slot)


def _attribute(slot: Slot) -> Typed:
    return Attribute(slot), _KIND[slot.kind]


def _only_path(node: Node) -> Node | None:
    """Return the path an argument consists of."""
    factor = node.first.first
    alone = not node.rest and not node.first.rest and type(factor).__name__ == "Reference"
    return factor.path if alone else None


def joined_dimension(one: Typed, other: Typed) -> Dimension | None:
    """Return the dimension two operands have together; plain numbers join lengths, 0 anything."""
    (first, a), (second, b) = one, other
    if a == b:
        return a
    for expression, own, against in ((first, a, b), (second, b, a)):
        if own == PLAIN and (against == LENGTH or expression == Number(0.0)):
            return against
    return None
