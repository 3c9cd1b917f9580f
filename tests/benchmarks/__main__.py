"""Run every benchmark: ``make bench``, or ``python -m tests.benchmarks run trace`` for some.

Each one prints a small table of what it measured here and now, ratios taken side by side in one
process. Nothing is asserted: times belong to the machine, not to the project.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path


def main(names: list[str]) -> None:
    folder = Path(__file__).parent
    known = sorted(p.stem.removeprefix("bench_") for p in folder.glob("bench_*.py"))
    unknown = [name for name in names if name not in known]
    if unknown:
        sys.exit(f"no benchmark {', '.join(unknown)}; there are: {', '.join(known)}")
    for name in names or known:
        print(f"\n== {name}", flush=True)
        importlib.import_module(f"tests.benchmarks.bench_{name}").main()


if __name__ == "__main__":
    main(sys.argv[1:])
