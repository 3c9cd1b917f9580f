"""Finished runs are kept and delivered later, whatever the daemon says or fails at.

The workers are as on another machine: their folder is not the daemon's, results and traces travel.
"""

import subprocess
from contextlib import contextmanager

import pytest

from daemon.model.run_state import RunState
from daemon.model.verbs import COMPLETE, GET, LEASE, PUT, RELEASE, RENEW
from grammars.text.files import matching_paths
from tests.chaos.disk import may_mount
from tests.chaos.lines import slow_line
from tests.make import make_submission
from tests.parts import daemon_at, eventually, finished, worker_for

LARGE = 200_000
"""Bytes of a trace."""


@contextmanager
def daemon_and_worker(folder, *, state="state", through=(), **settings):
    """A daemon and a worker that has none of its files."""
    options = () if through else ("--state", str(folder / "elsewhere"))
    with (
        daemon_at(folder / state, **settings) as daemon,
        daemon.client() as client,
        worker_for(daemon, 2, *options, through=through) as worker,
    ):
        yield daemon, client, worker


@contextmanager
def failing_daemon(folder):
    """A daemon that fails at verbs when it is told so, and a worker.

    A run that was given back in vain waits until its lease ends.
    """
    (folder / "faults").mkdir()
    with daemon_and_worker(folder, module="tests.batch.failing_daemon", lease=30.0) as parts:
        yield parts


def executions(log):
    return len(log.read_text().splitlines()) if log.exists() else 0


def spooled(folder):
    """Finished runs that the worker keeps."""
    return len(list(matching_paths(folder, "elsewhere/work/*/spool/*/*/attempt-*/result.json")))


def keeps_results(client):
    """Whether people see that a worker cannot deliver."""
    return "results cannot be delivered" in str(client.overview().troubles)


def assert_executed_once(client, log, runs):
    """Every run has its result and its trace, and was executed once."""
    rows = client.runs("c").rows
    assert [(row.state, row.attempt, row.reason) for row in rows] == [(RunState.DONE, 1, "")] * runs
    assert all(row.trace for row in rows)
    assert executions(log) == runs


@pytest.mark.parametrize(
    ("verb", "fault"),
    [
        *((COMPLETE, fault) for fault in ("raises", "locked", "malformed", "garbles")),
        *((PUT, fault) for fault in ("system", "reader", "garbles")),
    ],
    ids=str,
)
def test_no_fault_of_the_daemon_costs_a_finished_run(tmp_path, verb, fault):
    log = tmp_path / "log"
    with failing_daemon(tmp_path) as (_, client, worker):
        (tmp_path / "faults" / verb.name).write_text(fault)
        client.submit(make_submission("c", 3, size=LARGE, log=str(log)))
        eventually(lambda: keeps_results(client))
        assert "delivered later" in worker.output
        eventually(lambda: executions(log) == spooled(tmp_path) > 0)
        (tmp_path / "faults" / verb.name).unlink()
        eventually(lambda: finished(client, 3))
        assert_executed_once(client, log, 3)
        eventually(lambda: not spooled(tmp_path))
        eventually(lambda: not client.overview().troubles)


@pytest.mark.parametrize(
    ("verb", "fault"),
    [
        (LEASE, "raises"),
        *((RENEW, fault) for fault in ("raises", "malformed", "garbles")),
        *((RELEASE, fault) for fault in ("raises", "garbles")),
    ],
    ids=str,
)
def test_results_are_delivered_although_other_verbs_fail(tmp_path, verb, fault):
    log, gate = tmp_path / "log", tmp_path / "gate"
    with failing_daemon(tmp_path) as (_, client, _):
        client.submit(make_submission("c", 3, size=LARGE, until=str(gate), log=str(log)))
        eventually(lambda: executions(log) == 2)
        (tmp_path / "faults" / verb.name).write_text(fault)
        client.submit(make_submission("d", 1, crash=[1]))
        gate.touch()
        eventually(lambda: client.overview().done >= 2)
        (tmp_path / "faults" / verb.name).unlink()
        eventually(lambda: finished(client, 4))
        assert_executed_once(client, log, 3)


@pytest.mark.parametrize("fault", ["raises", "garbles"])
def test_no_run_is_blamed_for_a_scene_that_the_daemon_fails_to_send(tmp_path, fault):
    (tmp_path / "faults").mkdir()
    (tmp_path / "faults" / GET.name).write_text(fault)
    settings = {"module": "tests.batch.failing_daemon", "attempts": 1}
    with daemon_and_worker(tmp_path, **settings) as (_, client, worker):
        client.submit(make_submission("c", 2))
        eventually(lambda: "not started" in str(client.overview().troubles))
        (tmp_path / "faults" / GET.name).unlink()
        eventually(lambda: finished(client, 2))
        assert {row.state for row in client.runs("c").rows} == {RunState.DONE}
        assert worker.process.poll() is None


def in_place_of_traces(daemon):
    """Have the daemon unable to make the folder of a campaign's traces."""
    path = daemon.state / "traces" / "c"
    path.write_text("")
    return path


def test_a_folder_that_cannot_be_made_costs_no_finished_run(tmp_path):
    log = tmp_path / "log"
    with daemon_and_worker(tmp_path) as (daemon, client, _):
        path = in_place_of_traces(daemon)
        client.submit(make_submission("c", 3, size=LARGE, log=str(log)))
        eventually(lambda: keeps_results(client))
        eventually(lambda: executions(log) == spooled(tmp_path) > 0)
        path.unlink()
        eventually(lambda: finished(client, 3))
        assert_executed_once(client, log, 3)


@pytest.mark.skipif(not may_mount(), reason="a mount namespace needs root")
def test_nor_with_a_worker_that_sees_another_file_system(tmp_path):
    log, state = tmp_path / "log", tmp_path / "state"
    hidden = f'mount -t tmpfs -o mode=700 tmpfs {state} && exec "$@"'
    through = ("unshare", "--mount", "sh", "-c", hidden, "sh")
    with daemon_and_worker(tmp_path, through=through) as (daemon, client, worker):
        path = in_place_of_traces(daemon)
        client.submit(make_submission("c", 3, log=str(log)))
        eventually(lambda: keeps_results(client))
        path.unlink()
        eventually(lambda: finished(client, 3))
        assert_executed_once(client, log, 3)
        assert "bytes sent" in worker.output


@pytest.mark.skipif(not may_mount(), reason="mounting a small file system needs root")
def test_nor_does_a_disk_without_inodes(tmp_path):
    log, disk = tmp_path / "log", tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256m,nr_inodes=2000", "tmpfs", str(disk)]
    subprocess.run(mount, check=True)
    try:
        with daemon_and_worker(tmp_path, state="disk/state") as (daemon, client, _):
            client.submit(make_submission("c", 3, size=LARGE, log=str(log), sleep=0.5))
            eventually(lambda: executions(log) > 0)
            used = use_up_inodes(daemon.state / "incoming")
            eventually(lambda: keeps_results(client))
            for path in used:
                path.unlink()
            eventually(lambda: finished(client, 3))
            assert_executed_once(client, log, 3)
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)


def use_up_inodes(folder):
    """Make files until there can be no more."""
    made = []
    try:
        while True:
            made.append(folder / f"ballast-{len(made)}")
            made[-1].touch()
    except OSError:
        return made[:-1]


def test_a_large_result_passes_a_slow_line(tmp_path):
    """Of a third of a Mbit/s, which it takes for longer than a question usually may last."""
    with (
        daemon_at(tmp_path / "state") as daemon,
        daemon.client() as client,
        slow_line(daemon.endpoint, rate=40_000) as line,
        worker_for(daemon, 1, "--state", str(tmp_path / "elsewhere"), connect=line.endpoint),
    ):
        client.submit(make_submission("c", 1, evidence=230_000))
        eventually(lambda: finished(client, 1))
        (row,) = client.runs("c").rows
        assert (row.state, row.attempt) == (RunState.DONE, 1)
        result = client.run(row.id).row.result
        assert len(result.verdicts[0].evidence.note) == 230_000
        # The worker has its acknowledgement.
        eventually(lambda: not spooled(tmp_path))
