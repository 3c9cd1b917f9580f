"""What things cost: ``make bench``, or ``python -m tests.benchmarks run trace`` for some.

Each benchmark is a module ``bench_*`` with ``measure()``, which yields measurements
(:mod:`tests.benchmarks.measurement`). They are printed as they are made, and at the end the table
goal / measured / met of those that have goals. Nothing is asserted: times belong to the machine.
Modules with ``LONG``, the reason, are left out unless they are named. How to read it all is in
``docs/measuring.md``.
"""

from __future__ import annotations

import importlib
import os
import platform
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType

from tests.benchmarks.measurement import Measurement, beside_yardstick, goal_table, line, yardstick

COMMANDS = ("against", "campaign", "flame")
"""Modules with a command line of their own: ``main(arguments)`` yields measurements."""


def benchmarks() -> list[str]:
    """The names of all benchmarks."""
    return sorted(p.stem.removeprefix("bench_") for p in Path(__file__).parent.glob("bench_*.py"))


def load(name: str) -> ModuleType:
    return importlib.import_module(f"tests.benchmarks.bench_{name}")


def main(arguments: list[str]) -> None:
    print(
        f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, "
        f"Python {platform.python_version()}"
    )
    if arguments and arguments[0] in COMMANDS:
        module = importlib.import_module(f"tests.benchmarks.{arguments[0]}")
        made = printed(arguments[0], lambda: module.main(arguments[1:]))
    else:
        made = [each for name in chosen(arguments) for each in measured(name)]
    print()
    for row in goal_table(made):
        print(row)


def chosen(names: list[str]) -> list[str]:
    """The benchmarks of these names; without any, all that are not long."""
    known = benchmarks()
    unknown = [name for name in names if name not in known]
    if unknown:
        there = ", ".join((*known, *COMMANDS))
        sys.exit(f"no benchmark {', '.join(unknown)}; there are: {there}")
    if names:
        return names
    long = {name: load(name).LONG for name in known if hasattr(load(name), "LONG")}
    for name, why in long.items():
        print(f"left out, to be named: {name} ({why})")
    return [name for name in known if name not in long]


def measured(name: str) -> list[tuple[str, Measurement]]:
    return printed(name, load(name).measure)


def printed(
    name: str, measure: Callable[[], Iterable[Measurement]]
) -> list[tuple[str, Measurement]]:
    """Print what is measured as it comes, and return it with the name of the benchmark."""
    made, start = [], time.monotonic()
    print(f"\n== {name}", flush=True)
    for each in measure():
        one = beside_yardstick(each, yardstick())
        print(line(one), flush=True)
        made.append((name, one))
    print(f"-- {time.monotonic() - start:.0f} s", flush=True)
    return made


if __name__ == "__main__":
    main(sys.argv[1:])
