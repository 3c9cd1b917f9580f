"""Daemon and workers are killed and frozen at random while many short runs go through them."""

import random
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress

import psutil

from daemon.batch.client import Client
from daemon.batch.errors import DaemonError
from grammars.text.files import matching_paths
from tests.chaos.executor import EXECUTOR
from tests.chaos.links import links, may_make_namespaces
from tests.chaos.network import worker_at
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.make import make_spec, submission_of
from tests.parts import daemon_at, eventually, free_endpoint

LOCAL, REMOTE = 2, 4
FREEZES = (0.5, 6.0)
CAMPAIGNS = 4


class Yard:
    """A daemon with local slots, workers at the ends of cables, and what was done to them."""

    def __init__(self, daemon, workers, cables, rng):
        self.daemon, self.workers, self.cables, self.rng = daemon, workers, cables, rng
        self.done = Counter()
        self._thaws = []

    def strike(self, *, kill=False):
        """Do one of the things that happen to processes and cables, or ``kill`` one of these."""
        deeds = [
            (self._kill_daemon, 3.0),
            (self._kill_local, 2.0),
            (self._kill_worker, 3.0),
            (self._freeze, 2.0),
            (self._cut, 1.0),
        ][: 3 if kill else None]
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
            stack.enter_context(worker_at(daemon, link, 1, folder / f"worker-{i}"))
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
    spools = (folder / "state" / "spool", *matching_paths(folder, "worker-*/work/*/spool"))
    return [path for spool in spools for path in matching_paths(spool, "*/*/attempt-*")]


def violence(folder, *, runs=2000, seed=1, kills=0, operators=0, every=2.0, limit=285.0):
    """Strike every ``every`` seconds until nothing is under way; then look at what is left.

    With ``kills`` there are that many, spread evenly over the runs, and the runs do nothing.
    ``operators`` list, cancel, retry, pause and prioritise meanwhile, all at once.
    """
    report = Report("violence: kills, freezes and cut cables under load")
    isolated = may_make_namespaces()
    report.fact("network", "a namespace per worker" if isolated else "a relay per worker")
    rng = random.Random(seed)
    sleeps = (0.0 if kills else round(rng.uniform(0.0, 0.05), 3) for _ in range(runs))
    specs = [make_spec(i, sleep=sleep) for i, sleep in enumerate(sleeps)]
    campaigns = {f"chaos-{i}": specs[i::CAMPAIGNS] for i in range(CAMPAIGNS)}
    with yard(folder, seed, isolated=isolated) as scene:
        with scene.daemon.client() as client:
            for name, some in campaigns.items():
                client.submit(submission_of(name, *some))
        with operating(scene.daemon.endpoint, tuple(campaigns), operators, seed) as seen:
            if kills:
                _kill_evenly(scene, runs, kills)
            else:
                _strike_often(scene, runs, every, limit)
        scene.settle()
        _go_on(scene.daemon, campaigns)
        _await_end(scene, folder, runs)
        for what, count in sorted(scene.done.items()):
            report.fact(what, count)
        report.fact("runs", runs)
        left = attempts_below(folder)
        report.expect(not left, f"spools keep {len(left)} attempts: {left[:2]}")
        verify(report, scene.daemon.state, runs)
        _check_seen(report, scene.daemon, campaigns, seen)
    return report


def _strike_often(scene, runs, every, limit):
    deadline = time.monotonic() + limit
    before = (0, runs)
    while before[1] and time.monotonic() < deadline:
        time.sleep(every)
        before = progress(scene.daemon.endpoint) or before
        if before[1]:
            scene.strike()
            scene.revive()


def _kill_evenly(scene, runs, kills):
    for number in range(1, kills + 1):
        due = runs * number // (kills + 1)
        eventually(lambda due=due: (progress(scene.daemon.endpoint) or (0,))[0] >= due, 900.0)
        scene.strike(kill=True)
        scene.revive()


@contextmanager
def operating(endpoint, campaigns, count, seed):
    """People who steer campaigns for the block; yields digests of results they were told of."""
    seen = {}
    closing = threading.Event()

    def steer(number):
        rng = random.Random(f"{seed}-{number}")
        while not closing.wait(rng.uniform(0.1, 2.0)):
            campaign = rng.choice(campaigns)
            with suppress(DaemonError), Client.open(endpoint, timeout=5.0) as client:
                deed = rng.choice(("list", "list", "cancel", "pause", "prioritise"))
                if deed == "cancel":
                    client.cancel(campaign)
                    client.retry(campaign, only="cancelled")
                elif deed == "pause":
                    client.steer(campaign, paused=True)
                    client.steer(campaign, paused=False)
                elif deed == "prioritise":
                    client.steer(campaign, priority=rng.randint(-5, 5))
                else:
                    page = client.runs(campaign, state="done", limit=200, results=True)
                    seen.update((row.id, row.result.trace.sha256) for row in page.rows)

    with ThreadPoolExecutor(max(count, 1)) as people:
        steering = [people.submit(steer, number) for number in range(count)]
        try:
            yield seen
        finally:
            closing.set()
        for one in steering:
            one.result()


def _go_on(daemon, campaigns):
    """Undo what operators were about to undo when the daemon was killed."""
    with daemon.client() as client:
        for name in campaigns:
            client.steer(name, paused=False)
            client.retry(name, only="cancelled")


def _check_seen(report, daemon, campaigns, seen):
    """Whatever an operator was told of a result is still so."""
    with daemon.client() as client:
        rows = [row for name in campaigns for row in client.all_runs(name, results=True)]
    now = {row.id: row.result.trace.sha256 for row in rows if row.result is not None}
    changed = [run for run, digest in seen.items() if now.get(run) != digest]
    report.fact("results that operators saw", len(seen))
    report.expect(not changed, f"{len(changed)} results are gone or others: {changed[:3]}")


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
