"""Keys of the dashboard with 100,000 runs and 300 campaigns: CPU for each, and without any.

A real daemon on loopback and the dashboard in a pseudo-terminal of 120x40. The CPU for a key is
that of all the process does while keys come, what it asks of the daemon included.
"""

import time

from tests.benchmarks import progress
from tests.benchmarks.bench_tui import MANY, cpu, fresh, large, opened
from tests.benchmarks.measurement import Measurement, at_most
from tests.make import make_submission

CAMPAIGNS = 300
TIMES = 50
APART = 0.1
"""Seconds between two keys, in which what a key has caused is drawn."""
IDLE = 20.0


def measure():
    """Fill a ledger, then type."""
    with fresh(slots=0) as daemon:
        progress.say(f"{MANY:,} runs, {CAMPAIGNS} campaigns")
        with daemon.client() as client:
            for number in range(CAMPAIGNS - 1):
                client.submit(make_submission(f"small-{number}", 1))
        large(daemon)
        with opened(daemon, columns=120, rows=40) as shown:
            shown.until("large-1")
            shown.until(lambda: "judging" not in shown.lines[0])
            yield idle("campaigns", shown)
            yield key("a campaign down and up", shown, "jk")
            shown.type("g\r")
            shown.until("1-100 of")
            yield idle("runs", shown)
            yield key("  a run down and up", shown, "jk")
            yield key("  the last page of runs and the first", shown, "Gg")
            shown.type("m")
            shown.until("no-contact")
            yield idle("matrix", shown)
            yield key("  a cell right and left", shown, "lh")


def key(name, shown, keys):
    """Press two keys in turns; return the CPU for one."""
    shown.read(2.0)
    before = cpu(shown.pid)
    for number in range(TIMES):
        shown.type(keys[number % 2])
        end = time.monotonic() + APART
        while (left := end - time.monotonic()) > 0.0:
            shown.read(left)
    used = 1e3 * (cpu(shown.pid) - before) / TIMES
    return Measurement(name, used, "CPU ms", None, (at_most(20.0),))


def idle(name, shown):
    """Return the share of a core that the dashboard takes while nothing happens."""
    shown.read(5.0)
    before, start = cpu(shown.pid), time.monotonic()
    while time.monotonic() < start + IDLE:
        shown.read(1.0)
    share = 100.0 * (cpu(shown.pid) - before) / (time.monotonic() - start)
    return Measurement(f"{name}: idle", share, "% of a core", None, (at_most(0.5),))
