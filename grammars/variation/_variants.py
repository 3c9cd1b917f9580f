"""Variants: from a point of a sampling to a plan, or reasons for its rejection, and to a file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, TypeAlias

from grammars.floorplan import FloorPlan, parse_floorplan
from grammars.text.diagnostics import Finding, InputError, Severity, Where
from grammars.text.expressions import Expression, Name, evaluate
from grammars.text.files import write_atomically
from grammars.text.parsing import offset_of
from grammars.text.terminal_text import printable
from grammars.text.units import RATIO, Dimension, from_si, to_si
from grammars.variation._load import Requirement, Variant, VariantValue, Variation
from grammars.variation._soundness import check_soundness, flaws_of
from grammars.variation.designs import Method
from grammars.variation.plan_text import Slot, SlotValue, rewrite

_HEADER_LINES: Final = 2
"""Lines above the text of the plan: the source of a variant, and its seed."""
_MOST_REASONS: Final = 12
_DECIMALS: Final = 9
"""Decimals of calculated numbers, without the noise of 0.1 + 0.2."""
_NUMBER: Final = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


class Rejections:
    """Counts of rejected points by reason; numbers in messages are ignored."""

    def __init__(self) -> None:
        self._counts: dict[tuple[Where, str], int] = {}
        self._first: dict[tuple[Where, str], Finding] = {}

    def add(self, reasons: Iterable[Finding]) -> None:
        """Count the reasons for the rejection of one point."""
        for reason in reasons:
            # Sizes and distances differ between draws.
            key = (reason.where, _NUMBER.sub("#", reason.message))
            self._counts[key] = self._counts.get(key, 0) + 1
            self._first.setdefault(key, reason)

    def error(self, where: Where, message: str) -> InputError:
        """Return ``message`` as an error, followed by the reasons, the most frequent one first."""
        findings = [Finding(where, message, "loosen the requirements or the distributions")]
        for key, count in sorted(self._counts.items(), key=lambda item: -item[1])[:_MOST_REASONS]:
            reason = self._first[key]
            findings.append(Finding(reason.where, f"rejected {count} times: {reason.message}"))
        if len(self._counts) > _MOST_REASONS:
            more = f"and {len(self._counts) - _MOST_REASONS} more reasons"
            findings.append(Finding(where, more))
        return InputError(findings)


@dataclass(slots=True)
class VariantBuilder:
    """Turns points into variants; ``radius`` is that of the robot for the check of soundness."""

    variation: Variation
    method: Method
    seed: int
    radius: float | None
    suffix: bool
    _source: Mapping[str, float] = field(init=False)

    def __post_init__(self) -> None:
        radius = self.radius
        flaws = () if radius is None else flaws_of(self.variation.source, radius)
        self._source = {flaw.key: max(flaw.extent, 0.0) for flaw in flaws}

    def variant(
        self, point: Sequence[float], seed: int, rejections: Rejections, tries: int = 1
    ) -> Variant | None:
        """Return the variant of one point, or ``None`` after counting the reasons against it."""
        sampled = SampledPoint(self.variation, point)
        # Check requirements about draws alone first, without a compiled plan.
        cheap = [r for r in self.variation.requirements if not r.needs_plan]
        failing = _failing(cheap, sampled)
        if failing:
            rejections.add(failing)
            return None
        name = f"{self.variation.plan_name}_{seed}"
        edited = rewrite(
            self.variation.plan_text, sampled.settings.values(), name=name if self.suffix else ""
        )
        text = self._header(seed) + edited
        plan = self._sound(sampled, text, name, rejections)
        return None if plan is None else Variant(seed, sampled.values(), text, name, plan, tries)

    def _sound(
        self, sampled: SampledPoint, text: str, name: str, rejections: Rejections
    ) -> FloorPlan | None:
        try:
            plan = parse_floorplan(text, f"{name}.fpm")
            sampled.compiled = plan
            costly = [r for r in self.variation.requirements if r.needs_plan]
            failing = _failing(costly, sampled)
            if not failing and self.radius is not None:
                failing = self._in_source(check_soundness(plan, self._source, self.radius))
        except InputError as error:
            errors = [d for d in error.findings if d.severity is Severity.ERROR]
            failing = self._in_source(errors)
        rejections.add(failing)
        return None if failing else plan

    def _header(self, seed: int) -> str:
        plan, newline = self.variation.plan_text, self.variation.plan_text.newline
        design = f", {self.method} design {self.seed}" if self.method != "random" else ""
        # A file name must not end the comment around it.
        file = printable(" ".join(self.variation.plan_file.name.splitlines()))
        source = f"{plan.name} ({file})"
        return f"// Source plan: {source}{newline}// Seed: {seed}{design}{newline}"

    def _in_source(self, findings: Iterable[Finding]) -> list[Finding]:
        """Return findings about a variant with places in its source plan."""
        result = []
        for finding in findings:
            plan, line = self.variation.plan_text, max(0, finding.where.line - _HEADER_LINES)
            if line:
                line = plan.source.where(offset_of(plan.text, line, 1)).line
            where = Where(str(self.variation.plan_file), line, finding.where.column)
            result.append(Finding(where, finding.message))
        return result


def _failing(requirements: Iterable[Requirement], sampled: SampledPoint) -> list[Finding]:
    return [
        Finding(requirement.where, requirement.text)
        for requirement in requirements
        if evaluate(requirement.predicate, sampled.value_of) != 1.0
    ]


class SampledPoint:
    """One point as settings of slots, and as the values of names in requirements."""

    def __init__(self, variation: Variation, point: Sequence[float]) -> None:
        self._variation = variation
        self._units = {draw.name: draw.unit for draw in variation.draws}
        self._numbers = {
            draw.name: number for draw, number in zip(variation.draws, point, strict=True)
        }
        self.compiled: FloorPlan | None = None
        self.settings = {
            a.slot.name: self._setting(a.slot, a.source, a.dimension) for a in variation.assignments
        }

    def _setting(self, slot: Slot, source: str | Expression, dimension: Dimension) -> SlotValue:
        if isinstance(source, str):
            return SlotValue(slot, self._numbers[source], self._units[source])
        value = evaluate(source, self.value_of)
        number = value if dimension == RATIO else from_si(value, slot.unit)
        return SlotValue(slot, round(number, _DECIMALS) if math.isfinite(number) else number)

    def values(self) -> tuple[VariantValue, ...]:
        """Return the values of all draws and settings, in file order."""
        values = []
        for name in self._variation.reported:
            setting = self.settings.get(name)
            if setting is None:
                values.append(VariantValue(name, self._numbers[name], self._units[name]))
            else:
                values.append(VariantValue(name, setting.number, setting.unit or setting.slot.unit))
        return tuple(values)

    def value_of(self, name: Name) -> float:
        """Return the value of a name [m, rad or plain]; measures need the compiled plan."""
        meaning = self._variation.meanings[name]
        if isinstance(meaning, str):
            return to_si(self._numbers[meaning], self._units[meaning])
        if isinstance(meaning, Slot):
            return self._attribute(meaning)
        assert self.compiled is not None
        return meaning.take(self.compiled)

    def _attribute(self, slot: Slot) -> float:
        """Return the value of a slot in the sampled plan [m or rad]."""
        setting = self.settings.get(slot.name)
        if setting is not None:
            return to_si(setting.number, setting.unit or slot.unit)
        if isinstance(slot.value, float):
            return slot.value
        variables = self._variation.plan_text.variables
        return evaluate(slot.value, lambda name: self._attribute(variables[name.name]))


WriteOutcome: TypeAlias = Literal["written", "overwritten", "unchanged", "kept"]


@dataclass(frozen=True, slots=True)
class VariantFile:
    """File of a variant: the outcome of its writing, and its values."""

    path: Path
    outcome: WriteOutcome
    seed: int
    tries: int
    values: tuple[VariantValue, ...]


@dataclass(frozen=True, slots=True)
class WrittenVariants:
    """Files of the variants of ``plan``, as described by the file ``variation``."""

    variation: str
    plan: Path
    variants: tuple[VariantFile, ...]


def write_variants(
    variants: Iterable[Variant],
    folder: str | Path,
    *,
    overwrite: bool = False,
    source: str | Path | None = None,
) -> tuple[VariantFile, ...]:
    """Write every variant to ``<folder>/<plan>_<seed>.fpm``; create the folder if necessary.

    Existing files stay unless ``overwrite`` is set; ``source``, the plan of the variants, is never
    overwritten. Raises :class:`InputError` if a file cannot be written.
    """
    directory = Path(folder)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        files = []
        for one in variants:
            path = directory / f"{one.name}.fpm"
            outcome = _write(path, one.text.encode(), overwrite, source)
            files.append(VariantFile(path, outcome, one.seed, one.tries, one.values))
        return tuple(files)
    except OSError as error:
        reason = error.strerror or str(error)
        place = Where(str(error.filename or directory))
        raise InputError.at(place, f"cannot be written: {reason}") from error


def _write(path: Path, data: bytes, overwrite: bool, source: str | Path | None) -> WriteOutcome:
    existed = path.exists()
    if existed:
        if path.read_bytes() == data:
            return "unchanged"
        if source is not None and path.samefile(source):
            message = "is the plan itself and is not overwritten"
            raise InputError.at(Where(str(path)), message, "use another folder or seed")
        if not overwrite:
            return "kept"
    write_atomically(path, data, durable=False)  # Thousands of plans are quickly drawn again.
    return "overwritten" if existed else "written"
