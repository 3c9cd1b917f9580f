"""The runs of points: numbers and positions, repeats if runs differ, each point only once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from daemon.analysis.blame import Candidate
from daemon.model.search import Phase, Point, Proposal
from daemon.model.status import RunRow
from daemon.model.trials import Trial, median_trial, read_trial
from daemon.search.client import DaemonRuns
from daemon.search.composition import SearchCase
from grammars.text.diagnostics import InputError

MEDIAN_OF: Final = 3
"""Runs of a point if the system under test is not repeatable: its margin is their median."""
_FEWEST_OTHERS: Final = 2
_MOST_OTHERS: Final = 5
"""Repeats with other noise of which at least half must fail for a failure to hold."""


@dataclass(slots=True)
class PointRunner:
    """Issues the runs of points and remembers their trials.

    ``position`` and ``number`` are the next ones. ``reused`` counts runs with an earlier result,
    ``executed`` the others.
    """

    case: SearchCase
    runs: DaemonRuns
    allowed: Callable[[Point], bool] = lambda _: True
    position: int = 0
    number: int = 0
    executed: int = 0
    reused: int = 0
    _trials: dict[Point, Trial] = field(default_factory=dict)
    _repeats: defaultdict[int, list[Trial]] = field(default_factory=lambda: defaultdict(list))

    @property
    def repeats(self) -> int:
        """The number of runs for each point."""
        return 1 if self.case.task.repeatable else MEDIAN_OF

    def begin(
        self, point: Point, phase: Phase, method: str, *, guided: bool = True, note: str = ""
    ) -> Proposal:
        """Issue the runs of a point under the next number, unless it cannot be composed."""
        number = self.number
        self.number += 1
        proposal = Proposal(self.position, number, 0, phase, method, guided, point, note)
        try:
            candidates = [self.case.candidate(point, number, r) for r in range(self.repeats)]
        except InputError:
            self._trials[point] = Trial(proposal)
            return proposal
        for repeat, candidate in enumerate(candidates):
            self.issue(replace(proposal, repeat=repeat), candidate)
        return proposal

    def finish(self, proposal: Proposal) -> Trial:
        """Wait for the runs of a point and return their trial."""
        if proposal.values not in self._trials:
            positions = range(proposal.position, proposal.position + self.repeats)
            self._trials[proposal.values] = median_trial(list(map(self._trial, positions)))
        return self._trials[proposal.values]

    def _trial(self, position: int) -> Trial:
        return read_trial(self.case.task, self.wait(position))

    def is_known(self, point: Point) -> bool:
        """Return whether a point can be judged without a run."""
        return point in self._trials or not self.allowed(point)

    def results(self, points: Iterable[tuple[Point, str]], phase: Phase) -> list[Trial | None]:
        """Return the trials of points, which run at the same time; each comes with a note.

        The trial of a point that breaks a constraint of the search is ``None``.
        """
        pairs = list(points)
        new = {point: note for point, note in pairs if not self.is_known(point)}
        for proposal in [self.begin(point, phase, phase, note=note) for point, note in new.items()]:
            self.finish(proposal)
        return [self._trials.get(point) for point, _ in pairs]

    @property
    def others(self) -> int:
        """The number of repeats with other noise that decide whether a failure holds.

        These are the first of its confirmation. Run 0 does not count, since it was chosen for its
        failure.
        """
        return min(max(self.case.task.confirm, _FEWEST_OTHERS), _MOST_OTHERS)

    def holds(self, result: Trial) -> bool | None:
        """Return whether a failure occurs with most noises; ``None`` if that needs more runs.

        If runs differ, a point is judged by the median of several from the beginning.
        """
        if not result.fails or self.repeats > 1:
            return result.fails
        others = self._repeats[result.number][: self.others]
        failed = sum(one.fails for one in others)
        if 2 * failed >= self.others:
            return True
        return False if 2 * (len(others) - failed) > self.others else None

    def judge(self, results: Sequence[Trial | None]) -> list[Trial | None]:
        """Return results, with the median of the passing repeats for failures that do not hold.

        Half of the repeats decide if they agree; otherwise the rest runs as well.
        """
        failures = [one for one in results if one is not None and one.fails]
        for times in ((self.others + 1) // 2, self.others):
            self._run_repeats([one for one in failures if self.holds(one) is None], times)
        return [self._usual(one) for one in results]

    def _usual(self, result: Trial | None) -> Trial | None:
        if result is None or self.holds(result) == result.fails:
            return result
        return median_trial([one for one in self._repeats[result.number] if not one.fails])

    def repeat(self, result: Trial, times: int) -> list[Trial]:
        """Return repeats of a point, with other noise than the first run."""
        self._run_repeats([result], times)
        return self._repeats[result.number][:times]

    def _run_repeats(self, trials: Sequence[Trial], times: int) -> None:
        """Run points again until each has ``times`` repeats, a window at a time."""
        window = self.case.task.window
        new = [(one, r) for one in trials for r in range(len(self._repeats[one.number]), times)]
        for start in range(0, len(new), window):
            batch = [(one, self._begin_repeat(one, r)) for one, r in new[start : start + window]]
            for trial, position in batch:
                self._repeats[trial.number].append(self._trial(position))

    def _begin_repeat(self, trial: Trial, index: int) -> int:
        number, point, repeat = trial.number, trial.point, self.repeats + index
        proposal = Proposal(self.position, number, repeat, "confirm", "repeat", True, point)
        return self.issue(proposal, self.case.candidate(point, number, repeat))

    def issue(self, proposal: Proposal, candidate: Candidate) -> int:
        """Issue one run at the next position, and return the position."""
        position = self.position
        self.runs.issue(replace(proposal, position=position), candidate)
        self.position += 1
        return position

    def wait(self, position: int) -> RunRow:
        """Wait for a run, count it and return it."""
        row = self.runs.result(position)
        self.executed += not row.cached
        self.reused += bool(row.cached)
        return row
