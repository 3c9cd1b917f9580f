"""Memory of the process of a run: S1 of the published experiment, and many runs in one process.

A process of its own each time, warm as the fork server of a worker is, from which a child is forked
that frees memory as the process of a run does. RSS is all it has in memory; PSS counts a page that
several share in parts, USS not at all.
"""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.benchmarks.measurement import Measurement, Reference, at_most

TIMES = 20
MOST_GROWTH = 1.05
"""Of the memory after two runs: malloc may keep some more for later."""
ROOT = Path(__file__).parents[2]


class Memory(NamedTuple):
    """What a process has in memory [MB]; ``peak`` is the most RSS it has had."""

    rss: float
    pss: float
    uss: float
    peak: float


def own_memory() -> Memory:
    """The memory of this process."""
    pages = {
        line.split(":")[0]: float(line.split()[1]) / 1e3
        for line in Path("/proc/self/smaps_rollup").read_text().splitlines()[1:]
    }
    own = pages["Private_Clean"] + pages["Private_Dirty"]
    return Memory(pages["Rss"], pages["Pss"], own, peak())


def peak() -> float:
    """The most RSS this process has had [MB]."""
    status = Path("/proc/self/status").read_text()
    return float(status.split("VmHWM:")[1].split()[0]) / 1e3


def tell(name: str, times: int) -> None:
    """Print as JSON what memory a child of a warm process has: before runs, and after each."""
    from daemon.batch.freed_memory import return_freed_memory
    from daemon.run import execute, warm_up
    from tests.benchmarks.case_process import load

    warm_up()
    spec, scene = load(name)
    gc.collect()
    gc.freeze()
    if os.fork():
        os.wait()
        return
    return_freed_memory()
    found = [own_memory()]
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(times):
            execute(spec, scene, trace_path=Path(folder) / "run.mcap")
            found.append(own_memory())
    print(json.dumps(found), flush=True)
    os._exit(0)


def told(name: str, times: int) -> list[Memory]:
    """What :func:`tell` says of a process of its own."""
    program = f"from {__name__} import tell; tell({name!r}, {times})"
    said = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
    )
    return [Memory(*each) for each in json.loads(said.stdout)]


def measure() -> Iterator[Measurement]:
    """A child's one run, then many runs in one process: short ones, and those that need most."""
    for what, name, goals in (
        ("the demo", "rude-house", ()),
        ("S1, a2s", "s1", (at_most(220.0),)),
    ):
        before, after = told(name, 1)
        yield Measurement(
            f"{what}: a child's run, most RSS", after.peak, "MB",
            Reference("RSS before", before.rss), goals,
            f"at the end RSS {after.rss:.0f}, PSS {after.pss:.0f}, USS {after.uss:.0f} MB",
        )  # fmt: skip
    yield growth("the demo", "rude-house", TIMES)


def growth(what: str, name: str, times: int) -> Measurement:
    """What a process has in memory after ``times`` runs, beside what it has after two."""
    _, _, second, *_, last = told(name, times)
    return Measurement(
        f"{times} runs of {what} in one process, RSS", last.rss, "MB",
        Reference("after the second", second.rss), (at_most(MOST_GROWTH, of_ratio=True),),
        f"PSS {last.pss:.0f}, USS {last.uss:.0f} MB, most RSS {last.peak:.0f} MB",
    )  # fmt: skip
