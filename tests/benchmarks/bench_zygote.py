"""What the process of a run costs when the run does nothing: fork, guardian, lease, result, exit.

The zygote is warm for runs of the simulator, since what it has in memory is what a fork costs.
"""

import subprocess
import sys
import tempfile
from multiprocessing.connection import wait
from pathlib import Path

import psutil

from daemon.batch import run_process
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._zygotes import ZygotePool
from daemon.model.execution import RunLimits
from daemon.model.messages import Lease
from grammars.text import codec
from tests.benchmarks.measurement import Measurement, Reference
from tests.fake_run import execute
from tests.make import SCENE, make_spec

RUNS = 100
WARM = 10
KINDS = ("guarded", "unguarded")

guarded = unguarded = execute


def warm_up():
    """Called by the zygote alone."""
    from tests.kernels import load_all

    load_all()
    if f"{__name__}:unguarded" in sys.argv:
        run_process.guard = lambda *_, **__: None


def cpu_of(kind):
    """CPU of a run's processes and of the zygote, for one run [ms]."""
    with tempfile.TemporaryDirectory(prefix="bench-zygote-") as folder:
        scene = Path(folder) / "scene.json"
        scene.write_bytes(codec.to_json(SCENE))
        pool = ZygotePool(1, f"{__name__}:{kind}")
        pool.warm_up()
        (server,) = (
            one for one in psutil.Process().children() if "daemon.batch.zygote" in one.cmdline()
        )
        before = 0.0
        for number in range(WARM + RUNS):
            if number == WARM:
                before = sum(server.cpu_times())
            lease = Lease("c.0", "c", 1, number, "c/S1.mcap", make_spec(number))
            attempt = Attempt.prepare(Path(folder) / "c.0" / f"attempt-{number}", lease)
            execution = pool.start(attempt, scene, RunLimits())
            while execution.end is None:
                wait(execution.waitables)
                execution.listen()
            execution.close()
        return 1e3 * (sum(server.cpu_times()) - before) / RUNS


def measure():
    """Each in a process of its own."""
    program = f"import sys; from {__name__} import cpu_of; print(cpu_of(sys.argv[1]))"
    took = {}
    for kind in KINDS:
        done = subprocess.run(
            [sys.executable, "-c", program, kind], capture_output=True, text=True, check=True
        )
        took[kind] = float(done.stdout)
    bare = Reference("without a guardian", took["unguarded"])
    yield Measurement("an empty run", took["guarded"], "CPU ms", bare)
