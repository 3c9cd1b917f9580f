"""Machine code is compiled by one process at a time, which the others wait for."""

import fcntl
import select
import socket
import threading

import pytest

from daemon.batch.numba_cache import CACHE_VARIABLE, numba_cache_folder
from daemon.batch.run_process import PREPARATION
from daemon.batch.zygote import compiling_alone
from daemon.model.status import Preparation, PreparationPhase
from grammars.text import codec


@pytest.fixture
def wire():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        yield ours, theirs


def test_who_comes_second_says_that_it_waits_and_begins_when_the_first_is_done(tmp_path, wire):
    ours, theirs = wire
    begun = threading.Event()

    def second():
        with compiling_alone(tmp_path, theirs):
            begun.set()

    with (tmp_path / "kernels.lock").open("ab") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        waiting = threading.Thread(target=second)
        waiting.start()
        message = ours.recv(1000)
        assert message[:1] == PREPARATION
        waits = Preparation(PreparationPhase.WAITING)
        assert codec.from_json(Preparation, message[1:]) == waits
        assert not begun.is_set()
    assert begun.wait(30.0)
    waiting.join()


def test_nobody_is_waited_for_where_nothing_can_be_written(tmp_path, wire):
    (tmp_path / "file").touch()
    with compiling_alone(tmp_path / "file" / "kernels", wire[1]):
        assert not select.select([wire[0]], [], [], 0.0)[0]


def test_processes_that_share_a_cache_share_its_folder(tmp_path):
    assert numba_cache_folder({CACHE_VARIABLE: str(tmp_path)}) == tmp_path
    assert numba_cache_folder({}).name in ("__pycache__", "numba")
