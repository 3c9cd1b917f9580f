"""The whole of a campaign judged: the one function the command line, reports and dashboard use."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from daemon.judging.assessment._cell_verdicts import (
    BY_GRAVITY,
    ExpectationStatus,
    cell_measures,
    cell_verdict,
    group_by_cell,
    status_of,
    trusted_verdicts,
)
from daemon.judging.assessment._comparisons import comparison_verdicts
from daemon.model.assessments import (
    Assessment,
    AssessmentRules,
    CellAssessment,
    CellVerdict,
    ComparisonVerdict,
    RunRecord,
    UnexpectedVerdict,
)
from daemon.model.verdicts import Outcome, Verdict

AS_EXPECTED, UNEXPECTED, INFRASTRUCTURE, UNDECIDED = 0, 1, 3, 4  # 2 is bad input


def assess(declared: AssessmentRules, records: Iterable[RunRecord]) -> Assessment:
    """Judge the runs of a campaign by what the campaign declares.

    Pure: the same declaration and the same records give the same assessment, whoever asks. Runs
    without a result count as repeats of which nothing is known.
    """
    runs = tuple(records)
    cells = tuple(_assess_cell(group, declared) for group in _cells(runs))
    compared = tuple(
        verdict
        for comparison in declared.comparisons
        for verdict in comparison_verdicts(comparison, runs, declared)
    )
    oracles = [oracle for cell in cells for oracle in cell.oracles]
    surprises = [_unexpected_verdict(o, runs) for o in oracles if _is_contradicted(o)]
    surprises += [_unexpected_comparison(c) for c in compared if _is_contradicted(c)]
    statuses = {status_of(oracle) for oracle in oracles} | {status_of(c) for c in compared}
    return Assessment(cells, compared, tuple(surprises), _exit_code(runs, cells, statuses))


def _is_contradicted(verdict: CellVerdict | ComparisonVerdict) -> bool:
    return status_of(verdict) is ExpectationStatus.CONTRADICTED


def undecided_cells(
    declared: AssessmentRules, records: Iterable[RunRecord]
) -> tuple[tuple[str, str], ...]:
    """Return the cells, (scenario, SUT), whose oracles more repeats could still decide.

    Not those with a run that has no result (what is broken is not repeated), nor oracles of which
    nothing is expected or that some repeat could not judge.
    """
    found = []
    for group in _cells(records):
        if any(record.outcome is None for record in group):
            continue
        cell = _assess_cell(group, declared)
        if any(_can_be_decided(oracle) for oracle in cell.oracles):
            found.append((cell.scenario, cell.sut))
    return tuple(found)


def _can_be_decided(oracle: CellVerdict) -> bool:
    open_yet = oracle.verdict is Outcome.INCONCLUSIVE and not oracle.met
    return open_yet and not oracle.inconclusive


def _cells(records: Iterable[RunRecord]) -> list[list[RunRecord]]:
    return [sorted(group, key=lambda r: r.repeat) for group in group_by_cell(records).values()]


def _assess_cell(records: Sequence[RunRecord], declared: AssessmentRules) -> CellAssessment:
    found = [v for r in records for v in trusted_verdicts(r)]
    # A trace that cannot be trusted gives errors for measures too; they are no oracles for that.
    measures = {v.oracle for v in found if v.outcome is Outcome.MEASURE}
    names = dict.fromkeys(v.oracle for v in found if v.oracle not in measures)
    oracles = tuple(cell_verdict(name, records, declared) for name in names)
    return CellAssessment(
        scenario=records[0].scenario,
        sut=records[0].sut,
        verdict=_worst_outcome(oracles, records),
        oracles=oracles,
        measures=cell_measures(records),
        runs=tuple(record.id for record in records),
    )


def _worst_outcome(oracles: Sequence[CellVerdict], records: Sequence[RunRecord]) -> Outcome:
    if oracles:
        return min((oracle.verdict for oracle in oracles), key=BY_GRAVITY.index)
    broken = any(_broken(record) for record in records)
    return Outcome.ERROR if broken else Outcome.INCONCLUSIVE


def _broken(record: RunRecord) -> bool:
    """Whether a run was not executed, or not so that it can be judged."""
    return record.state == "lost" or record.outcome is Outcome.ERROR


def _exit_code(
    records: Sequence[RunRecord],
    cells: Sequence[CellAssessment],
    statuses: Collection[ExpectationStatus],
) -> int:
    """Return 1, 3, 4 or 0: a finding counts even when other runs broke."""
    if ExpectationStatus.CONTRADICTED in statuses:
        return UNEXPECTED
    if any(_broken(record) for record in records):
        return INFRASTRUCTURE
    unfinished = any(record.outcome is None for record in records)
    # A cell that nothing was asked about is no success either.
    silent = not cells or any(not cell.oracles for cell in cells)
    if unfinished or silent or ExpectationStatus.OPEN in statuses:
        return UNDECIDED
    return AS_EXPECTED


def _unexpected_verdict(oracle: CellVerdict, records: Sequence[RunRecord]) -> UnexpectedVerdict:
    """Return what contradicts: the worst run, or the first that passes where it should not."""
    shown = oracle.worst
    run, repeat, verdict = (shown.run, shown.repeat, shown.verdict) if shown else ("", None, None)
    said = f"{oracle.sut} {oracle.scenario} {oracle.oracle}"
    if oracle.expected != "pass":
        first = next((pair for pair in _passing_runs(oracle, records)), None)
        run, repeat, verdict = first if first else (run, repeat, verdict)
        text = f"{said}  passes {oracle.passed} of {oracle.n}, expected {oracle.expected}"
    else:
        text = f"{said}  {evidence_text(verdict)}" if verdict else said
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
    oracle: CellVerdict, records: Sequence[RunRecord]
) -> Iterable[tuple[str, int, Verdict]]:
    for record in records:
        if (record.scenario, record.sut) == (oracle.scenario, oracle.sut):
            for verdict in trusted_verdicts(record):
                if verdict.oracle == oracle.oracle and verdict.outcome is Outcome.PASS:
                    yield record.id, record.repeat, verdict


def evidence_text(verdict: Verdict) -> str:
    """Return a verdict's margin and evidence: ``-0.012 m  t=41.3 s  door-17``."""
    seen = verdict.evidence
    parts = ["" if verdict.margin is None else _quantity(verdict.margin, verdict.unit)]
    parts.append("" if seen.time is None else f"t={seen.time:.1f} s")
    parts.extend((seen.object, seen.note))
    return "  ".join(part for part in parts if part)


def _quantity(value: float, unit: str) -> str:
    return f"{value:+.3g} {unit}" if unit not in ("", "1") else f"{value:+.3g}"


def _unexpected_comparison(cell: ComparisonVerdict) -> UnexpectedVerdict:
    mean = "" if cell.mean is None else f"  {_quantity(cell.mean, cell.unit)}"
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
