"""Variations and their variants as values, and from a variation file to what it means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from grammars.floorplan import FloorPlan, parse_floorplan
from grammars.text import sources
from grammars.text.diagnostics import (
    Diagnostic,
    Findings,
    InputError,
    SourceText,
    SyntaxNode,
    Where,
    did_you_mean,
    with_article,
)
from grammars.text.units import ANGLE, DIMENSIONS, RATIO, Dimension, read_unit
from grammars.variation._arithmetic import ExpressionReader, PlanResolver, joined_dimension
from grammars.variation._distributions import Distribution, DistributionReader
from grammars.variation._expressions import (
    Constant,
    Expression,
    NamedDraw,
    Requirement,
    dimension_name,
    parts,
)
from grammars.variation._syntax import (
    BlockNode,
    ImportNode,
    LetNode,
    RequireNode,
    SingleNode,
    SumNode,
    ValueNode,
    parse,
)
from grammars.variation.plan_text import PlanElement, PlanText, Slot


@dataclass(frozen=True, slots=True)
class VariationDraw:
    """One value to draw; ``unit`` is empty when none was written."""

    name: str
    distribution: Distribution
    unit: str
    where: Where


@dataclass(frozen=True, slots=True)
class Assignment:
    """A slot and where its value comes from: a draw by name, or arithmetic over named draws."""

    slot: Slot
    source: str | Expression
    dimension: Dimension
    where: Where


@dataclass(frozen=True, slots=True, eq=False)
class Variation:
    """A loaded variation: the plan as text and as geometry, what is drawn and what must hold.

    ``draws`` are in file order, the order they take numbers from a random stream; ``reported``
    names the values of a variant (named draws and attributes) in file order.
    """

    file: str
    plan_file: Path
    plan_text: PlanText
    source: FloorPlan
    draws: tuple[VariationDraw, ...]
    assignments: tuple[Assignment, ...]
    requirements: tuple[Requirement, ...]
    reported: tuple[str, ...]
    warnings: tuple[Diagnostic, ...] = ()

    @property
    def plan_name(self) -> str:
        """The name of the plan that is varied."""
        return self.source.name


@dataclass(frozen=True, slots=True)
class VariantValue:
    """A value of one variant: a named draw, a variable or an attribute; in ``unit`` as written."""

    name: str
    number: float
    unit: str


@dataclass(frozen=True, slots=True)
class Variant:
    """One sampled plan: its text (``.fpm``) and what the text means.

    ``name`` is ``<plan>_<seed>``, also the stem of its file; ``tries`` counts the draws until
    everything required held.
    """

    seed: int
    values: tuple[VariantValue, ...]
    text: str
    name: str
    plan: FloorPlan = field(repr=False, compare=False)
    tries: int = 1


def load_variation(path: str | Path, *, shared_defaults: bool = False) -> Variation:
    """Read a ``.variation`` file (UTF-8) and the plan it imports.

    Varying an inherited wall thickness or height overrides it for that space alone;
    ``shared_defaults`` changes the plan's ``Defaults`` instead, as the published tool does.
    Raises :class:`InputError` with everything that is wrong with either file.
    """
    return parse_variation(
        read_text(Path(path), "variation"),
        str(path),
        Path(path).parent,
        shared_defaults=shared_defaults,
    )


def parse_variation(
    text: str, file: str, folder: Path, *, shared_defaults: bool = False
) -> Variation:
    """Compile the text of a variation; its plan is looked for from ``folder``.

    Raises :class:`InputError` with everything that is wrong with it or its plan.
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
    targets = PlanResolver(plan, findings, shared_defaults)
    reader = _VariationReader(source, findings, targets)
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
        reported=tuple(reader.reported),
        warnings=(*compiled.warnings, *findings.warnings),
    )


def read_text(path: Path, what: str) -> str:
    """Return a text as it is, line ends included; raises :class:`InputError`."""
    text = sources.read_text(path, f"the {what}", keep_line_ends=True)
    # Line ends stay: a variant differs from its plan in nothing but what is varied. A lone \r ends
    # no line for the parser, so these are made into ends it knows.
    lone = "\r" in text.replace("\r\n", "")
    return text.replace("\r\n", "\n").replace("\r", "\n") if lone else text


def _imported(
    statements: Sequence[SyntaxNode], folder: Path, source: SourceText, findings: Findings
) -> Path:
    """Return the plan's path; nothing else can be checked without it."""
    imports = [node for node in statements if isinstance(node, ImportNode)]
    example = 'write first: import "plan.fpm"'
    if not imports:
        raise InputError.at(source.where(0), "imports no plan", example)
    if imports[0] is not statements[0]:
        findings.error(imports[0], "the import comes first", example)
    for node in imports[1:]:
        findings.error(node, "a variation varies one plan", "write one file per plan")
    name: str = imports[0].file[1:-1]
    path = folder / name
    if not sources.is_file(path):
        beside = sources.names_in(folder, lambda beside: beside.suffix == ".fpm")
        findings.error(imports[0], f'there is no plan "{name}"', did_you_mean(name, beside))
        raise InputError(findings.errors)
    return path


@dataclass(slots=True)
class _VariationReader:
    """Reads statement by statement; draws keep the order they are written in."""

    source: SourceText
    findings: Findings
    targets: PlanResolver
    draws: list[VariationDraw] = field(default_factory=list)
    assignments: list[Assignment] = field(default_factory=list)
    requirements: list[Requirement] = field(default_factory=list)
    reported: list[str] = field(default_factory=list)
    _shared: dict[str, Dimension] = field(default_factory=dict)
    _lets: dict[str, SyntaxNode] = field(default_factory=dict)
    _used: set[str] = field(default_factory=set)
    _varied: dict[int | str, tuple[str, SyntaxNode]] = field(default_factory=dict)

    def read(self, node: SyntaxNode) -> None:
        """Read one statement."""
        match node:
            case LetNode():
                self._let(node)
            case RequireNode():
                self._require(node)
            case BlockNode():
                self._block(node)
            case SingleNode():
                slot = self.targets.variable(node.target)
                self._assign(node, slot, node.value)

    def finish(self, tree: SyntaxNode) -> None:
        """Report what shows only at the end; raises :class:`InputError` for everything found."""
        for name, node in self._lets.items():
            if name not in self._used and not self.findings.errors:
                self.findings.warning(node, f'the draw "{name}" is never used')
        if not self.assignments and not self.findings.errors:
            self.findings.error(tree, "nothing is varied", 'add "NAME: uniform([1.0, 2.0])"')
        self.findings.raise_errors()

    def _let(self, node: LetNode) -> None:
        name = node.name
        if name in self._lets:
            line = self.source.at(self._lets[name]).line
            self.findings.error(node, f'the draw "{name}" is already named in line {line}')
            return
        if name in self.targets.plan.variables or name in self.targets.plan.elements:
            self.findings.error(node, f'"{name}" is already the name of something in the plan')
            return
        self._lets[name] = node
        if isinstance(node.value, SumNode):
            hint = f"let {name} = uniform(0.8 m .. 1.2 m)"
            self.findings.error(node, "let names a distribution", hint)
            self._shared[name] = RATIO
            return
        read = DistributionReader(self.findings).read(node.value)
        unit = "" if read is None else read[1]
        self._shared[name] = read_unit(unit)[1]
        if read is not None:
            self.draws.append(VariationDraw(name, *read, self.source.at(node)))
            self.reported.append(name)

    def _block(self, node: BlockNode) -> None:
        if not node.attributes:
            hint = "write what to vary between the braces"
            self.findings.error(node, f'nothing of "{".".join(node.target.parts)}" is varied', hint)
        element = self.targets.element(node.target)
        for attribute in node.attributes:
            path = ".".join(attribute.path.parts)
            slot = None
            if element is not None:
                slot = self.targets.attribute(attribute, element, path)
                self._check_gap(attribute, element, path)
            self._assign(attribute, slot, attribute.value)

    def _check_gap(self, node: SyntaxNode, element: PlanElement, path: str) -> None:
        if path != "location.translation.y" or element.kind != "space":
            return
        if any(part.key == "spaced" for part in element.node.parts):
            message = f'"{element.address}" is spaced: its y translation cannot be varied'
            self.findings.error(node, message, "vary the wall thickness, or take out spaced")

    def _assign(self, node: SyntaxNode, slot: Slot | None, value: ValueNode) -> None:
        """Read the value of an attribute or variable; ``slot`` is missing when it was refused."""
        where = self.source.at(node)
        if slot is not None and slot.number is None:
            hint = f'write "{slot.remedy}" there, then vary it'
            self.findings.error(node, f"{slot.name} is not written in the plan", hint)
            slot = None
        if slot is not None and self._is_twice(node, slot):
            return
        if isinstance(value, SumNode):
            typed = self._arithmetic(draws_only=True).read(value)
            if typed is None:
                return
            self._use(typed[0])
            if slot is not None and self._fits(node, slot, typed[1], typed[0] == Constant(0.0)):
                source = typed[0].name if isinstance(typed[0], NamedDraw) else typed[0]
                self.assignments.append(Assignment(slot, source, typed[1], where))
                self.reported.append(slot.name)
            return
        read = DistributionReader(self.findings).read(value)
        if read is None or slot is None:
            return
        distribution, unit = read
        dimension = read_unit(unit)[1]
        if self._fits(node, slot, dimension, False):
            self.draws.append(VariationDraw(slot.name, distribution, unit, where))
            self.assignments.append(Assignment(slot, slot.name, dimension, where))
            self.reported.append(slot.name)

    def _arithmetic(self, *, draws_only: bool = False) -> ExpressionReader:
        return ExpressionReader(self.findings, self.targets, self._shared, draws_only)

    def _use(self, expression: Expression) -> None:
        for part in parts(expression):
            if isinstance(part, NamedDraw):
                self._used.add(part.name)

    def _is_twice(self, node: SyntaxNode, slot: Slot) -> bool:
        """Report a slot that is varied already; other spaces may share it on purpose."""
        before = self._varied.get(slot.key)
        self._varied[slot.key] = (slot.name, node)
        if before is None:
            return False
        name, line = before[0], self.source.at(before[1]).line
        if name == slot.name:
            self.findings.error(node, f"{slot.name} is already varied in line {line}")
            return True
        message = f"{slot.name} and {name} (line {line}) are one shared default: this one counts"
        self.findings.warning(node, message)
        return False

    def _fits(self, node: SyntaxNode, slot: Slot, dimension: Dimension, zero: bool) -> bool:
        if dimension in (RATIO, DIMENSIONS[slot.kind]) or zero:
            return True
        given = dimension_name(dimension)
        hint = "lengths are in m" if slot.kind == "length" else "angles are in deg or rad"
        self.findings.error(node, f"{slot.name} is {with_article(slot.kind)}, not {given}", hint)
        return False

    def _require(self, node: RequireNode) -> None:
        left = self._arithmetic().read(node.left)
        right = self._arithmetic().read(node.right)
        if left is None or right is None:
            return
        self._use(left[0])
        self._use(right[0])
        if joined_dimension(left, right) is None:
            message = f"{dimension_name(left[1])} is compared with {dimension_name(right[1])}"
            hint = "write its unit: 45 deg" if ANGLE in (left[1], right[1]) else ""
            self.findings.error(node, message, hint)
            return
        written = self.source.text[node._tx_position : node._tx_position_end]
        text = " ".join(written.split())
        where = self.source.at(node)
        self.requirements.append(Requirement(left[0], node.comparison, right[0], text, where))
