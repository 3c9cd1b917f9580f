"""A gateway between a real daemon and a real Dask cluster; what goes wrong, goes wrong for real."""

import hashlib
import signal
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from daemon.client import Client
from daemon.protocol import Live, RunState
from daemon.verdict import Outcome
from tests.daemon.dask_harness import Dask, dask_in, gateway, gateway_for
from tests.daemon.harness import DaemonPart, Part, alive, daemon_at, eventually, finished
from tests.daemon.samples import make_spec, make_submission, submission_of


@pytest.fixture(scope="module")
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    """A cluster of one worker with two threads."""
    with dask_in(tmp_path_factory.mktemp("dask"), 2) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaemonPart]:
    """A daemon without slots of its own, where one blame is enough to be lost."""
    with daemon_at(tmp_path_factory.mktemp("daemon") / "state", attempts=2) as part:
        yield part


@pytest.fixture(scope="module")
def worker(dask: Dask, daemon: DaemonPart) -> Iterator[Part]:
    with gateway_for(dask, daemon) as part, daemon.client() as client:
        eventually(lambda: client.overview().workers == 1, 30.0)
        eventually(lambda: client.workers()[0].slots == 2, 30.0)
        yield part


@pytest.fixture
def client(daemon: DaemonPart, worker: Part) -> Iterator[Client]:
    with daemon.client() as connected:
        yield connected


def done(client: Client, campaign: str) -> bool:
    return next(row.finished for row in client.campaigns() if row.id == campaign)


def test_runs_come_back_with_results_and_traces(client: Client) -> None:
    client.submit(make_submission("plain", 6, outcome="fail"))
    eventually(lambda: done(client, "plain"))
    for row in client.runs("plain").rows:
        assert (row.state, row.outcome, row.attempt) == (RunState.DONE, Outcome.FAIL, 1)
        result = client.run(row.id).result
        assert result is not None
        assert hashlib.sha256(Path(row.trace).read_bytes()).hexdigest() == result.trace.sha256


def test_every_run_has_a_fresh_and_nice_process(client: Client, tmp_path: Path) -> None:
    log = tmp_path / "log"
    client.submit(make_submission("fresh", 6, log=str(log)))
    eventually(lambda: done(client, "fresh"))
    lines = [line.split() for line in log.read_text().splitlines()]
    assert len({pid for _, pid, _ in lines}) == 6
    assert all(int(nice) >= 10 for _, _, nice in lines)


def test_the_gateway_has_as_many_slots_as_the_cluster_has_threads(
    client: Client, dask: Dask
) -> None:
    eventually(lambda: client.workers()[0].slots == 2)
    (extra,) = dask.start_workers(3)
    eventually(lambda: client.workers()[0].slots == 5, 30.0)
    extra.kill()
    eventually(lambda: client.workers()[0].slots == 2)


def test_a_run_that_crashes_is_blamed_and_harms_no_other(client: Client) -> None:
    poison = make_spec(0, crash=[1, 2])
    client.submit(submission_of("poison", poison, *(make_spec(i) for i in range(1, 5))))
    eventually(lambda: done(client, "poison"))
    lost, *others = client.runs("poison").rows
    assert (lost.state, lost.attempt) == (RunState.LOST, 2)
    assert "killed by SIGKILL" in lost.reason
    assert [(row.state, row.attempt) for row in others] == [(RunState.DONE, 1)] * 4


def test_limits_are_kept_where_it_executes(dask: Dask, tmp_path: Path) -> None:
    with (
        daemon_at(tmp_path / "state", attempts=1) as daemon,
        daemon.client() as client,
        gateway_for(dask, daemon, "--wall", "0.5", "--memory", str(2**30)),
    ):
        greedy, slow = make_spec(0, allocate=2048), make_spec(1, sleep=60.0)
        client.submit(submission_of("c", greedy, slow))
        eventually(lambda: done(client, "c"))
        reasons = [row.reason for row in client.runs("c").rows]
        assert "MemoryError" in reasons[0]
        assert "stopped after 0.5 s of wall clock time" in reasons[1]


def test_cancelling_stops_the_processes_at_once(client: Client, dask: Dask, tmp_path: Path) -> None:
    log = tmp_path / "log"
    client.submit(make_submission("cancel", 4, sleep=60.0, log=str(log)))
    running = eventually(lambda: started(log, 2))
    client.cancel("cancel")
    eventually(lambda: not alive(running), 3.0)
    client.submit(make_submission("next", 1))
    eventually(lambda: done(client, "next"))
    eventually(lambda: not list((dask.folder / "scratch").rglob("attempt-*")))


def started(log: Path, count: int) -> list[psutil.Process]:
    """The processes of the runs that have begun, once there are as many."""
    lines = log.read_text().splitlines() if log.exists() else []
    return [psutil.Process(int(line.split()[1])) for line in lines] if len(lines) >= count else []


def test_running_runs_are_seen_live(client: Client) -> None:
    seen: list[Live] = []
    with client.events(lambda _: None, seen.append):
        client.submit(make_submission("live", 1, sleep=1.5))
        eventually(lambda: done(client, "live"))
    times = [live.snapshot.time for live in seen if live.run == "live.0"]
    assert len(times) >= 1
    assert times == sorted(times)


def test_a_dead_gateway_leaves_nothing_running_in_the_cluster(dask: Dask, tmp_path: Path) -> None:
    with daemon_at(tmp_path / "state", attempts=1, grace=0.5) as daemon, daemon.client() as client:
        log = tmp_path / "log"
        with gateway_for(dask, daemon) as part:
            client.submit(make_submission("c", 2, sleep=3.0, log=str(log)))
            running = eventually(lambda: started(log, 2))
            part.kill()
            eventually(lambda: not alive(running), 5.0)
        with gateway_for(dask, daemon):
            eventually(lambda: finished(client, 2), 20.0)


def test_a_gateway_told_twice_gives_its_runs_back_without_blame(dask: Dask, tmp_path: Path) -> None:
    with daemon_at(tmp_path / "state", attempts=1) as daemon, daemon.client() as client:
        log = tmp_path / "log"
        part = gateway(dask, daemon)
        client.submit(make_submission("c", 3, sleep=60.0, log=str(log)))
        running = eventually(lambda: started(log, 2))
        part.signal(signal.SIGTERM)
        part.signal(signal.SIGQUIT)
        assert part.wait() == 0
        eventually(lambda: not alive(running), 3.0)
        now = client.overview()
        assert (now.queued, now.running, now.lost) == (3, 0, 0)
