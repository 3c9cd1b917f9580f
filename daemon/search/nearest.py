"""The nearest failure: the smallest change of the scenario as written that still fails.

Parameters of failures go back to their written values as long as the failure holds. In the failure
with the fewest changes, each change is halved towards the written value, down to neighbouring steps
of which one passes. A failure with a single noise is luck: only failures that hold count.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from daemon.analysis.blame import ddmin
from daemon.model.search import Point, SearchTask
from daemon.model.search_answer import NearestFailure
from daemon.model.trials import Trial
from daemon.model.verdicts import Outcome
from daemon.search.answers.facts import distinct_failures
from daemon.search.answers.sentences import changes_text
from daemon.search.point_runner import PointRunner
from daemon.search.points import (
    changed_parameters,
    distance_from_written,
    taken_back,
    value_between,
    with_value,
)

NEAREST_POINTS: Final = 60
"""Most points to find the nearest failure; a failing point takes several runs."""
_TAKING_BACK: Final = 40
"""Most of these points for taking parameters back, before values are halved: fewer changes are
worth more than smaller ones.
"""
_STARTS: Final = 5
_MOST_STARTS: Final = 20
"""Failures to begin with, and their largest number while none holds."""
_AT_A_TIME: Final = 2
"""Points tried at the same time, for any number of cores."""


class _SpentError(Exception):
    """The budget has no points for another trial."""


def find_nearest(
    points: PointRunner, failures: Sequence[Trial], influence: Mapping[str, float]
) -> NearestFailure | None:
    """Return the nearest failure that holds; ``None`` if no failure holds.

    ``influence`` is given for each parameter; its sign does not matter.
    """
    task, before = points.case.task, points.position
    order = sorted(
        range(len(task.parameters)),
        key=lambda i: (-abs(influence.get(task.parameters[i].name, 0.0)), -i),
    )
    approach = _Approach(points, tuple(order))
    near: list[Trial] = []
    for count, start in enumerate(_starts(task, failures)):
        if near and (count >= _STARTS or approach.is_spent or not approach.changed(near[-1])):
            break
        # This needs repeats, but no other point.
        (failing,) = points.judge([start])
        if failing is not None and failing.fails:
            near.append(approach.take_back(failing))
    if not near:
        return None
    approach.is_spent = False
    approach.budget += NEAREST_POINTS - _TAKING_BACK
    near.sort(key=lambda failing: _change(task, failing.point))
    fewest = len(approach.changed(near[0]))
    finalists = [failing for failing in near if len(approach.changed(failing)) == fewest]
    ends = map(approach.halve, finalists)
    result, passes = min(ends, key=lambda end: _change(task, end[0].point))
    return NearestFailure(
        result=result,
        passes=passes,
        runs=points.position - before,
        complete=not approach.is_spent,
    )


def _change(task: SearchTask, point: Point) -> tuple[int, float]:
    """Return the number of changed parameters, and the sum of their changes."""
    return len(changed_parameters(task, point)), distance_from_written(task, point)


def _starts(task: SearchTask, failures: Sequence[Trial]) -> list[Trial]:
    """Return the failure with the smallest change, the worst of each kind, and the next worst."""
    by_change = sorted(failures, key=lambda f: (distance_from_written(task, f.point), f.number))
    kinds = [one.example for one in distinct_failures(failures)]
    worst = sorted(failures, key=lambda f: (f.value.value if f.value else math.inf, f.number))
    starts = {one.point: one for one in (*by_change[:1], *kinds, *worst)}
    return list(starts.values())[:_MOST_STARTS]


@dataclass(slots=True)
class _Approach:
    """Brings failures near; ``order`` lists the parameters with most influence first.

    ``is_spent`` is set once the ``budget`` has prevented a trial.
    """

    points: PointRunner
    order: tuple[int, ...]
    budget: int = _TAKING_BACK
    is_spent: bool = False
    _tried: dict[Point, Trial | None] = field(default_factory=dict)

    def changed(self, failing: Trial) -> tuple[int, ...]:
        """Return the changed parameters, those with most influence first."""
        changed = changed_parameters(self.points.case.task, failing.point)
        return tuple(index for index in self.order if index in changed)

    def take_back(self, failing: Trial) -> Trial:
        """Return a failure with as many parameters as possible back at their written values."""
        task, start, changed = self.points.case.task, failing.point, self.changed(failing)

        def point_of(changes: tuple[int, ...]) -> Point:
            return taken_back(task, start, [index for index in changed if index not in changes])

        def first_failing(groups: Sequence[tuple[int, ...]]) -> int | None:
            for first in range(0, len(groups), _AT_A_TIME):
                batch = [point_of(changes) for changes in groups[first : first + _AT_A_TIME]]
                for number, trial in enumerate(self._try(batch), first):
                    if trial is not None and trial.fails:
                        return number
            return None

        with suppress(_SpentError):
            for changes in ddmin(changed, first_failing):
                failing = self._tried[point_of(changes)] or failing
        return failing

    def halve(self, failing: Trial) -> tuple[Trial, Trial | None]:
        """Bring values nearer to the written ones, those with least influence first.

        Return the failure, and the last passing point beside it, if any.
        """
        # The budget may have ended this step early; known points cost nothing now.
        failing, passes = self.take_back(failing), None
        with suppress(_SpentError):
            for index in reversed(self.changed(failing)):
                failing, beside = self._halve(failing, index)
                passes = beside or passes
        return failing, passes

    def _halve(self, failing: Trial, index: int) -> tuple[Trial, Trial | None]:
        """Bring one parameter to the step at which the failure begins."""
        parameter = self.points.case.task.parameters[index]
        origin = parameter.written
        assert origin is not None  # otherwise it is not changed
        passing = origin
        while (value := value_between(parameter, failing.point[index], passing)) is not None:
            (trial,) = self._try([with_value(failing.point, index, value)])
            if trial is not None and trial.fails:
                failing = trial
            else:
                passing = value
        places = [with_value(failing.point, index, v) for v in (passing, origin)]
        beside = [self._tried.get(place) for place in places]
        passes = (one for one in beside if one is not None and one.outcome is Outcome.PASS)
        return failing, next(passes, None)

    def _try(self, tried: Sequence[Point]) -> list[Trial | None]:
        """Return the trials of points, judged over noises; raises :class:`_SpentError`."""
        new = {point for point in tried if not self.points.is_known(point)}
        # Try a whole batch or none: with half of one the answer would depend on the budget.
        if len(new) > self.budget:
            self.is_spent = True
            raise _SpentError
        self.budget -= len(new)
        notes = [changes_text(self.points.case.task, point) for point in tried]
        results = self.points.results(zip(tried, notes, strict=True), "nearest")
        trials = self.points.judge(results)
        self._tried.update(zip(tried, trials, strict=True))
        return trials
