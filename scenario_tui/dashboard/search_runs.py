"""A search as the dashboard shows it: its runs in brief, and those of them that people look at."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from scenario_tui.text.search_text import row_fails

if TYPE_CHECKING:
    from daemon.model.proposals import ObjectiveValue, Phase, ProposalRow
    from daemon.model.search import Point, SearchTask
    from daemon.model.search_answer import PointResult, SearchRow
    from daemon.model.verdicts import Verdict


@dataclass(frozen=True, slots=True)
class SearchedRun:
    """A run of a search without its verdicts: what a curve and a table need of thousands.

    ``value`` is ``None`` for a run that is not over, and for one that says nothing; ``fails`` is
    whether an oracle that the search is about fails.
    """

    position: int
    number: int
    repeat: int
    phase: Phase
    guided: bool
    values: Point
    state: RunState
    outcome: Outcome | None
    value: ObjectiveValue | None
    fails: bool
    run: str
    label: str

    @property
    def settled(self) -> bool:
        """Whether nothing more comes of it."""
        return self.state in (RunState.DONE, RunState.LOST, RunState.CANCELLED)

    @property
    def explores(self) -> bool:
        """Whether it is a proposal itself: no repeat of one, nothing done with a failure."""
        return self.phase == "explore" and self.repeat == 0


@dataclass(frozen=True, slots=True)
class SearchRuns:
    """A search and its runs in order, as far as they are known."""

    row: SearchRow
    runs: tuple[SearchedRun, ...] = ()

    @property
    def campaign(self) -> str:
        """The id of the search in the ledger."""
        return self.row.campaign


@dataclass(frozen=True, slots=True)
class NotableRun:
    """A run of a search that people look at, and why; ``count`` failures are like it.

    ``key`` tells it from the others, also when it is another run later; ``about`` says what fails.
    """

    key: str
    what: str
    values: Point
    value: ObjectiveValue | None
    fails: bool
    number: int
    run: str
    label: str
    about: str = ""
    count: int = 0


def searched_run(task: SearchTask, row: ProposalRow) -> SearchedRun:
    """Return a run of a search in brief."""
    from daemon.model.proposals import objective

    run, proposal = row.run, row.proposal
    return SearchedRun(
        proposal.position,
        proposal.number,
        proposal.repeat,
        proposal.phase,
        proposal.guided,
        proposal.values,
        run.state,
        run.outcome,
        objective(task, run.leads),
        row_fails(task, row),
        run.id,
        run.label,
    )


def of_search(task: SearchTask, verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return the verdicts of the oracles that a search is about."""
    names = {scale.oracle for scale in task.scales}
    return [verdict for verdict in verdicts if verdict.oracle in names]


def decisive_moment(task: SearchTask, verdicts: Sequence[Verdict]) -> float | None:
    """Return when a run came nearest to failing [s], of the oracles that a search is about."""
    timed = [found for found in of_search(task, verdicts) if found.evidence.time is not None]
    # Failures before what passed, then the smallest margin; a margin nobody knows comes last.
    timed.sort(key=lambda v: (v.outcome is not Outcome.FAIL, v.margin is None, v.margin or 0.0))
    return timed[0].evidence.time if timed else None


def best_run(runs: Sequence[SearchedRun]) -> SearchedRun | None:
    """Return the proposal with the smallest margin, the first of several."""
    valued = [run for run in runs if run.explores and run.value is not None]
    return min(valued, key=lambda run: run.value.value if run.value else 0.0, default=None)


def best_margin(row: SearchRow) -> ObjectiveValue | None:
    """Return the smallest margin of a search as far as it was told."""
    best = row.answer.best if row.answer is not None else None
    return best.value if best is not None else None


def notable_runs(search: SearchRuns) -> tuple[NotableRun, ...]:
    """Return the runs to look at: best, first and nearest failure, findings, and as written.

    What the answer says is known from its phase on; the best and the first failure at once.
    """
    return tuple(_notable(search))


def _notable(search: SearchRuns) -> Iterator[NotableRun]:
    task, answer = search.row.task, search.row.answer
    best = best_run(search.runs)
    if best is not None:
        what = "best so far" if search.row.state == "running" else "best"
        yield _notable_run(task, "best", what, best)
    first = next((run for run in search.runs if run.explores and run.fails), None)
    if first is not None:
        yield _notable_run(task, "first", "first failure", first)
    if answer is not None:
        if answer.nearest is not None:
            yield _notable_run(task, "nearest", "nearest failure", answer.nearest.result)
        for index, found in enumerate(answer.findings):
            about = _about(task, found.oracle, found.object, found.waypoint)
            one = _notable_run(task, f"finding-{index}", "finding", found.example)
            yield replace(one, about=about, count=found.count)
    written = next((run for run in search.runs if run.number == 0 and run.repeat == 0), None)
    if written is not None and written.settled:
        yield _notable_run(task, "written", "as written", written)


def _notable_run(
    task: SearchTask, key: str, what: str, run: SearchedRun | PointResult
) -> NotableRun:
    value = run.value
    about = "" if value is None else _about(task, value.oracle, value.object)
    return NotableRun(
        key, what, run.values, value, run.fails, run.number, run.run, run.label, about
    )


def _about(task: SearchTask, oracle: str, *places: str) -> str:
    # Of a search about one oracle that one is told above.
    names = [*([oracle] if len(task.scales) > 1 else []), *places]
    return " › ".join(filter(None, names)) or oracle
