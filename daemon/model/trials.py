"""The trials of a search: points that were run, and the values of their runs.

A search learns the *leading margin* of a run: a signed margin that goes down towards a failure even
where the verdict's own margin is flat.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from daemon.model.search import Phase, Point, Proposal, SearchTask
from daemon.model.spec import LeadingMargin
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome, RunState, Verdict


@dataclass(frozen=True, slots=True)
class ObjectiveValue:
    """Value of a run for a search: ``value`` is compared, ``margin`` in ``unit`` is reported.

    Both are equal if one oracle is minimised. ``oracle`` is the one nearest to failing, ``object``
    the object involved, ``waypoint`` the robot's next one.
    """

    value: float
    margin: float
    unit: str
    oracle: str
    object: str = ""
    waypoint: str = ""


@dataclass(frozen=True, slots=True)
class Trial:
    """A point that a search tries: the proposal, and the verdict of its run.

    ``run``, ``label`` and ``digest`` are those of the run, empty if the point has no possible run.
    ``outcome`` is that of the oracle in question: an error if the run cannot be trusted, ``None``
    without a result. ``unsought`` are failing oracles outside of the search.
    """

    proposal: Proposal
    run: str = ""
    label: str = ""
    digest: str = ""
    outcome: Outcome | None = None
    value: ObjectiveValue | None = None
    verdict: Verdict | None = None
    unsought: tuple[str, ...] = ()

    @property
    def number(self) -> int:
        """The number of its point."""
        return self.proposal.number

    @property
    def point(self) -> Point:
        """A value of each parameter."""
        return self.proposal.values

    @property
    def compared(self) -> float:
        """The value that the search compares; not a number without a margin."""
        return math.nan if self.value is None else self.value.value

    @property
    def fails(self) -> bool:
        """True if the oracle in question fails."""
        return self.outcome is Outcome.FAIL

    @property
    def explores(self) -> bool:
        """True if it looks for failures: neither a repeat nor work on a known failure."""
        return self.proposal.phase == "explore" and self.proposal.repeat == 0

    @property
    def is_written(self) -> bool:
        """True for the scenario as written, which begins a search."""
        return self.proposal.method == "written"

    @property
    def is_drawn(self) -> bool:
        """True if its point was drawn without looking at results: only these show frequencies."""
        return not self.proposal.guided and not self.is_written

    @property
    def about(self) -> str:
        """The object of the reported margin, otherwise that of the verdict.

        They may differ: a mission fails at the waypoint that was never near; its margin is the
        distance left to the first waypoint that was not reached.
        """
        value, verdict = self.value, self.verdict
        if value is not None and value.object and (not verdict or value.oracle == verdict.oracle):
            return value.object
        return verdict.evidence.object if verdict is not None else ""


def read_trial(task: SearchTask, run: RunRow) -> Trial:
    """Return the trial of a run.

    A lost run, or one in which the system under test crashed, is an error, not the failure that
    the search looks for.
    """
    assert run.proposal is not None  # runs of searches have one
    trial = Trial(run.proposal, run.id, run.label, run.digest)
    if not run.settled:
        return trial
    trusted = run.state is RunState.DONE and run.ended != "crashed"
    value = objective(task, run.leads) if trusted else None
    verdict = _decisive_verdict(task, run.verdicts, value) if trusted else None
    sought = {scale.oracle for scale in task.scales}
    failing = [one.oracle for one in run.verdicts if one.outcome is Outcome.FAIL]
    unsought = tuple(oracle for oracle in failing if oracle not in sought)
    if verdict is None or verdict.outcome is Outcome.ERROR:
        return replace(trial, outcome=Outcome.ERROR, verdict=verdict, unsought=unsought)
    return replace(trial, outcome=verdict.outcome, value=value, verdict=verdict, unsought=unsought)


def objective(task: SearchTask, leads: Sequence[LeadingMargin]) -> ObjectiveValue | None:
    """Return the value of a run with these leading margins, if any."""
    best: ObjectiveValue | None = None
    for lead in leads:
        scale = next((s for s in task.scales if s.oracle == lead.oracle), None)
        if scale is None or lead.margin is None:
            continue
        value = lead.margin if len(task.scales) == 1 else lead.margin / scale.scale
        if best is None or value < best.value:
            best = ObjectiveValue(
                value, lead.margin, lead.unit, lead.oracle, lead.object, lead.waypoint
            )
    return best


def _decisive_verdict(
    task: SearchTask, verdicts: Sequence[Verdict], value: ObjectiveValue | None
) -> Verdict | None:
    """Return the verdict that counts: of several minimised oracles one that fails."""
    oracles = [scale.oracle for scale in task.scales]
    named = {verdict.oracle: verdict for verdict in verdicts if verdict.oracle in oracles}
    nearest = named.get(value.oracle) if value is not None else None
    if nearest is not None and nearest.outcome is Outcome.FAIL:
        return nearest
    for outcome in (Outcome.FAIL, Outcome.ERROR):
        for name in oracles:
            if name in named and named[name].outcome is outcome:
                return named[name]
    return nearest or next((named[name] for name in oracles if name in named), None)


def point_trials(task: SearchTask, runs: Iterable[RunRow], phase: Phase = "explore") -> list[Trial]:
    """Return the settled points of a phase in order, with the median of repeats."""
    groups: dict[int, list[Trial]] = {}
    for trial in (read_trial(task, run) for run in runs if run.settled):
        if trial.proposal.phase == phase:
            groups.setdefault(trial.number, []).append(trial)
    return [median_trial(groups[number]) for number in sorted(groups)]


def median_trial(trials: Sequence[Trial]) -> Trial:
    """Return the trial with the median margin among repeats of one point.

    Trials without a margin count only if there are no others. Of an even number it is the smaller
    of the two in the middle.
    """
    ordered = sorted((one for one in trials if one.value is not None), key=_compared)
    return ordered[(len(ordered) - 1) // 2] if ordered else trials[0]


def _compared(trial: Trial) -> float:
    return trial.compared


def smallest_margin(trials: Iterable[Trial]) -> Trial | None:
    """Return the trial with the smallest margin, the first of equal ones."""
    return min((one for one in trials if one.value is not None), key=_compared, default=None)


def smallest_so_far(values: Iterable[float]) -> list[float]:
    """Return the running minimum of values; not a number before the first valid one."""
    smallest, least = math.nan, list[float]()
    for value in values:
        if not value >= smallest and not math.isnan(value):
            smallest = value
        least.append(smallest)
    return least


def first_failure(trials: Iterable[Trial]) -> Trial | None:
    """Return the failure of the lowest number."""
    return min((one for one in trials if one.fails), key=lambda one: one.number, default=None)
