"""A Dask cluster under load: its workers, its scheduler and the gateway are killed at random."""

import random
import time
from collections import Counter
from contextlib import suppress

import psutil

from tests.batch.dask_harness import dask_in, gateway_for
from tests.chaos.executor import EXECUTOR
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.chaos.violence import attempts_below, progress
from tests.make import make_spec, submission_of
from tests.parts import alive, daemon_at

THREADS = 2
WORKERS = 2
PATIENCE = 300.0
"""Seconds for runs that nobody disturbs any more, on a machine that has much else to do."""


class Cluster:
    """What can be killed, and how often it was."""

    def __init__(self, dask, gateway, rng):
        self.done = Counter()
        self._dask = dask
        self._gateway = gateway
        self._rng = rng
        self._workers = []
        self.refill()

    def refill(self):
        """Start as many workers as there should be."""
        self._workers = alive(self._workers)
        for _ in range(WORKERS - len(self._workers)):
            self._workers += self._dask.start_workers(THREADS)

    def strike(self):
        """Kill something; the gateway and the scheduler start again at once."""
        (deed,) = self._rng.choices(["Dask worker", "Dask scheduler", "gateway"], [3, 2, 2])
        self.done[f"{deed} killed"] += 1
        if deed == "Dask worker":
            with suppress(psutil.NoSuchProcess):
                self._rng.choice(self._workers).kill()
        elif deed == "Dask scheduler":
            self._dask.scheduler.kill()
            self._dask.start_scheduler()
        else:
            self._gateway.kill()
            self._gateway.restart()
        self.revive()

    def revive(self):
        """Start again what has given up or was killed."""
        self.refill()
        if self._gateway.process.poll() is not None:
            self._gateway.restart()


def cluster(folder, *, runs=200, seed=1, every=5.0, seconds=90.0):
    """Strike every ``every`` seconds for a while, let it finish; then look at what is left."""
    report = Report("cluster: Dask workers, scheduler and gateway killed under load")
    rng = random.Random(seed)
    specs = [make_spec(i, sleep=round(rng.uniform(0.1, 0.5), 3)) for i in range(runs)]
    with (
        daemon_at(folder / "state", lease=5.0, attempts=200) as daemon,
        daemon.client() as client,
        dask_in(folder / "dask") as dask,
        gateway_for(dask, daemon, executor=EXECUTOR) as gateway,
    ):
        client.submit(submission_of("chaos", *specs))
        scene = Cluster(dask, gateway, rng)
        calm = time.monotonic() + seconds
        end = calm + PATIENCE
        while progress(daemon.endpoint) != (runs, 0) and time.monotonic() < end:
            time.sleep(every)
            if time.monotonic() < calm:
                scene.strike()
            scene.revive()
        for what, count in sorted(scene.done.items()):
            report.fact(what, count)
        report.fact("runs", runs)
        left = attempts_below(folder)
        report.expect(not left, f"spools keep {len(left)} attempts: {left[:2]}")
        verify(report, daemon.state, runs)
    return report
