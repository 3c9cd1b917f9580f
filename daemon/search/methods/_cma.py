"""Covariance matrix adaptation: a normal distribution that moves to where results are better.

Hansen, N.; Ostermeier, A.: Completely derandomized self-adaptation in evolution strategies,
Evolutionary Computation 9 (2001), by the library cmaes. It compares results and takes no
differences of them, so plateaus do no harm. Results are told a population at a time, in the order
of proposals; those of the generation before that are still out are told with the next.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from daemon.search.methods._history import KnownResult, SearchHistory
from daemon.search.methods._stages import Choice
from grammars.model.geometry import Floats
from grammars.text.plugins import load_extra

_FIRST_SPREAD: Final = 0.3
"""Standard deviation at the beginning, of the unit cube: a third, as Hansen has it."""
_ENOUGH: Final = 40
"""Results of which the best tenth says where to begin."""
_WIDENED: Final = 0.1
"""What is added to their standard deviation, of the unit cube."""
_TRIES: Final = 50
"""Points drawn in a row that are not allowed, or taken already."""
_NARROWEST: Final = 1e-3
"""Standard deviation along every axis below which the search begins anew elsewhere."""
_LARGEST_GROWTH: Final = 4


class CmaStage:
    """Points of a normal distribution that adapts to what is known.

    It begins at the best results that are known, without any at the written values, else in the
    middle. Once it is narrow it begins anew around the next even point with twice the population
    (Auger, A.; Hansen, N.: A restart CMA evolution strategy with increasing population size, CEC
    2005), to find what else fails.
    """

    name: Final = "cma"

    def __init__(self) -> None:
        self._strategy: Any = None
        self._start = 0
        self._starts_of: Final[dict[int, int]] = {}
        self._seen = 0
        self._untold: Final[list[tuple[Floats, float]]] = []

    def choose(self, number: int, history: SearchHistory) -> Choice | None:
        """Return a point drawn; where none is new, an even one, and begin anew."""
        known = history.known(number)
        if self._strategy is None:
            self._begin(*_first_distribution(known, history), growth=1)
            self._seen = len(known)
        self._tell(known, history)
        self._strategy.reseed_rng(history.small_seed(number))
        point = history.first_new(self._strategy.ask() for _ in range(_TRIES))
        if point is not None:
            self._starts_of[number] = self._start
            return point, True
        even = history.nearest_even(self._strategy.mean)
        self._begin_anew(history)
        return None if even is None else (even, True)

    def _tell(self, known: list[KnownResult], history: SearchHistory) -> None:
        for result in known[self._seen :]:
            # Points of an earlier start lie far away, and would draw this one back to it.
            if self._starts_of.get(result.number) == self._start:
                self._untold.append((result.unit, result.value))
            if len(self._untold) == self._strategy.population_size:
                population = self._untold.copy()
                self._untold.clear()
                self._strategy.tell(population)
                if self._strategy.should_stop() or _is_narrow(population):
                    self._begin_anew(history)
        self._seen = len(known)

    def _begin_anew(self, history: SearchHistory) -> None:
        self._start += 1
        self._untold.clear()
        even = history.next_even()
        centre = np.full(history.space.dimensions, 0.5)
        place = centre if even is None else history.space.unit(even)
        self._begin(place, _FIRST_SPREAD, None, growth=min(2**self._start, _LARGEST_GROWTH))

    def _begin(self, mean: Floats, sigma: float, cov: Floats | None, growth: int) -> None:
        d = len(mean)
        self._strategy = _cmaes().CMA(
            mean=mean,
            sigma=sigma,
            cov=cov,
            bounds=np.tile([0.0, 1.0], (d, 1)),
            population_size=growth * (4 + int(3 * np.log(d))),
            seed=0,
        )


def _is_narrow(population: list[tuple[Floats, float]]) -> bool:
    places = np.array([place for place, _ in population])
    return bool(np.std(places, axis=0).max() < _NARROWEST)


def _first_distribution(
    known: list[KnownResult], history: SearchHistory
) -> tuple[Floats, float, Floats | None]:
    """Return mean, standard deviation and covariance to begin with.

    Nomura, M.; Watanabe, S.; Akimoto, Y.; Ozaki, Y.; Onishi, M.: Warm starting CMA-ES for
    hyperparameter optimization, AAAI 2021: the best tenth of the results, widened a little.
    """
    if len(known) >= _ENOUGH:
        results = [(result.unit, result.value) for result in known]
        mean, sigma, cov = _cmaes().get_warm_start_mgd(results, gamma=0.1, alpha=_WIDENED)
        return mean, sigma, cov
    space = history.space
    written = space.written
    if written is not None and space.contains(written):
        return space.unit(written), _FIRST_SPREAD, None
    return np.full(space.dimensions, 0.5), _FIRST_SPREAD, None


def _cmaes() -> Any:
    return load_extra("cmaes", "search", "the method cma", "scenario search")
