"""The estimator of optuna, given what is known and asked for places of the unit cube.

Its studies are made anew for every proposal and forgotten: what a search knows is in the ledger.
Trials are handed over as they are, without the copies that its storage would make of them, which
take longer than the estimate.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Container, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution
from optuna.samplers import TPESampler
from optuna.storages import InMemoryStorage
from optuna.trial import FrozenTrial, TrialState, create_trial

from grammars.model.geometry import Floats

if TYPE_CHECKING:
    from optuna.study import Study

_PAST: Final = 10**9
"""Trials that are given are older than those that are asked for, which are numbered from 0."""
_DRAWN: Final = 128
"""Places that are drawn for each that is proposed, the most promising of them. Of optuna's own 24
few lie near the good results where a dozen parameters vary: with 128 the search of the
demonstration found 22 and 12 failures in 60 runs with two seeds (24: 9 and 10), with 512 of two
others 8 and 15 (128: 14 and 16).
"""
_QUIETLY: Final = threading.Lock()

RankedPlace: TypeAlias = tuple[int, Floats, int]
"""The number of a proposal, its place in the unit cube, and its rank, 0 for the best."""


class ParzenTree:
    """Estimates where good results lie.

    ``choices`` has for every axis of the cube the number of its choices, 0 for a range.
    """

    def __init__(self, choices: Sequence[int]) -> None:
        self._choices: Final = tuple(choices)
        self._distributions: Final[dict[str, BaseDistribution]] = {
            f"axis {k}": CategoricalDistribution(range(n)) if n else FloatDistribution(0.0, 1.0)
            for k, n in enumerate(choices)
        }
        self._trials: Final[dict[int, FrozenTrial]] = {}

    def places(
        self, results: Sequence[RankedPlace], pending: Sequence[Floats], seed: int, count: int
    ) -> Iterator[Floats]:
        """Return up to ``count`` places, (d,), each away from those before it.

        ``pending`` are places without a result so far. The places are a function of the arguments.
        """
        storage = _GivenTrials()
        storage.given = [*map(self._trial, results), *map(self._running, pending)]
        with _quiet():
            sampler = _Sampler(seed, self._distributions)
            study = optuna.create_study(storage=storage, sampler=sampler, study_name="search")
        for _ in range(count):
            trial = study.ask(self._distributions)
            yield self._place(trial.params)

    def _trial(self, result: RankedPlace) -> FrozenTrial:
        number, place, rank = result
        if number not in self._trials:
            trial = create_trial(params=self._params(place), distributions=self._distributions,
                                 value=0.0)  # fmt: skip
            trial.number = number - _PAST
            self._trials[number] = trial
        self._trials[number].value = float(rank)
        return self._trials[number]

    def _running(self, place: Floats) -> FrozenTrial:
        trial = create_trial(state=TrialState.RUNNING, params=self._params(place),
                             distributions=self._distributions)  # fmt: skip
        trial.number = -1
        return trial

    def _params(self, place: Floats) -> dict[str, Any]:
        return {
            name: min(int(share * n), n - 1) if n else float(share)
            for name, n, share in zip(self._distributions, self._choices, place, strict=True)
        }

    def _place(self, params: dict[str, Any]) -> Floats:
        values = (params[name] for name in self._distributions)
        shares = [(v + 0.5) / n if n else v for v, n in zip(values, self._choices, strict=True)]
        return np.array(shares, dtype=np.float64)


class _GivenTrials(InMemoryStorage):
    """A storage that has some trials to begin with, not copied."""

    given: list[FrozenTrial]

    def get_all_trials(
        self,
        study_id: int,
        deepcopy: bool = True,
        states: Container[TrialState] | None = None,
    ) -> list[FrozenTrial]:
        """Return the given trials, then those asked for."""
        own = super().get_all_trials(study_id, deepcopy, states)
        return [t for t in self.given if states is None or t.state in states] + own


class _Sampler(TPESampler):
    """Of the same distributions for every trial, which it need not look for."""

    def __init__(self, seed: int, distributions: dict[str, BaseDistribution]) -> None:
        super().__init__(
            n_startup_trials=1,
            seed=seed,
            n_ei_candidates=_DRAWN,
            multivariate=True,
            constant_liar=True,
        )
        self._varied = {name: d for name, d in distributions.items() if not d.single()}

    def infer_relative_search_space(
        self, study: Study, trial: FrozenTrial
    ) -> dict[str, BaseDistribution]:
        """Return what is sampled together."""
        return self._varied


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep optuna from telling of a new study: one at a time, as its level is one for all."""
    with _QUIETLY:
        before = optuna.logging.get_verbosity()
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        try:
            yield
        finally:
            optuna.logging.set_verbosity(before)
