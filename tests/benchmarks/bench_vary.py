"""A hundred sampled plans, written and checked, against the goal of ten seconds.

Plans are parsed again from their text, checked
for soundness and written; the reference data's kitchen is used when ``SCENARIO_REFERENCE_DATA`` is
set, the demo's flat otherwise (and besides).
"""

import os
import tempfile
import time
from pathlib import Path

from grammars.variation import load_variation, sample, write_variants
from tests.benchmarks.measurement import Measurement, Reference, at_most

COUNT = 100
RADIUS = 0.3


def files():
    """Return the variations there are to measure."""
    found = [Path(__file__).parents[2] / "campaigns" / "demo" / "flat.variation"]
    data = os.environ.get("SCENARIO_REFERENCE_DATA")
    if data:
        found.append(Path(data) / "floorplans" / "kitchen.variation")
    return found


def sampled(path, method, check):
    """Return seconds from file to files, plans written and plans tried."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        variants = sample(load_variation(path), COUNT, seed=0, method=method, check=check)
        written = write_variants(variants, folder)
        took = time.perf_counter() - start
    return took, len(written), sum(variant.tries for variant in variants)


def measure():
    """Yield the seconds for a hundred plans; sampled without a check they are the reference."""
    for path in files():
        # Grammars are compiled and geometry libraries loaded once per process.
        sample(load_variation(path), 1, seed=0, check=RADIUS)
        ways = (
            ("random", None), ("random", RADIUS), ("lhs", None)
        )  # fmt: skip
        beside = None
        for method, check in ways:
            took, plans, tried = sampled(path, method, check)
            how = f"{method}, sound for {check} m" if check else method
            note = f"{plans} plans of {tried} draws, {1e3 * took / tried:.1f} ms per draw"
            goals = (at_most(10.0),) if check else ()
            yield Measurement(f"{path.stem}: {how}", took, "s", beside, goals, note)
            beside = beside or Reference("random", took)
