"""What a search has found, so far or in the end, as one value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from daemon.judging.statistics import at_most
from daemon.model.search import SearchTask
from daemon.model.search_answer import (
    Confirmation,
    NearestFailure,
    PointResult,
    SearchAnswer,
    ShrunkScenario,
)
from daemon.model.verdicts import Outcome
from daemon.search.answers.findings import (
    distinct_failures,
    drawn_points,
    parameter_influence,
    unsought_failures,
)
from daemon.search.answers.sentences import answer_sentences
from daemon.search.execution.results import ExploredPoint, first_failure, smallest_margin


@dataclass(frozen=True, slots=True)
class LaterResults:
    """What is found out about failures after the exploration."""

    confirmed: Confirmation | None = None
    nearest: NearestFailure | None = None
    shrunk: ShrunkScenario | None = None


def make_answer(
    task: SearchTask,
    explored: Sequence[ExploredPoint],
    *,
    ended: str = "",
    executed: int = 0,
    reused: int = 0,
    later: LaterResults | None = None,
    holding: Sequence[bool] = (),
) -> SearchAnswer:
    """Return the answer of a search that has learnt these points, sentences included.

    ``holding`` says of each explored failure that was repeated whether most noises confirm it.
    The text of the found scenario is not in it: it is written in the end.
    """
    later = later or LaterResults()
    results = [one.result for one in explored if one.result is not None]
    drawn = [one.result for one in drawn_points(explored) if one.result is not None]
    judged = [r for r in drawn if r.outcome in (Outcome.PASS, Outcome.FAIL)]
    failed = sum(result.fails for result in judged)
    answer = SearchAnswer(
        ended=ended,
        explored=len(explored),
        executed=executed,
        reused=reused,
        failed=sum(result.fails for result in results),
        errors=sum(result.outcome is Outcome.ERROR for result in results),
        inconclusive=sum(result.outcome is Outcome.INCONCLUSIVE for result in results),
        space_filling=len(judged),
        space_filling_failed=failed,
        failing_share=failing_share(failed, len(judged)),
        written=next((one.result for one in explored if one.method == "written"), None),
        first=first_failure(results),
        best=smallest_margin(results),
        confirmed=later.confirmed,
        nearest=later.nearest,
        shrunk=later.shrunk,
        findings=distinct_failures(results),
        influence=parameter_influence(task, explored),
        refused=len(explored) - len(results),
        repeated=len(holding),
        holding=sum(holding),
        unsought=unsought_failures(explored),
    )
    return replace(answer, sentences=answer_sentences(task, answer))


def failing_share(failed: int, runs: int) -> float | None:
    """Return the share of the space that fails at most, with 95 % certainty, one-sided.

    Without a failure it is 1 - 0.05^(1/n). ``None`` without runs.
    """
    return at_most(failed, runs) if runs else None


def told_failure(answer: SearchAnswer) -> PointResult | None:
    """Return the failure that is handed on.

    That is the nearest one, else the first if most of its repeats confirm it, else the worst.
    """
    if answer.nearest is not None:
        return answer.nearest.result
    if answer.confirmed is not None and answer.confirmed.holds:
        return answer.first
    if answer.best is not None and answer.best.fails:
        return answer.best
    return answer.first
