"""Nothing that a run has started outlives it, whatever ends it: processes that are really there."""

import faulthandler
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from daemon.batch.worker import _loop
from daemon.batch.worker._connection import describe_worker
from daemon.batch.worker._loop import UsageMeter
from daemon.model.verdicts import RunState
from daemon.supervision.child import when_stdin_ends
from daemon.supervision.guardian import end_guarded, guard
from tests.fake_run import leave_process
from tests.make import make_spec, make_submission, submission_of
from tests.parts import alive, daemon_at, eventually, finish, worker_for


def left_behind(file, count=0):
    """The processes of a file of numbers that are there; none unless the file has so many."""
    numbers = file.read_text().split() if file.exists() else []
    found = []
    for number in numbers if len(numbers) >= count else ():
        with suppress(psutil.NoSuchProcess):
            found.append(psutil.Process(int(number)))
    return alive(found)


# --- below a worker


RUNS = {
    "ends": {},
    "raises": {"raise": "no such door"},
    "crashes": {"crash": [1]},
    # It goes on for so long: otherwise it may have ended before it is noticed.
    "its guardian is killed": {"kill": 0, "sleep": 600.0},
}


def test_nothing_outlives_a_run_however_it_ends(tmp_path):
    specs = [
        make_spec(number, leaves=str(tmp_path / str(number)), **what)
        for number, what in enumerate(RUNS.values())
    ]
    with daemon_at(tmp_path / "state", 2, attempts=1) as daemon, daemon.client() as client:
        client.submit(submission_of("c", *specs))
        rows = finish(client, "c")
        assert [row.state for row in rows] == [RunState.DONE] + 3 * [RunState.LOST]
        for number, name in enumerate(RUNS):
            # Not only in the end: before anybody was told that the run has ended.
            assert (tmp_path / str(number)).exists()
            assert left_behind(tmp_path / str(number)) == [], name
        for row, words in zip(rows[1:], ("no such door", "SIGKILL", "SIGKILL"), strict=True):
            assert words in row.reason


def kill_zygote(worker, client):
    (server,) = [one for one in psutil.Process(worker.pid).children() if one.children()]
    server.kill()
    client.cancel("c")


@pytest.mark.parametrize(
    "end",
    [
        lambda worker, client: client.cancel("c"),
        lambda worker, client: worker.signal(signal.SIGQUIT),
        lambda worker, client: worker.signal(signal.SIGKILL),
        kill_zygote,
    ],
    ids=["cancelled", "worker quits", "worker is killed", "zygote is killed"],
)
def test_nothing_outlives_a_run_that_something_above_it_ends(shared, client, tmp_path, end):
    file = tmp_path / "left"
    with worker_for(shared, 1, "--step-back", "3") as worker:
        client.submit(make_submission("c", 1, leaves=str(file), sleep=600.0))
        begun = eventually(lambda: left_behind(file, 2))
        autogroup = Path(f"/proc/{worker.pid}/autogroup")
        assert not autogroup.exists() or autogroup.read_text().endswith("nice 3\n")
        end(worker, client)
        eventually(lambda: not alive(begun))
        client.cancel("c")
        eventually(lambda: client.campaign("c").finished and not client.overview().running)
        client.delete(("c",))


# --- below a guardian

CONTEXT = multiprocessing.get_context("fork")


def guarded(folder, run):
    faulthandler.disable()  # pytest's would tell of crashes that are meant
    guard(folder / "output")
    leave_process(folder / "left")
    with (folder / "left").open("a") as file:
        file.write(f"{os.getpid()}\n")
    run()


def start(folder, run):
    process = CONTEXT.Process(target=guarded, args=(folder, run))
    process.start()
    return process


@pytest.mark.parametrize(
    ("run", "code"),
    [
        (lambda: None, 0),
        (lambda: os._exit(7), 7),
        (lambda: os.kill(os.getpid(), signal.SIGSEGV), -signal.SIGSEGV),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), -signal.SIGKILL),
    ],
    ids=["returns", "exits", "crashes", "is killed"],
)
def test_a_guardian_ends_as_the_run_does_and_nothing_is_left(tmp_path, run, code):
    process = start(tmp_path, run)
    process.join()
    assert process.exitcode == code
    assert left_behind(tmp_path / "left") == []


def test_a_run_is_ended_by_its_guardian(tmp_path):
    process = start(tmp_path, signal.pause)
    eventually(lambda: left_behind(tmp_path / "left", 3))
    end_guarded(process)
    assert left_behind(tmp_path / "left") == []


def guard_and_wait(file):
    guard()
    file.write_text(str(os.getpid()))
    signal.pause()


def test_a_guardian_that_is_stopped_does_not_keep_a_run(tmp_path, monkeypatch):
    monkeypatch.setattr("daemon.supervision.guardian.KILL_LIMIT", 0.0)
    process = CONTEXT.Process(target=guard_and_wait, args=(tmp_path / "run",))
    process.start()
    run = eventually(lambda: left_behind(tmp_path / "run", 1))
    os.kill(process.pid, signal.SIGSTOP)
    end_guarded(process)
    eventually(lambda: not alive(run))


# --- by a tether

HELD = """
import os, time
from daemon.supervision.child import when_stdin_ends
when_stdin_ends(lambda: os._exit(1))
os.write(0, b"!")
while True:
    time.sleep(60.0)
"""


@pytest.mark.parametrize("unread", [False, True])
def test_a_process_ends_with_the_other_end_of_its_tether(unread):
    ours, theirs = socket.socketpair()
    # As a server that is killed leaves a socket: with what it has not read, that is an error.
    with ours, theirs, subprocess.Popen([sys.executable, "-c", HELD], stdin=theirs) as process:
        theirs.close()
        ours.recv(1, 0 if not unread else socket.MSG_PEEK)
        ours.close()
        try:
            assert process.wait(60.0) == 1
        finally:
            process.kill()


def test_a_tether_that_does_not_wait_has_not_ended_yet(monkeypatch):
    theirs, ours = os.pipe()
    os.set_blocking(theirs, False)  # as whoever gave it to us may have left it
    asked, ended, read = threading.Event(), threading.Event(), os.read

    def watched_read(descriptor, size):
        try:
            return read(descriptor, size)
        except BlockingIOError:
            asked.set()
            raise

    with os.fdopen(theirs) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        monkeypatch.setattr(os, "read", watched_read)
        when_stdin_ends(ended.set)
        assert asked.wait(60.0)
        asked.clear()
        os.write(ours, b"?")  # still held
        assert asked.wait(60.0)
        assert not ended.is_set()
        os.close(ours)
        assert ended.wait(60.0)


# --- a worker's share of its machine, over all of its processes

ALLOCATED = 100 * 2**20
PROGRAM = f"""
data = b"x" * {ALLOCATED}
total = sum(data[:20_000_000])
print(flush=True)
input()
"""


def test_memory_and_processor_time_of_children_count(monkeypatch):
    monkeypatch.setattr(_loop, "_USAGE_PERIOD", 0.0)
    meter = UsageMeter()
    me = describe_worker()
    before = meter.measure(me)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", PROGRAM], **pipes) as child:
        child.stdout.readline()
        during = meter.measure(me)
        child.communicate(b"\n")
    assert during.memory - before.memory > 0.9 * ALLOCATED
    assert 0.0 < during.cpu <= 1.0
    assert before.memory_total == psutil.virtual_memory().total
    assert meter.measure(me).memory < during.memory - 0.9 * ALLOCATED
    # They are looked at once in a period at most.
    monkeypatch.setattr(_loop, "_USAGE_PERIOD", 3600.0)
    assert meter.measure(me) == meter.measure(me)
