"""Delta debugging: from what fails to the least that still fails.

Zeller and Hildebrandt 2002, "Simplifying and isolating failure-inducing input". Written here and
not taken from a package: the ones on PyPI (picire, ddmin) have not been released since 2021 and
2019, and run tests in their own processes; here whoever asks decides what runs at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Final, TypeAlias, TypeVar

T = TypeVar("T")
PATIENCE: Final = 4
"""So many items are stepped over one by one when looking for a flip."""
FirstFailing: TypeAlias = Callable[[Sequence[tuple[T, ...]]], int | None]
"""Returns the index of the first configuration that fails, or ``None`` when none does."""


def ddmin(items: Sequence[T], first_failing: FirstFailing[T]) -> Iterator[tuple[T, ...]]:
    """Yield ever smaller configurations that fail, the last one 1-minimal.

    ``items`` as a whole must fail. A configuration keeps the order of ``items``; it is 1-minimal
    when it fails and does not with any single item taken away. What neither passes nor fails
    counts as not failing. Nothing is yielded when nothing can be taken away.
    """
    current, parts = tuple(items), 2
    if current and first_failing([()]) == 0:
        yield ()
        return
    while len(current) > 1:
        chunks = split(current, parts)
        complements = [_without(current, chunk) for chunk in chunks] if parts > 2 else []
        tried = [*chunks, *complements]
        hit = first_failing(tried)
        if hit is not None:
            current = tried[hit]
            parts = 2 if hit < len(chunks) else max(parts - 1, 2)
            yield current
        elif parts == len(current):
            return
        else:
            parts = min(2 * parts, len(current))


def split(items: Sequence[T], parts: int) -> list[tuple[T, ...]]:
    """Return ``items`` in ``parts`` runs of nearly equal length, none of them empty."""
    bounds = [index * len(items) // parts for index in range(parts + 1)]
    return [tuple(items[low:high]) for low, high in pairwise(bounds)]


def _without(items: tuple[T, ...], chunk: tuple[T, ...]) -> tuple[T, ...]:
    start = items.index(chunk[0])
    return items[:start] + items[start + len(chunk) :]


def flip(items: Sequence[T], first_failing: FirstFailing[T]) -> int:
    """Return the index of an item that makes the items before it fail when it is added.

    All ``items`` together must fail, none of them must not. Where several do, it is the last of
    them if that is among the last few items, else one near the end: steps backwards, at first one
    by one, grow until something does not fail, then the gap is halved.
    """
    low, high, probes = 0, len(items), 0

    def fails(count: int) -> bool:
        return first_failing([tuple(items[:count])]) == 0

    while (probe := high - 2 ** max(0, probes - PATIENCE + 1)) > low:
        if not fails(probe):
            low = probe
            break
        high, probes = probe, probes + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if fails(middle) else (middle, high)
    return high - 1
