"""What things cost: ``make bench``, or ``python -m tests.benchmarks run trace`` for some.

Each benchmark is a module ``bench_*`` with ``measure()``, which yields measurements
(:mod:`tests.benchmarks.measurement`). They are printed as they are made, and at the end the table
goal / measured / met of those that have goals. Nothing is asserted: times belong to the machine.
One that fails says how, the others go on, and the exit status is 1. Modules with ``LONG``, the
reason, are left out unless they are named. How to read it all is in ``docs/measuring.md``.
"""

import importlib
import os
import platform
import sys
import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, beside_yardstick, yardstick
from tests.benchmarks.printing import make_console, print_goals, print_line, print_parts

COMMANDS = ("against", "campaign")
"""Modules with a command line of their own: ``main(arguments)`` yields measurements."""


@dataclass(slots=True)
class Made:
    """Results of the parts so far: measurements with the benchmark's name, seconds, failures."""

    console: Console = field(default_factory=make_console)
    measurements: list[tuple[str, Measurement]] = field(default_factory=list)
    parts: list[tuple[str, float]] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    def add(self, name, title, measure):
        """Print what is measured as it comes, and keep it."""
        start = time.monotonic()
        print(f"\n== {title}", flush=True)
        try:
            for each in measure():
                one = beside_yardstick(each, yardstick())
                progress.clear()
                print_line(self.console, one)
                self.measurements.append((name, one))
        except Exception:
            progress.clear()
            traceback.print_exc()
            self.failed.append(name)
        progress.clear()
        self.parts.append((name, time.monotonic() - start))
        print(f"-- {self.parts[-1][1]:.0f} s", flush=True)


def benchmarks():
    """The names of all benchmarks."""
    return sorted(p.stem.removeprefix("bench_") for p in Path(__file__).parent.glob("bench_*.py"))


def load(name):
    return importlib.import_module(f"tests.benchmarks.bench_{name}")


def main(arguments):
    print(
        f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, "
        f"Python {platform.python_version()}"
    )
    made = Made()
    if arguments and arguments[0] in COMMANDS:
        module = importlib.import_module(f"tests.benchmarks.{arguments[0]}")
        made.add(arguments[0], arguments[0], lambda: module.main(arguments[1:]))
    else:
        names = chosen(arguments)
        for k, name in enumerate(names, 1):
            made.add(name, f"{name} ({k} of {len(names)})", lambda name=name: load(name).measure())
    print_goals(made.console, made.measurements)
    print_parts(made.console, made.parts)
    if made.failed:
        sys.exit(f"failed, see above: {', '.join(made.failed)}")


def chosen(names):
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


if __name__ == "__main__":
    main(sys.argv[1:])
