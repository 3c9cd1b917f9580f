"""Assessment of a campaign's run records: cells, comparisons, surprises, reference values."""

from __future__ import annotations

import functools
import statistics
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Final, TypeAlias

from daemon.judging.assessment._cell_verdicts import (
    BY_GRAVITY,
    base_name,
    cell_measures,
    cell_verdict,
    duration,
    expectation_status,
    expected_verdict,
    group_by_cell,
    matches_scenario,
    matches_sut,
    measured_value,
    trusted_verdicts,
)
from daemon.judging.statistics import EACH_SIDE, MeanDifference, mean_difference, mean_interval
from daemon.model.assessments import (
    DELAY,
    MISSING_STATES,
    Assessment,
    AssessmentRules,
    CellAssessment,
    CellVerdict,
    ComparisonVerdict,
    ExpectationStatus,
    ReferenceComparison,
    ReferenceValue,
    ScenarioComparison,
    UnexpectedVerdict,
    state_of,
)
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome, Verdict
from grammars.text.diagnostics import InputError, Where
from grammars.text.words import count_noun, format_quantity

PairKey: TypeAlias = tuple[str, int, int]
"""Key that two runs of a pair share: the variant of the floor plan, the repeat, the seed."""


def comparison_verdicts(
    comparison: ScenarioComparison, records: Sequence[RunRow], declared: AssessmentRules
) -> list[ComparisonVerdict]:
    """Return the comparison for every system under test that ran both scenarios, in order."""
    sides = (comparison.left, comparison.right)
    suts: dict[str, set[str]] = {}
    for record in records:
        suts.setdefault(record.sut, set()).add(base_name(record.scenario))
    # Skip a system that ran only one of the scenarios, or of their variants.
    return [
        _cell(comparison, sut, [r for r in records if r.sut == sut], declared)
        for sut, scenarios in suts.items()
        if scenarios.issuperset(sides)
    ]


def _cell(
    comparison: ScenarioComparison,
    sut: str,
    records: Sequence[RunRow],
    declared: AssessmentRules,
) -> ComparisonVerdict:
    compared = [r for r in records if base_name(r.scenario) in (comparison.left, comparison.right)]
    left, right = (_values(comparison, s, compared) for s in (comparison.left, comparison.right))
    differences = tuple(left[key] - right[key] for key in sorted(left.keys() & right.keys()))
    difference = mean_difference(left, right)
    both = mean_difference(left, right, EACH_SIDE)
    missing = sum(_value(comparison, record) is None for record in compared)
    note = _missing_text(comparison, missing, compared)
    verdict, note = _verdict(comparison, difference, note, differences)
    expected, why = expected_verdict(declared.expectations, comparison.left, comparison.name, sut)
    failed, passed = int(verdict is Outcome.FAIL), int(verdict is Outcome.PASS)
    mean = sum(differences) / len(differences) if differences else None
    return ComparisonVerdict(
        comparison=comparison.name,
        text=comparison.text,
        sut=sut,
        unit=comparison.unit,
        limit=comparison.limit,
        n=difference.n if difference else len(differences),
        left_out=missing,
        differences=differences,
        mean=difference.mean if difference else mean,
        low=difference.low if difference else None,
        high=difference.high if difference else None,
        method=difference.method if difference else "",
        verdict=verdict,
        note=note,
        expected=expected,
        status=expectation_status(expected, verdict, passed=passed, failed=failed, n=1),
        why=why,
        state=state_of(r.state for r in compared),
        interval=(both.low, both.high) if both else None,
    )


def _values(
    comparison: ScenarioComparison, scenario: str, records: Sequence[RunRow]
) -> dict[PairKey, float]:
    """Return the known values of the runs of a scenario."""
    return {
        (record.scenario.partition("@")[2], record.repeat, record.seed): value
        for record in records
        if base_name(record.scenario) == scenario
        and (value := _value(comparison, record)) is not None
    }


def _value(comparison: ScenarioComparison, record: RunRow) -> float | None:
    if comparison.quantity != DELAY:
        return measured_value(record, comparison.quantity)
    if not mission_completed(record):
        return None
    return measured_value(record, comparison.measure) if comparison.measure else duration(record)


def mission_completed(record: RunRow) -> bool:
    """Return whether a run ended its mission: only then can its time tell a delay."""
    arrived = all(v.outcome is Outcome.PASS for v in record.verdicts if _asks_for_arrival(v.text))
    return record.ended == "finished" and arrived


@functools.lru_cache(maxsize=256)
def _asks_for_arrival(text: str) -> bool:
    """Return whether an oracle judges by ``reached``."""
    # The parser of the language loads slowly, and few campaigns compare delays.
    from grammars.oracle import Reached, parse_oracle

    try:
        oracle = parse_oracle("", text, Where("an oracle"))
    except InputError:  # by a plug-in that is not installed here
        return False
    return isinstance(oracle.judgement, Reached)


def _verdict(
    comparison: ScenarioComparison,
    difference: MeanDifference | None,
    note: str,
    differences: Sequence[float],
) -> tuple[Outcome, str]:
    """Return the verdict and its obstacle; ``note`` says which runs have no value."""
    if difference is None:
        few = "only one pair" if differences else "nothing to compare"
        return Outcome.INCONCLUSIVE, f"{few}; {note}" if note else few
    verdict = _judge(comparison, difference)
    # Runs that took too long for a measurement might have been the worst.
    if verdict is Outcome.PASS and note:
        return Outcome.INCONCLUSIVE, note
    return verdict, note


def _missing_text(comparison: ScenarioComparison, missing: int, records: Sequence[RunRow]) -> str:
    """Return how many compared runs have no value and why; empty if all have one."""
    states = Counter(record.state for record in records if record.state in MISSING_STATES)
    parts = [
        count_noun(states[state], "run") + f" {state}" for state in MISSING_STATES if states[state]
    ]
    if others := missing - states.total():
        why = "did not end the mission" if comparison.quantity == DELAY else "left out"
        parts.append(count_noun(others, "run") + f" {why}")
    return ", ".join(parts)


def _judge(comparison: ScenarioComparison, difference: MeanDifference) -> Outcome:
    low, high, limit = difference.low, difference.high, comparison.limit
    # ">= limit" is "<= -limit" of the negated difference.
    if comparison.op in (">", ">="):
        low, high, limit = -high, -low, -limit
    strict = comparison.op in ("<", ">")
    if high < limit or (high == limit and not strict):
        return Outcome.PASS
    if low > limit or (low == limit and strict):
        return Outcome.FAIL
    return Outcome.INCONCLUSIVE


AS_EXPECTED, UNEXPECTED, INFRASTRUCTURE, UNDECIDED = 0, 1, 3, 4  # 2 is bad input


def assess(declared: AssessmentRules, records: Iterable[RunRow]) -> Assessment:
    """Judge the runs of a campaign by its declarations.

    Pure: the same declaration and records always give the same assessment. Runs without a result
    count as unknown repeats.
    """
    runs = tuple(records)
    cells = tuple(_assess_cell(group, declared) for group in group_by_cell(runs).values())
    compared = tuple(
        verdict
        for comparison in declared.comparisons
        for verdict in comparison_verdicts(comparison, runs, declared)
    )
    contradicted = ExpectationStatus.CONTRADICTED
    oracles = (oracle for cell in cells for oracle in cell.oracles)
    surprises = [_unexpected_verdict(o, runs) for o in oracles if o.status is contradicted]
    surprises += [_unexpected_comparison(c) for c in compared if c.status is contradicted]
    statuses = {cell.status for cell in cells} | {one.status for one in compared}
    return Assessment(cells, compared, tuple(surprises), _exit_code(runs, statuses))


def undecided_cells(
    declared: AssessmentRules, records: Iterable[RunRow]
) -> tuple[tuple[str, str], ...]:
    """Return the cells, (scenario, SUT), whose oracles more repeats could still decide.

    Leave out cells with a run that has no result, since broken runs are not repeated. An oracle
    counts only if something is expected of it and every repeat could judge it.
    """
    undecided = []
    for group in group_by_cell(records).values():
        if any(record.outcome is None for record in group):
            continue
        cell = _assess_cell(group, declared)
        if any(_can_be_decided(oracle) for oracle in cell.oracles):
            undecided.append((cell.scenario, cell.sut))
    return tuple(undecided)


def _can_be_decided(oracle: CellVerdict) -> bool:
    unknown = oracle.verdict is Outcome.INCONCLUSIVE
    return unknown and oracle.status is not ExpectationStatus.MET and not oracle.inconclusive


def _assess_cell(records: Sequence[RunRow], declared: AssessmentRules) -> CellAssessment:
    verdicts = [v for r in records for v in trusted_verdicts(r)]
    # Untrustworthy traces give errors for measures too; that does not make them oracles.
    measures = {v.oracle for v in verdicts if v.outcome is Outcome.MEASURE}
    names = dict.fromkeys(v.oracle for v in verdicts if v.oracle not in measures)
    oracles = tuple(cell_verdict(name, records, declared) for name in names)
    return CellAssessment(
        scenario=records[0].scenario,
        sut=records[0].sut,
        verdict=_worst_outcome(oracles, records),
        oracles=oracles,
        measures=cell_measures(records),
        runs=tuple(record.id for record in records),
        state=state_of(r.state for r in records),
    )


def _worst_outcome(oracles: Sequence[CellVerdict], records: Sequence[RunRow]) -> Outcome:
    if oracles:
        return min((oracle.verdict for oracle in oracles), key=BY_GRAVITY.index)
    broken = any(_broken(record) for record in records)
    return Outcome.ERROR if broken else Outcome.INCONCLUSIVE


def _broken(record: RunRow) -> bool:
    """Return whether a run was lost or cannot be judged."""
    return record.state == "lost" or record.outcome is Outcome.ERROR


def _exit_code(records: Sequence[RunRow], statuses: Collection[ExpectationStatus]) -> int:
    """Return 1, 3, 4 or 0: a finding counts even if other runs broke."""
    if ExpectationStatus.CONTRADICTED in statuses:
        return UNEXPECTED
    if any(_broken(record) for record in records):
        return INFRASTRUCTURE
    unfinished = any(record.outcome is None for record in records)
    if unfinished or not records or ExpectationStatus.OPEN in statuses:
        return UNDECIDED
    return AS_EXPECTED


def _unexpected_verdict(oracle: CellVerdict, records: Sequence[RunRow]) -> UnexpectedVerdict:
    """Return the run that contradicts: the worst, or the first that passes unexpectedly."""
    worst = oracle.worst
    run, repeat, verdict = (worst.run, worst.repeat, worst.verdict) if worst else ("", None, None)
    subject = f"{oracle.sut} {oracle.scenario} {oracle.oracle}"
    if oracle.expected != "pass":
        # It should have failed: the worst run was expected, a passing one is the surprise.
        run, repeat, verdict = next(_passing_runs(oracle, records), (run, repeat, verdict))
        text = f"{subject}  passes {oracle.passed} of {oracle.n}, expected {oracle.expected}"
    else:
        text = f"{subject}  {evidence_text(verdict)}" if verdict else subject
        if oracle.failed < oracle.n:
            text += f"  ({oracle.failed} of {oracle.n} fail)"
    return UnexpectedVerdict(
        scenario=oracle.scenario,
        sut=oracle.sut,
        oracle=oracle.oracle,
        verdict=oracle.verdict,
        expected=oracle.expected,
        run=run,
        repeat=repeat,
        why=oracle.why,
        text=text,
    )


def _passing_runs(
    oracle: CellVerdict, records: Sequence[RunRow]
) -> Iterator[tuple[str, int, Verdict]]:
    for record in records:
        if (record.scenario, record.sut) == (oracle.scenario, oracle.sut):
            for verdict in trusted_verdicts(record):
                if verdict.oracle == oracle.oracle and verdict.outcome is Outcome.PASS:
                    yield record.id, record.repeat, verdict


def evidence_text(verdict: Verdict) -> str:
    """Return a verdict's margin and evidence: ``−0.012 m  at 41.3 s  door_17``."""
    evidence, margin = verdict.evidence, verdict.margin
    parts = ["" if margin is None else format_quantity(margin, verdict.unit, signed=True)]
    parts.append("" if evidence.time is None else f"at {evidence.time:.1f} s")
    parts.extend((evidence.object, evidence.note_text))
    return "  ".join(part for part in parts if part)


def _unexpected_comparison(cell: ComparisonVerdict) -> UnexpectedVerdict:
    mean = "" if cell.mean is None else f"  {format_quantity(cell.mean, cell.unit, signed=True)}"
    return UnexpectedVerdict(
        scenario="",
        sut=cell.sut,
        oracle=cell.comparison,
        verdict=cell.verdict,
        expected=cell.expected,
        run="",
        repeat=None,
        why=cell.why,
        text=f"{cell.sut} {cell.comparison}{mean}  {cell.verdict}, n={cell.n}: {cell.text}",
    )


_STATISTICS: Final[dict[str, Callable[[Sequence[float]], float]]] = {
    "median": statistics.median,
    "min": min,
    "max": max,
}


def reference_comparisons(
    references: Sequence[ReferenceValue], assessment: Assessment
) -> tuple[ReferenceComparison, ...]:
    """Return every reference value beside the value of the runs, in the order of the file.

    There is one comparison for each executed scenario and system under test that it names.
    """
    return tuple(one for r in references for one in _compared(r, assessment))


def _compared(reference: ReferenceValue, assessment: Assessment) -> Iterator[ReferenceComparison]:
    if not reference.scenario:
        for verdict in assessment.comparisons:
            if verdict.comparison == reference.oracle and matches_sut(reference.suts, verdict.sut):
                yield _of_values(reference, "", verdict.sut, verdict.differences)
        return
    for cell in assessment.cells:
        if not matches_sut(reference.suts, cell.sut):
            continue
        if not matches_scenario(reference.scenario, cell.scenario):
            continue
        if reference.statistic == "rate":
            verdicts = (oracle for oracle in cell.oracles if oracle.oracle == reference.oracle)
            yield from (_of_verdict(reference, verdict) for verdict in verdicts)
        else:
            measures = {measure.oracle: measure.values for measure in cell.measures}
            values = measures.get(reference.oracle, ())
            yield _of_values(reference, cell.scenario, cell.sut, values)


def _of_verdict(reference: ReferenceValue, verdict: CellVerdict) -> ReferenceComparison:
    rate = verdict.passed / verdict.n if verdict.n else None
    return ReferenceComparison(
        reference, verdict.scenario, verdict.sut, verdict.n, rate, None, verdict.low, verdict.high
    )


def _of_values(
    reference: ReferenceValue, scenario: str, sut: str, values: Sequence[float]
) -> ReferenceComparison:
    if not values:
        return ReferenceComparison(reference, scenario, sut, 0, None)
    interval = mean_interval(values)
    if reference.statistic == "mean":
        return ReferenceComparison(
            reference, scenario, sut, interval.n,
            interval.mean, interval.std, interval.low, interval.high,
        )  # fmt: skip
    value = _STATISTICS[reference.statistic](values)
    return ReferenceComparison(reference, scenario, sut, len(values), value, interval.std)
