"""Reading arithmetic: names are found in the plan, dimensions checked.

What is not in the plan is reported with what could have been meant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from grammars.floorplan import PolygonNode
from grammars.text.diagnostics import (
    Findings,
    SyntaxNode,
    closest,
    did_you_mean,
    with_article,
)
from grammars.text.units import ANGLE, DIMENSIONS, LENGTH, RATIO, Dimension, read_unit, to_si
from grammars.variation._expressions import (
    Constant,
    Expression,
    NamedDraw,
    Operation,
    PlanAttribute,
    PlanMeasure,
    dimension_name,
    distance,
    measurement,
    measures_of,
)
from grammars.variation._syntax import (
    CallNode,
    FactorNode,
    GroupNode,
    LiteralNode,
    MinusNode,
    ReferenceNode,
    SumNode,
)
from grammars.variation.plan_text import PlanElement, PlanText, Slot

_OLD_SPELLINGS: Final = (
    ("location.transformation.", "location."),
    ("location.pose.", "location."),
    ("pose.", "location."),
    ("wall_", "defaults.wall."),
    ("wall.", "defaults.wall."),
    ("walls.", "defaults.wall."),
)
"""Spellings of older versions of the language, each with today's."""


@dataclass(frozen=True, slots=True)
class PlanResolver:
    """Looks up elements and attributes; what is not there is reported and read as ``None``."""

    plan: PlanText
    findings: Findings
    shared_defaults: bool

    def element(self, path: SyntaxNode) -> PlanElement | None:
        """Return the element an address such as ``hall`` or ``hall.pillar`` names."""
        address = ".".join(path.parts)
        found = self.plan.elements.get(address, [])
        if len(found) == 1:
            return found[0]
        if found:
            kinds = " and ".join(with_article(e.kind) for e in found)
            message = f'"{address}" is the name of {kinds}'
            self.findings.error(path, message, "rename one of them in the plan")
            return None
        self.findings.error(path, f'the plan has no "{address}"', self._suggest(address))
        return None

    def _suggest(self, address: str) -> str:
        if address in self.plan.variables:
            return f'it is a variable: write "{address}: uniform([…])"'
        if address == self.plan.name:
            return "the plan itself has nothing to vary"
        inside = [name for name in self.plan.elements if name.endswith(f".{address}")]
        if inside:
            return f"write {' or '.join(inside)}: features are addressed by their space"
        return did_you_mean(address, self.plan.elements)

    def variable(self, path: SyntaxNode) -> Slot | None:
        """Return the variable that a statement such as ``ceiling: uniform(…)`` names."""
        name = ".".join(path.parts)
        slot = self.plan.variables.get(name)
        if slot is not None:
            return slot
        if name in self.plan.elements:
            known = ", ".join(self.plan.elements[name][0].paths())
            hint = f'say what to vary: "{name}: {{ … }}" with {known}'
            self.findings.error(path, f'"{name}" is no variable of the plan', hint)
            return None
        hint = did_you_mean(name, self.plan.variables) or "the plan has no variables"
        self.findings.error(path, f'the plan has no variable "{name}"', hint)
        return None

    def longest(self, path: SyntaxNode) -> tuple[PlanElement, str] | None:
        """Split ``hall.pillar.height`` into the element and the path in it."""
        words = path.parts
        for count in (1, 2):
            address, rest = ".".join(words[:count]), ".".join(words[count:])
            for element in self.plan.elements.get(address, []):
                is_feature = ".".join(words[: count + 1]) in self.plan.elements
                if rest in element.paths() or not is_feature:
                    return element, rest
        address = ".".join(words[:-1])
        self.findings.error(path, f'the plan has no "{address}"', self._suggest(address))
        return None

    def attribute(
        self, place: SyntaxNode, element: PlanElement, path: str, more: tuple[str, ...] = ()
    ) -> Slot | None:
        """Return the slot of an attribute; ``more`` are words that could have been meant too."""
        slot = self.plan.slot(element, path, shared_defaults=self.shared_defaults)
        if slot is None:
            label = f'{element.kind} "{element.address}"'
            hint = suggested_path(path, element, more)
            self.findings.error(place, f'{label} has no "{path}"', hint)
        return slot


def suggested_path(path: str, element: PlanElement, more: tuple[str, ...] = ()) -> str:
    """Return ``did you mean …?`` where something is close, and every path there is."""
    known = [*more, *element.paths()]
    meant = _closest_path(path, known)
    question = f'did you mean "{meant}"? ' if meant else ""
    points = isinstance(element.node.shape, PolygonNode) and path.startswith("shape")
    note = "; points are varied through variables of the plan" if points else ""
    return f"{question}it has: {', '.join(known)}{note}"


def _closest_path(path: str, known: list[str]) -> str:
    for old, new in _OLD_SPELLINGS:
        if path.startswith(old) and new + path.removeprefix(old) in known:
            return new + path.removeprefix(old)
    ending = [name for name in known if name.endswith(f".{path}")]
    if len(ending) == 1:
        return ending[0]
    return closest(path, known)


_LARGEST: Final = 1e6
Typed: TypeAlias = tuple[Expression, Dimension]


@dataclass(frozen=True, slots=True)
class ExpressionReader:
    """Turns syntax trees into expressions; broken ones are reported and read as ``None``.

    ``shared`` maps named draws to their dimension; ``draws_only`` leaves out the sampled plan.
    """

    findings: Findings
    targets: PlanResolver
    shared: Mapping[str, Dimension]
    draws_only: bool = False

    def read(self, node: SumNode) -> Typed | None:
        """Return a sum and its dimension."""
        typed = self._product(node.first)
        for tail in node.rest:
            other = self._product(tail.operand)
            typed = self._alike(tail, tail.operator, [typed, other])
        return typed

    def _product(self, node: SyntaxNode) -> Typed | None:
        typed = self._factor(node.first)
        for tail in node.rest:
            other = self._factor(tail.operand)
            if typed is None or other is None:
                typed = None
                continue
            product = tail.operator == "*"
            dimension = typed[1] * other[1] if product else typed[1] / other[1]
            typed = Operation(tail.operator, (typed[0], other[0])), dimension
        return typed

    def _factor(self, node: FactorNode) -> Typed | None:
        match node:
            case MinusNode():
                typed = self._factor(node.operand)
                return None if typed is None else (Operation("neg", (typed[0],)), typed[1])
            case GroupNode():
                return self.read(node.expression)
            case CallNode():
                return self._call(node)
            case LiteralNode():
                return self._literal(node)
            case ReferenceNode():
                return self._reference(node)

    def _literal(self, node: LiteralNode) -> Typed | None:
        number = float(node.number)
        if number > _LARGEST:
            self.findings.error(node, f"{node.number} is too large")
            return None
        unit = node.unit or ""
        return Constant(to_si(number, unit)), read_unit(unit)[1]

    def _call(self, node: CallNode) -> Typed | None:
        if node.function == "distance":
            return self._distance(node)
        arguments = [self.read(argument) for argument in node.arguments]
        if node.function == "abs":
            if len(arguments) != 1:
                self.findings.error(node, "abs takes one number")
                return None
            return self._alike(node, "abs", arguments)
        return self._alike(node, node.function, arguments)

    def _alike(
        self, node: SyntaxNode, operator: str, operands: Sequence[Typed | None]
    ) -> Typed | None:
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

    def _distance(self, node: CallNode) -> Typed | None:
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
        return PlanMeasure(f"distance({one.address}, {other.address})", take), dimension

    def _refuse_plan(self, node: SyntaxNode) -> bool:
        if self.draws_only:
            known = did_you_mean("", self.shared) or 'name one: "let wide = uniform(…)"'
            message = "values are made of distributions and named draws, not of the plan"
            self.findings.error(node, message, known)
        return self.draws_only

    def _reference(self, node: ReferenceNode) -> Typed | None:
        words = node.path.parts
        name = words[0]
        if len(words) == 1 and name in self.shared:
            return NamedDraw(name), self.shared[name]
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

    def _unknown_draw(self, node: SyntaxNode, written: str) -> None:
        if closest(written, self.shared):
            hint = did_you_mean(written, self.shared)
        elif "." in written:
            hint = "values are made of distributions and draws named by let"
        else:
            hint = f'name it before: "let {written} = uniform(…)"'
        self.findings.error(node, f'there is no draw called "{written}"', hint)

    def _variable(self, node: SyntaxNode, name: str) -> Typed | None:
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

    def _of_element(self, node: SyntaxNode, element: PlanElement, path: str) -> Typed | None:
        if path in measures_of(element):
            dimension, take = measurement(element, path)
            return PlanMeasure(f"{element.address}.{path}", take), dimension
        slot = self.targets.attribute(node, element, path, tuple(measures_of(element)))
        return None if slot is None else _attribute(slot)


def _attribute(slot: Slot) -> Typed:
    return PlanAttribute(slot), DIMENSIONS[slot.kind]


def _only_path(node: SumNode) -> SyntaxNode | None:
    """Return the path an argument consists of."""
    factor = node.first.first
    alone = not node.rest and not node.first.rest
    return factor.path if alone and isinstance(factor, ReferenceNode) else None


def joined_dimension(one: Typed, other: Typed) -> Dimension | None:
    """Return the dimension two operands have together; plain numbers join lengths, 0 anything."""
    (first, a), (second, b) = one, other
    if a == b:
        return a
    for expression, own, against in ((first, a, b), (second, b, a)):
        if own == RATIO and (against == LENGTH or expression == Constant(0.0)):
            return against
    return None
