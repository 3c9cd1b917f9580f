"""What a worker waits for while a run ends."""

import os
from multiprocessing import Pipe
from multiprocessing.connection import wait
from types import SimpleNamespace

import pytest

from daemon.batch.run_process import FAILED
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._forkserver import ForkedExecution
from daemon.model.messages import Lease
from tests.daemon.batch.samples import make_spec


@pytest.fixture
def guardian():
    """A process that goes on until ``held`` is closed, as far as can be seen from outside."""
    sentinel, held = os.pipe()
    yield SimpleNamespace(sentinel=sentinel, held=held, exitcode=None)
    os.close(sentinel)
    os.close(held)


def execution_of(guardian, wire, folder):
    lease = Lease("c.0", "c", 1, 7, "c/S1.mcap", make_spec())
    attempt = Attempt.prepare(folder / "attempt-1", lease)
    return ForkedExecution(attempt, guardian, wire, 1e9, float("inf"), lambda: None, lambda: None)


def test_a_pipe_the_run_has_closed_wakes_nobody_while_its_guardian_ends(tmp_path, guardian):
    ours, theirs = Pipe(duplex=False)
    execution = execution_of(guardian, ours, tmp_path)
    with ours:
        with theirs:
            theirs.send_bytes(FAILED + b"no such door")
            assert wait(execution.waitables, 60.0) == [ours]
        execution.listen()
        assert wait(execution.waitables, 0.0) == []
        guardian.exitcode = 1
        assert execution.end is not None
        assert execution.end.why == "no such door"


def test_a_run_that_was_killed_in_the_middle_of_a_message_ends_nobody_else(tmp_path, guardian):
    ours, theirs = Pipe(duplex=False)
    execution = execution_of(guardian, ours, tmp_path)
    with ours:
        with theirs:
            # Longer than what a full pipe takes at once: a message that long is written in parts.
            os.write(theirs.fileno(), (8000).to_bytes(4, "big") + FAILED + b"no such")
        execution.listen()
        assert wait(execution.waitables, 0.0) == []
        guardian.exitcode = -9
        assert execution.end is not None
        assert execution.end.why == "the run's process was killed by SIGKILL"
