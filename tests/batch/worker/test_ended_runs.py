"""The end of a run, as its worker learns of it."""

import signal
import socket
from multiprocessing.connection import wait
from types import SimpleNamespace

import psutil
import pytest

from daemon.batch.run_process import ENDED, FAILED, STARTED
from daemon.batch.worker import _zygotes
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._zygotes import ForkedExecution, ZygotePool
from daemon.model.execution import RunLimits
from daemon.model.messages import Lease
from grammars.text import codec
from tests.make import SCENE, make_spec
from tests.parts import EXECUTOR, alive, eventually


class Zygote:
    """A zygote that may be ended, and ends nothing by it."""

    failure = ""

    def end(self, why):
        self.failure = why


@pytest.fixture
def wires():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    with ours, theirs:
        yield ours, theirs


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(time=1000.0)
    monkeypatch.setattr(_zygotes, "time", SimpleNamespace(monotonic=lambda: now.time))
    return now


@pytest.fixture
def execution(wires, clock, tmp_path):
    lease = Lease("c.0", "c", 1, 7, "c/S1.mcap", make_spec())
    attempt = Attempt.prepare(tmp_path / "attempt-1", lease)
    return ForkedExecution(attempt, Zygote(), wires[0], 10.0)


def test_a_run_ends_when_nothing_of_it_is_left(wires, execution):
    wires[1].send(STARTED)
    wires[1].send(FAILED + b"no such door")
    assert wait(execution.waitables, 60.0) == [wires[0]]
    execution.listen()
    assert execution.end is None
    wires[1].send(ENDED + b"1")
    execution.listen()
    assert (execution.end.why, execution.end.counts) == ("no such door", True)
    assert execution.waitables == ()


def test_a_run_that_was_killed_says_by_what(wires, execution):
    wires[1].send(STARTED)
    wires[1].send(ENDED + b"-9")
    execution.listen()
    assert execution.end.why == "the run's process was killed by SIGKILL"


def test_a_run_that_never_started_is_not_blamed(wires, execution):
    wires[1].close()
    execution.listen()
    assert execution.end.why == "the process that starts runs has ended"
    assert not execution.end.counts


def test_a_silent_zygote_is_ended_and_its_run_given_up(execution, clock):
    clock.time = execution.deadline + 1.0
    execution.listen()
    assert "did not answer" in execution.zygote.failure
    assert execution.end is None
    clock.time = execution.deadline + 1.0
    execution.listen()
    assert not execution.end.counts


def test_a_run_that_does_not_end_costs_its_zygote_and_keeps_no_worker(wires, execution, clock):
    wires[1].send(STARTED)
    execution.listen()
    clock.time = execution.deadline + 1.0
    execution.listen()
    assert wires[1].recv(10) == b"", "its guardian has it end"
    assert not execution.zygote.failure
    clock.time = execution.deadline + 1.0
    execution.listen()
    assert execution.zygote.failure
    clock.time = execution.deadline + 1.0
    execution.listen()
    assert execution.end.why == "stopped after 10 s of wall clock time"


@pytest.fixture
def pool():
    pool = ZygotePool(1, EXECUTOR)
    pool.warm_up()
    yield pool
    pool.close()


def begin(pool, folder, **what):
    """Have a run begin that lasts, and leaves processes behind."""
    (folder / "scene.json").write_bytes(codec.to_json(SCENE))
    spec = make_spec(leaves=str(folder / "left"), sleep=600.0, **what)
    attempt = Attempt.prepare(folder / "attempt-1", Lease("c.0", "c", 1, 7, "c/0.mcap", spec))
    eventually(lambda: pool.listen() or pool.prepare(spec, folder / "scene.json", RunLimits()))
    execution = pool.start(attempt, folder / "scene.json", RunLimits())
    file = folder / "left"
    numbers = eventually(lambda: file.exists() and len(n := file.read_text().split()) == 2 and n)
    return execution, [psutil.Process(int(number)) for number in numbers]


def zygote_of_mine():
    mine = psutil.Process().children()
    (zygote,) = [one for one in alive(mine) if "daemon.batch.zygote" in one.cmdline()]
    return zygote


def ended(execution):
    execution.listen()
    if execution.end is not None:
        execution.close()
    return execution.end is not None


def test_a_guardian_that_is_stopped_keeps_no_run(pool, tmp_path, monkeypatch):
    execution, left = begin(pool, tmp_path)
    monkeypatch.setattr(_zygotes, "_KILL_PATIENCE", 0.2)
    monkeypatch.setattr(_zygotes, "_LAST_PATIENCE", 0.2)
    zygote = zygote_of_mine()
    (guardian,) = zygote.children()
    guardian.send_signal(signal.SIGSTOP)
    zygote.send_signal(signal.SIGSTOP)
    execution.kill("not wanted")
    eventually(lambda: ended(execution))
    assert not alive([zygote])
    guardian.send_signal(signal.SIGCONT)
    eventually(lambda: not alive([guardian, *left]))


def test_a_zygote_that_died_is_replaced(pool, tmp_path):
    execution, left = begin(pool, tmp_path)
    zygote = zygote_of_mine()
    zygote.kill()
    eventually(lambda: ended(execution))
    eventually(lambda: not alive(left))
    (tmp_path / "left").unlink()
    (tmp_path / "again").mkdir()
    execution, left = begin(pool, tmp_path / "again")
    execution.kill("not wanted")
    eventually(lambda: ended(execution))
    assert not alive(left)
