"""Workers, processes of runs, their stacks, relays and supervisors are killed at random."""

import random
import tempfile
import time
from collections import Counter
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import psutil
import pytest

from daemon.stacks.ros2.process import StackProcess
from daemon.stacks.ros2.settings import Ros2Settings
from tests.chaos.executor import EXECUTOR, PROGRAMS
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.make import make_spec, submission_of
from tests.parts import daemon_at, eventually, finished, worker_for

MARKER = "SCENARIO_STACK"
PATIENCE = 300.0
"""Seconds for runs that nobody disturbs any more, on a machine that has much else to do."""
TARGETS = {"worker": 1, "process of a run": 3, "stack": 3, "relay": 3, "supervisor": 2}


@contextmanager
def folder_of_stacks():
    """Temporary files of everything that is started meanwhile, so that others' stay out of it."""
    with tempfile.TemporaryDirectory(dir="/tmp") as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", folder)
        patch.setattr(tempfile, "tempdir", folder)
        yield Path(folder)


class Stacks:
    """What runs in a folder of stacks, and what was done to it."""

    def __init__(self, folder, workers, rng):
        self.done = Counter()
        self._folder, self._workers, self._rng = folder, workers, rng
        self._started = Counter()

    def strike(self):
        """Kill something, with SIGKILL."""
        target = self._rng.choices(list(TARGETS), list(TARGETS.values()))[0]
        if target == "worker":
            worker = self._rng.choice(self._workers)
            worker.kill()
            worker.restart()
            self.done["worker killed"] += 1
            return
        found = sorted(self._find(target), key=lambda process: process.pid)
        if found:
            with suppress(psutil.NoSuchProcess):
                self._rng.choice(found).kill()
                self.done[f"{target} killed"] += 1

    def revive(self):
        """Start workers again that have given up."""
        for worker in self._workers:
            if worker.process.poll() is not None:
                worker.restart()

    def _find(self, target):
        for process in psutil.process_iter():
            with suppress(psutil.Error):
                words = " ".join(process.cmdline())
                if "supervision.supervisor" in words and self._is_ours(process):
                    parent = process.parent()
                    if target == "supervisor":
                        yield process
                    elif target == "process of a run" and parent is not None and parent.pid != 1:
                        yield parent
                elif self._belongs_to_a_stack(process):
                    role = "relay" if "/relay.py" in words else "stack"
                    if target == role:
                        yield process

    def _belongs_to_a_stack(self, process):
        return MARKER in process.environ() and self._is_ours(process)

    def _is_ours(self, process):
        return bool(process.environ().get("TMPDIR") == str(self._folder))

    def left(self):
        """What runs or listens, or lies in the folder."""
        found = []
        for process in psutil.process_iter():
            with suppress(psutil.Error):
                words = " ".join(process.cmdline())
                supervises = "supervision.supervisor" in words and self._is_ours(process)
                if supervises or self._belongs_to_a_stack(process):
                    found.append(f"process {process.pid}: {words[:120]}")
        sockets = Path("/proc/net/unix").read_text().splitlines()
        found += [f"socket {line.split()[-1]}" for line in sockets if str(self._folder) in line]
        found += [f"folder {path}" for path in self._folder.glob("scenario-*/stacks/*/")]
        return found


def stacks(folder, *, runs=50, seed=1, every=0.5, limit=120.0):
    """Strike every ``every`` seconds until nothing is under way; then look for what is left.

    After ``limit`` seconds what is still under way is left to end undisturbed.
    """
    report = Report("stacks: workers, runs, stacks, relays and supervisors killed")
    rng = random.Random(seed)
    specs = [make_spec(i, stack=round(rng.uniform(0.2, 1.5), 3)) for i in range(runs)]
    with folder_of_stacks() as place:
        with batch(folder, place, rng) as (daemon, scene):
            _strike(report, daemon, scene, specs, every, limit)
        for what, count in sorted(scene.done.items()):
            report.fact(what, count)
        report.fact("runs", runs)
        # The next stack of this machine ends what a killed supervisor of a killed run has left.
        last = StackProcess(Ros2Settings(launch="true"), values={}, relay=PROGRAMS / "relay.py")
        last.release()
        deadline = time.monotonic() + 30.0
        while scene.left() and time.monotonic() < deadline:
            time.sleep(0.1)
        left = scene.left()
        report.expect(not left, f"{len(left)} things are left: {left[:4]}")
        verify(report, folder / "state", runs)
    return report


@contextmanager
def batch(folder, place, rng):
    """A daemon and two workers with two slots each, whose stacks lie in ``place``."""
    with ExitStack() as parts:
        daemon = parts.enter_context(daemon_at(folder / "state", 0, lease=3.0, attempts=200))
        workers = [
            parts.enter_context(
                worker_for(daemon, 2, "--state", str(folder / f"worker-{i}"), executor=EXECUTOR)
            )
            for i in range(2)
        ]
        yield daemon, Stacks(place, workers, rng)


def _strike(report, daemon, scene, specs, every, limit):
    with daemon.client() as client:
        client.submit(submission_of("chaos", *specs))
        deadline = time.monotonic() + limit
        while not finished(client, len(specs)) and time.monotonic() < deadline:
            time.sleep(every)
            scene.strike()
            scene.revive()
        eventually(lambda: finished(client, len(specs)), PATIENCE)
    # The harness kills what is below its parts: supervisors shall have ended their stacks before.
    patience = time.monotonic() + 30.0
    while any("process" in what for what in scene.left()) and time.monotonic() < patience:
        time.sleep(0.1)
