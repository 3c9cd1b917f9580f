"""What people wait for many times a day: commands, names completed, the dashboard's first screen.

CPU of whole processes from start to end, bytecode on disk, each in turns with an interpreter that
imports numpy and leaves: as much work of the same sort, which no change of ours makes quicker.
"""

import statistics
import sys
import tempfile
import time

from tests.benchmarks import progress
from tests.benchmarks.bench_daemon import fill_ledger, fresh
from tests.benchmarks.measurement import Measurement, Reference, at_most, cpu, cpu_of, kept_bytecode
from tests.make import make_submission
from tests.parts import ROOT, eventually
from tests.people.terminal.pseudo_terminal import scenario, terminal

CAMPAIGNS = 20_000
TIMES = 7
NUMPY = ("import numpy", [sys.executable, "-c", "import numpy"])


def beside_numpy(name, goal, command, **more):
    """A command in turns with an interpreter that imports numpy; the best of each."""
    progress.say(name)
    environment = kept_bytecode(**more)
    cpu_of(command, environment)  # writes its bytecode
    pairs = [(cpu_of(command, environment), cpu_of(NUMPY[1], environment)) for _ in range(TIMES)]
    ours, theirs = (min(values) for values in zip(*pairs, strict=True))
    return Measurement(name, ours, "CPU s", Reference(NUMPY[0], theirs), (at_most(goal),))


def completion(state):
    """TAB behind ``scenario results`` with many campaigns in the ledger."""
    progress.say(f"a ledger of {CAMPAIGNS} campaigns")
    fill_ledger(state, CAMPAIGNS)
    return beside_numpy(
        f"{CAMPAIGNS} ids completed", 0.3, scenario(), SCENARIO_STATE=str(state),
        _SCENARIO_COMPLETE="complete_bash", COMP_WORDS="scenario results c1", COMP_CWORD="2",
    )  # fmt: skip


def first_screen():
    """A daemon's status, and the dashboard from its start to its first screen, seven times."""
    with fresh() as daemon, daemon.client() as client:
        client.submit(make_submission("small-1", 5))
        eventually(lambda: client.overview().queued == 5)
        yield beside_numpy("status", 0.3, scenario("status", "--connect", daemon.endpoint))
        progress.say("dashboard")
        walls, used, filled, numpy = [], [], [], []
        for _ in range(TIMES):
            start = time.perf_counter()
            with terminal(scenario("tui", "--connect", daemon.endpoint)) as shown:
                shown.until("Quit")
                walls.append(time.perf_counter() - start)
                used.append(cpu(shown.pid))
                shown.until("small-1")
                filled.append(time.perf_counter() - start)
            start = time.perf_counter()
            cpu_of(NUMPY[1], kept_bytecode())
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
    yield beside_numpy("scenario --help", 0.2, scenario("--help"))
    yield beside_numpy("check demo", 0.5, scenario("check", demo))
    with tempfile.TemporaryDirectory(prefix="bench-reactions-") as folder:
        yield completion(folder)
    yield from first_screen()
