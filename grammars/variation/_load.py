"""Variations and variants as values, the reader of variation files, and fixed draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from grammars.floorplan import FloorPlan, parse_floorplan
from grammars.text import sources
from grammars.text.diagnostics import (
    Finding,
    Findings,
    InputError,
    SourceText,
    SyntaxNode,
    Where,
    did_you_mean,
    raise_all,
    rule_of,
    with_article,
)
from grammars.text.expression_check import DimensionCheck
from grammars.text.expressions import Expression, Name, Number, read_expression, walk
from grammars.text.quantity import parse_quantity
from grammars.text.units import DIMENSIONS, LENGTH, RATIO, Dimension, from_si, read_unit
from grammars.variation._distributions import Distribution, Fixed, read_distribution
from grammars.variation._names import Meaning, NameReader, PlanMeasure, dimension_name
from grammars.variation._syntax import DISTRIBUTIONS, parse
from grammars.variation.plan_text import PlanElement, PlanText, Slot


@dataclass(frozen=True, slots=True)
class VariationDraw:
    """A value to draw; ``unit`` is empty if the file has none."""

    name: str
    distribution: Distribution
    unit: str
    where: Where


@dataclass(frozen=True, slots=True)
class Assignment:
    """A slot and the source of its value: a draw by name, or arithmetic over named draws."""

    slot: Slot
    source: str | Expression
    dimension: Dimension
    where: Where


@dataclass(frozen=True, slots=True)
class Requirement:
    """A predicate that every variant must fulfil, with its source ``text``.

    ``needs_plan``: it measures the compiled plan.
    """

    predicate: Expression
    text: str
    where: Where
    needs_plan: bool


@dataclass(frozen=True, slots=True, eq=False)
class Variation:
    """A loaded variation: the plan as text and as geometry, with draws and requirements.

    ``draws`` are in file order, in which they take numbers from a random stream; ``meanings`` has
    the meanings of names in assignments and requirements; ``reported`` has the names of the values
    of a variant (named draws and attributes) in file order.
    """

    file: str
    plan_file: Path
    plan_text: PlanText
    source: FloorPlan
    draws: tuple[VariationDraw, ...]
    assignments: tuple[Assignment, ...]
    requirements: tuple[Requirement, ...]
    meanings: Mapping[Name, Meaning]
    reported: tuple[str, ...]
    warnings: tuple[Finding, ...] = ()

    @property
    def plan_name(self) -> str:
        """Name of the plan."""
        return self.source.name


@dataclass(frozen=True, slots=True)
class VariantValue:
    """A value of one variant, in ``unit``: a named draw, a variable or an attribute."""

    name: str
    number: float
    unit: str


@dataclass(frozen=True, slots=True)
class Variant:
    """One sampled plan, as text (``.fpm``) and compiled.

    ``name`` is ``<plan>_<seed>``, also the stem of its file; ``tries`` counts the draws until
    all requirements held.
    """

    seed: int
    values: tuple[VariantValue, ...]
    text: str
    name: str
    plan: FloorPlan = field(repr=False, compare=False)
    tries: int = 1


def load_variation(path: str | Path) -> Variation:
    """Read a ``.variation`` file (UTF-8) and the plan it imports.

    Raises :class:`InputError` with all problems of both files.
    """
    return parse_variation(read_text(Path(path), "variation"), str(path), Path(path).parent)


def parse_variation(text: str, file: str, folder: Path) -> Variation:
    """Compile the text of a variation whose plan is relative to ``folder``.

    Raises :class:`InputError` with all problems of it and its plan.
    """
    source = SourceText(text, file)
    tree = parse(source)
    findings = Findings(source)
    # An empty text gives no tree.
    statements = getattr(tree, "statements", ())
    plan_file = _imported(statements, folder, source, findings)
    plan_text = read_text(plan_file, "plan")
    compiled = parse_floorplan(plan_text, str(plan_file))
    plan = PlanText(plan_text, str(plan_file))
    reader = _VariationReader(source, findings, NameReader(plan, source, findings))
    for node in statements:
        reader.read(node)
    reader.finish(tree)
    return Variation(
        file=file,
        plan_file=plan_file,
        plan_text=plan,
        source=compiled,
        draws=tuple(reader.draws),
        assignments=tuple(reader.assignments),
        requirements=tuple(reader.requirements),
        meanings=reader.names.meanings,
        reported=tuple(reader.reported),
        warnings=(*compiled.warnings, *findings.warnings),
    )


def read_text(path: Path, noun: str) -> str:
    """Return a text with its line ends; raises :class:`InputError`."""
    text = sources.read_text(path, f"the {noun}", keep_line_ends=True)
    # Line ends stay, because a variant differs from its plan only in varied values. The parser
    # does not know a lone \r as a line end.
    lone = "\r" in text.replace("\r\n", "")
    return text.replace("\r\n", "\n").replace("\r", "\n") if lone else text


def _imported(
    statements: Sequence[SyntaxNode], folder: Path, source: SourceText, findings: Findings
) -> Path:
    """Return the path of the plan, without which no other checks are possible."""
    imports = [node for node in statements if rule_of(node) == "Import"]
    example = 'write first: import "plan.fpm"'
    if not imports:
        raise InputError.at(source.where(0), "imports no plan", example)
    if imports[0] is not statements[0]:
        findings.error(imports[0], "the import must come first", example)
    for node in imports[1:]:
        findings.error(node, "a variation can vary only one plan", "write one file per plan")
    name: str = imports[0].file[1:-1]
    path = folder / name
    if not sources.is_file(path):
        plans = sources.names_in(folder, lambda file: file.suffix == ".fpm")
        findings.error(imports[0], f'there is no plan "{name}"', did_you_mean(name, plans))
        raise InputError(findings.errors)
    return path


@dataclass(slots=True)
class _VariationReader:
    """Reads statement by statement; draws keep the order of the file."""

    source: SourceText
    findings: Findings
    names: NameReader
    draws: list[VariationDraw] = field(default_factory=list)
    assignments: list[Assignment] = field(default_factory=list)
    requirements: list[Requirement] = field(default_factory=list)
    reported: list[str] = field(default_factory=list)
    _lets: dict[str, SyntaxNode] = field(default_factory=dict)
    _varied: dict[str, SyntaxNode] = field(default_factory=dict)

    def read(self, node: SyntaxNode) -> None:
        """Read one statement."""
        match rule_of(node):
            case "Let":
                self._let(node)
            case "Require":
                with self.findings.collecting():
                    self._require(node)
            case "Block":
                self._block(node)
            case "Single":
                slot = self.names.variable(".".join(node.target.parts), node.target)
                self._assign(node, slot, node.value)

    def finish(self, tree: SyntaxNode) -> None:
        """Report unused draws; raise :class:`InputError` if there are any errors."""
        meanings = self.names.meanings.values()
        for name, node in self._lets.items():
            if name not in meanings and not self.findings.errors:
                self.findings.warning(node, f'the draw "{name}" is never used')
        if not self.assignments and not self.findings.errors:
            self.findings.error(tree, "the file varies no value", 'add "NAME: uniform([1.0, 2.0])"')
        self.findings.raise_errors()

    def _let(self, node: SyntaxNode) -> None:
        name = node.name
        if name in self._lets:
            line = self.source.at(self._lets[name]).line
            self.findings.error(node, f'the draw "{name}" is already defined in line {line}')
            return
        if name in self.names.plan.variables or name in self.names.plan.elements:
            self.findings.error(node, f'the plan already uses the name "{name}"')
            return
        self._lets[name] = node
        self.names.draws[name] = RATIO
        if rule_of(node.value) not in DISTRIBUTIONS:
            hint = f"let {name} = uniform(0.8 m .. 1.2 m)"
            self.findings.error(node, "let needs a distribution", hint)
            return
        with self.findings.collecting():
            distribution, unit = read_distribution(node.value, self.source)
            self.names.draws[name] = read_unit(unit)[1]
            self.draws.append(VariationDraw(name, distribution, unit, self.source.at(node)))
            self.reported.append(name)

    def _block(self, node: SyntaxNode) -> None:
        address = ".".join(node.target.parts)
        if not node.attributes:
            hint = "write attributes between the braces"
            self.findings.error(node, f'the block of "{address}" is empty', hint)
        element = self.names.element(address, node.target)
        for attribute in node.attributes:
            path = ".".join(attribute.path.parts)
            slot = None
            if element is not None:
                slot = self.names.attribute(element, path, attribute)
                self._check_gap(attribute, element, path)
            self._assign(attribute, slot, attribute.value)

    def _check_gap(self, node: SyntaxNode, element: PlanElement, path: str) -> None:
        if path != "location.translation.y" or element.kind != "space":
            return
        if any(part.key == "spaced" for part in element.node.parts):
            message = f'"{element.address}" is spaced: its y translation cannot be varied'
            self.findings.error(node, message, "vary the wall thickness, or remove spaced")

    def _assign(self, node: SyntaxNode, slot: Slot | None, value: SyntaxNode) -> None:
        """Read the value of an attribute or variable; without ``slot``, only check it."""
        if slot is not None and slot.number is None:
            hint = f'write "{slot.remedy}" in the plan first'
            self.findings.error(node, f"the plan does not contain {slot.name}", hint)
            slot = None
        if slot is not None and slot.name in self._varied:
            line = self.source.at(self._varied[slot.name]).line
            self.findings.error(node, f"{slot.name} is already varied in line {line}")
            return
        if slot is not None:
            self._varied[slot.name] = node
        with self.findings.collecting():
            if rule_of(value) in DISTRIBUTIONS:
                self._assign_draw(node, slot, value)
            else:
                self._assign_sum(node, slot, value)

    def _assign_draw(self, node: SyntaxNode, slot: Slot | None, value: SyntaxNode) -> None:
        distribution, unit = read_distribution(value, self.source)
        dimension = read_unit(unit)[1]
        if slot is not None and self._fits(node, slot, dimension):
            where = self.source.at(node)
            self.draws.append(VariationDraw(slot.name, distribution, unit, where))
            self.assignments.append(Assignment(slot, slot.name, dimension, where))
            self.reported.append(slot.name)

    def _assign_sum(self, node: SyntaxNode, slot: Slot | None, value: SyntaxNode) -> None:
        expression = read_expression(value, self.source)
        dimension = self._check(draws_only=True).quantity(expression)
        zero = isinstance(expression, Number) and expression.value == 0.0
        if dimension is None or slot is None:
            return
        if zero or self._fits(node, slot, dimension):
            # A draw alone keeps its unit.
            source = expression.name if isinstance(expression, Name) else expression
            self.assignments.append(Assignment(slot, source, dimension, self.source.at(node)))
            self.reported.append(slot.name)

    def _check(self, *, draws_only: bool = False) -> DimensionCheck:
        kind_of = partial(self.names.kind_of, draws_only=draws_only)
        return DimensionCheck(self.source, self.findings, kind_of, bare=LENGTH)

    def _fits(self, node: SyntaxNode, slot: Slot, dimension: Dimension) -> bool:
        if dimension in (RATIO, DIMENSIONS[slot.kind]):
            return True
        hint = "lengths are in m" if slot.kind == "length" else "angles are in deg or rad"
        message = f"{slot.name} is {with_article(slot.kind)}, not {dimension_name(dimension)}"
        self.findings.error(node, message, hint)
        return False

    def _require(self, node: SyntaxNode) -> None:
        predicate = read_expression(node.predicate, self.source)
        self._check().predicate(predicate)
        text = " ".join(self.source.text[node._tx_position : node._tx_position_end].split())
        names = (part for part in walk(predicate) if isinstance(part, Name))
        needs_plan = any(isinstance(self.names.meanings.get(name), PlanMeasure) for name in names)
        self.requirements.append(Requirement(predicate, text, self.source.at(node), needs_plan))


def draw_unit(variation: Variation, draw: VariationDraw) -> str:
    """Return the unit of a draw, by default that of its attribute; empty for plain numbers."""
    if draw.unit:
        return draw.unit
    slots = (a.slot for a in variation.assignments if a.source == draw.name)
    return next((slot.unit for slot in slots), "")


def fix_draws(
    variation: Variation, values: Mapping[str, Any], where: Where, places: Mapping[str, Where]
) -> Variation:
    """Return a variation with some draws fixed to ``values``.

    A number without a unit is in the unit of the draw. ``places`` has the places of single values,
    ``where`` that of all others. Raises :class:`InputError` with all invalid values.
    """
    draws = {draw.name: draw for draw in variation.draws}
    findings = Findings()
    for key, value in values.items():
        place = places.get(key, where)
        name = key if key in draws else key.replace("-", "_")
        with findings.collecting():
            if name not in draws:
                raise _unknown(variation, key, place)
            number = _number(value, draw_unit(variation, draws[name]), name, place)
            old = draws[name].distribution
            fixed = Fixed(number, old.replaced if isinstance(old, Fixed) else old)
            draws[name] = replace(draws[name], distribution=fixed)
    raise_all(findings.all)
    return replace(variation, draws=tuple(draws.values()))


def _unknown(variation: Variation, key: str, where: Where) -> InputError:
    names = [draw.name for draw in variation.draws]
    message = f'variation of {variation.plan_name} has no draw "{key}"'
    hint = did_you_mean(key, names)
    if key in variation.reported:
        hint = f"it is calculated; the draws are: {', '.join(names)}"
    return InputError.at(where, message, hint)


def _number(value: Any, unit: str, name: str, where: Where) -> float:
    """Return a value in the unit of its draw; raises :class:`InputError`."""
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        message = f"{name} is one value, not {value}"
        raise InputError.at(where, message, f"write {name}: 1 {unit}".rstrip())
    quantity = parse_quantity(str(value), where)
    dimension = DIMENSIONS[quantity.dimension]
    if dimension == RATIO:
        return quantity.value
    if dimension != read_unit(unit)[1]:
        expected = f"in {unit}" if unit else "a plain number"
        message = f"{name} is {expected}, not {with_article(quantity.dimension)}"
        raise InputError.at(where, message, f"write {name}: 1 {unit}".rstrip())
    return from_si(quantity.value, unit)
