"""Designs: which values the variants take, when they are not drawn one by one.

Every design is a sequence of points, one number per draw. Quantiles of space-filling designs are
mapped through each draw's distribution, so weights and shapes keep their meaning.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, Literal, TypeAlias, get_args

import numpy as np

from grammars.text.diagnostics import InputError, Where
from grammars.variation._distributions import Distribution

Method: TypeAlias = Literal["random", "grid", "halton", "lhs", "pairwise"]
METHODS: Final[tuple[str, ...]] = get_args(Method)
MAX_POINTS: Final = 100_000
"""Points a design may have."""

Point: TypeAlias = tuple[float, ...]


def grid(distributions: Sequence[Distribution], levels: int, where: Where) -> Iterator[Point]:
    """Return every combination of every draw's levels; the last draw changes fastest.

    Raises :class:`InputError` when there are more than ``MAX_POINTS``.
    """
    axes = [distribution.levels(levels) for distribution in distributions]
    size = math.prod(len(axis) for axis in axes)
    if size > MAX_POINTS:
        message = f"the full grid has {size:,} points, more than {MAX_POINTS:,}"
        raise InputError.at(where, message, "lower the levels, or take pairwise or lhs")
    return itertools.product(*axes)


def halton(distributions: Sequence[Distribution], seed: int) -> Iterator[Point]:
    """Return points of a scrambled Halton sequence, without an end.

    Halton, J. H.: On the efficiency of certain quasi-random sequences of points, Numerische
    Mathematik 2 (1960); scrambling after Owen (2017), as in :class:`scipy.stats.qmc.Halton`.
    """
    engine = _qmc().Halton(len(distributions), scramble=True, **_rng(seed))
    while True:
        yield from _points_at(distributions, engine.random(64))


def latin_hypercube(distributions: Sequence[Distribution], n: int, seed: int) -> Iterator[Point]:
    """Return ``n`` points with one in each of ``n`` equally likely slices of every draw.

    McKay, Beckman, Conover: A comparison of three methods for selecting values of input variables
    in the analysis of output from a computer code, Technometrics 21 (1979).
    """
    engine = _qmc().LatinHypercube(len(distributions), **_rng(seed))
    return _points_at(distributions, engine.random(n))


def pairwise(
    distributions: Sequence[Distribution],
    levels: int,
    accepted: Callable[[Point], bool],
    where: Where,
) -> Iterator[Point]:
    """Return points such that every two levels of every two draws meet in one of them.

    Points that are not ``accepted`` are avoided and their pairs covered by others where that is
    possible. With fewer than two draws this is the grid.
    """
    axes = [list(distribution.levels(levels)) for distribution in distributions]
    if len(axes) < 2:
        return (point for point in itertools.product(*axes) if accepted(point))
    pairs = sum(len(a) * len(b) for a, b in itertools.combinations(axes, 2))
    if pairs > MAX_POINTS:
        message = f"there are {pairs:,} pairs of values, more than {MAX_POINTS:,}"
        raise InputError.at(where, message, "lower the levels, or take lhs")
    complete = len(axes)

    def kept(row: Sequence[float]) -> bool:
        return len(row) < complete or accepted(tuple(row))

    # allpairspy asks for every beginning of a row: only complete ones can be judged.
    rows = _allpairs()(axes, filter_func=kept)
    return (tuple(row) for row in rows)


def _points_at(distributions: Sequence[Distribution], quantiles: Any) -> Iterator[Point]:
    for row in quantiles.tolist():
        yield tuple(d.at(share) for d, share in zip(distributions, row, strict=True))


def _rng(seed: int) -> dict[str, Any]:
    return {"rng": np.random.default_rng(np.random.SeedSequence(seed))}


def _qmc() -> Any:
    try:
        from scipy.stats import qmc
    except ImportError as error:
        raise _missing_package("scipy") from error
    return qmc


def _allpairs() -> Any:
    try:
        from allpairspy import AllPairs
    except ImportError as error:
        raise _missing_package("allpairspy") from error
    return AllPairs


def _missing_package(package: str) -> InputError:
    hint = 'install it with: pip install "scenario-tui[sampling]"'
    return InputError.at(Where("scenario vary"), f"this design needs {package}", hint)
