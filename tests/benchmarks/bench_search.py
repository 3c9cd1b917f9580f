"""What a proposal of a search costs: goal 50 ms, whatever has been learnt before.

A function stands for the runs, of twelve parameters, with a plateau and a narrow region that fails.
The reference is a point of the even sequence, which looks at no result, in the same process.
"""

import math
import statistics

from daemon.search.methods import SearchMethod
from daemon.search.space import SearchSpace
from tests.analysis.search.tasks import make_task, ranged
from tests.benchmarks.measurement import Measurement, Reference, at_most, microseconds

SIZES = (60, 500, 2000)
LAST = 20
"""Proposals of which the median is told, the last ones."""
GOAL = at_most(50.0)


def task(method, runs):
    """Return a search of twelve times of doors, or of two for the boundary."""
    count = 2 if method == "boundary" else 12
    parameters = (ranged(f"p{k}", 5.0, 7.0, written=6.0) for k in range(count))
    return make_task(*parameters, method=method, runs=runs)


def margin(point):
    """Fail near one place of the space, and be the same far away from it."""
    place = [float(value) for value in point[:4]]
    return min(0.105, 0.12 * math.dist(place, (6.5,) * len(place)) - 0.045)


def proposals(method, runs):
    """Return the time of one of the last proposals, and of all together [ms]."""
    asked = task(method, runs)
    made, points, took = SearchMethod(asked, SearchSpace(asked)), [], []
    for n in range(runs):
        if n >= asked.window:
            made.learn(margin(points[n - asked.window]))
        took.append(microseconds(lambda: points.append(made.propose().values)) / 1e3)
    return statistics.median(took[-LAST:]), sum(took)


def measure():
    """Yield the CPU time of a proposal after 60, 500 and 2 000 runs."""
    proposals("tpe", 20)  # optuna is imported once a process
    for runs in SIZES:
        even = Reference("halton", proposals("halton", runs)[0])
        for method in ("tpe", "cma", "boundary"):
            one, total = proposals(method, runs)
            name, note = f"a proposal of {method} after {runs} runs", f"all {total / 1e3:.1f} s"
            yield Measurement(name, one, "CPU ms", even, (GOAL,), note)
