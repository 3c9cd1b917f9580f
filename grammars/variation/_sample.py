"""Sampling: from a variation to plans that hold everything required of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from grammars.floorplan import FloorPlan
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where
from grammars.variation._load import Variant, Variation
from grammars.variation._soundness import defects
from grammars.variation._variants import Rejections, VariantBuilder
from grammars.variation.designs import (
    MAX_POINTS,
    METHODS,
    Method,
    Point,
    grid,
    halton,
    latin_hypercube,
)

LAST_SEED: Final = 2**32 - 1
_MISSES_PER_TRY: Final = 20


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

    ``random`` draws every distribution in file order from
    ``numpy.random.RandomState(seed + k)``, as the published tool does. When a draw is rejected
    (a ``require`` does not hold, the plan cannot be compiled or is unsound) the next one is taken
    from the same stream, at most ``tries`` times, so a variant depends on its own seed only.

    The other methods are designs over all variants; ``seed`` scrambles ``halton`` and ``lhs``.
    ``grid`` takes every combination of ``levels`` values per range or normal distribution and of
    all listed values; there ``n`` is only an upper bound. Rejected points of ``grid`` and ``lhs``
    are left out, ``halton`` goes on to the next point.

    ``check`` is the radius [m] of a robot that must reach every space of a sound plan; ``None``
    leaves soundness unchecked. ``suffix`` writes the seed into the plan's name.

    Raises :class:`InputError` when nothing fulfils the requirements, saying which of them
    rejected how often, or when a design has more than ``n`` points; :class:`ValueError` for
    arguments out of range.
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}")
    if n is None and method != "grid":
        raise ValueError(f"{method} needs a number of variants")
    if n is not None and not 1 <= n <= MAX_POINTS:
        raise ValueError(f"the number of variants is between 1 and {MAX_POINTS}")
    if not 1 <= levels <= 100 or not 1 <= tries <= 1_000_000:
        raise ValueError("levels are between 1 and 100, tries between 1 and 1000000")
    if check is not None and not 0.0 < check < math.inf:
        raise ValueError("the radius must be positive")
    if not 0 <= seed <= LAST_SEED - (n or 1) + 1:
        raise ValueError(f"seeds are between 0 and {LAST_SEED}")
    trials = VariantBuilder(variation, method, seed, check, suffix)
    if method == "random":
        assert n is not None
        return tuple(_random_variant(trials, seed + k, tries) for k in range(n))
    return _design_variants(trials, method, n, levels, tries)


def variant_plans(
    variation: Variation,
    n: int | None = None,
    *,
    seed: int,
    method: Method = "random",
    check: float | None = None,
) -> tuple[tuple[str, FloorPlan], ...]:
    """Return the variants of a variation as compiled plans, each named ``<plan>_<seed>``.

    For campaigns: nothing is written, and every plan carries its own name. Raises
    :class:`InputError` like :func:`sample`.
    """
    variants = sample(variation, n, seed=seed, method=method, check=check, suffix=True)
    return tuple((variant.name, variant.plan) for variant in variants)


def source_defects(variation: Variation, radius: float) -> tuple[Diagnostic, ...]:
    """Return as warnings what is unsound in the plan itself; variants may keep it."""
    return tuple(
        Diagnostic(d.where, d.message, "its variants may keep this", Severity.WARNING)
        for d in defects(variation.source, radius).values()
        if d.extent > d.slack
    )


def _random_variant(trials: VariantBuilder, seed: int, tries: int) -> Variant:
    """Return the first variant of a seed's stream that nothing rejects."""
    # Rejected draws go on in the stream of their seed: no variant depends on how many of the others
    # were rejected, so any of them can be drawn alone.
    stream = np.random.RandomState(seed)
    rejected = Rejections()
    for attempt in range(1, tries + 1):
        point = [draw.distribution.draw(stream) for draw in trials.variation.draws]
        variant = trials.variant(point, seed, rejected, attempt)
        if variant is not None:
            return variant
    message = f"seed {seed}: none of {tries} draws fulfils everything required"
    raise rejected.error(Where(trials.variation.file, 1, 1), message)


def _design_variants(
    trials: VariantBuilder, method: Method, n: int | None, levels: int, tries: int
) -> tuple[Variant, ...]:
    """Return the variants of a design; point ``k`` has the seed ``seed + k``, rejected or not."""
    where = Where(trials.variation.file, 1, 1)
    rejected = Rejections()
    wanted = n if method == "halton" else None
    found: list[Variant] = []
    seen, missed = 0, 0
    for k, point in enumerate(_points(trials, method, n, levels, tries)):
        seen = k + 1
        # Rejected points keep their number: a requirement more leaves the others their names.
        variant = trials.variant(point, trials.seed + k, rejected)
        found.extend([] if variant is None else [variant])
        missed = 0 if variant is not None else missed + 1
        if wanted is not None and missed > _MISSES_PER_TRY * tries:
            break
        if wanted is not None and len(found) == wanted:
            return tuple(found)
        if n is not None and len(found) > n:
            message = f"the {method} design has more than {n} variants"
            hint = "allow more, lower the levels, or take random, halton or lhs"
            raise InputError.at(where, message, hint)
    if not found or wanted is not None:
        short = f"{len(found)} of {seen} points fulfil" if seen else "no point fulfils"
        raise rejected.error(where, f"{method} design: {short} everything required")
    return tuple(found)


def _points(
    trials: VariantBuilder, method: Method, n: int | None, levels: int, tries: int
) -> Iterator[Point]:
    where = Where(trials.variation.file, 1, 1)
    distributions = [draw.distribution for draw in trials.variation.draws]
    if method == "grid":
        return grid(distributions, levels, where)
    assert n is not None
    if method == "lhs":
        return latin_hypercube(distributions, n, trials.seed)
    return itertools.islice(halton(distributions, trials.seed), n * tries)
