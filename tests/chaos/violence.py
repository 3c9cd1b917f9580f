"""Daemon and workers are killed and frozen at random while many short runs go through them."""

from __future__ import annotations

import random
import threading
import time
from collections import Counter
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field

import psutil

from daemon.batch.client import Client
from daemon.batch.errors import DaemonError
from tests.chaos.links import Link, links, may_make_namespaces
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.daemon.batch.harness import DaemonPart, Part, daemon_at, free_endpoint, worker_for
from tests.daemon.batch.samples import make_spec, submission_of

EXECUTOR = "tests.chaos.executor:execute"
LOCAL, REMOTE = 2, 4
FREEZES = (0.5, 6.0)


@dataclass(slots=True)
class Yard:
    """A daemon with local slots, workers at the ends of cables, and what was done to them."""

    daemon: DaemonPart
    workers: list[Part]
    cables: list[Link]
    rng: random.Random
    done: Counter[str] = field(default_factory=Counter)
    _thaws: list[threading.Timer] = field(default_factory=list)

    def strike(self):
        """Do one of the things that happen to processes and cables."""
        deeds = [
            (self._kill_daemon, 3.0),
            (self._kill_local, 2.0),
            (self._kill_worker, 3.0),
            (self._freeze, 2.0),
            (self._cut, 1.0),
        ]
        act = self.rng.choices([deed for deed, _ in deeds], [weight for _, weight in deeds])[0]
        act()

    def _kill_daemon(self):
        self.daemon.kill()
        self.daemon.restart()
        self.done["daemon killed"] += 1

    def _kill_local(self):
        with suppress(psutil.NoSuchProcess):
            for child in psutil.Process(self.daemon.pid).children():
                child.kill()
                self.done["local worker killed"] += 1

    def _kill_worker(self):
        worker = self.rng.choice(self.workers)
        worker.kill()
        worker.restart()
        self.done["worker killed"] += 1

    def _freeze(self):
        part = self.rng.choice([self.daemon, *self.workers])
        process = psutil.Process(part.pid)
        process.suspend()
        self._later(process.resume)
        self.done["daemon frozen" if part is self.daemon else "worker frozen"] += 1

    def _cut(self):
        cable = self.rng.choice(self.cables)
        cable.cut()
        self._later(cable.mend)
        self.done["cable cut"] += 1

    def _later(self, act):
        def undo():
            with suppress(psutil.NoSuchProcess):
                act()

        timer = threading.Timer(self.rng.uniform(*FREEZES), undo)
        self._thaws.append(timer)
        timer.start()

    def settle(self):
        """Wait until nothing is frozen or cut any more, and start again what has given up."""
        for timer in self._thaws:
            timer.join()
        self.revive()

    def revive(self):
        """Start workers again that left because no daemon was there when they came."""
        for worker in self.workers:
            if worker.process.poll() is not None:
                worker.restart()


@contextmanager
def yard(folder, seed, *, isolated):
    """The daemon and its workers for the block; nothing is left afterwards."""
    settings = {"lease": 3.0, "attempts": 200}
    with ExitStack() as stack:
        endpoint, cables = stack.enter_context(links(free_endpoint(), REMOTE, isolated=isolated))
        daemon = stack.enter_context(
            daemon_at(folder / "state", LOCAL, listen=endpoint, executor=EXECUTOR, **settings)
        )
        daemon.client().close()
        workers = [
            stack.enter_context(
                worker_for(
                    daemon,
                    1,
                    *("--state", str(folder / f"worker-{i}")),
                    connect=link.endpoint,
                    through=link.through,
                    executor=EXECUTOR,
                )
            )
            for i, link in enumerate(cables)
        ]
        made = Yard(daemon, workers, cables, random.Random(seed))
        try:
            yield made
        finally:
            made.settle()


def progress(endpoint):
    """Runs at rest and runs under way; ``None`` when nobody answers."""
    try:
        with Client.open(endpoint, timeout=1.0) as client:
            now = client.overview()
    except DaemonError:
        return None
    return now.done + now.lost + now.cancelled, now.queued + now.running


def attempts_below(folder):
    """What is left in the spools of the daemon's machine and of the workers' own ones."""
    spools = (folder / "state" / "spool", *folder.glob("worker-*/work/*/spool"))
    return [path for spool in spools for path in spool.glob("*/*/attempt-*")]


def violence(folder, *, runs=2000, seed=1, every=2.0, limit=285.0):
    """Strike every ``every`` seconds until nothing is under way; then look at what is left."""
    report = Report("violence: kills, freezes and cut cables under load")
    isolated = may_make_namespaces()
    report.fact("network", "a namespace per worker" if isolated else "a relay per worker")
    rng = random.Random(seed)
    specs = [make_spec(i, sleep=round(rng.uniform(0.0, 0.05), 3)) for i in range(runs)]
    with yard(folder, seed, isolated=isolated) as scene:
        with scene.daemon.client() as client:
            client.submit(submission_of("chaos", *specs))
        deadline = time.monotonic() + limit
        before = (0, runs)
        while before[1] and time.monotonic() < deadline:
            time.sleep(every)
            before = progress(scene.daemon.endpoint) or before
            if before[1]:
                scene.strike()
                scene.revive()
        scene.settle()
        _await_end(scene, folder, runs)
        for what, count in sorted(scene.done.items()):
            report.fact(what, count)
        report.fact("runs", runs)
        left = attempts_below(folder)
        report.expect(not left, f"spools keep {len(left)} attempts: {left[:2]}")
        verify(report, scene.daemon.state, runs)
    return report


def _await_end(scene, folder, runs, patience=60.0):
    """Let the last runs and deliveries happen undisturbed, for as long as any do."""
    deadline = time.monotonic() + patience
    before = None
    while time.monotonic() < deadline:
        now = progress(scene.daemon.endpoint), len(attempts_below(folder))
        if now == ((runs, 0), 0):
            return
        if now[0] is not None and now != before:
            deadline, before = time.monotonic() + patience, now
        time.sleep(0.2)
