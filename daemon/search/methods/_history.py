"""What was proposed and what came of it, as far as a proposal may know of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.model.search import Point
from daemon.search.space import SearchSpace
from grammars.model.geometry import Floats

_TRIES: Final = 10_000
"""Points of a sequence in a row that are taken already, or not allowed."""
_NEAREST_OF: Final = 64
"""Points of a sequence of which the nearest is taken."""
_LISTED: Final = 100_000
"""Points of a space that are gone through one by one when a sequence finds no new one."""


@dataclass(frozen=True, slots=True)
class KnownResult:
    """A proposal that has a value; ``unit`` is its place in the unit cube, (d,)."""

    number: int
    point: Point
    unit: Floats
    value: float


class SearchHistory:
    """All proposals of a search, and what was learnt of them.

    ``seed`` is the root of all random numbers of the search; every proposal has a generator of its
    own, so that none depends on how many numbers another took.
    """

    def __init__(self, space: SearchSpace, seed: int, window: int) -> None:
        self.space: Final = space
        self.window: Final = window
        self._seed: Final = seed
        self._points: Final[dict[int, Point]] = {}
        self._taken: Final[set[Point]] = set()
        self._values: Final[dict[int, float | None]] = {}
        self._known: Final[list[KnownResult]] = []
        self._known_below = 0
        # Loaded for who proposes: a check only asks whether the method of a search fits it.
        from grammars.variation.designs import halton_points

        self._sequence: Final = halton_points(space.dimensions, seed)

    def generator(self, number: int) -> np.random.Generator:
        """Return the random numbers of a proposal."""
        return np.random.default_rng(self._child(number))

    def small_seed(self, number: int) -> int:
        """Return a seed of a proposal for libraries that take 32 bits."""
        return int(self._child(number).generate_state(1)[0])

    def _child(self, number: int) -> np.random.SeedSequence:
        return np.random.SeedSequence(self._seed, spawn_key=(number,))

    def take(self, number: int, point: Point) -> None:
        """Keep what is proposed."""
        self._points[number] = point
        self._taken.add(point)

    def learn(self, number: int, point: Point, value: float | None) -> None:
        """Keep what a proposal gave; numbers that are not finite say nothing."""
        if number in self._values:
            return
        if self._points.get(number) != point:
            self.take(number, point)
        self._values[number] = value if value is not None and math.isfinite(value) else None

    def best(self) -> int | None:
        """Return the number with the lowest value, the first of equals."""
        valued = [(value, n) for n, value in self._values.items() if value is not None]
        return min(valued)[1] if valued else None

    def known(self, number: int) -> list[KnownResult]:
        """Return what proposal ``number`` may know, in order; proposals are asked for in order.

        Values without a place in the space (written outside of it) are left out.
        """
        while self._known_below <= number - self.window:
            n = self._known_below
            self._known_below += 1
            value = self._values.get(n)
            if value is not None and self.space.contains(self._points[n]):
                point = self._points[n]
                self._known.append(KnownResult(n, point, self.space.unit(point), value))
        return self._known

    def outcomes(self, number: int) -> dict[Point, float | None]:
        """Return the value of each point that proposal ``number`` may know, or that it has none."""
        points = ((n, self._points.get(n)) for n in range(number - self.window + 1))
        return {p: self._values[n] for n, p in points if p is not None and n in self._values}

    def pending(self, number: int) -> list[Point]:
        """Return the points that are out when proposal ``number`` is made, in order."""
        first = max(0, number - self.window + 1)
        points = (self._points[n] for n in range(first, number) if n in self._points)
        return [point for point in points if self.space.contains(point)]

    def is_new(self, point: Point) -> bool:
        """Return whether a point is allowed and was not proposed before."""
        return point not in self._taken and self.space.allowed(point)

    def next_even(self) -> Point | None:
        """Return the next new point of the scrambled Halton sequence, ``None`` without any."""
        return next(self._new_even(), None) or self._any_new()

    def first_new(self, places: Iterable[Floats]) -> Point | None:
        """Return the first new point at one of these places, ``None`` without any."""
        return next(filter(self.is_new, map(self.space.at, places)), None)

    def nearest_even(self, place: Floats) -> Point | None:
        """Return that of the next new points of the sequence that is nearest to a place."""
        points = list(itertools.islice(self._new_even(), _NEAREST_OF))
        if not points:
            return self._any_new()
        distances = [float(np.linalg.norm(self.space.unit(point) - place)) for point in points]
        return points[distances.index(min(distances))]

    def _new_even(self) -> Iterator[Point]:
        size = self.space.size
        tries = min(_TRIES, 10 * size + 100) if size else _TRIES
        return filter(self.is_new, map(self.space.at, itertools.islice(self._sequence, tries)))

    def _any_new(self) -> Point | None:
        """Return any new point of a small space: a sequence may miss the last ones for long."""
        small = 0 < self.space.size <= _LISTED
        return next(filter(self.is_new, self.space.points()), None) if small else None
