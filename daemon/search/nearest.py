"""The nearest failure: the smallest change from the scenario as written with which it still fails.

From failures that were found, parameters are taken back to their written values, those of least
influence first and in halves, as long as they still fail. Where the fewest changes are left, these
are halved towards the written values until neighbouring steps, one of which passes. To fail is to
fail with most noises: the smallest change that fails with one of them is luck. Only where no
failure does, one noise decides, and that is told.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Protocol

from daemon.model.search import Point, PointValue, SearchTask
from daemon.model.search_answer import Confirmation, NearestFailure, ParameterChange, PointResult
from daemon.model.verdicts import Outcome
from daemon.search.answers.findings import distinct_failures
from daemon.search.answers.wording import nearest_sentence, noise_words, short_name
from daemon.search.execution.results import first_failure, smallest_margin
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
_MORE_TRIED: Final = 2
_WELL_BEYOND: Final = 1.25
"""Where noise does not confirm a failure, so many others are tried, each so many times as far."""


class PointProber(Protocol):
    """Runs points to find out whether they fail: with most noises, or with ``one_noise``.

    ``runs`` counts what was run.
    """

    @property
    def runs(self) -> int:
        """How many runs were made."""

    def is_known(self, point: Point, *, one_noise: bool) -> bool:
        """Return whether nothing is run to find out about a point."""

    def results(
        self, tried: Sequence[tuple[Point, str]], *, one_noise: bool
    ) -> list[PointResult | None]:
        """Return what points say, run at the same time; ``None`` for what makes no run.

        Each comes with a few words on what is tried. What fails by chance does not.
        """


class _SpentError(Exception):
    """Another point had to be tried and none is left."""


@dataclass(frozen=True, slots=True)
class NearestQuestion:
    """What the nearest failure is looked for with.

    ``influence`` is of each parameter, its sign does not matter.
    """

    task: SearchTask
    failures: Sequence[PointResult]
    influence: Mapping[str, float]


def find_nearest(question: NearestQuestion, prober: PointProber) -> NearestFailure | None:
    """Return the nearest failure, which holds if one does; ``None`` when nothing has failed."""
    trials = _PointTrials(prober)
    found = _find(question, trials)
    if found is None and question.failures:
        trials.one_noise = True
        found = _find(question, trials)
    return found


def _find(question: NearestQuestion, trials: _PointTrials) -> NearestFailure | None:
    """Return the smallest change that is come down to from any of the starts that fail."""
    task = question.task
    order = sorted(
        range(len(task.parameters)),
        key=lambda i: (abs(question.influence.get(task.parameters[i].name, 0.0)), i),
    )
    descents: list[_Descent] = []
    for count, start in enumerate(_starts(question)):
        if count >= _STARTS and descents:
            break
        # Whether it holds takes repeats, but it is no other point.
        (failing,) = trials.prober.results([(start.values, "")], one_noise=trials.one_noise)
        if failing is None or not failing.fails:
            continue
        descents.append(_Descent(task, tuple(order), trials, failing))
        if not descents[-1].take_back() or not descents[-1].changed():
            break
    if not descents:
        return None
    trials.left = NEAREST_POINTS - trials.points
    fewest = min(len(descent.changed()) for descent in descents)
    finalists = [descent for descent in descents if len(descent.changed()) == fewest]
    ended = []
    for descent in sorted(finalists, key=_Descent.size):
        ended.append((descent, descent.halve()))
        if not ended[-1][1]:
            break
    nearest, complete = min(ended, key=lambda one: one[0].size())
    nearest.compare()
    return _nearest(task, nearest, complete=complete)


def _starts(question: NearestQuestion) -> list[PointResult]:
    """Return failures to begin with, in this order.

    That with the smallest change, the worst, the first, the worst of each other kind, the worst of
    the rest.
    """
    task, among = question.task, question.failures
    if not among:
        return []
    least = min(among, key=lambda f: (distance_from_written(task, f.values), f.number))
    kinds = [one.example for one in distinct_failures(among)]
    worst = sorted(among, key=lambda f: (f.value.value if f.value else math.inf, f.number))
    picked = [least, smallest_margin(among), first_failure(among), *kinds, *worst]
    starts = {one.values: one for one in picked if one is not None}
    return list(starts.values())[:_MOST_STARTS]


@dataclass(slots=True)
class _PointTrials:
    """Tries points as long as some are left, for all descents together."""

    prober: PointProber
    one_noise: bool = False
    points: int = 0
    left: int = _TAKING_BACK

    def is_known(self, point: Point) -> bool:
        """Return whether nothing is run to find out about a point."""
        return self.prober.is_known(point, one_noise=self.one_noise)

    def results(self, tried: Sequence[tuple[Point, str]]) -> list[PointResult | None]:
        """Return what points say; raises :class:`_SpentError`."""
        new = {point for point, _ in tried if not self.is_known(point)}
        # A whole batch or none: half of one would make the answer depend on what is left.
        if len(new) > self.left:
            raise _SpentError
        self.points += len(new)
        self.left -= len(new)
        return self.prober.results(tried, one_noise=self.one_noise)


@dataclass(slots=True)
class _Descent:
    """A failure on its way to the scenario as written; ``order`` has the least influence first.

    ``passing`` has the nearest value that passes of each parameter, ``passes`` the last point that
    did.
    """

    task: SearchTask
    order: tuple[int, ...]
    trials: _PointTrials
    failing: PointResult
    passing: dict[int, PointValue] = field(default_factory=dict)
    passes: PointResult | None = None

    def size(self) -> tuple[int, float]:
        """Return how many parameters are not as written, and how far they are from it."""
        values = self.failing.values
        return len(self.changed()), distance_from_written(self.task, values)

    def changed(self) -> tuple[int, ...]:
        """Return the parameters that are not as written, those of least influence first."""
        changed = changed_parameters(self.task, self.failing.values)
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
            written = self.task.parameters[index].written
            for value in (self.passing.get(index), written):
                if value is None:
                    continue
                point = with_value(self.failing.values, index, value)
                known = self.trials.is_known(point)
                result = self.trials.results([(point, "")])[0] if known else None
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
        values = self.failing.values
        found = self.trials.results(
            [(taken_back(self.task, values, group), self._note(group)) for group in groups]
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
        return f"{short_name(self.task, self.task.parameters[group[0]])} as written"

    def _remember_passing(self, result: PointResult | None, group: Sequence[int]) -> None:
        if result is None or result.outcome is not Outcome.PASS:
            return
        self.passes = result
        if len(group) == 1:
            self.passing[group[0]] = result.values[group[0]]

    def _halve(self, index: int) -> None:
        """Bring one parameter to the step at which it begins to fail."""
        parameter = self.task.parameters[index]
        passing = parameter.written
        while passing is not None:
            value = value_between(parameter, self.failing.values[index], passing)
            if value is None:
                return
            point = with_value(self.failing.values, index, value)
            note = f"{short_name(self.task, parameter)} at {parameter.shown(value)}"
            (result,) = self.trials.results([(point, note)])
            if result is not None and result.fails:
                self.failing = result
            else:
                passing = value
                self._remember_passing(result, (index,))


def larger_changes(
    task: SearchTask, nearest: NearestFailure, failures: Iterable[PointResult]
) -> list[PointResult]:
    """Return failures to take instead of one that other noise does not confirm, the next first.

    They have no more changes; each is well beyond the one before, up to :data:`_MORE_TRIED`.
    """
    most = len(nearest.changes)
    sized = sorted(
        (distance_from_written(task, one.values), one.number, one)
        for one in failures
        if one.fails and 0 < len(changed_parameters(task, one.values)) <= most
    )
    found: list[PointResult] = []
    beyond = distance_from_written(task, nearest.result.values)
    for size, _, one in sized:
        if size >= _WELL_BEYOND * beyond and len(found) < _MORE_TRIED:
            found.append(one)
            beyond = size
    return found


def instead(
    task: SearchTask, nearest: NearestFailure, result: PointResult, confirmed: Confirmation
) -> NearestFailure:
    """Return the nearest failure with a larger change, which other noise confirms."""
    passing = {change.parameter: change.passing for change in nearest.changes}
    changes = _changes(task, result, passing)
    return replace(
        nearest,
        result=result,
        changes=changes,
        sentence=nearest_sentence(task, result, changes, nearest.passes),
        confirmed=confirmed,
        unconfirmed=nearest.result,
        holds=True,
    )


def with_repeats(
    task: SearchTask, nearest: NearestFailure, confirmed: Confirmation | None, *, holds: bool
) -> NearestFailure:
    """Return the nearest failure with what its repeats say; its sentence too where it is luck."""
    sentence = nearest.sentence
    if not holds:
        luck = noise_words(confirmed)
        sentence = nearest_sentence(task, nearest.result, nearest.changes, nearest.passes, luck)
    return replace(nearest, confirmed=confirmed, sentence=sentence, holds=holds)


def _nearest(task: SearchTask, descent: _Descent, *, complete: bool) -> NearestFailure:
    result, passes = descent.failing, descent.passes
    passing = {task.parameters[i].name: value for i, value in descent.passing.items()}
    changes = _changes(task, result, passing)
    sentence = nearest_sentence(task, result, changes, passes)
    trials = descent.trials
    return NearestFailure(
        result=result,
        changes=changes,
        passes=passes,
        runs=trials.prober.runs,
        complete=complete,
        sentence=sentence,
        holds=not trials.one_noise,
    )


def _changes(
    task: SearchTask, result: PointResult, passing: Mapping[str, PointValue | None]
) -> tuple[ParameterChange, ...]:
    """Return the changes of a failure, the largest first."""
    changed = changed_parameters(task, result.values)
    parameters = task.parameters
    return tuple(
        ParameterChange(
            parameter=parameters[i].name,
            unit=parameters[i].unit,
            written=parameters[i].written,
            value=result.values[i],
            passing=passing.get(parameters[i].name),
        )
        for i in sorted(changed, key=_by_size(task, result.values), reverse=True)
    )


def _by_size(task: SearchTask, point: Point) -> Callable[[int], tuple[float, int]]:
    return lambda i: (change_size(task.parameters[i], point[i]), -i)
