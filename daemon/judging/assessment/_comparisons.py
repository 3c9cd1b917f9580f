"""Comparisons: what one scenario costs more than its sibling, paired by repeat.

Equal repeats see the same doors and the same noise, so differences of pairs vary less than their
terms. Where there are no pairs, Welch's test compares the means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from daemon.judging.assessment._cell_verdicts import (
    ExpectationStatus,
    base_name,
    duration,
    expectation_status,
    expected_verdict,
    measured_value,
)
from daemon.judging.statistics import MeanDifference, mean_difference
from daemon.model.assessments import (
    DELAY,
    AssessmentRules,
    ComparisonVerdict,
    RunRecord,
    ScenarioComparison,
)
from daemon.model.verdicts import Outcome

PairKey: TypeAlias = tuple[str, int, int]
"""What makes two runs a pair: the variant of the floor plan, the repeat, the seed."""


@dataclass(frozen=True, slots=True)
class _ComparedSide:
    values: dict[PairKey, float]
    left_out: int


def comparison_verdicts(
    comparison: ScenarioComparison, records: Sequence[RunRecord], declared: AssessmentRules
) -> list[ComparisonVerdict]:
    """Return the comparison for every system under test that ran both scenarios, in order."""
    sides = (comparison.left, comparison.right)
    suts: dict[str, set[str]] = {}
    for record in records:
        suts.setdefault(record.sut, set()).add(base_name(record.scenario))
    return [
        _cell(comparison, sut, [r for r in records if r.sut == sut], declared)
        for sut, scenarios in suts.items()
        if scenarios.issuperset(sides)
    ]


def _cell(
    comparison: ScenarioComparison,
    sut: str,
    records: Sequence[RunRecord],
    declared: AssessmentRules,
) -> ComparisonVerdict:
    left, right = (
        _compared_side(comparison, s, records) for s in (comparison.left, comparison.right)
    )
    pairs = sorted(left.values.keys() & right.values.keys())
    differences = tuple(left.values[key] - right.values[key] for key in pairs)
    difference = mean_difference(left.values, right.values)
    left_out = left.left_out + right.left_out
    verdict, note = _verdict(comparison, difference, left_out, differences)
    wanted, why = expected_verdict(declared.expectations, comparison.left, comparison.name, sut)
    failed, passed = int(verdict is Outcome.FAIL), int(verdict is Outcome.PASS)
    status = expectation_status(wanted, verdict, passed=passed, failed=failed, n=1)
    mean = sum(differences) / len(differences) if differences else None
    return ComparisonVerdict(
        comparison=comparison.name,
        text=comparison.text,
        sut=sut,
        unit=comparison.unit,
        limit=comparison.limit,
        n=difference.n if difference else len(differences),
        left_out=left_out,
        differences=differences,
        mean=difference.mean if difference else mean,
        low=difference.low if difference else None,
        high=difference.high if difference else None,
        method=difference.method if difference else "",
        verdict=verdict,
        note=note,
        expected=wanted,
        met=status is ExpectationStatus.MET,
        why=why,
    )


def _compared_side(
    comparison: ScenarioComparison, scenario: str, records: Sequence[RunRecord]
) -> _ComparedSide:
    values: dict[PairKey, float] = {}
    left_out = 0
    for record in records:
        if base_name(record.scenario) != scenario:
            continue
        value = _value(comparison, record)
        if value is None:
            left_out += 1
        else:
            variant = record.scenario.partition("@")[2]
            values[(variant, record.repeat, record.seed)] = value
    return _ComparedSide(values, left_out)


def _value(comparison: ScenarioComparison, record: RunRecord) -> float | None:
    if comparison.quantity != DELAY:
        return measured_value(record, comparison.quantity)
    if not mission_completed(record):
        return None
    return measured_value(record, comparison.measure) if comparison.measure else duration(record)


def mission_completed(record: RunRecord) -> bool:
    """Whether the mission was ended: only then the time it took says anything about a delay."""
    # By the text of the oracle, which is all that a record has of it: those with a guard or a leg
    # before ``reached`` do not count.
    arrived = all(
        v.outcome is Outcome.PASS for v in record.verdicts if v.text.startswith("reached(")
    )
    return record.ended == "finished" and arrived


def _verdict(
    comparison: ScenarioComparison,
    difference: MeanDifference | None,
    left_out: int,
    differences: Sequence[float],
) -> tuple[Outcome, str]:
    note = f"{_runs(left_out)} left out" if left_out else ""
    if left_out and comparison.quantity == DELAY:
        note = f"{_runs(left_out)} did not end the mission"
    if difference is None:
        few = "only one pair" if differences else "nothing to compare"
        return Outcome.INCONCLUSIVE, f"{few}; {note}" if note else few
    verdict = _judge(comparison, difference)
    # Those that took too long to be measured might have been the worst.
    if verdict is Outcome.PASS and left_out:
        return Outcome.INCONCLUSIVE, note
    return verdict, note


def _judge(comparison: ScenarioComparison, difference: MeanDifference) -> Outcome:
    low, high, limit = difference.low, difference.high, comparison.limit
    if comparison.op in (">", ">="):
        low, high, limit = -high, -low, -limit
    strict = comparison.op in ("<", ">")
    if high < limit or (high == limit and not strict):
        return Outcome.PASS
    if low > limit or (low == limit and strict):
        return Outcome.FAIL
    return Outcome.INCONCLUSIVE


def _runs(count: int) -> str:
    return "1 run" if count == 1 else f"{count} runs"
