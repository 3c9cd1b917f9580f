"""Two campaigns side by side: which verdicts changed, which quantities, what got worse.

Repeats of equal number and seed met the same doors and the same noise, so they are paired. All
quantities are tested at once, hence the p values are Holm's. Worse means a smaller margin or a
longer duration; campaigns do not say whether a measure should be small or large.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

from daemon.judging.assessment._assess import assess
from daemon.judging.assessment._cell_verdicts import (
    Cell,
    group_by_cell,
    measured_value,
    trusted_verdicts,
)
from daemon.judging.statistics import (
    EACH_SIDE,
    MeanDifference,
    cliffs_delta,
    holm_adjusted,
    mean_difference,
)
from daemon.model.assessments import DURATION, Assessment, AssessmentRules, CellVerdict
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome

QuantityKind: TypeAlias = Literal["margin", "measure", "duration"]
SIGNIFICANT: Final = 0.05


@dataclass(frozen=True, slots=True)
class JudgedCampaign:
    """A campaign with its runs, ready to compare; ``name`` is for people."""

    name: str
    declared: AssessmentRules
    records: tuple[RunRow, ...]


@dataclass(frozen=True, slots=True)
class VerdictChange:
    """An oracle's verdict on a cell before and after; ``None`` if it was not judged."""

    scenario: str
    sut: str
    oracle: str
    before: Outcome | None
    after: Outcome | None
    passed_before: str
    passed_after: str

    @property
    def worse(self) -> bool:
        """True if it fails now and did not before."""
        return self.after is Outcome.FAIL and self.before not in (None, Outcome.FAIL)


@dataclass(frozen=True, slots=True)
class QuantityChange:
    """A quantity of one cell before and after: means [``unit``] and what their difference shows.

    ``mean`` is after minus before, ``low`` to ``high`` its two-sided 95 % interval. ``delta`` is
    Cliff's, from -1 (always smaller now) to 1. ``p`` is two-sided and Holm's; ``changed`` means it
    is below 5 %. ``worse`` means that it got worse by more than the gate allows, again by Holm's p
    value. Without enough values all of these are ``None`` or false.
    """

    scenario: str
    sut: str
    quantity: str
    kind: QuantityKind
    unit: str
    before: float
    after: float
    n: int
    method: Literal["paired", "welch", ""]
    mean: float
    low: float | None = None
    high: float | None = None
    delta: float | None = None
    p: float | None = None
    changed: bool = False
    worse: bool = False


@dataclass(frozen=True, slots=True)
class CampaignDifference:
    """Differences between two campaigns, and the cells, (scenario, SUT), that only one has.

    Unfinished campaigns are compared by their finished runs; ``unfinished_before`` and
    ``unfinished_after`` count their other runs.
    """

    before: str
    after: str
    worse_by: float | None
    verdicts: tuple[VerdictChange, ...]
    shifts: tuple[QuantityChange, ...]
    only_before: tuple[tuple[str, str], ...]
    only_after: tuple[tuple[str, str], ...]
    unfinished_before: int = 0
    unfinished_after: int = 0

    @property
    def regressed(self) -> bool:
        """True if a verdict or a quantity got worse."""
        return any(v.worse for v in self.verdicts) or any(s.worse for s in self.shifts)


@dataclass(frozen=True, slots=True)
class ComparedCampaigns:
    """Changes from one campaign to the other."""

    comparison: CampaignDifference
    regressed: bool


def compare_campaigns(
    before: JudgedCampaign, after: JudgedCampaign, worse_by: float | None = None
) -> CampaignDifference:
    """Compare two campaigns cell by cell.

    ``worse_by`` is the share of its previous value by which a margin or a duration may get worse;
    ``None`` disables this gate.
    """
    # Only shared cells are compared: an added scenario does not change the others, and would make
    # Holm's correction harder for them.
    sides = tuple(group_by_cell(side.records) for side in (before, after))
    shared = [key for key in sides[1] if key in sides[0]]
    shifts = [
        shift
        for key in shared
        for shift in _quantity_changes(sides[0][key], sides[1][key], worse_by)
    ]
    return CampaignDifference(
        before=before.name,
        after=after.name,
        worse_by=worse_by,
        verdicts=tuple(_verdicts(before, after, sides, set(shared))),
        shifts=_adjust_together(shifts),
        only_before=tuple(key for key in sides[0] if key not in sides[1]),
        only_after=tuple(key for key in sides[1] if key not in sides[0]),
        unfinished_before=sum(not record.settled for record in before.records),
        unfinished_after=sum(not record.settled for record in after.records),
    )


def _verdicts(
    before: JudgedCampaign,
    after: JudgedCampaign,
    sides: Sequence[Mapping[Cell, Sequence[RunRow]]],
    shared: set[Cell],
) -> Iterable[VerdictChange]:
    old, new = (_oracles(assess(side.declared, side.records)) for side in (before, after))
    for key in dict.fromkeys((*new, *old)):
        scenario, sut, oracle = key
        # Each side has its own rules: a changed expectation changes no verdict, a policy may.
        was, now = old.get(key), new.get(key)
        if (scenario, sut) not in shared or (was and now and was.verdict is now.verdict):
            continue
        if any(
            _is_open(side, records[scenario, sut])
            for side, records in zip((was, now), sides, strict=True)
        ):
            continue
        yield VerdictChange(
            scenario,
            sut,
            oracle,
            was.verdict if was else None,
            now.verdict if now else None,
            f"{was.passed}/{was.n}" if was else "",
            f"{now.passed}/{now.n}" if now else "",
        )


def _is_open(verdict: CellVerdict | None, records: Sequence[RunRow]) -> bool:
    """Return whether unfinished runs may still decide an oracle of a cell."""
    undecided = verdict is None or verdict.verdict is Outcome.INCONCLUSIVE
    return undecided and any(not record.settled for record in records)


def _oracles(assessment: Assessment) -> Mapping[tuple[str, str, str], CellVerdict]:
    return {(o.scenario, o.sut, o.oracle): o for cell in assessment.cells for o in cell.oracles}


_TestedChange: TypeAlias = tuple[QuantityChange, float | None, float | None]
"""A shift with the p values of "it changed" and of "it got worse", before their adjustment."""


def _quantity_changes(
    before: Sequence[RunRow], after: Sequence[RunRow], worse_by: float | None
) -> Iterable[_TestedChange]:
    for name, (kind, unit) in _quantities((*after, *before)).items():
        old, new = (_values(side, name, kind) for side in (before, after))
        if old and new:
            yield _test_change(after[0], name, kind, unit, old, new, worse_by)


def _quantities(records: Iterable[RunRow]) -> dict[str, tuple[QuantityKind, str]]:
    quantities: dict[str, tuple[QuantityKind, str]] = {}
    for record in records:
        for verdict in record.verdicts:
            # An error tells neither the kind of an oracle nor its unit.
            if verdict.outcome is Outcome.ERROR:
                continue
            kind: QuantityKind = "measure" if verdict.outcome is Outcome.MEASURE else "margin"
            quantities.setdefault(verdict.oracle, (kind, verdict.unit))
    quantities.setdefault(DURATION, ("duration", "s"))
    return quantities


def _values(
    records: Iterable[RunRow], name: str, kind: QuantityKind
) -> dict[tuple[int, int], float]:
    values: dict[tuple[int, int], float] = {}
    for record in records:
        value = _margin(record, name) if kind == "margin" else measured_value(record, name)
        if value is not None:
            values[record.repeat, record.seed] = value
    return values


def _margin(record: RunRow, name: str) -> float | None:
    # An inconclusive margin is a bound; means of bounds are meaningless.
    decided = (Outcome.PASS, Outcome.FAIL)
    margins = (
        v.margin for v in trusted_verdicts(record) if v.oracle == name and v.outcome in decided
    )
    return next(margins, None)


def _test_change(
    record: RunRow,
    name: str,
    kind: QuantityKind,
    unit: str,
    old: Mapping[tuple[int, int], float],
    new: Mapping[tuple[int, int], float],
    worse_by: float | None,
) -> _TestedChange:
    difference = mean_difference(new, old, confidence=EACH_SIDE)
    was, now = (sum(side.values()) / len(side) for side in (old, new))
    shift = QuantityChange(
        scenario=record.scenario,
        sut=record.sut,
        quantity=name,
        kind=kind,
        unit=unit,
        before=was,
        after=now,
        n=difference.n if difference else len(old.keys() & new.keys()),
        method=difference.method if difference else "",
        mean=difference.mean if difference else now - was,
    )
    if difference is None:
        return shift, None, None
    shift = replace(
        shift,
        low=difference.low,
        high=difference.high,
        delta=cliffs_delta(tuple(new.values()), tuple(old.values())),
    )
    return shift, difference.p_different, _p_worse(difference, kind, was, worse_by)


def _p_worse(
    difference: MeanDifference, kind: QuantityKind, before: float, worse_by: float | None
) -> float | None:
    """Return the p value for "worse by more than allowed"; ``None`` without a gate."""
    # Measures have no gate: whether more is worse is unknown.
    if worse_by is None or kind == "measure":
        return None
    allowed = worse_by * abs(before)  # it may be negative
    # A margin gets worse downwards.
    if kind == "duration":
        return difference.p_above(allowed)
    return difference.p_below(-allowed)


def _adjust_together(tested: Sequence[_TestedChange]) -> tuple[QuantityChange, ...]:
    """Return the shifts with p values adjusted for their number."""
    # Two families, because there are two questions: what changed, and what the gate forbids.
    different = _holm_or_none([p_different for _, p_different, _ in tested])
    worse = _holm_or_none([p_worse for _, _, p_worse in tested])
    return tuple(
        replace(
            shift,
            p=p,
            changed=p is not None and p < SIGNIFICANT,
            worse=q is not None and q < SIGNIFICANT,
        )
        for (shift, _, _), p, q in zip(tested, different, worse, strict=True)
    )


def _holm_or_none(values: Sequence[float | None]) -> list[float | None]:
    adjusted = iter(holm_adjusted([value for value in values if value is not None]))
    return [None if value is None else next(adjusted) for value in values]
