"""Memory of the process of a run: S1 of the published experiment, and twenty runs in one process.

A process of its own each time, warm as the fork server of a worker is. What counts is what a run
needs for itself (USS: pages nobody shares); RSS also has the pages of the interpreter, libraries
and machine code, which the processes of all runs share.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks.measurement import Measurement, Reference, at_most

TIMES = 20
MOST_GROWTH = 1.05
"""Of the memory after two runs: malloc may keep some more for later."""
ROOT = Path(__file__).parents[2]


def own_memory() -> tuple[float, float]:
    """USS and RSS of this process [MB]."""
    pages = {
        line.split(":")[0]: float(line.split()[1]) / 1e3
        for line in Path("/proc/self/smaps_rollup").read_text().splitlines()[1:]
    }
    return pages["Private_Clean"] + pages["Private_Dirty"], pages["Rss"]


def peak() -> float:
    """The most RSS this process has had [MB]."""
    status = Path("/proc/self/status").read_text()
    return float(status.split("VmHWM:")[1].split()[0]) / 1e3


def tell(name: str, times: int) -> None:
    """Print as JSON what memory a child of a warm process has: before runs, and after each."""
    from daemon.run import execute, warm_up
    from tests.benchmarks.case_process import load

    warm_up()
    spec, scene = load(name)
    if os.fork():
        os.wait()
        return
    found = [(*own_memory(), peak())]
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(times):
            execute(spec, scene, trace_path=Path(folder) / "run.mcap")
            found.append((*own_memory(), peak()))
    print(json.dumps(found), flush=True)
    os._exit(0)


def told(name: str, times: int) -> list[tuple[float, float, float]]:
    """What :func:`tell` says of a process of its own: USS, RSS and peak of RSS [MB]."""
    program = f"from {__name__} import tell; tell({name!r}, {times})"
    said = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
    )
    found: list[tuple[float, float, float]] = json.loads(said.stdout)
    return found


def measure() -> Iterator[Measurement]:
    """The run that needs most, then many short ones in one process."""
    (before, _, _), (uss, rss, most) = told("s1", 1)
    yield Measurement(
        "S1, a2s: its process, most RSS", most, "MB", Reference("USS at the end", uss),
        (at_most(220.0),), f"RSS at the end {rss:.0f} MB, USS before {before:.0f} MB",
    )  # fmt: skip
    _, _, (_, second, _), *_, (uss, last, _) = told("rude-house", TIMES)
    yield Measurement(
        f"{TIMES} runs of the demo in one process, RSS", last, "MB",
        Reference("after the second", second), (at_most(MOST_GROWTH, of_ratio=True),),
        f"USS at the end {uss:.0f} MB",
    )  # fmt: skip
