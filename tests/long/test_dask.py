"""Dask clusters that lose workers, scheduler or gateway, or have another version of ours."""

from dataclasses import replace
from pathlib import Path

import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.execution import DEFAULT_EXECUTOR
from daemon.model.spec import SutReference
from daemon.model.submission import Submission
from daemon.model.verdicts import RunState
from daemon.run import execute
from tests.batch.dask_harness import begun, dask_in, gateway, gateway_for
from tests.make import make_submission
from tests.parts import alive, daemon_at, eventually
from tests.turned_clock import TURNED, end_leases


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    """A cluster of one worker with two threads."""
    with dask_in(tmp_path_factory.mktemp("dask"), 2) as cluster:
        yield cluster


@pytest.fixture
def daemon(tmp_path):
    with daemon_at(tmp_path / "state", **TURNED) as part:
        yield part


@pytest.fixture
def client(daemon):
    with daemon.client() as connected:
        yield connected


def finish(client):
    """The runs of the only campaign, once it is finished."""
    eventually(lambda: client.campaign("c").finished)
    return client.runs("c").rows


@pytest.mark.parametrize(
    ("option", "limit", "asked", "words"),
    [
        ("--memory", 2**30, {"allocate": 2048}, "MemoryError"),
        # It never ends: no limit is too short.
        ("--wall", 0.01, {"sleep": 600.0}, "stopped after 0.01 s of wall clock time"),
    ],
)
def test_limits_are_kept_where_it_executes(dask, daemon, client, option, limit, asked, words):
    with gateway_for(dask, daemon, option, str(limit)):
        client.submit(make_submission("c", 1, **asked))
        eventually(lambda: words in client.runs("c").rows[0].reason)
        client.cancel("c")


def test_a_dead_gateway_leaves_nothing_running_in_the_cluster(dask, daemon, client, tmp_path):
    log = tmp_path / "log"
    with gateway_for(dask, daemon) as part:
        client.submit(make_submission("c", 2, sleep=600.0, log=str(log)))
        running = eventually(lambda: begun(log, 2))
        part.kill()
        eventually(lambda: not alive(running))
    end_leases(daemon)
    eventually(lambda: client.overview().queued == 2)


def test_a_worker_that_dies_costs_its_runs_nothing_but_time(dask, daemon, client, tmp_path):
    log, gate = tmp_path / "log", tmp_path / "gate"
    with gateway_for(dask, daemon):
        (victim,) = dask.start_workers(1)
        eventually(lambda: [row.slots for row in client.workers()] == [3])
        client.submit(make_submission("c", 6, until=str(gate), log=str(log)))
        # Leased is not begun: only what is under way dies with the worker.
        eventually(lambda: begun(log, 3))
        sitters = victim.children(recursive=True)
        victim.kill()
        eventually(lambda: not alive(sitters))
        gate.touch()
        rows = finish(client)
        assert {row.state for row in rows} == {RunState.DONE}
        assert sorted(row.attempt for row in rows) == [1, 1, 1, 1, 1, 2]
        eventually(lambda: client.workers()[0].slots == 2)


@pytest.mark.parametrize("kind", ["other", "lacking"])
def test_a_cluster_with_another_version_gets_no_runs(tmp_path, daemon, client, kind):
    with dask_in(tmp_path / "dask", 1) as dask, gateway_for(dask, daemon) as part:
        eventually(lambda: client.overview().workers == 1)
        (stranger,) = dask.start_workers(8, kind=kind)
        # The gateway says so when it renews: soon, where leases are short.
        eventually(lambda: "pip install 'scenario-tui==" in part.output)
        client.submit(make_submission("c", 2))
        stranger.kill()
        assert [row.attempt for row in finish(client)] == [1] * 2
        assert "has workers again" in part.output


def test_a_scheduler_without_this_version_is_refused(daemon, tmp_path):
    with dask_in(tmp_path / "dask", kind="lacking") as cluster:
        part = gateway(cluster, daemon)
        assert part.wait() == 5
    assert "pip install 'scenario-tui==" in part.output


def test_runs_go_on_with_a_scheduler_that_comes_back(tmp_path, daemon, client):
    log, gate = tmp_path / "log", tmp_path / "gate"
    with dask_in(tmp_path / "dask", 1) as dask, gateway_for(dask, daemon) as part:
        client.submit(make_submission("c", 2, until=str(gate), log=str(log)))
        running = eventually(lambda: begun(log, 1))
        dask.scheduler.kill()
        eventually(lambda: "does not answer" in part.output)
        eventually(lambda: not alive(running))
        gate.touch()
        dask.start_scheduler()
        dask.start_workers(1)
        finish(client)


def test_a_real_run_leaves_the_same_bytes_as_here(dask, daemon, client, campaigns, tmp_path):
    demo = expand(load_campaign(campaigns / "demo" / "campaign.yaml"))
    spec = replace(demo.specs[0], sut=SutReference("idle", "idle", {}), limit=1.0)
    client.submit(Submission.of("c", (spec,), demo.scenes[:1]))
    with gateway_for(dask, daemon, executor=DEFAULT_EXECUTOR):
        here = execute(spec, demo.scenes[0], trace_path=tmp_path / "here.mcap")
        (row,) = finish(client)
    assert client.run("c.0").row.result.digest == here.digest
    assert Path(row.trace).read_bytes() == (tmp_path / "here.mcap").read_bytes()
