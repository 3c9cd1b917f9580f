"""A worker between a real daemon and a real Dask cluster; what goes wrong, goes wrong for real.

The long tests have clusters that lose their workers, their scheduler or their gateway.
"""

import hashlib
from pathlib import Path

import pytest

from daemon.model.attachments import attach_files
from daemon.model.verdicts import Outcome, RunState
from tests.batch.dask_harness import begun, dask_in, gateway_for
from tests.make import make_spec, make_submission, submission_of
from tests.parts import alive, daemon_at, eventually, finish


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    """A cluster of one worker with two threads."""
    with dask_in(tmp_path_factory.mktemp("dask"), 2) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def client(dask, tmp_path_factory):
    """A daemon without slots of its own, where a run is lost the second time it is blamed."""
    with (
        daemon_at(tmp_path_factory.mktemp("daemon") / "state", attempts=2) as daemon,
        gateway_for(dask, daemon),
        daemon.client() as connected,
    ):
        eventually(lambda: [row.slots for row in connected.workers()] == [2])
        yield connected


def test_runs_come_back_with_results_traces_and_the_files_they_read(client, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "policy").write_bytes(b"weights")
    files, log = attach_files({"model": tmp_path / "policy"}), tmp_path / "log"
    how = {"reads": "model", "outcome": "fail", "log": str(log)}
    client.submit(make_submission("plain", 6, files=files, **how))
    for row in finish(client, "plain"):
        assert (row.state, row.outcome, row.attempt) == (RunState.DONE, Outcome.FAIL, 1), row.reason
        trace = Path(row.trace).read_bytes()
        assert trace.endswith(hashlib.sha256(b"weights").hexdigest().encode())
        assert hashlib.sha256(trace).hexdigest() == client.run(row.id).row.result.trace.sha256
    # Every run has a fresh and nice process.
    lines = [line.split() for line in log.read_text().splitlines()]
    assert len({pid for _, pid, _ in lines}) == 6
    assert all(int(nice) >= 10 for _, _, nice in lines)


def test_a_run_that_crashes_is_blamed_and_harms_no_other(client):
    poison = make_spec(0, crash=[1, 2])
    client.submit(submission_of("poison", poison, *(make_spec(i) for i in range(1, 5))))
    lost, *others = finish(client, "poison")
    assert (lost.state, lost.attempt) == (RunState.LOST, 2)
    assert "killed by SIGKILL" in lost.reason
    assert [(row.state, row.attempt) for row in others] == [(RunState.DONE, 1)] * 4


def test_cancelling_stops_the_processes_at_once(client, dask, tmp_path):
    log = tmp_path / "log"
    client.submit(make_submission("cancel", 4, sleep=600.0, log=str(log)))
    running = eventually(lambda: begun(log, 2))
    client.cancel("cancel")
    eventually(lambda: not alive(running))
    client.submit(make_submission("next", 1))
    finish(client, "next")
    eventually(lambda: not dask.leftovers())
