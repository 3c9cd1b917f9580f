"""Sampling designs: points with one number per draw, planned over all variants.

Quantiles of space-filling designs are mapped through the distribution of each draw, so weights and
shapes keep their meaning.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Final, Literal, TypeAlias

from grammars.text.diagnostics import InputError, Where
from grammars.variation._distributions import Distribution

Method: TypeAlias = Literal["random", "grid", "halton", "lhs"]
_MOST_POINTS: Final = 100_000
"""Points of a grid at most."""
_BLOCK: Final = 64
"""Points of a sequence computed at a time."""

Point: TypeAlias = tuple[float, ...]


def grid(distributions: Sequence[Distribution], levels: int, where: Where) -> Iterator[Point]:
    """Return all combinations of the levels of all draws; the last draw changes fastest.

    Raises :class:`InputError` for more than 100 000 points.
    """
    axes = [distribution.levels(levels) for distribution in distributions]
    size = math.prod(len(axis) for axis in axes)
    if size > _MOST_POINTS:
        message = f"the full grid has {size:,} points, more than {_MOST_POINTS:,}"
        raise InputError.at(where, message, "lower the levels, or use lhs")
    return itertools.product(*axes)


def halton_points(dimensions: int, seed: int) -> Iterator[Point]:
    """Yield endless points in the unit cube [0, 1) of a scrambled Halton sequence.

    Owen: A randomized Halton algorithm in R (2017).
    """
    # This import takes half a second, and random draws do not need it.
    from scipy.stats import qmc

    engine = qmc.Halton(dimensions, rng=seed)
    while True:
        yield from map(tuple, engine.random(_BLOCK).tolist())


def latin_hypercubes(dimensions: int, n: int, seed: int) -> Iterator[Point]:
    """Yield endless blocks of ``n`` points with one in each of ``n`` equal slices of every axis.

    McKay, Beckman, Conover: A comparison of three methods for selecting values of input variables
    in the analysis of output from a computer code, Technometrics 21 (1979).
    """
    from scipy.stats import qmc

    engine = qmc.LatinHypercube(dimensions, rng=seed)
    while True:
        yield from map(tuple, engine.random(n).tolist())


def points_at(distributions: Sequence[Distribution], quantiles: Iterator[Point]) -> Iterator[Point]:
    """Yield the values of the draws at their quantiles, point by point."""
    for row in quantiles:
        yield tuple(d.at(share) for d, share in zip(distributions, row, strict=True))
