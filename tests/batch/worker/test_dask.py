"""A worker between a real daemon and a real Dask cluster; what goes wrong, goes wrong for real."""

import hashlib
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.attachments import attach_files
from daemon.model.execution import DEFAULT_EXECUTOR
from daemon.model.run_state import RunState
from daemon.model.spec import SutReference
from daemon.model.submission import Submission
from daemon.model.verdicts import Outcome
from daemon.run import execute
from tests.batch.dask_harness import dask_in, gateway, gateway_for
from tests.make import make_spec, make_submission, submission_of
from tests.parts import alive, daemon_at, eventually


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    """A cluster of one worker with two threads."""
    with dask_in(tmp_path_factory.mktemp("dask"), 2) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    """A daemon without slots of its own, where a run is lost the second time it is blamed."""
    with daemon_at(tmp_path_factory.mktemp("daemon") / "state", attempts=2) as part:
        yield part


@pytest.fixture(scope="module")
def worker(dask, daemon):
    with gateway_for(dask, daemon) as part, daemon.client() as client:
        eventually(lambda: client.overview().workers == 1)
        eventually(lambda: client.workers()[0].slots == 2)
        yield part


@pytest.fixture
def client(daemon, worker):
    with daemon.client() as connected:
        yield connected


def done(client, campaign):
    return next(row.finished for row in client.campaigns() if row.id == campaign)


def test_runs_come_back_with_results_and_traces(client):
    client.submit(make_submission("plain", 6, outcome="fail"))
    eventually(lambda: done(client, "plain"))
    for row in client.runs("plain").rows:
        assert (row.state, row.outcome, row.attempt) == (RunState.DONE, Outcome.FAIL, 1)
        result = client.run(row.id).row.result
        assert result is not None
        assert hashlib.sha256(Path(row.trace).read_bytes()).hexdigest() == result.trace.sha256


def test_files_of_systems_travel_into_the_cluster(client, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "policy").write_bytes(b"weights")
    files = attach_files({"model": tmp_path / "policy"})
    client.submit(make_submission("files", 3, files=files, reads="model"))
    eventually(lambda: done(client, "files"))
    for row in client.runs("files").rows:
        digest = hashlib.sha256(b"weights").hexdigest()
        assert (row.state, row.attempt) == (RunState.DONE, 1), row.reason
        assert Path(row.trace).read_bytes().endswith(digest.encode())


def test_every_run_has_a_fresh_and_nice_process(client, tmp_path):
    log = tmp_path / "log"
    client.submit(make_submission("fresh", 6, log=str(log)))
    eventually(lambda: done(client, "fresh"))
    lines = [line.split() for line in log.read_text().splitlines()]
    assert len({pid for _, pid, _ in lines}) == 6
    assert all(int(nice) >= 10 for _, _, nice in lines)


def test_a_run_that_crashes_is_blamed_and_harms_no_other(client):
    poison = make_spec(0, crash=[1, 2])
    client.submit(submission_of("poison", poison, *(make_spec(i) for i in range(1, 5))))
    eventually(lambda: done(client, "poison"))
    lost, *others = client.runs("poison").rows
    assert (lost.state, lost.attempt) == (RunState.LOST, 2)
    assert "killed by SIGKILL" in lost.reason
    assert [(row.state, row.attempt) for row in others] == [(RunState.DONE, 1)] * 4


def test_limits_are_kept_where_it_executes(dask, tmp_path):
    specs = make_spec(0, allocate=2048), make_spec(1, sleep=600.0)
    # By a gateway of its own: on a busy machine 3 s may be too short for any other run.
    limits = ("--wall", "3", "--memory", str(2**30))
    with (
        daemon_at(tmp_path / "state") as daemon,
        daemon.client() as client,
        gateway_for(dask, daemon, *limits),
    ):
        client.submit(submission_of("limits", *specs))
        eventually(lambda: all(row.reason for row in client.runs("limits").rows))
        reasons = [row.reason for row in client.runs("limits").rows]
        assert "MemoryError" in reasons[0]
        assert "stopped after 3 s of wall clock time" in reasons[1]
        client.cancel("limits")


def test_cancelling_stops_the_processes_at_once(client, dask, tmp_path):
    log = tmp_path / "log"
    client.submit(make_submission("cancel", 4, sleep=600.0, log=str(log)))
    running = eventually(lambda: started(log, 2))
    client.cancel("cancel")
    eventually(lambda: not alive(running))
    client.submit(make_submission("next", 1))
    eventually(lambda: done(client, "next"))
    eventually(lambda: not dask.leftovers())


def started(log, count):
    """The processes of the runs that have begun and are not over, once there are as many."""
    lines = log.read_text().splitlines() if log.exists() else []
    pids = [int(line.split()[1]) for line in lines]
    going = [psutil.Process(pid) for pid in pids if psutil.pid_exists(pid)]
    return going if len(going) >= count else []


def test_dask_begins_a_run_anew_when_its_worker_dies(tmp_path):
    log, gate = tmp_path / "log", tmp_path / "gate"
    with (
        dask_in(tmp_path / "dask", kind="patient") as dask,
        daemon_at(tmp_path / "state") as daemon,
        daemon.client() as client,
        gateway_for(dask, daemon),
    ):
        (victim,) = dask.start_workers(1)
        client.submit(make_submission("anew", 1, until=str(gate), log=str(log)))
        running = eventually(lambda: started(log, 1))
        dask.start_workers(1)
        victim.kill()
        eventually(lambda: not alive(running))
        eventually(lambda: log.read_text().count("\n") == 2)
        gate.touch()
        eventually(lambda: done(client, "anew"))
        (row,) = client.runs("anew").rows
        assert (row.state, row.attempt) == (RunState.DONE, 1)


def test_a_dead_gateway_leaves_nothing_running_in_the_cluster(dask, tmp_path):
    # On a busy machine a lease may lapse before its run begins: then it begins again.
    with (
        daemon_at(tmp_path / "state", attempts=50, lease=3.0) as daemon,
        daemon.client() as client,
    ):
        log = tmp_path / "log"
        with gateway_for(dask, daemon) as part:
            client.submit(make_submission("c", 2, sleep=600.0, log=str(log)))
            running = eventually(lambda: started(log, 2))
            part.kill()
            eventually(lambda: not alive(running))
        eventually(lambda: client.overview().queued == 2)


def test_a_dask_worker_that_dies_costs_its_runs_nothing_but_time(client, dask, tmp_path):
    (victim,) = dask.start_workers(1)
    eventually(lambda: client.workers()[0].slots == 3)
    log, gate = tmp_path / "log", tmp_path / "gate"
    client.submit(make_submission("death", 6, until=str(gate), log=str(log)))
    # Leased is not begun: only what is under way dies with the worker.
    eventually(lambda: started(log, 3))
    sitters = victim.children(recursive=True)
    victim.kill()
    eventually(lambda: not alive(sitters))
    gate.touch()
    eventually(lambda: done(client, "death"))
    rows = client.runs("death").rows
    assert {row.state for row in rows} == {RunState.DONE}
    assert sorted(row.attempt for row in rows) == [1, 1, 1, 1, 1, 2]
    eventually(lambda: client.workers()[0].slots == 2)


@pytest.mark.parametrize("kind", ["other", "lacking"])
def test_a_cluster_with_another_version_gets_no_runs(tmp_path, kind):
    with (
        dask_in(tmp_path / "dask", 1) as dask,
        daemon_at(tmp_path / "state", lease=30.0) as daemon,
        daemon.client() as client,
        gateway_for(dask, daemon) as part,
    ):
        eventually(lambda: client.overview().workers == 1)
        (stranger,) = dask.start_workers(8, kind=kind)
        trouble = eventually(lambda: client.workers() and client.workers()[0].trouble)
        assert "pip install 'scenario-tui==" in trouble
        client.submit(make_submission("versions", 2))
        stranger.kill()
        eventually(lambda: done(client, "versions"))
        assert [row.attempt for row in client.runs("versions").rows] == [1] * 2
        assert "has workers again" in part.output


def test_runs_go_on_with_a_scheduler_that_comes_back(tmp_path):
    with (
        dask_in(tmp_path / "dask", 1) as dask,
        daemon_at(tmp_path / "state", lease=30.0) as daemon,
        daemon.client() as client,
        gateway_for(dask, daemon),
    ):
        log, gate = tmp_path / "log", tmp_path / "gate"
        client.submit(make_submission("again", 2, until=str(gate), log=str(log)))
        running = eventually(lambda: started(log, 1))
        dask.scheduler.kill()
        eventually(lambda: "does not answer" in client.overview().trouble)
        eventually(lambda: not alive(running))
        gate.touch()
        dask.start_scheduler()
        dask.start_workers(1)
        eventually(lambda: done(client, "again"))


def test_a_scheduler_without_this_version_is_refused(daemon, tmp_path):
    with dask_in(tmp_path, kind="lacking") as cluster:
        part = gateway(cluster, daemon)
        assert part.wait() == 5
    assert "pip install 'scenario-tui==" in part.output


def test_a_real_run_leaves_the_same_bytes_as_here(dask, campaigns, tmp_path):
    demo = expand(load_campaign(campaigns / "demo" / "campaign.yaml"))
    spec = replace(demo.specs[0], sut=SutReference("idle", "idle", {}), limit=1.0)
    submission = Submission.of("c", (spec,), demo.scenes[:1])
    with daemon_at(tmp_path / "state") as daemon, daemon.client() as client:
        client.submit(submission)
        with gateway_for(dask, daemon, executor=DEFAULT_EXECUTOR):
            here = execute(spec, demo.scenes[0], trace_path=tmp_path / "here.mcap")
            eventually(lambda: done(client, "c"))
        (row,) = client.runs("c").rows
        there = client.run("c.0").row.result
        assert there is not None
        assert there.digest == here.digest
        assert Path(row.trace).read_bytes() == (tmp_path / "here.mcap").read_bytes()
