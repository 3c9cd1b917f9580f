"""What people wait for many times a day: commands, names completed, the dashboard's first screen.

CPU of whole processes from start to end, bytecode on disk, each in turns with an interpreter that
imports numpy and leaves: as much work of the same sort, which no change of ours makes quicker.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import psutil

from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference, at_most
from tests.make import make_submission
from tests.parts import daemon_at, eventually
from tests.people.terminal.pseudo_terminal import scenario, terminal

ROOT = Path(__file__).parents[2]
CAMPAIGNS = 20_000
TIMES = 7
NUMPY = ("import numpy", [sys.executable, "-c", "import numpy"])


def environment(**more):
    """What a shell has, with bytecode kept."""
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return kept | more


def cpu_of(command, environ):
    """CPU seconds of a process from start to end.

    Raises ``RuntimeError`` with what it said when it fails.
    """
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(command, cwd=ROOT, env=environ, stdout=output, stderr=output)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            output.seek(0)
            raise RuntimeError(f"{command}: {output.read().decode()}")
    return usage.ru_utime + usage.ru_stime


def beside_numpy(name, command, goal, environ):
    """A command in turns with an interpreter that imports numpy; the best of each."""
    progress.say(name)
    cpu_of(command, environ)  # writes its bytecode
    pairs = [(cpu_of(command, environ), cpu_of(NUMPY[1], environ)) for _ in range(TIMES)]
    ours, theirs = (min(values) for values in zip(*pairs, strict=True))
    return Measurement(name, ours, "CPU s", Reference(NUMPY[0], theirs), (at_most(goal),))


def completion(state):
    """TAB behind ``scenario results`` with many campaigns in the ledger."""
    progress.say(f"a ledger of {CAMPAIGNS} campaigns")
    paths = StatePaths(state)
    paths.make_folders()
    with LedgerWriter.open(paths) as ledger, ledger.transaction():
        submission = make_submission("c", 1)
        for i in range(CAMPAIGNS):
            ledger.submit(replace(submission, campaign=f"c{i}", name=f"n{i % 100}"), float(i))
    pressed = environment(
        SCENARIO_STATE=str(state), _SCENARIO_COMPLETE="complete_bash",
        COMP_WORDS="scenario results c1", COMP_CWORD="2",
    )  # fmt: skip
    return beside_numpy(f"{CAMPAIGNS} ids completed", scenario(), 0.3, pressed)


def first_screen(state):
    """The dashboard from its start to its first screen, seven times."""
    with daemon_at(state) as daemon, daemon.client() as client:
        client.submit(make_submission("small-1", 5))
        eventually(lambda: client.overview().queued == 5)
        yield beside_numpy(
            "status", scenario("status", "--connect", daemon.endpoint), 0.3, environment()
        )
        progress.say("dashboard")
        walls, used, filled, numpy = [], [], [], []
        for _ in range(TIMES):
            start = time.perf_counter()
            with terminal(scenario("tui", "--connect", daemon.endpoint)) as shown:
                shown.until("Quit")
                walls.append(time.perf_counter() - start)
                times = psutil.Process(shown.pid).cpu_times()
                used.append(times.user + times.system)
                shown.until("small-1")
                filled.append(time.perf_counter() - start)
            start = time.perf_counter()
            cpu_of(NUMPY[1], environment())
            numpy.append(time.perf_counter() - start)
        # By the clock on the wall as well, which other work on the machine makes run for both.
        beside = Reference(NUMPY[0], min(numpy))
        yield Measurement(
            "dashboard's first screen", min(walls), "s", beside, (at_most(0.4),),
            f"median {statistics.median(walls):.2f} s, "
            f"campaigns in it after {min(filled):.2f} s",
        )  # fmt: skip
        yield Measurement("  its CPU", min(used), "CPU s", None, (at_most(0.6),))


def measure():
    """Commands, then what needs a ledger, then what needs a daemon."""
    demo = str(ROOT / "campaigns" / "demo" / "campaign.yaml")
    yield beside_numpy("scenario --help", scenario("--help"), 0.2, environment())
    yield beside_numpy("check demo", scenario("check", demo), 0.5, environment())
    with tempfile.TemporaryDirectory(prefix="bench-reactions-") as folder:
        yield completion(Path(folder, "many"))
        yield from first_screen(Path(folder, "state"))
