"""What a run and its worker tell each other: bounded, and never at the cost of the run."""

import math
import platform
import socket
from contextlib import suppress
from dataclasses import replace
from itertools import count
from multiprocessing.connection import wait
from types import SimpleNamespace

import pytest

from daemon.batch import run_process
from daemon.batch.run_process import (
    COMPILED,
    ENDED,
    FAILED,
    LARGEST_MESSAGE,
    LIVE,
    READY,
    STARTED,
    WATCH,
    SnapshotSender,
)
from daemon.batch.worker import _zygotes
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._live import LineBudget
from daemon.batch.worker._zygotes import ForkedExecution
from daemon.model.execution import available_cores, core_quota, machine_text
from daemon.model.messages import Lease
from daemon.model.spec import Snapshot
from daemon.model.status import LiveSnapshot, Preparation, PreparationPhase
from grammars.model.geometry import Pose2
from grammars.text import codec
from tests.make import make_spec

RUN = "a-campaign-with-a-long-name-0123abcd.99999"
FULL = Snapshot(
    0.0,
    1200.0,
    Pose2(-12.345678901234567, 23.456789012345678, -1.2345678901234567),
    None,
    0,
    12,
    tuple(-1.2345678901234567 - index for index in range(500)),
)


@pytest.fixture
def wires():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        yield ours, theirs


# --- what a run tells


def test_kernels_that_are_compiled_beside_the_first_runs_are_counted_on(wires):
    zygote, pool = object.__new__(_zygotes.ZygoteProcess), _zygotes.ZygotePool(1)
    zygote.wire, zygote.failure, zygote.ready, zygote._awaited = wires[0], "", set(), set()
    zygote.compiled, zygote._count = None, 0
    zygote.wire.setblocking(False)
    pool._zygotes["pilot"] = zygote
    counts = []
    for message in (b"0", b"2", None, b"1"):
        wires[1].send(READY + b"pilot" if message is None else COMPILED + message)
        pool.listen()
        counts.append(pool.preparation and pool.preparation.done)
    assert counts == [0, 2, None, 3]
    words = [Preparation(PreparationPhase.COMPILING, count).words for count in (0, 3)]
    assert words[1] == f"{words[0]}: 3 so far"


def test_a_building_full_of_doors_is_told_whole(wires):
    ours, theirs = wires
    SnapshotSender(RUN, theirs)(FULL)
    message = ours.recv(LARGEST_MESSAGE)
    assert message[:1] == LIVE
    assert codec.from_json(LiveSnapshot, message[1:]).snapshot == FULL


def test_a_run_waits_for_no_worker_and_is_told_in_whole_messages(wires):
    ours, theirs = wires
    sender = SnapshotSender(RUN, theirs)
    for second in range(1000):
        sender(replace(FULL, time=float(second)))
    ours.setblocking(False)
    times = []
    with suppress(BlockingIOError):
        while True:
            message = ours.recv(LARGEST_MESSAGE)[1:]
            times.append(codec.from_json(LiveSnapshot, message).snapshot.time)
    assert times == [float(second) for second in range(len(times))]
    assert 0 < len(times) < 1000
    ours.close()
    sender(FULL)
    assert sender.interest() == "progress"


@pytest.mark.parametrize(
    ("words", "interest", "wanted", "often"),
    [
        ("", "progress", "nothing", 5),
        ("details", "everything", "nothing", 10),
        ("details judgement", "everything", "everything", 10),
        ("margin", "progress", "margin", 5),
    ],
)
def test_a_run_hears_what_is_wanted_of_it(wires, monkeypatch, words, interest, wanted, often):
    """And tells so much, so often in a second."""
    milliseconds = count(1_000_000)
    clock = SimpleNamespace(monotonic=lambda: next(milliseconds) / 1000.0)
    monkeypatch.setattr(run_process, "time", clock)
    ours, theirs = wires
    ours.send(WATCH + b"details judgement margin")
    ours.send(WATCH + words.encode())
    sender = SnapshotSender(RUN, theirs)
    assert (sender.interest(), sender.scope()) == (interest, wanted)
    asked = [sender.interest() for _ in range(10_000)]
    assert set(asked) == {interest, "nothing"}
    assert round(asked.count(interest) / 10.0) == often


def test_a_short_message_after_a_pause_is_never_left_out():
    budget = LineBudget(filled_at=0.0)
    budget.spend(200_000)
    assert not budget.allows(1.0)
    assert budget.allows(6.0)
    budget.spend(1)
    assert budget.allows(6.0)


# --- how a worker learns of its end


class Zygote:
    """A zygote that may be ended, and ends nothing by it."""

    failure = ""

    def end(self, why):
        self.failure = why


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(time=1000.0)
    monkeypatch.setattr(_zygotes, "time", SimpleNamespace(monotonic=lambda: now.time))
    return now


@pytest.fixture
def execution(wires, clock, tmp_path):
    lease = Lease("c.0", "c", 1, 7, "c/S1.mcap", make_spec())
    attempt = Attempt.prepare(tmp_path / "attempt-1", lease)
    wires[0].setblocking(False)
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


def test_a_run_that_never_started_is_not_blamed(wires, execution):
    wires[1].close()
    execution.listen()
    assert execution.end.why == "the process that starts runs has ended"
    assert not execution.end.counts


def pass_deadline(execution, clock):
    clock.time = execution.deadline + 1.0
    execution.listen()


def test_a_silent_zygote_is_ended_and_its_run_given_up(execution, clock):
    pass_deadline(execution, clock)
    assert "did not answer" in execution.zygote.failure
    assert execution.end is None
    pass_deadline(execution, clock)
    assert not execution.end.counts


def test_a_run_that_does_not_end_costs_its_zygote_and_keeps_no_worker(wires, execution, clock):
    wires[1].send(STARTED)
    execution.listen()
    pass_deadline(execution, clock)
    assert wires[1].recv(10) == b"", "its guardian has it end"
    assert not execution.zygote.failure
    pass_deadline(execution, clock)
    assert execution.zygote.failure
    pass_deadline(execution, clock)
    assert execution.end.why == "stopped after 10 s of wall clock time"


def test_a_machine_is_told_by_its_processor_and_cores_and_not_by_its_name():
    said = machine_text()
    assert f"{available_cores()} core" in said
    assert platform.python_version() in said
    assert platform.node() not in said
    assert all(part.strip() for part in said.split(","))


@pytest.mark.parametrize(
    ("groups", "files", "cores"),
    [
        ("0::/a/b\n", {"a/cpu.max": "150000 100000", "a/b/cpu.max": "max 100000"}, 1.5),
        ("0::/../other\n", {"cpu.max": "50000 100000"}, 0.5),
        ("0::/a\n", {}, math.inf),
        (
            "4:memory:/x\n3:cpu,cpuacct:/docker/1\n",
            {"cpu,cpuacct/cpu.cfs_quota_us": "200000", "cpu,cpuacct/cpu.cfs_period_us": "100000"},
            2.0,
        ),
        (
            "1:cpu:/\n",
            {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"},
            math.inf,
        ),
    ],
)
def test_a_container_grants_the_cores_of_its_quota(tmp_path, groups, files, cores):
    for name, text in {f"sys/fs/cgroup/{n}": t for n, t in files.items()}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/cgroup").write_text(groups)
    assert core_quota(tmp_path) == cores
