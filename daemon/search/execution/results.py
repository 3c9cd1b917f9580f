"""What a run of a search says about the oracle in question, and what several of them say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from daemon.judging.statistics import proportion_interval
from daemon.model.proposals import ObjectiveValue, ProposalRow, objective
from daemon.model.run_state import RunState
from daemon.model.search import Point, SearchTask
from daemon.model.search_answer import Confirmation, PointResult
from daemon.model.verdicts import Outcome, Verdict


@dataclass(frozen=True, slots=True)
class ExploredPoint:
    """A proposal of the exploration; without a result where no run can be made of its point."""

    number: int
    values: Point
    method: str
    guided: bool
    result: PointResult | None


def point_result(task: SearchTask, row: ProposalRow) -> PointResult:
    """Return what a settled run says.

    A run that was lost, or in which the system under test crashed, is an error: another failure
    than the one that is looked for.
    """
    run, proposal = row.run, row.proposal
    trusted = run.state is RunState.DONE and run.ended != "crashed"
    value = objective(task, run.leads) if trusted else None
    verdict = _decisive_verdict(task, run.verdicts, value) if trusted else None
    if verdict is None or verdict.outcome is Outcome.ERROR:
        value, outcome = None, Outcome.ERROR
    else:
        outcome = verdict.outcome
    return PointResult(
        number=proposal.number,
        position=proposal.position,
        values=proposal.values,
        outcome=outcome,
        value=value,
        verdict=verdict,
        run=run.id,
        label=run.label,
        digest=run.digest,
        unsought=_unsought(task, run.verdicts),
    )


def _unsought(task: SearchTask, verdicts: Sequence[Verdict]) -> tuple[str, ...]:
    sought = {scale.oracle for scale in task.scales}
    return tuple(v.oracle for v in verdicts if v.outcome is Outcome.FAIL and v.oracle not in sought)


def _decisive_verdict(
    task: SearchTask, verdicts: Sequence[Verdict], value: ObjectiveValue | None
) -> Verdict | None:
    """Return the verdict that counts: where several oracles are minimised, one that fails."""
    asked = [scale.oracle for scale in task.scales]
    named = {verdict.oracle: verdict for verdict in verdicts if verdict.oracle in asked}
    nearest = named.get(value.oracle) if value is not None else None
    if nearest is not None and nearest.outcome is Outcome.FAIL:
        return nearest
    for outcome in (Outcome.FAIL, Outcome.ERROR):
        for name in asked:
            if name in named and named[name].outcome is outcome:
                return named[name]
    return nearest or next((named[name] for name in asked if name in named), None)


def median_result(results: Sequence[PointResult]) -> PointResult:
    """Return the result with the median margin among repeats of one point.

    Those without a margin count only when there are no others; of an even number it is the smaller
    one of the two in the middle.
    """
    known = [result for result in results if result.value is not None]
    if not known:
        return results[0]
    ordered = sorted(known, key=_value)
    return ordered[(len(ordered) - 1) // 2]


def _value(result: PointResult) -> float:
    return result.value.value if result.value is not None else float("inf")


def smallest_margin(results: Sequence[PointResult]) -> PointResult | None:
    """Return the result with the smallest margin, the first of equal ones."""
    known = [result for result in results if result.value is not None]
    return min(known, key=_value) if known else None


def first_failure(results: Sequence[PointResult]) -> PointResult | None:
    """Return the failure of the lowest number."""
    failures = [result for result in results if result.fails]
    return min(failures, key=lambda result: result.number) if failures else None


def confirmation(repeats: Sequence[PointResult]) -> Confirmation | None:
    """Return how many repeats fail, of those with a verdict; ``None`` when none has one."""
    judged = [r for r in repeats if r.outcome in (Outcome.PASS, Outcome.FAIL)]
    if not judged:
        return None
    failed = sum(result.fails for result in judged)
    low, high = proportion_interval(failed, len(judged))
    return Confirmation(failed, len(judged), low, high)
