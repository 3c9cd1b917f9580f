"""Verdicts of one cell over all repeats: evidence of each oracle, measures, expectations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from typing import Final, TypeAlias

from daemon.judging.statistics import (
    CONFIDENCE,
    at_least,
    at_most,
    cut_percentage,
    mean_interval,
    proportion_interval,
    runs_needed,
)
from daemon.model.assessments import (
    DURATION,
    AssessmentRules,
    CellMeasure,
    CellVerdict,
    Expectation,
    ExpectationStatus,
    ExpectedVerdict,
    RepeatPolicy,
    WorstRun,
    state_of,
)
from daemon.model.status import RunRow
from daemon.model.verdicts import Evidence, Outcome, Verdict

Cell: TypeAlias = tuple[str, str]
"""A scenario (or one of its variants) with a system under test."""

BY_GRAVITY: Final = (Outcome.FAIL, Outcome.ERROR, Outcome.INCONCLUSIVE, Outcome.PASS)
"""Outcomes, the most important first: a failure is a finding, an error may hide one."""


def group_by_cell(records: Iterable[RunRow]) -> dict[Cell, list[RunRow]]:
    """Return the runs of each cell by repeat; cells keep the order of their appearance."""
    groups: dict[Cell, list[RunRow]] = {}
    for record in records:
        groups.setdefault((record.scenario, record.sut), []).append(record)
    return {cell: sorted(runs, key=lambda run: run.repeat) for cell, runs in groups.items()}


def base_name(scenario: str) -> str:
    """Return the scenario's name in the file: ``S1`` for its variant ``S1@1003``."""
    return scenario.partition("@")[0]


def expectation_matches(expectation: Expectation, scenario: str, oracle: str, sut: str) -> bool:
    """Return whether an expectation is about an oracle of a scenario with a system under test.

    A pattern that matches a scenario matches its variants.
    """
    return (
        matches_scenario(expectation.scenario, scenario)
        and fnmatchcase(oracle, expectation.oracle)
        and matches_sut(expectation.suts, sut)
    )


def matches_scenario(pattern: str, scenario: str) -> bool:
    """Return whether a pattern matches a scenario, or the base scenario of a variant."""
    return any(fnmatchcase(name, pattern) for name in (scenario, base_name(scenario)))


def matches_sut(patterns: Sequence[str], sut: str) -> bool:
    """Return whether any pattern matches a system under test; an empty list matches all."""
    return any(fnmatchcase(sut, pattern) for pattern in patterns or ("*",))


def expected_verdict(
    expectations: Sequence[Expectation], scenario: str, oracle: str, sut: str
) -> tuple[ExpectedVerdict, str]:
    """Return the expected verdict and why, from the last matching expectation; otherwise pass."""
    # The last one counts, so that a file can go from the rule to its exceptions.
    for expectation in reversed(expectations):
        if expectation_matches(expectation, scenario, oracle, sut):
            return expectation.verdict, expectation.why
    return "pass", ""


def expectation_status(
    expected: ExpectedVerdict, verdict: Outcome, *, passed: int, failed: int, n: int
) -> ExpectationStatus:
    """Compare the result of ``n`` repeats with the expectation.

    ``pass`` is about the verdict, which follows the policy. ``fail`` and ``mixed`` are about single
    repeats: a known failure must not pass by chance either.
    """
    if expected == "any":
        return ExpectationStatus.MET
    if expected == "pass":
        is_met, is_contradicted = verdict is Outcome.PASS, verdict is Outcome.FAIL
    elif expected == "fail":
        is_met, is_contradicted = failed == n > 0, passed > 0
    else:
        is_met, is_contradicted = failed > 0, passed == n > 0
    if is_met:
        return ExpectationStatus.MET
    return ExpectationStatus.CONTRADICTED if is_contradicted else ExpectationStatus.OPEN


def measured_value(record: RunRow, name: str) -> float | None:
    """Return the value of the measure ``name`` in a run, ``None`` if there is no trusted one."""
    if record.outcome is None or record.ended == "crashed":
        return None
    verdict = record.verdict(name)
    if verdict is None:
        return duration(record) if name == DURATION else None
    return verdict.evidence.value if verdict.outcome is Outcome.MEASURE else None


def duration(record: RunRow) -> float | None:
    """Return the simulated time of a run [s]."""
    return None if record.result is None else record.result.timing.simulated


def cell_measures(records: Sequence[RunRow]) -> tuple[CellMeasure, ...]:
    """Return every measure of one cell that has values, the duration last."""
    units: dict[str, str] = {}
    for record in records:
        for verdict in record.verdicts:
            if verdict.outcome is Outcome.MEASURE:
                units.setdefault(verdict.oracle, verdict.unit)
    if DURATION not in {v.oracle for r in records for v in r.verdicts}:
        units[DURATION] = "s"
    cells = (_cell_measure(name, unit, records) for name, unit in units.items())
    return tuple(cell for cell in cells if cell is not None)


def _cell_measure(name: str, unit: str, records: Sequence[RunRow]) -> CellMeasure | None:
    pairs = [(r.repeat, value) for r in records if (value := measured_value(r, name)) is not None]
    if not pairs:
        return None
    repeats, values = zip(*pairs, strict=True)
    interval = mean_interval(values)
    return CellMeasure(
        scenario=records[0].scenario,
        sut=records[0].sut,
        oracle=name,
        unit=unit,
        repeats=repeats,
        values=values,
        mean=interval.mean,
        std=interval.std,
        low=interval.low,
        high=interval.high,
    )


def trusted_verdicts(record: RunRow) -> tuple[Verdict, ...]:
    """Return the verdicts of a run as they count: all are errors if its system crashed."""
    if record.ended != "crashed":
        return record.verdicts
    return tuple(_distrust(verdict, record.note) for verdict in record.verdicts)


def _distrust(verdict: Verdict, note: str) -> Verdict:
    evidence = Evidence(note=note)
    return Verdict(verdict.oracle, verdict.text, Outcome.ERROR, None, None, verdict.unit, evidence)


def cell_verdict(name: str, records: Sequence[RunRow], declared: AssessmentRules) -> CellVerdict:
    """Return the verdict of the oracle ``name`` on the repeats of one cell."""
    pairs = [(r, v) for r in records for v in trusted_verdicts(r) if v.oracle == name]
    verdicts = [v for _, v in pairs]
    counts, n = Counter(v.outcome for v in verdicts), len(records)
    passed, failed = counts[Outcome.PASS], counts[Outcome.FAIL]
    policy = declared.policy
    verdict = _policy_verdict(policy, verdicts, n)
    scenario, sut = records[0].scenario, records[0].sut
    expected, why = expected_verdict(declared.expectations, scenario, name, sut)
    confidence = confidence_of(policy)
    needed = runs_needed(passed, n, policy.rate, confidence) if policy.rule == "rate" else None
    waiting = sum(not record.settled for record in records)
    statement = _statement(policy, passed, failed, n, needed)
    if waiting and verdict is Outcome.INCONCLUSIVE:
        # What these repeats show can only be said once all have finished.
        statement = f"{passed} of {n} pass, {waiting} not finished"
    return CellVerdict(
        scenario=scenario,
        sut=sut,
        oracle=name,
        passed=passed,
        failed=failed,
        inconclusive=counts[Outcome.INCONCLUSIVE],
        errors=counts[Outcome.ERROR],
        missing=n - len(verdicts),
        n=n,
        # The lower bound takes repeats without a verdict for failures, the upper one for passes.
        low=proportion_interval(passed, n)[0],
        high=proportion_interval(n - failed, n)[1],
        at_least=at_least(passed, n, confidence),
        needed=needed,
        statement=statement,
        worst=_worst_run(pairs),
        verdict=verdict,
        expected=expected,
        status=expectation_status(expected, verdict, passed=passed, failed=failed, n=n),
        why=why,
        state=state_of(record.state for record in records),
    )


def confidence_of(policy: RepeatPolicy) -> float:
    """Return the confidence of each look at a cell.

    Looking again and again until something shows would find it by chance. With ``k`` looks each may
    err in 5 %/k (Bonferroni), so that all of them together err in at most 5 %.
    """
    return 1.0 - (1.0 - CONFIDENCE) / len(policy.looks)


def _policy_verdict(policy: RepeatPolicy, verdicts: Sequence[Verdict], n: int) -> Outcome:
    counts = Counter(v.outcome for v in verdicts)
    if policy.rule == "all":
        gravest = [outcome for outcome in BY_GRAVITY[:3] if counts[outcome]]
        if gravest and gravest[0] is not Outcome.INCONCLUSIVE:
            return gravest[0]
        return Outcome.PASS if counts[Outcome.PASS] == n else Outcome.INCONCLUSIVE
    # The result of the sound repeats holds whatever the broken ones would have been: those matter
    # only while the result is open.
    outcome = _rate(policy, counts, n) if policy.rule == "rate" else _mean(policy, verdicts, n)
    undecided = outcome is Outcome.INCONCLUSIVE
    return Outcome.ERROR if undecided and counts[Outcome.ERROR] else outcome


def _rate(policy: RepeatPolicy, counts: Counter[Outcome], n: int) -> Outcome:
    """Judge by the rate; a repeat without a verdict may have passed or failed."""
    confidence = confidence_of(policy)
    if at_least(counts[Outcome.PASS], n, confidence) >= policy.rate:
        return Outcome.PASS
    if at_most(n - counts[Outcome.FAIL], n, confidence) < policy.rate:
        return Outcome.FAIL
    return Outcome.INCONCLUSIVE


def _mean(policy: RepeatPolicy, verdicts: Sequence[Verdict], n: int) -> Outcome:
    """Judge by the mean margin; an unknown margin leaves the result open."""
    margins = [
        v.margin
        for v in verdicts
        if v.margin is not None and v.outcome in (Outcome.PASS, Outcome.FAIL)
    ]
    if len(margins) < max(n, 2):
        return Outcome.INCONCLUSIVE
    # Each bound of a two-sided interval is a one-sided bound with half the doubt.
    interval = mean_interval(margins, 2.0 * confidence_of(policy) - 1.0)
    if interval.low is not None and interval.low >= 0.0:
        return Outcome.PASS
    if interval.high is not None and interval.high < 0.0:
        return Outcome.FAIL
    return Outcome.INCONCLUSIVE


def _statement(policy: RepeatPolicy, passed: int, failed: int, n: int, needed: int | None) -> str:
    confidence = confidence_of(policy)
    if failed == n:
        text = f"{passed} of {n} shows at most {cut_percentage(at_most(0, n, confidence))}"
    else:
        text = f"{passed} of {n} shows at least {cut_percentage(at_least(passed, n, confidence))}"
    if policy.rule != "rate":
        return text
    most = at_most(n - failed, n, confidence)
    if most < policy.rate:
        text += f", at most {cut_percentage(most)}" if failed < n else ""
        text += f": less than {cut_percentage(policy.rate)}"
    elif needed:
        runs = "1 more run" if needed == 1 else f"{needed} more runs"
        text += f", {runs} needed for {cut_percentage(policy.rate)}"
    looks = len(policy.looks)
    return f"{text} ({looks} looks)" if looks > 1 else text


def _worst_run(pairs: Sequence[tuple[RunRow, Verdict]]) -> WorstRun | None:
    if not pairs:
        return None
    record, verdict = min(pairs, key=lambda pair: severity(pair[1]))
    return WorstRun(record.id, record.repeat, verdict)


def severity(verdict: Verdict) -> tuple[int, bool, float]:
    """Return a key that sorts the gravest verdict first, equal outcomes by margin."""
    margin = verdict.margin
    return BY_GRAVITY.index(verdict.outcome), margin is None, margin or 0.0
