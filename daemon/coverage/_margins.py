"""How far from their limits the runs of a campaign were, oracle by oracle."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final

from daemon.coverage._types import MarginHistogram
from daemon.verdict import Outcome, Verdict

BINS: Final = 12
"""At most so many bins."""
_BLOCKS: Final = "▁▂▃▄▅▆▇█"


def margin_histograms(verdicts: Iterable[Verdict]) -> tuple[MarginHistogram, ...]:
    """Return one histogram per oracle and unit, in the order they come; measures have none."""
    judged: dict[tuple[str, str], list[Verdict]] = {}
    for verdict in verdicts:
        if verdict.outcome is not Outcome.MEASURE:
            judged.setdefault((verdict.oracle, verdict.unit), []).append(verdict)
    # A verdict in error has no unit; it belongs to the oracle's other verdicts.
    units = {name: unit for name, unit in judged if unit}
    merged: dict[str, list[Verdict]] = {}
    for (name, _), found in judged.items():
        merged.setdefault(name, []).extend(found)
    return tuple(_histogram(name, units.get(name, ""), found) for name, found in merged.items())


def _histogram(name: str, unit: str, verdicts: Sequence[Verdict]) -> MarginHistogram:
    decided = [v for v in verdicts if v.outcome in (Outcome.PASS, Outcome.FAIL)]
    margins = [v.margin for v in decided]
    known = [m for m in margins if m is not None and math.isfinite(m)]
    edges = bin_edges(known)
    passed = sum(v.outcome is Outcome.PASS for v in decided)
    return MarginHistogram(
        oracle=name,
        unit=unit,
        edges=edges,
        counts=_counts(known, edges),
        passed=passed,
        failed=len(decided) - passed,
        undecided=len(verdicts) - len(decided),
        unbounded=len(decided) - len(known),
        least=min(known, default=None),
        greatest=max(known, default=None),
    )


def bin_edges(values: Sequence[float]) -> tuple[float, ...]:
    """Return edges of equal bins of a round width that hold all values; zero is one of them."""
    if not values:
        return ()
    low, high = min(0.0, *values), max(0.0, *values)
    width = _round_width((high - low) / (BINS - 2)) if high > low else 1.0
    first, last = math.floor(low / width), math.floor(high / width) + 1
    # Division rounds: a value may lie on the edge it is divided by, or just beyond it.
    first -= _edge(first, width) > low
    last += _edge(last, width) <= high
    return tuple(_edge(index, width) for index in range(first, last + 1))


def _edge(index: int, width: float) -> float:
    """Return an edge as people would write it: 0.3, not 0.30000000000000004."""
    return float(f"{index * width:.12g}")


def _round_width(least: float) -> float:
    """Return the smallest of 1, 2 and 5 times a power of ten that is not below ``least``."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= least)


def _counts(values: Sequence[float], edges: Sequence[float]) -> tuple[int, ...]:
    return tuple(sum(low <= value < high for value in values) for low, high in pairwise(edges))


def bars(histogram: MarginHistogram) -> str:
    """Return a histogram as one line of text; a bar stands at zero, where fail and pass part."""
    most = max(histogram.counts, default=0)
    line = ""
    for edge, count in zip(histogram.edges, (*histogram.counts, None), strict=False):
        line += "|" if edge == 0.0 else ""
        if count is not None:
            line += _BLOCKS[(len(_BLOCKS) - 1) * count // most] if count else "·"
    return line
