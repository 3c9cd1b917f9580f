"""The clock of the machine is set back and forth under a working daemon."""

import random
import time

from grammars.text.files import write_atomically
from tests.chaos.executor import EXECUTOR
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.make import make_submission
from tests.parts import daemon_at, eventually, finished, worker_for

STEPPED = "tests.chaos.stepped"
LEASE = 10.0
HOUR = 3600.0
REACHES = (24 * HOUR, 400 * 24 * HOUR)
"""Seconds by which the clock is off at most."""


def clock(folder, *, runs=40, steps=12, every=1.0, seed=1):
    """Set the clock ``every`` so many seconds: no lease ends before its time, or never."""
    report = Report("clock: set back and forth by hours and by years")
    rng = random.Random(seed)
    off = folder / "offset"
    settings = {"lease": LEASE, "executor": EXECUTOR}
    with daemon_at(folder / "state", 2, module=STEPPED, **settings) as daemon:
        with daemon.client() as client:
            client.submit(make_submission("clock", runs, sleep=0.5))
            for _ in range(steps):
                write_atomically(off, str(rng.choice(REACHES) * rng.uniform(-1.0, 1.0)).encode())
                time.sleep(every)
            eventually(lambda: finished(client, runs), 300.0)
            again = sum(row.attempt > 1 for row in client.runs("clock").rows)
        report.fact("clock set", steps)
        report.fact("runs that lost their lease meanwhile", again)
        report.expect(again == 0, f"{again} runs lost their lease to the clock")
        verify(report, daemon.state, runs)
    _frozen_worker(report, folder / "frozen")
    return report


def _frozen_worker(report, folder):
    """A worker freezes, the clock goes back a day: its lease ends in its own time."""
    settings = {"lease": LEASE}
    with (
        daemon_at(folder / "state", 0, module=STEPPED, **settings) as daemon,
        daemon.client() as client,
        worker_for(daemon, 1, executor=EXECUTOR) as worker,
    ):
        off = folder / "offset"
        client.submit(make_submission("frozen", 1, sleep=60.0))
        eventually(lambda: client.overview().running == 1)
        worker.freeze()
        start = time.monotonic()
        write_atomically(off, str(-24 * HOUR).encode())
        # A clock set back must not keep a dead worker's lease alive.
        eventually(lambda: client.overview().running == 0, 6 * LEASE)
        took = time.monotonic() - start
        report.fact("frozen worker's lease ended after", f"{took:.1f} s (lease {LEASE:g} s)")
