"""Methods of a search: they choose the next values by the results so far.

The samplers are optuna's. They learn results in the order of the proposals. So proposals do not
depend on which run ends first, and a search that starts again proposes the same points. The method
``boundary`` is our own.
"""

from __future__ import annotations

import bisect
import itertools
import math
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from daemon.model.search import SPACE_FILLING, Point, SearchTask
from daemon.search.space import SearchSpace
from grammars.text.diagnostics import did_you_mean

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution
    from optuna.samplers import BaseSampler
    from optuna.trial import Trial

METHODS: Final = ("auto", "halton", "random", "tpe", "cma", "boundary")
COVARIANCE_FROM: Final = 150
"""Proposals after which ``auto`` uses the method cma, if all parameters are ranges."""
_TRIES: Final = 16
"""Most useless points in a row, forbidden or known, that a sampler may propose."""
_MOST_TRIES: Final = 10_000
"""Useless draws in a row after which a space counts as exhausted."""
_DRAWN: Final = 128
"""Places that TPE draws for each proposal. With a dozen parameters few of optuna's default 24 lie
near the good results: over a narrow failing region 60 runs found 14.0 failures with 128 places and
9.5 with 24, the mean of 24 searches.
"""
_DRAWN_FEW: Final = 24
_MANY_RESULTS: Final = 500
"""Proposals after which TPE draws few places, so that a proposal costs less than 50 ms."""
_JITTER: Final = 1e-9
"""Largest random addition to results, so that the first of equal ones has no advantage."""
_MOST_MESHED: Final = 2
"""Most parameters of the method ``boundary``."""
_CELL: Final = 2**16
"""Side of a cell of the first mesh, in steps: it can be halved 16 times."""
_FEWEST, _MOST = 3, 15
"""Least and greatest number of results along a side of the first mesh."""

_Corner: TypeAlias = tuple[int, ...]
"""A place of the mesh, in steps along every axis."""
_Cell: TypeAlias = tuple[_Corner, int]
"""The corner of a cell with the lowest coordinates, and its side, in steps."""
_Values: TypeAlias = Mapping[Point, float | None]
"""The values of points with a result, ``None`` for a result without a value."""


@dataclass(frozen=True, slots=True)
class MethodProposal:
    """A point to run.

    ``method`` is ``written`` for the scenario as written, otherwise the name of a method. Results
    influenced the choice of a ``guided`` point.
    """

    values: Point
    method: str
    guided: bool


class SearchMethod:
    """Proposes points: the scenario as written, then those of the task's method.

    A proposal is a function of the task and of the results learnt before it. The caller must keep
    to the task's window: before proposal ``n`` it reports exactly the results up to ``n - window``.
    """

    def __init__(self, task: SearchTask, space: SearchSpace) -> None:
        self._task: Final = task
        self._space: Final = space
        self._places: Final = _unguided_places(task)
        self._mesh: Final = BoundaryMesh(task.runs, space) if task.method == "boundary" else None
        guided = task.method in ("auto", "tpe", "cma")
        self._guide: Final = _Guide(task, space) if guided else None
        self._points: Final[list[Point]] = []
        self._taken: Final[set[Point]] = set()
        self._values: Final[dict[Point, float | None]] = {}

    def propose(self) -> MethodProposal | None:
        """Return the next proposal; ``None`` if no new point remains."""
        proposal = self._next(len(self._points))
        if proposal is not None:
            self._points.append(proposal.values)
            self._taken.add(proposal.values)
        return proposal

    def learn(self, value: float | None) -> None:
        """Learn the result of the first proposal without one.

        Lower values are nearer to failing; ``None`` and numbers that are not finite are ignored.
        """
        value = value if value is not None and math.isfinite(value) else None
        self._values[self._points[len(self._values)]] = value
        if self._guide is not None:
            self._guide.learn(value)

    def _next(self, number: int) -> MethodProposal | None:
        first = self._space.written
        if number == 0 and first is not None:
            if self._guide is not None:
                # It may lie outside the space.
                self._guide.take(None)
            return MethodProposal(first, "written", False)
        if self._mesh is not None:
            choice = self._mesh.choose(self._values, self._is_new)
            if choice is not None:
                return MethodProposal(choice[0], "boundary", choice[1])
        method = self._method_at(number)
        is_guided = method in ("tpe", "cma")
        if self._guide is not None and is_guided:
            point = self._guide.propose(method, number, self._is_new)
            if point is not None:
                return MethodProposal(point, method, True)
        for place in itertools.islice(self._places, _MOST_TRIES):
            point = self._space.at(place)
            if self._is_new(point):
                if self._guide is not None:
                    self._guide.take(place)
                return MethodProposal(point, method, is_guided)
        return None

    def _method_at(self, number: int) -> str:
        """Return the method of a proposal, independent of the budget."""
        method = self._task.method
        if method not in ("auto", "tpe"):
            return method
        if number < SPACE_FILLING:
            return "halton"
        ranges = not any(parameter.choices for parameter in self._task.parameters)
        adapts = method == "auto" and ranges and self._space.dimensions > 1
        return "cma" if adapts and number >= COVARIANCE_FROM else "tpe"

    def _is_new(self, point: Point) -> bool:
        return point not in self._taken and self._space.allowed(point)


def _unguided_places(task: SearchTask) -> Iterator[Sequence[float]]:
    """Yield places of the unit cube, (d,), independent of results."""
    # Only a running search loads this; a check only asks whether its method fits.
    from grammars.variation.designs import halton_points

    if task.method != "random":
        yield from halton_points(len(task.parameters), task.seed)
    rng = np.random.default_rng(task.seed)
    while True:
        yield rng.random(len(task.parameters)).tolist()


class _Guide:
    """A study of optuna over the unit cube."""

    def __init__(self, task: SearchTask, space: SearchSpace) -> None:
        # This takes half a second, which searches that fill the space can save.
        import optuna
        from optuna.distributions import CategoricalDistribution, FloatDistribution

        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._optuna: Final = optuna
        self._space: Final = space
        self._parameters: Final = task.parameters
        self._seed: Final = int(np.random.SeedSequence(task.seed).generate_state(1)[0])
        self._chance: Final = np.random.default_rng(task.seed)
        self._axes: Final[dict[str, BaseDistribution]] = {
            p.name: CategoricalDistribution(_middles(len(p.choices)))
            if p.choices
            else FloatDistribution(0.0, 1.0)
            for p in task.parameters
        }
        self._study: Final = optuna.create_study()
        self._sampler = ""
        self._out: Final[deque[Trial | None]] = deque()

    def propose(self, method: str, number: int, is_new: Callable[[Point], bool]) -> Point | None:
        """Return a new point of a sampler; ``None`` after many useless proposals."""
        self._follow(method, _DRAWN if number < _MANY_RESULTS else _DRAWN_FEW)
        for _ in range(_TRIES):
            trial = self._study.ask(self._axes)
            point = self._space.at([trial.params[name] for name in self._axes])
            if is_new(point):
                self._out.append(trial)
                return point
            self._study.tell(trial, state=self._optuna.trial.TrialState.FAIL)
        return None

    def take(self, place: Sequence[float] | None) -> None:
        """Add the place of a point from outside; ``None`` has no influence on the sampler."""
        if place is None:
            self._out.append(None)
            return
        # For a list the sampler knows only the middles of the cells.
        params = {
            p.name: _middles(len(p.choices))[int(share * len(p.choices))] if p.choices else share
            for p, share in zip(self._parameters, place, strict=True)
        }
        self._study.enqueue_trial(params)
        self._out.append(self._study.ask(self._axes))

    def learn(self, value: float | None) -> None:
        """Learn the result of the first point in progress."""
        trial, states = self._out.popleft(), self._optuna.trial.TrialState
        if trial is None:
            return
        if value is None:
            self._study.tell(trial, state=states.FAIL)
        else:
            self._study.tell(trial, value + _JITTER * self._chance.random())

    def _follow(self, method: str, candidates: int) -> None:
        """Switch to the sampler of a method."""
        name = f"{method} {candidates}" if method == "tpe" else method
        if name != self._sampler:
            self._sampler = name
            self._study.sampler = (
                self._covariance() if method == "cma" else self._estimator(candidates)
            )

    def _estimator(self, candidates: int) -> BaseSampler:
        """Return tree-structured Parzen estimators over all parameters together.

        Falkner, S.; Klein, A.; Hutter, F.: BOHB, ICML 2018. Points in progress count as bad ones.
        """
        return self._optuna.samplers.TPESampler(
            n_startup_trials=1, n_ei_candidates=candidates, seed=self._seed
        )

    def _covariance(self) -> BaseSampler:
        """Return a normal distribution that adapts; it begins around the best results, if any.

        Nomura, M.; et al.: Warm starting CMA-ES for hyperparameter optimization, AAAI 2021.
        """
        complete = (self._optuna.trial.TrialState.COMPLETE,)
        results = self._study.get_trials(deepcopy=False, states=complete)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", self._optuna.exceptions.ExperimentalWarning)
            return self._optuna.samplers.CmaEsSampler(
                n_startup_trials=0,
                seed=self._seed,
                source_trials=results if len(results) >= SPACE_FILLING else None,
                warn_independent_sampling=False,
            )


def _middles(count: int) -> list[float]:
    """Return the places of choices in the unit interval: the middles of equal cells."""
    return [(k + 0.5) / count for k in range(count)]


def method_problem(task: SearchTask) -> tuple[str, str] | None:
    """Return why the method of a search is unusable, and a remedy; ``None`` for a usable one."""
    method, count = task.method, len(task.parameters)
    lists = [parameter.name for parameter in task.parameters if parameter.choices]
    if method not in METHODS:
        return f'there is no method "{method}"', did_you_mean(method, METHODS)
    if method == "boundary" and count > _MOST_MESHED:
        message = f"the method boundary takes one or two parameters, not {count}"
        return message, "write method: auto, or vary less"
    if method == "cma" and count < 2:
        return "the method cma takes two parameters or more", "write method: tpe"
    if method in ("boundary", "cma") and lists:
        message = f"the method {method} takes ranges alone, {lists[0]} is a list"
        return message, "write method: tpe"
    return None


class BoundaryMesh:
    """The boundary between passing and failing, a margin of zero, over one or two ranges.

    The space is divided into equal cells with results at their corners, for half of the ``runs``.
    Cells with passing and failing corners contain the boundary and are halved, the largest first;
    then those with corners near zero, which may contain it. The result is a mesh that is fine along
    the boundary.
    """

    def __init__(self, runs: int, space: SearchSpace) -> None:
        self._space: Final = space
        side = round((runs / 2.0) ** (1.0 / space.dimensions))
        side = min(max(side, _FEWEST), _MOST)
        self._across: Final = (side - 1) * _CELL
        # Half of a value's share: smaller cells contain no new values.
        levels = max(axis.levels for axis in space.axes)
        self._finest: Final = max(self._across / (2.0 * levels), 2.0)
        places = range(0, side * _CELL, _CELL)
        self._first: Final = list(itertools.product(places, repeat=space.dimensions))
        self._points: Final[dict[_Corner, Point]] = {}
        self._ready: Final[list[tuple[tuple[float, ...], _Cell]]] = []
        self._waiting: list[_Cell] = [
            (low, _CELL) for low in self._first if max(low) < self._across
        ]

    def choose(self, values: _Values, is_new: Callable[[Point], bool]) -> tuple[Point, bool] | None:
        """Return the next point and whether it halves a cell; ``None`` if no cell is ready yet.

        ``values`` are those of all points with a result.
        """

        def new(corners: Iterable[_Corner]) -> Point | None:
            return next(filter(is_new, map(self._point, corners)), None)

        point = new(self._first)
        if point is not None:
            return point, False
        self._sort(values)
        while self._ready:
            cell = self._ready[0][1]
            # The corners of its halves, the middle first.
            point = new(_offset(cell, (cell[1] // 2, 0, cell[1])))
            if point is not None:
                return point, True
            del self._ready[0]
            self._waiting += _halves(cell)
            self._sort(values)
        return None

    def _point(self, corner: _Corner) -> Point:
        if corner not in self._points:
            self._points[corner] = self._space.at([steps / self._across for steps in corner])
        return self._points[corner]

    def _sort(self, values: _Values) -> None:
        """Sort cells with known corners by their need to be halved."""
        waiting, self._waiting = self._waiting, []
        for cell in waiting:
            corners = [self._point(corner) for corner in _corners(cell)]
            results = [values[point] for point in corners if point in values]
            # A forbidden corner never has a result, so the others decide.
            if len(results) < sum(map(self._space.allowed, corners)):
                self._waiting.append(cell)
                continue
            margins = [value for value in results if value is not None]
            if margins and cell[1] >= self._finest:
                bisect.insort(self._ready, (_need(margins, cell[1]), cell))


def _need(margins: Sequence[float], side: int) -> tuple[float, ...]:
    """Return the rank of a cell: lower ones are halved first."""
    nearest, spread = min(map(abs, margins)), max(margins) - min(margins)
    if min(margins) < 0.0 <= max(margins):
        return (0.0, -side, nearest)
    # The distance to zero is relative to the spread of margins in the cell.
    return (1.0, nearest / spread if spread > 0.0 else math.inf, -side)


def _corners(cell: _Cell) -> list[_Corner]:
    return _offset(cell, (0, cell[1]))


def _halves(cell: _Cell) -> list[_Cell]:
    half = cell[1] // 2
    return [(low, half) for low in _offset(cell, (0, half))]


def _offset(cell: _Cell, steps: tuple[int, ...]) -> list[_Corner]:
    """Return the lowest corner of a cell, moved by each of ``steps`` along each axis."""
    low, _ = cell
    offsets = itertools.product(steps, repeat=len(low))
    return [tuple(a + b for a, b in zip(low, offset, strict=True)) for offset in offsets]
