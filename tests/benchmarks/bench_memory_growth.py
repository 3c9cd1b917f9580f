"""Memory of one process that executes S1 of the published experiment again and again."""

from __future__ import annotations

from collections.abc import Iterator

from tests.benchmarks.bench_memory import growth
from tests.benchmarks.measurement import Measurement

LONG = "eight runs of S1"
TIMES = 8


def measure() -> Iterator[Measurement]:
    """Beside what it has after two."""
    yield growth("S1", "s1", TIMES)
