"""A run that waits for its kernels keeps no other from the slots that are free."""

import os
import signal
import time
from dataclasses import replace

from daemon.batch.worker import _work, work
from daemon.model.spec import SutReference
from daemon.model.status import Preparation, PreparationPhase
from tests.make import make_spec, submission_of
from tests.parts import EXECUTOR, daemon_at

LOOKS = 5


class Compiling:
    """A backend with the kernels of ``pilot`` alone; ends the worker when it has seen enough."""

    slots = 2
    waitables = ()
    trouble = ""
    preparation = Preparation(PreparationPhase.COMPILING, 1)

    def __init__(self):
        self.started = []
        self._looks = 0

    def listen(self): ...

    def prepare(self, spec, *_):
        if spec.sut.kind == "pilot":
            return True
        self._looks += 1
        if self._looks == LOOKS:
            os.kill(os.getpid(), signal.SIGQUIT)
        return False

    def start(self, attempt, *_):
        self.started.append(attempt.lease.run)
        os.kill(os.getpid(), signal.SIGQUIT)
        raise OSError("it has been seen")


def test_a_run_that_waits_for_kernels_keeps_no_other_waiting(tmp_path, monkeypatch):
    first = replace(make_spec(0), sut=SutReference("ros", "ros", {}))
    backend = Compiling()
    monkeypatch.setattr(_work, "_open_backend", lambda *_: backend)
    with daemon_at(tmp_path / "state") as daemon:
        with daemon.client() as client:
            client.submit(submission_of("c", first, make_spec(1)))
        work(daemon.endpoint, slots=2, executor=EXECUTOR)
    assert backend.started == ["c.1"]


class Counting(Compiling):
    """Compiles on and on; ends the worker when the daemon calls it busy, or after a while."""

    def __init__(self, client):
        super().__init__()
        self.client, self.busy, self._until = client, 0, time.monotonic() + 20.0

    @property
    def preparation(self):
        self._looks += 1
        return Preparation(PreparationPhase.COMPILING, self._looks)

    def prepare(self, *_):
        self.busy = sum(row.busy for row in self.client.workers())
        if self.busy == self.slots or time.monotonic() > self._until:
            os.kill(os.getpid(), signal.SIGQUIT)
        return False


def test_runs_that_wait_for_kernels_have_their_slots(tmp_path, monkeypatch):
    with daemon_at(tmp_path / "state") as daemon, daemon.client() as client:
        backend = Counting(client)
        monkeypatch.setattr(_work, "_open_backend", lambda *_: backend)
        client.submit(submission_of("c", *(make_spec(repeat) for repeat in range(3))))
        work(daemon.endpoint, slots=2, executor=EXECUTOR)
    assert backend.busy == 2
