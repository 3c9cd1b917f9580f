"""Submissions and cancellations of very many runs beside work: no lease lapses meanwhile."""

import sqlite3
import threading
import time
from contextlib import closing, suppress

from daemon.batch import bus
from daemon.batch.errors import DaemonError
from tests.chaos.executions import Executions
from tests.chaos.light import LightWorker
from tests.chaos.report import Report
from tests.make import make_submission
from tests.parts import daemon_at, eventually, worker_for

EXECUTOR = "tests.chaos.executor:execute"
PATIENCE = 600.0


class Pulse:
    """Asks what a worker asks, ten times a second, and remembers the slowest answer."""

    def __init__(self, daemon):
        self.slowest = 0.0
        self._daemon = daemon
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._ask, daemon=True)
        self._thread.start()

    def stop(self):
        """Ask no more."""
        self._stop.set()
        self._thread.join()

    def _ask(self):
        endpoint = self._daemon.endpoint
        with bus.open_client(endpoint) as session:
            worker = LightWorker(session, endpoint, "pulse", 0)
            while not self._stop.wait(0.1):
                start = time.monotonic()
                with suppress(DaemonError):  # unanswered in time: as slow as that
                    worker.renew()
                self.slowest = max(self.slowest, time.monotonic() - start)


def long_writes(folder, *, runs=200_000, working=4, lease=5.0):
    """Submit and cancel ``runs`` runs while some are executed: each of these is begun once."""
    report = Report("long writes: very many runs come and go beside work")
    log, gate = Executions(folder / "executions"), folder / "gate"
    with (
        daemon_at(folder / "state", 1, lease=lease, executor=EXECUTOR) as daemon,
        worker_for(daemon, working - 1, "--state", str(folder / "away"), executor=EXECUTOR),
        daemon.client(PATIENCE) as client,
    ):
        work = make_submission("work", working, log=str(log.path), until=str(gate))
        client.submit(work)
        eventually(lambda: len(log.begun) == working)
        pulse = Pulse(daemon)
        many = make_submission("many", runs)
        # No more of it is to start: what is started over, starts over itself.
        client.steer("work", paused=True)
        client.steer("work", paused=False)
        start = time.monotonic()
        client.submit(many)
        report.fact(f"{runs} runs submitted in", f"{time.monotonic() - start:.1f} s")
        client.steer("many", paused=True)
        start = time.monotonic()
        client.cancel("many")
        report.fact(f"{runs} runs cancelled in", f"{time.monotonic() - start:.1f} s")
        pulse.stop()
        report.fact("slowest renewal", f"{pulse.slowest:.2f} s")
        gate.touch()
        eventually(lambda: _done(client, "work") == working)
        report.runs, report.executions = working, log.begun.total()
        report.started_over = log.started_over
        report.expect(not log.started_over, f"{log.started_over} runs were started over")
    with closing(sqlite3.connect(folder / "state" / "ledger.db")) as db:
        again = db.execute("SELECT count(*) FROM run WHERE attempt > 1").fetchone()[0]
        report.lost = db.execute("SELECT count(*) FROM run WHERE state = 'lost'").fetchone()[0]
    report.expect(again == 0, f"{again} runs were leased again")
    return report


def _done(client, campaign):
    return next(row.done for row in client.campaigns() if row.id == campaign)
