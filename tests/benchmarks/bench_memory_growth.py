"""Memory of one process that executes S1 of the published experiment again and again."""

from tests.benchmarks.bench_memory import growth

LONG = "eight runs of S1"
TIMES = 8


def measure():
    """Beside what it has after two."""
    yield growth("S1", "s1", TIMES)
