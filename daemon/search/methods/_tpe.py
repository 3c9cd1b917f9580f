"""Tree-structured Parzen estimators: where good results lie densely and others do not.

Bergstra, J.; Bardenet, R.; Bengio, Y.; Kegl, B.: Algorithms for hyper-parameter optimization,
NeurIPS 2011; multivariate after Falkner, S.; Klein, A.; Hutter, F.: BOHB, ICML 2018. The estimator
is optuna's. It sees ranks: of a plateau, whose values are equal, others come first every time, so
that none of them is taken for good because it was the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from daemon.model.search import Point
from daemon.search.methods._history import KnownResult, SearchHistory
from daemon.search.methods._stages import Choice
from grammars.model.geometry import Floats

if TYPE_CHECKING:
    from daemon.search.methods._optuna import ParzenTree

_RESULTS: Final = 500
"""The last results that a proposal is made of: more cost time and tell little."""
_TRIES: Final = 8
"""Proposals of the estimator in a row that are not allowed, or taken already."""


class TpeStage:
    """Points where the best tenth of the results is denser than the others."""

    name: Final = "tpe"

    def __init__(self) -> None:
        self._tree: ParzenTree | None = None

    def choose(self, number: int, history: SearchHistory) -> Choice | None:
        """Return a point for what is known, even ones as long as nothing is."""
        known = history.known(number)[-_RESULTS:]
        if not known:
            point = history.next_even()
            return None if point is None else (point, False)
        tree = self._loaded(history)
        ranks = shuffled_ranks(known, history.generator(number))
        results = [(k.number, k.unit, rank) for k, rank in zip(known, ranks, strict=True)]
        pending = [history.space.unit(point) for point in history.pending(number)]
        places: list[Floats] = []
        for place in tree.places(results, pending, history.small_seed(number), _TRIES):
            places.append(place)
            point = history.space.at(place)
            if history.is_new(point):
                return point, True
        return _guided(history.nearest_even(places[0]))

    def _loaded(self, history: SearchHistory) -> ParzenTree:
        if self._tree is None:
            # optuna takes a second to import: those that search without it need not wait.
            from daemon.search.methods._optuna import ParzenTree

            choices = [0 if axis.is_number else axis.levels for axis in history.space.axes]
            self._tree = ParzenTree(choices)
        return self._tree


def shuffled_ranks(known: Sequence[KnownResult], rng: np.random.Generator) -> list[int]:
    """Return the rank of every value, 0 for the lowest; equal ones are in an order drawn."""
    values = np.array([k.value for k in known])
    order = np.lexsort((rng.random(len(values)), values))
    ranks = np.empty(len(values), dtype=int)
    ranks[order] = np.arange(len(values))
    return ranks.tolist()


def _guided(point: Point | None) -> Choice | None:
    return None if point is None else (point, True)
