"""The dashboard over runs of the published building: memory, opening a run, a page of runs.

Ten runs with the pilot, executed by a real daemon, then looked at in a terminal of 200 x 50: one
run with map and signals, all of them one after the other. Memory is the resident set of the
dashboard's own process; the one that reads traces for it is its reference, and leaves by itself.
"""

import tempfile
import time
from pathlib import Path

import psutil

from daemon.campaign import expand, load_campaign
from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference, at_most
from tests.parts import daemon_at, eventually, finished
from tests.people.terminal.pseudo_terminal import scenario, terminal

CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "ortega2024" / "first.yaml"
SECONDS = 600.0
"""How long ten runs may take on a busy machine."""
MEGABYTE = 2**20


def measure():
    """Run the campaign, then look at it."""
    with tempfile.TemporaryDirectory(prefix="bench-dashboard-") as folder:
        progress.say("ten runs of the published building")
        settings = {"executor": "daemon.run:execute"}
        with daemon_at(Path(folder) / "state", 2, **settings) as daemon, daemon.client() as client:
            submission = expand(load_campaign(CAMPAIGN))
            client.submit(submission)
            count = len(submission.runs)
            eventually(lambda: finished(client, count), SECONDS)
            progress.say("looked at")
            command = scenario("tui", "--connect", daemon.endpoint)
            with terminal(command, columns=200, rows=50) as shown:
                shown.until(submission.campaign)
                yield from look(shown, count)


def look(shown, count):
    """Open one run after the other, as somebody does who looks for the one that failed."""
    yield memory("the list of campaigns", shown)
    shown.type("\r")
    shown.until("S1/pilot/0")
    shown.read(1.0)
    first = opened(shown)
    yield memory("a run open, its map and its signals", shown)
    further = []
    for _ in range(count - 1):
        shown.type("\x1b")
        shown.until(f"of {count}  as submitted")
        shown.type("j")
        shown.read(0.3)
        further.append(opened(shown))
    yield memory(f"  after {count} of them", shown)
    beside = Reference("the first one", first)
    yield Measurement("a run opened, the next ones", min(further), "s", beside, ())


def opened(shown):
    """Open the run under the cursor and return after how long its signals are there [s]."""
    start = time.perf_counter()
    shown.type("\r")
    shown.until(lambda: "loc.error" in shown.text and " wp" in shown.lines[2])
    took = time.perf_counter() - start
    shown.read(1.0)
    return took


def memory(name, shown):
    process = psutil.Process(shown.pid)
    own = process.memory_info().rss / MEGABYTE
    children = [child.memory_info().rss / MEGABYTE for child in process.children()]
    beside = Reference("who reads traces", sum(children)) if children else None
    return Measurement(f"{name}: RSS", own, "MB", beside, (at_most(150.0),))
