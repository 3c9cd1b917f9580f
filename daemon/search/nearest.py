"""The nearest failure: the smallest change from the scenario as written with which it still fails.

From failures that were found, parameters are taken back to their written values, those of least
influence first and in halves, as long as they still fail. Where the fewest changes are left, these
are halved towards the written values until neighbouring steps, one of which passes. To fail is to
fail with most noises: the smallest change that fails with one of them is luck. Only where no
failure does, one noise decides, and that is told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from daemon.model.search import Point, PointValue, SearchTask
from daemon.model.search_answer import NearestFailure, ParameterChange
from daemon.model.trials import Trial, first_failure, smallest_margin
from daemon.model.verdicts import Outcome
from daemon.search.answers.facts import distinct_failures
from daemon.search.execution.point_runner import PointRunner
from daemon.search.points import (
    change_size,
    changed_parameters,
    distance_from_written,
    taken_back,
    value_between,
    with_value,
)

NEAREST_POINTS: Final = 60
"""Points that are tried at most to find the nearest failure; one that fails takes several runs."""
_TAKING_BACK: Final = 40
"""So many of them at most go into which parameters matter, before their values are halved: fewer
changes are worth more than smaller ones.
"""
_STARTS: Final = 5
_MOST_STARTS: Final = 20
"""So many failures are begun with; where none of them holds more, until one does."""


class _SpentError(Exception):
    """Another point had to be tried and none is left."""


def find_nearest(
    points: PointRunner, failures: Sequence[Trial], influence: Mapping[str, float]
) -> NearestFailure | None:
    """Return the nearest failure, which holds if one does; ``None`` when nothing has failed.

    ``influence`` is of each parameter, its sign does not matter.
    """
    task, before = points.case.task, points.position
    order = sorted(
        range(len(task.parameters)),
        key=lambda i: (abs(influence.get(task.parameters[i].name, 0.0)), i),
    )
    for one_noise in (False, True):
        budget = _PointBudget(points, one_noise)
        descents = _descents(budget, _starts(task, failures), tuple(order))
        if descents:
            nearest, complete = _halve_fewest(budget, descents)
            return _answer(nearest, points.position - before, complete=complete)
    return None


def _descents(
    budget: _PointBudget, starts: Sequence[Trial], order: tuple[int, ...]
) -> list[_Descent]:
    """Return the starts that fail, brought as near as their parameters can be taken back."""
    descents: list[_Descent] = []
    for count, start in enumerate(starts):
        if count >= _STARTS and descents:
            break
        # Whether it holds takes repeats, but it is no other point.
        (failing,) = budget.judged([start])
        if failing is None or not failing.fails:
            continue
        descents.append(_Descent(order, budget, failing))
        if not descents[-1].take_back() or not descents[-1].changed():
            break
    return descents


def _halve_fewest(budget: _PointBudget, descents: Sequence[_Descent]) -> tuple[_Descent, bool]:
    """Return the smallest of the fewest changes, and whether nothing else could be done."""
    budget.left = NEAREST_POINTS - budget.spent
    fewest = min(len(descent.changed()) for descent in descents)
    finalists = [descent for descent in descents if len(descent.changed()) == fewest]
    ended = []
    for descent in sorted(finalists, key=_Descent.size):
        ended.append((descent, descent.halve()))
        if not ended[-1][1]:
            break
    nearest, complete = min(ended, key=lambda one: one[0].size())
    nearest.compare()
    return nearest, complete


def _starts(task: SearchTask, failures: Sequence[Trial]) -> list[Trial]:
    """Return failures to begin with, in this order.

    That with the smallest change, the worst, the first, the worst of each other kind, the worst of
    the rest.
    """
    if not failures:
        return []
    least = min(failures, key=lambda f: (distance_from_written(task, f.point), f.number))
    kinds = [one.example for one in distinct_failures(failures)]
    worst = sorted(failures, key=lambda f: (f.value.value if f.value else math.inf, f.number))
    picked = [least, smallest_margin(failures), first_failure(failures), *kinds, *worst]
    starts = {one.point: one for one in picked if one is not None}
    return list(starts.values())[:_MOST_STARTS]


@dataclass(slots=True)
class _PointBudget:
    """Tries points as long as some are left, for all descents together.

    To fail is to do so with most noises, or with ``one_noise``.
    """

    points: PointRunner
    one_noise: bool
    spent: int = 0
    left: int = _TAKING_BACK

    @property
    def task(self) -> SearchTask:
        """The search."""
        return self.points.case.task

    def is_known(self, point: Point) -> bool:
        """Return whether nothing is run to find out about a point."""
        trial = self.points.known(point)
        if trial is None or self.one_noise:
            return self.points.is_known(point)
        return self.points.holds(trial) is not None

    def try_points(self, tried: Sequence[tuple[Point, str]]) -> list[Trial | None]:
        """Return what points say; raises :class:`_SpentError`."""
        new = {point for point, _ in tried if not self.is_known(point)}
        # A whole batch or none: half of one would make the answer depend on what is left.
        if len(new) > self.left:
            raise _SpentError
        self.spent += len(new)
        self.left -= len(new)
        return self.judged(self.points.results(tried, "nearest"))

    def judged(self, trials: Sequence[Trial | None]) -> list[Trial | None]:
        """Return trials, in place of failures by chance what most noises say."""
        return list(trials) if self.one_noise else self.points.with_most_noises(trials)


@dataclass(slots=True)
class _Descent:
    """A failure on its way to the scenario as written; ``order`` has the least influence first.

    ``passing`` has the nearest value that passes of each parameter, ``passes`` the last point that
    did.
    """

    order: tuple[int, ...]
    budget: _PointBudget
    failing: Trial
    passing: dict[int, PointValue] = field(default_factory=dict)
    passes: Trial | None = None

    def size(self) -> tuple[int, float]:
        """Return how many parameters are not as written, and how far they are from it."""
        values = self.failing.point
        return len(self.changed()), distance_from_written(self.budget.task, values)

    def changed(self) -> tuple[int, ...]:
        """Return the parameters that are not as written, those of least influence first."""
        changed = changed_parameters(self.budget.task, self.failing.point)
        return tuple(index for index in self.order if index in changed)

    def take_back(self) -> bool:
        """Take parameters back to their written values; return whether no other one can be."""
        try:
            if self.changed():
                self._take_back()
        except _SpentError:
            return False
        return True

    def halve(self) -> bool:
        """Bring values nearer to the written ones; return whether nothing else could be done."""
        try:
            # Again where the points ended in the middle of it; what was tried costs nothing.
            if self.changed():
                self._take_back()
            for index in self.changed():
                self._halve(index)
        except _SpentError:
            return False
        return True

    def compare(self) -> None:
        """Take as passing the known point that differs in one parameter alone, if there is one."""
        for index in self.changed():
            written = self.budget.task.parameters[index].written
            for value in (self.passing.get(index), written):
                if value is None:
                    continue
                point = with_value(self.failing.point, index, value)
                known = self.budget.is_known(point)
                result = self.budget.try_points([(point, "")])[0] if known else None
                if result is not None and result.outcome is Outcome.PASS:
                    self._remember_passing(result, (index,))
                    break

    def _take_back(self) -> None:
        changed = self.changed()
        if self._first_failing([changed]) is not None:
            return
        self._take_back_some(changed)
        # One by one at the end: what was needed beside another one may not be any more. Pairs run
        # at the same time.
        while len(changed := self.changed()) > 1:
            pairs = [changed[i : i + 2] for i in range(0, len(changed), 2)]
            if all(self._first_failing([(one,) for one in pair]) is None for pair in pairs):
                return

    def _take_back_some(self, group: tuple[int, ...]) -> None:
        """Take back what can go of a group that cannot go as a whole."""
        if len(group) < 2:
            return
        halves = group[: len(group) // 2], group[len(group) // 2 :]
        gone = self._first_failing(halves)
        for number, half in enumerate(halves):
            if number != gone:
                self._take_back_some(half)

    def _first_failing(self, groups: Sequence[tuple[int, ...]]) -> int | None:
        """Take back the first of these groups without which it still fails; return which."""
        values = self.failing.point
        found = self.budget.try_points(
            [(taken_back(self.budget.task, values, group), self._note(group)) for group in groups]
        )
        for number, (group, result) in enumerate(zip(groups, found, strict=True)):
            if result is not None and result.fails:
                self.failing = result
                return number
            self._remember_passing(result, group)
        return None

    def _note(self, group: Sequence[int]) -> str:
        if len(group) != 1:
            return f"{len(group)} parameters as written"
        task = self.budget.task
        return f"{task.short_name(task.parameters[group[0]].name)} as written"

    def _remember_passing(self, result: Trial | None, group: Sequence[int]) -> None:
        if result is None or result.outcome is not Outcome.PASS:
            return
        self.passes = result
        if len(group) == 1:
            self.passing[group[0]] = result.point[group[0]]

    def _halve(self, index: int) -> None:
        """Bring one parameter to the step at which it begins to fail."""
        parameter = self.budget.task.parameters[index]
        passing = parameter.written
        while passing is not None:
            value = value_between(parameter, self.failing.point[index], passing)
            if value is None:
                return
            point = with_value(self.failing.point, index, value)
            note = f"{self.budget.task.short_name(parameter.name)} at {parameter.shown(value)}"
            (result,) = self.budget.try_points([(point, note)])
            if result is not None and result.fails:
                self.failing = result
            else:
                passing = value
                self._remember_passing(result, (index,))


def _answer(descent: _Descent, runs: int, *, complete: bool) -> NearestFailure:
    task, failing = descent.budget.task, descent.failing
    # The largest change first.
    ordered = sorted(
        changed_parameters(task, failing.point),
        key=lambda i: (-change_size(task.parameters[i], failing.point[i]), i),
    )
    changes = tuple(
        ParameterChange(
            parameter=task.parameters[i].name,
            unit=task.parameters[i].unit,
            written=task.parameters[i].written,
            value=failing.point[i],
            passing=descent.passing.get(i),
        )
        for i in ordered
    )
    return NearestFailure(
        result=failing,
        changes=changes,
        passes=descent.passes,
        runs=runs,
        complete=complete,
        holds=not descent.budget.one_noise,
    )
