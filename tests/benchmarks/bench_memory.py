"""Memory of the process of a run: S1 of the published experiment, and many runs in one process.

One run is executed by a child of a worker's zygote, as every run is; many by a child of a
process that is as warm as that. RSS is all that a process has in memory, with what it shares with
the zygote; PSS counts a page that several share in parts, USS not at all.
"""

import gc
import json
import os
import subprocess
import sys
import tempfile
from multiprocessing.connection import wait
from pathlib import Path
from typing import NamedTuple

from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference, at_most

MOST_GROWTH = 1.05
"""Of the memory after two runs: malloc may keep some more for later."""
ROOT = Path(__file__).parents[2]
CASE = "SCENARIO_BENCH_CASE"
"""The variable that tells the zygote which rooms the run enters."""
FOUND = "memory.json"
"""Lies in the folder of an attempt when the run is over."""


class Memory(NamedTuple):
    """What a process has in memory [MB]; ``peak`` is the most RSS it has had."""

    rss: float
    pss: float
    uss: float
    peak: float


def own_memory():
    """The memory of this process."""
    pages = {
        line.split(":")[0]: float(line.split()[1]) / 1e3
        for line in Path("/proc/self/smaps_rollup").read_text().splitlines()[1:]
    }
    own = pages["Private_Clean"] + pages["Private_Dirty"]
    return Memory(pages["Rss"], pages["Pss"], own, peak())


def peak():
    """The most RSS this process has had [MB]."""
    status = Path("/proc/self/status").read_text()
    return float(status.split("VmHWM:")[1].split()[0]) / 1e3


def warm_up():
    """Load what the run needs; called by the zygote alone."""
    from daemon.run import load_kernels, warm_up
    from tests.benchmarks.case_process import load

    warm_up()
    load_kernels(*load(os.environ[CASE]))


def execute(spec, scene, *, trace_path, on_progress, interest):
    """A run that leaves beside its trace what memory it has had."""
    from daemon.run import execute

    found = [own_memory()]

    def look(snapshot):
        found.append(own_memory())
        on_progress(snapshot)

    result = execute(spec, scene, trace_path=trace_path, on_progress=look, interest=interest)
    found.append(own_memory())
    (trace_path.parent / FOUND).write_text(json.dumps(found))
    return result


def tell_of_child(name):
    """Print as JSON what memory a child of a zygote has: before a run, meanwhile, after it."""
    from daemon.batch.worker._attempts import Attempt
    from daemon.batch.worker._zygotes import ZygotePool
    from daemon.model.execution import RunLimits
    from daemon.model.messages import Lease
    from grammars.text import codec
    from tests.benchmarks.case_process import load

    spec, scene = load(name)
    os.environ[CASE] = name
    with tempfile.TemporaryDirectory(prefix="bench-memory-") as folder:
        file = Path(folder) / "scene.json"
        file.write_bytes(codec.to_json(scene))
        pool = ZygotePool(1, f"{__name__}:execute")
        pool.warm_up()
        lease = Lease("c.0", "c", 1, 0, "c/run.mcap", spec)
        attempt = Attempt.prepare(Path(folder) / "c.0" / "attempt-1", lease)
        execution = pool.start(attempt, file, RunLimits(nice=0))
        while execution.end is None:
            wait(execution.waitables)
            execution.listen()
        execution.close()
        pool.close()
        print((attempt.folder / FOUND).read_text(), flush=True)


def tell(name, times):
    """Print as JSON what memory a child of a warm process has: before runs, and after each."""
    from daemon.batch.zygote import LARGE
    from daemon.run import execute, load_kernels, warm_up
    from daemon.supervision.child import return_freed_memory
    from tests.benchmarks.case_process import load

    warm_up()
    spec, scene = load(name)
    load_kernels(spec, scene)
    gc.collect()
    gc.freeze()
    if os.fork():
        os.wait()
        return
    return_freed_memory(LARGE)
    found = [own_memory()]
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(times):
            execute(spec, scene, trace_path=Path(folder) / "run.mcap")
            found.append(own_memory())
    print(json.dumps(found), flush=True)
    os._exit(0)


def told(call):
    """What a function of this module says that is called by a process of its own."""
    progress.say(call)
    program = f"import {__name__} as bench; bench.{call}"
    said = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
    )
    return [Memory(*each) for each in json.loads(said.stdout)]


def measure():
    """A child's one run, then many runs in one process: short ones, and those that need most."""
    for what, name, goals in (
        ("the demo", "rude-house", ()),
        ("S1, a2s", "s1", (at_most(220.0),)),
    ):
        found = told(f"tell_of_child({name!r})")
        pss, uss = max(one.pss for one in found), max(one.uss for one in found)
        yield Measurement(
            f"{what}: a child's run, most RSS", found[-1].peak, "MB",
            Reference("RSS before", found[0].rss), goals,
            f"most PSS {pss:.0f}, USS {uss:.0f} MB; at the end RSS {found[-1].rss:.0f} MB",
        )  # fmt: skip
    yield growth("the demo", "rude-house", 20)
    yield growth("S1", "s1", 8)


def growth(what, name, times):
    """What a process has in memory after ``times`` runs, beside what it has after two."""
    _, _, second, *_, last = told(f"tell({name!r}, {times})")
    return Measurement(
        f"{times} runs of {what} in one process, RSS", last.rss, "MB",
        Reference("after the second", second.rss), (at_most(MOST_GROWTH, of_ratio=True),),
        f"PSS {last.pss:.0f}, USS {last.uss:.0f} MB, most RSS {last.peak:.0f} MB",
    )  # fmt: skip
