"""Designs: which values the variants take, when they are not drawn one by one.

Every design is a sequence of points, one number per draw. Quantiles of space-filling designs are
mapped through each draw's distribution, so weights and shapes keep their meaning.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from grammars.text.diagnostics import InputError, Where
from grammars.variation._distributions import Distribution

Method: TypeAlias = Literal["random", "grid", "halton", "lhs"]
METHODS: Final[tuple[str, ...]] = get_args(Method)
MAX_POINTS: Final = 100_000
"""Points a design may have."""
_BLOCK: Final = 64
"""Points of a sequence that are made at a time."""

Point: TypeAlias = tuple[float, ...]


def grid(distributions: Sequence[Distribution], levels: int, where: Where) -> Iterator[Point]:
    """Return every combination of every draw's levels; the last draw changes fastest.

    Raises :class:`InputError` when there are more than ``MAX_POINTS``.
    """
    axes = [distribution.levels(levels) for distribution in distributions]
    size = math.prod(len(axis) for axis in axes)
    if size > MAX_POINTS:
        message = f"the full grid has {size:,} points, more than {MAX_POINTS:,}"
        raise InputError.at(where, message, "lower the levels, or take lhs")
    return itertools.product(*axes)


def halton(distributions: Sequence[Distribution], seed: int) -> Iterator[Point]:
    """Return points of a scrambled Halton sequence, without an end; see :func:`halton_points`."""
    return _points_at(distributions, halton_points(len(distributions), seed))


def halton_points(dimensions: int, seed: int) -> Iterator[Point]:
    """Return points in the unit cube [0, 1) of a scrambled Halton sequence, without an end.

    Halton, J. H.: On the efficiency of certain quasi-random sequences of points, Numerische
    Mathematik 2 (1960); the digits are permuted after Owen, A randomized Halton algorithm in R
    (2017). The points are those of :class:`scipy.stats.qmc.Halton` with the same generator.
    """
    rng = _generator(seed)
    digits = [_permuted_digits(base, rng) for base in _primes(dimensions)]
    for first in itertools.count(0, _BLOCK):
        numbers = np.arange(first, first + _BLOCK)
        axes = [_radical_inverse(numbers, permutations) for permutations in digits]
        yield from map(tuple, np.column_stack(axes).tolist())


def latin_hypercube(distributions: Sequence[Distribution], n: int, seed: int) -> Iterator[Point]:
    """Return ``n`` points with one in each of ``n`` equally likely slices of every draw.

    McKay, Beckman, Conover: A comparison of three methods for selecting values of input variables
    in the analysis of output from a computer code, Technometrics 21 (1979). The points are those
    of :class:`scipy.stats.qmc.LatinHypercube` with the same generator.
    """
    rng = _generator(seed)
    within = rng.uniform(size=(n, len(distributions)))
    slices = np.tile(np.arange(1, n + 1), (len(distributions), 1))
    for axis in slices:
        rng.shuffle(axis)
    return _points_at(distributions, ((slices.T - within) / n).tolist())


def _points_at(
    distributions: Sequence[Distribution], quantiles: Iterable[Sequence[float]]
) -> Iterator[Point]:
    for row in quantiles:
        yield tuple(d.at(share) for d, share in zip(distributions, row, strict=True))


def _generator(seed: int) -> np.random.Generator:
    # A child of the seed's sequence, as scipy has it: what was drawn before is drawn again.
    return np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])


def _primes(n: int) -> list[int]:
    """Return the first ``n`` prime numbers."""
    found: list[int] = []
    for number in itertools.count(2):
        if len(found) == n:
            return found
        if all(number % prime for prime in found):
            found.append(number)
    raise AssertionError("there is always another prime")


def _permuted_digits(base: int, rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """Return what stands for each digit at each place, (places, base)."""
    # As many places as a float has bits for.
    places = math.ceil(54 / math.log2(base)) - 1
    permutations = np.tile(np.arange(base), (places, 1))
    for permutation in permutations:
        rng.shuffle(permutation)
    return permutations


def _radical_inverse(
    numbers: npt.NDArray[np.int64], permutations: npt.NDArray[np.int64]
) -> npt.NDArray[np.float64]:
    """Return numbers with their digits, permuted, mirrored at the point: between 0 and 1."""
    base = permutations.shape[1]
    mirrored, weight = np.zeros(len(numbers)), 1.0 / base
    for digits in permutations:
        numbers, last = np.divmod(numbers, base)
        mirrored += digits[last] * weight
        weight /= base
    return mirrored
