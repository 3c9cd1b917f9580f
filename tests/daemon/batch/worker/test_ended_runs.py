"""What a worker waits for while a run ends."""

from __future__ import annotations

import os
from collections.abc import Iterator
from multiprocessing import Pipe
from multiprocessing.connection import wait
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from daemon.batch.run_process import FAILED
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._forkserver import ForkedExecution
from daemon.model.messages import Lease
from tests.daemon.batch.samples import make_spec


@pytest.fixture
def guardian() -> Iterator[Any]:
    """A process that goes on until ``held`` is closed, as far as can be seen from outside."""
    sentinel, held = os.pipe()
    yield SimpleNamespace(sentinel=sentinel, held=held, exitcode=None)
    os.close(sentinel)
    os.close(held)


def test_a_pipe_the_run_has_closed_wakes_nobody_while_its_guardian_ends(
    tmp_path: Path, guardian: Any
) -> None:
    ours, theirs = Pipe(duplex=False)
    lease = Lease("c.0", "c", 1, 7, "c/S1.mcap", make_spec())
    attempt = Attempt.prepare(tmp_path / "attempt-1", lease)
    execution = ForkedExecution(
        attempt, guardian, ours, 1e9, float("inf"), lambda: None, lambda: None
    )
    with ours:
        with theirs:
            theirs.send_bytes(FAILED + b"no such door")
            assert wait(execution.waitables, 60.0) == [ours]
        execution.listen()
        assert wait(execution.waitables, 0.0) == []
        guardian.exitcode = 1
        assert execution.end is not None
        assert execution.end.why == "no such door"
