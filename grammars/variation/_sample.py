"""Sampling: from a variation to plans that fulfil all requirements."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Final, TypeAlias

import numpy as np

from grammars.text.diagnostics import Finding, InputError, Severity, Where
from grammars.variation._load import Variant, Variation
from grammars.variation._soundness import flaws_of
from grammars.variation._variants import Rejections, VariantBuilder
from grammars.variation.designs import Method, grid, halton_points, latin_hypercubes, points_at

LAST_SEED: Final = 2**32 - 1


def sample(
    variation: Variation,
    n: int | None = None,
    *,
    seed: int,
    method: Method = "random",
    levels: int = 3,
    tries: int = 200,
    check: float | None = None,
    suffix: bool = False,
) -> tuple[Variant, ...]:
    """Return variants of a plan; variant ``k`` has the seed ``seed + k``.

    ``random`` draws all distributions in file order from ``numpy.random.RandomState(seed + k)``,
    like the published tool, so a variant depends only on its own seed. The other methods are
    designs over all variants; ``seed`` scrambles ``halton`` and ``lhs``. ``grid`` combines
    ``levels`` values per range or normal distribution and all listed values; there ``n`` is only
    an upper bound.

    After a rejected point (a ``require`` does not hold, the plan does not compile or is unsound)
    the next one is tried, at most ``tries`` for one variant; a grid tries all its points.

    ``check`` is the radius [m] of a robot that must reach all spaces of a sound plan; ``None``
    skips the check of soundness. ``suffix`` writes the seed into the name of the plan.

    Raises :class:`InputError` if no point fulfils the requirements (with the number of rejections
    for each reason), or if a design has more than ``n`` points; :class:`ValueError` for seeds out
    of range.
    """
    if not 0 <= seed <= LAST_SEED - (n or 1) + 1:
        raise ValueError(f"seeds are between 0 and {LAST_SEED}")
    builder = VariantBuilder(variation, method, seed, check, suffix)
    if method == "grid":
        return _grid_variants(builder, n, levels)
    assert n is not None
    if method == "random":
        streams = [_random_points(variation, seed + k) for k in range(n)]
    else:
        streams = [_design(variation, method, n, seed)] * n
    return tuple(_variant(builder, stream, tries) for stream in streams)


def source_defects(variation: Variation, radius: float) -> tuple[Finding, ...]:
    """Return warnings about flaws of the plan itself, which variants may keep."""
    return tuple(
        Finding(flaw.where, flaw.message, "its variants may keep this", Severity.WARNING)
        for flaw in flaws_of(variation.source, radius)
        if flaw.extent > flaw.slack
    )


_SeededPoint: TypeAlias = tuple[int, Sequence[float]]


def _random_points(variation: Variation, seed: int) -> Iterator[_SeededPoint]:
    """Yield random points from the stream of a seed, all with this seed."""
    # After a rejection, draw from the same stream, so that a variant does not depend on rejections
    # of other variants.
    stream = np.random.RandomState(seed)
    while True:
        yield seed, [draw.distribution.draw(stream) for draw in variation.draws]


def _design(variation: Variation, method: Method, n: int, seed: int) -> Iterator[_SeededPoint]:
    """Return the points of a space-filling design; point ``k`` has the seed ``seed + k``."""
    distributions = [draw.distribution for draw in variation.draws]
    quantiles = (
        halton_points(len(distributions), seed)
        if method == "halton"
        else latin_hypercubes(len(distributions), n, seed)
    )
    # Rejected points keep their number, so that new requirements do not rename other variants.
    return zip(itertools.count(seed), points_at(distributions, quantiles))


def _variant(builder: VariantBuilder, points: Iterator[_SeededPoint], tries: int) -> Variant:
    """Return the variant of the first accepted point."""
    rejections = Rejections()
    seed = 0
    for attempt, (seed, point) in enumerate(itertools.islice(points, tries), start=1):
        variant = builder.variant(point, seed, rejections, attempt)
        if variant is not None:
            return variant
    message = f"seed {seed}: none of {tries} draws fulfils all requirements"
    raise rejections.error(_top(builder.variation), message)


def _grid_variants(builder: VariantBuilder, n: int | None, levels: int) -> tuple[Variant, ...]:
    """Return the variants of all accepted points of a grid."""
    where = _top(builder.variation)
    rejections = Rejections()
    variants: list[Variant] = []
    distributions = [draw.distribution for draw in builder.variation.draws]
    for seed, point in enumerate(grid(distributions, levels, where), start=builder.seed):
        variant = builder.variant(point, seed, rejections)
        if variant is not None:
            variants.append(variant)
        if n is not None and len(variants) > n:
            message = f"the grid has more than {n} variants"
            hint = "allow more, lower the levels, or use random, halton or lhs"
            raise InputError.at(where, message, hint)
    if not variants:
        raise rejections.error(where, "no point of the grid fulfils all requirements")
    return tuple(variants)


def _top(variation: Variation) -> Where:
    return Where(variation.file, 1, 1)
