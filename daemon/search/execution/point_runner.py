"""Having points run: numbers and positions, repeats where runs differ, each point only once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

from daemon.analysis.blame import Candidate
from daemon.model.proposals import Phase, Proposal, ProposalRow
from daemon.model.search import Point
from daemon.model.search_answer import PointResult
from daemon.search.execution.results import median_result, point_result
from daemon.search.execution.runs import Case, Runs
from grammars.text.diagnostics import InputError

MEDIAN_OF: Final = 3
"""Runs of a point where the system under test is not repeatable: its margin is their median."""
_FEWEST_OTHERS: Final = 2
_MOST_OTHERS: Final = 5
"""A failure holds if at least half of so many repeats with other noise are failures too."""


@dataclass(frozen=True, slots=True)
class RunPurpose:
    """What a run is for, by which method its point was chosen, and what it tries."""

    phase: Phase
    method: str
    guided: bool = True
    note: str = ""


@dataclass(frozen=True, slots=True)
class BegunPoint:
    """A point whose runs have been issued, at these positions."""

    number: int
    point: Point
    positions: tuple[int, ...]


@dataclass(slots=True)
class PointRunner:
    """Issues the runs of points and remembers what came of them.

    ``position`` and ``number`` are the next ones; ``reused`` of the runs had a result before,
    ``executed`` had not.
    """

    case: Case
    runs: Runs
    allowed: Callable[[Point], bool] = lambda _: True
    position: int = 0
    number: int = 0
    executed: int = 0
    reused: int = 0
    _known: dict[Point, PointResult | None] = field(default_factory=dict)
    _repeats: dict[tuple[int, int], PointResult] = field(default_factory=dict)

    @property
    def repeats(self) -> int:
        """How many runs a point takes."""
        return 1 if self.case.task.repeatable else MEDIAN_OF

    def begin(self, point: Point, purpose: RunPurpose) -> BegunPoint | None:
        """Issue the runs of a point under the next number; ``None`` where it makes no run."""
        number = self.number
        self.number += 1
        try:
            candidates = [self.case.candidate(point, number, r) for r in range(self.repeats)]
        except InputError:
            self._known.setdefault(point, None)
            return None
        positions = tuple(
            self.issue(candidate, number, repeat, point, purpose)
            for repeat, candidate in enumerate(candidates)
        )
        return BegunPoint(number, point, positions)

    def finish(self, begun: BegunPoint) -> PointResult:
        """Wait for the runs of a point and return what they say."""
        task = self.case.task
        found = median_result([point_result(task, self.wait(p)) for p in begun.positions])
        self._known.setdefault(begun.point, found)
        return found

    def is_known(self, point: Point) -> bool:
        """Return whether nothing is run to find out about a point."""
        return point in self._known or not self.allowed(point)

    def known(self, point: Point) -> PointResult | None:
        """Return what a point is known to say; ``None`` where it makes no run, or had none."""
        return self._known.get(point)

    def results(self, tried: Iterable[tuple[Point, RunPurpose]]) -> list[PointResult | None]:
        """Return what points say, run at the same time; ``None`` for what makes no run.

        What breaks a constraint of the search makes none.
        """
        wanted = list(tried)
        new = {point: purpose for point, purpose in wanted if not self.is_known(point)}
        for begun in [self.begin(point, purpose) for point, purpose in new.items()]:
            if begun is not None:
                self.finish(begun)
        return [self._known.get(point) for point, _ in wanted]

    def failures(self) -> list[PointResult]:
        """Return every point that is known to fail, in the order in which they were run."""
        return [one for one in self._known.values() if one is not None and one.fails]

    def repeat(self, result: PointResult, times: int) -> list[PointResult]:
        """Return what so many repeats of a point say, with other noise than the first run.

        Those that were run before are not run again.
        """
        wanted = [(result, r) for r in range(self.repeats, self.repeats + times)]
        return self._repeated(wanted)

    @property
    def others(self) -> int:
        """How many repeats with other noise say whether a failure holds.

        Those are the first that confirm one, so that what holds is confirmed. That run 0 fails says
        nothing about it: it was chosen for that.
        """
        return min(max(self.case.task.confirm, _FEWEST_OTHERS), _MOST_OTHERS)

    def holds(self, result: PointResult) -> bool | None:
        """Return whether a failure is one with most noises; ``None`` where more runs must say.

        Where runs differ a point is judged by the median of several from the beginning.
        """
        if not result.fails or self.repeats > 1:
            return result.fails
        missing_failed, missing_other = self._missing(result)
        if missing_failed > 0 and missing_other > 0:
            return None
        return missing_failed <= 0

    def _missing(self, result: PointResult) -> tuple[int, int]:
        """Return how many repeats have to fail, or not to, until it is known what most do."""
        known = self._others_of(result)
        failed = sum(one.fails for one in known)
        needed = (self.others + 1) // 2
        return needed - failed, self.others - needed + 1 - (len(known) - failed)

    def _others_of(self, result: PointResult) -> list[PointResult]:
        keys = [(result.number, repeat) for repeat in range(1, self.others + 1)]
        return [self._repeats[key] for key in keys if key in self._repeats]

    def with_most_noises(self, results: Sequence[PointResult | None]) -> list[PointResult | None]:
        """Return results, in place of those that are failures by chance what the others say.

        Failures are run again, at the same time, until it is known whether they hold.
        """
        failures = [one for one in results if one is not None and one.fails]
        while open_ones := [one for one in failures if self.holds(one) is None]:
            wanted: list[tuple[PointResult, int]] = []
            for one in open_ones:
                begun = len(self._others_of(one)) + 1
                # No more than can be needed: the next ones may not be.
                wanted.extend((one, begun + more) for more in range(min(self._missing(one))))
            self._repeated(wanted)
        return [self._usual(one) for one in results]

    def _usual(self, result: PointResult | None) -> PointResult | None:
        if result is None or self.holds(result) == result.fails:
            return result
        return median_result([one for one in self._others_of(result) if not one.fails])

    def _repeated(self, wanted: Sequence[tuple[PointResult, int]]) -> list[PointResult]:
        """Run the repeats of points that were not run, a window at a time, and return them all."""
        task, purpose = self.case.task, RunPurpose("confirm", "repeat")
        new = [(r, repeat) for r, repeat in wanted if (r.number, repeat) not in self._repeats]
        for start in range(0, len(new), task.window):
            positions: dict[tuple[int, int], int] = {}
            for result, repeat in new[start : start + task.window]:
                number, point = result.number, result.values
                candidate = self.case.candidate(point, number, repeat)
                positions[number, repeat] = self.issue(candidate, number, repeat, point, purpose)
            for key, position in positions.items():
                self._repeats[key] = point_result(task, self.wait(position))
        return [self._repeats[result.number, repeat] for result, repeat in wanted]

    def issue(
        self, candidate: Candidate, number: int, repeat: int, point: Point, purpose: RunPurpose
    ) -> int:
        """Issue one run and return its position."""
        position = self.position
        proposal = Proposal(
            position=position,
            number=number,
            repeat=repeat,
            phase=purpose.phase,
            method=purpose.method,
            guided=purpose.guided,
            values=point,
            note=purpose.note,
        )
        self.runs.issue(proposal, candidate)
        self.position += 1
        return position

    def wait(self, position: int) -> ProposalRow:
        """Wait for a run and return it, counted."""
        row = self.runs.result(position)
        self.executed += not row.run.cached
        self.reused += bool(row.run.cached)
        return row
