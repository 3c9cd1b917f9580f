"""A hundred sampled plans, written and checked, against the goal of ten seconds.

Run with ``python -m tests.benchmarks.bench_vary``. Plans are parsed again from their text, checked
for soundness and written; the reference data's kitchen is used when ``SCENARIO_REFERENCE_DATA`` is
set, the demo's flat otherwise (and besides).
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

from grammars.variation import Method, load_variation, sample, write_variants

COUNT = 100
RADIUS = 0.3


def files() -> list[Path]:
    """Return the variations there are to measure."""
    found = [Path(__file__).parents[2] / "campaigns" / "demo" / "flat.variation"]
    data = os.environ.get("SCENARIO_REFERENCE_DATA")
    if data:
        found.append(Path(data) / "floorplans" / "kitchen.variation")
    return found


def measure(path: Path, method: Method, check: float | None) -> tuple[float, int, int]:
    """Return seconds from file to files, plans written and plans tried."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        variants = sample(load_variation(path), COUNT, seed=0, method=method, check=check)
        written = write_variants(variants, folder)
        took = time.perf_counter() - start
    return took, len(written), sum(variant.tries for variant in variants)


def main() -> None:
    for path in files():
        # Grammars are compiled and geometry libraries loaded once per process.
        sample(load_variation(path), 1, seed=0, check=RADIUS)
        for method, check in (("random", None), ("random", RADIUS), ("lhs", None)):
            took, plans, tried = measure(path, method, check)
            how = f"{method}, sound for {check} m" if check else method
            print(
                f"{path.stem:10} {how:26} {plans:4d} plans of {tried:4d} draws"
                f"  {took:6.2f} s  {1e3 * took / tried:6.1f} ms per draw"
            )


if __name__ == "__main__":
    main()
