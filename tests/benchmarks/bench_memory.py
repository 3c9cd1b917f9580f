"""The process of a run: memory of S1 and of many runs, and what it costs when the run does nothing.

One run is executed by a child of a worker's zygote, as every run is; many by a child of a
process that is as warm as that. RSS is all that a process has in memory, with what it shares with
the zygote; PSS counts a page that several share in parts, USS not at all. An empty run costs fork,
guardian, lease, result and exit, for the zygote that is warm for S1.
"""

import gc
import json
import multiprocessing
import os
import resource
import tempfile
from contextlib import contextmanager
from multiprocessing.connection import wait
from pathlib import Path
from typing import NamedTuple

import psutil

from tests import fake_run
from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference, at_most, told
from tests.make import SCENE, make_spec

MOST_GROWTH = 1.05
"""Of the memory after two runs: malloc may keep some more for later."""
RUNS, WARM = 100, 10
CASE = "SCENARIO_BENCH_CASE"
"""The variable that tells the zygote which rooms the run enters."""
FOUND = "memory.json"
"""Lies in the folder of an attempt when the run is over."""

do_nothing = fake_run.execute


class Memory(NamedTuple):
    """What a process has in memory [MB]; ``peak`` is the most RSS it has had."""

    rss: float
    pss: float
    uss: float
    peak: float


def own_memory():
    """The memory of this process."""
    now = psutil.Process().memory_full_info()
    most = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return Memory(*(each / 1e6 for each in (now.rss, now.pss, now.uss, most)))


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


@contextmanager
def zygote(executor, scene):
    """Yield a function that executes a run by a child of a zygote and returns its folder."""
    from daemon.batch.worker._attempts import Attempt
    from daemon.batch.worker._zygotes import ZygotePool
    from daemon.model.execution import RunLimits
    from daemon.model.messages import Lease
    from grammars.text import codec

    with tempfile.TemporaryDirectory(prefix="bench-memory-") as name:
        file = Path(name) / "scene.json"
        file.write_bytes(codec.to_json(scene))
        pool = ZygotePool(1, f"{__name__}:{executor}")
        pool.warm_up()

        def run(spec, number=1):
            lease = Lease("c.0", "c", 1, number, "c/run.mcap", spec)
            attempt = Attempt.prepare(Path(name) / "c.0" / f"attempt-{number}", lease)
            execution = pool.start(attempt, file, RunLimits(nice=0))
            while execution.end is None:
                wait(execution.waitables)
                execution.listen()
            execution.close()
            return attempt.folder

        yield run
        pool.close()


def memory_of_child(name):
    """Return what memory a child of a zygote has: before a run, meanwhile, after it."""
    from tests.benchmarks.case_process import load

    spec, scene = load(name)
    with zygote("execute", scene) as run:
        return json.loads((run(spec) / FOUND).read_text())


def cpu_of_empty_runs():
    """Return the CPU of a run's processes and of the zygote, for one run [ms]."""
    with zygote("do_nothing", SCENE) as run:
        (server,) = (
            one for one in psutil.Process().children() if "daemon.batch.zygote" in one.cmdline()
        )
        for number in range(WARM):
            run(make_spec(number), number)
        before = sum(server.cpu_times())
        for number in range(WARM, WARM + RUNS):
            run(make_spec(number), number)
        return 1e3 * (sum(server.cpu_times()) - before) / RUNS


def memory_of_runs(name, times):
    """Return what memory a child of a warm process has: before runs, and after each."""
    from daemon.run import load_kernels, warm_up
    from tests.benchmarks.case_process import load

    warm_up()
    case = load(name)
    load_kernels(*case)
    gc.collect()
    gc.freeze()
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_execute_often, args=(*case, times, there))
    child.start()
    found = here.recv()
    child.join()
    return found


def _execute_often(spec, scene, times, answer):
    from daemon.batch.zygote import LARGE
    from daemon.run import execute
    from daemon.supervision.child import return_freed_memory

    return_freed_memory(LARGE)
    found = [own_memory()]
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(times):
            execute(spec, scene, trace_path=Path(folder) / "run.mcap")
            found.append(own_memory())
    answer.send(found)


def measure():
    """A child's one run, then many runs in one process: short ones, and those that need most."""
    for what, name, goals in (("the demo", "rude-house", ()), ("S1", "s1", (at_most(220.0),))):
        progress.say(what)
        found = [Memory(*one) for one in told(memory_of_child, name, **{CASE: name})]
        pss, uss = max(one.pss for one in found), max(one.uss for one in found)
        yield Measurement(
            f"{what}: a child's run, most RSS", found[-1].peak, "MB",
            Reference("RSS before", found[0].rss), goals,
            f"most PSS {pss:.0f}, USS {uss:.0f} MB; at the end RSS {found[-1].rss:.0f} MB",
        )  # fmt: skip
    for what, name, times in (("the demo", "rude-house", 20), ("S1", "s1", 8)):
        progress.say(f"{times} runs of {what}")
        found = [Memory(*one) for one in told(memory_of_runs, name, times)]
        second, last = found[2], found[-1]
        yield Measurement(
            f"{times} runs of {what} in one process, RSS", last.rss, "MB",
            Reference("after the second", second.rss), (at_most(MOST_GROWTH, of_ratio=True),),
            f"PSS {last.pss:.0f}, USS {last.uss:.0f} MB, most RSS {last.peak:.0f} MB",
        )  # fmt: skip
    yield Measurement("an empty run", told(cpu_of_empty_runs, **{CASE: "s1"}), "CPU ms")
