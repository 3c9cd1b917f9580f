"""A worker whose spool cannot be written any more goes on when it can, and blames no run."""

import subprocess
from contextlib import contextmanager
from pathlib import Path

import pytest

from daemon.model.run_state import RunState
from tests.chaos.disk import may_mount
from tests.make import make_submission
from tests.parts import daemon_at, eventually, finished, worker_for

pytestmark = pytest.mark.skipif(not may_mount(), reason="mounting needs root")


@contextmanager
def mounted(folder, *options):
    """A file system over ``folder`` for the block, unless the block takes it away."""
    subprocess.run(["mount", *options, str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@contextmanager
def read_only(folder):
    with mounted(folder, "--bind", str(folder)):
        subprocess.run(["mount", "-o", "remount,ro,bind", str(folder)], check=True)
        yield


def mount_points(folder):
    """Return the mount points below ``folder``, as the kernel lists them."""
    mounts = (line.split()[1] for line in Path("/proc/self/mounts").read_text().splitlines())
    return [mount for mount in mounts if mount.startswith(f"{folder}/")]


def executions(log):
    return len(log.read_text().splitlines()) if log.exists() else 0


@contextmanager
def working(folder):
    with (
        daemon_at(folder / "state", attempts=1) as daemon,
        daemon.client() as client,
        worker_for(daemon, 2, "--state", str(folder / "elsewhere")) as worker,
    ):
        yield client, worker


def test_a_spool_that_becomes_read_only_ends_no_worker(tmp_path):
    log, gate = tmp_path / "log", tmp_path / "gate"
    with working(tmp_path) as (client, worker):
        client.submit(make_submission("c", 4, until=str(gate), log=str(log)))
        eventually(lambda: executions(log) == 2)
        (spool,) = (tmp_path / "elsewhere" / "work").glob("*/spool")
        with read_only(spool):
            gate.touch()
            eventually(lambda: "Read-only file system" in str(client.overview().troubles))
        eventually(lambda: finished(client, 4))
        assert {row.state for row in client.runs("c").rows} == {RunState.DONE}
        assert worker.process.poll() is None, worker.output
        eventually(lambda: not client.overview().troubles)


def test_a_folder_that_cannot_be_removed_ends_no_worker(tmp_path):
    log, gate = tmp_path / "log", tmp_path / "gate"
    with working(tmp_path) as (client, worker):
        client.submit(make_submission("c", 1, until=str(gate), log=str(log)))
        eventually(lambda: executions(log) == 1)
        (attempt,) = (tmp_path / "elsewhere" / "work").glob("*/spool/*/*/attempt-*")
        busy = attempt / "busy"
        busy.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "tmpfs", str(busy)], check=True)
        try:
            gate.touch()
            eventually(lambda: finished(client, 1))
            eventually(lambda: "cannot be removed" in worker.output)
            client.submit(make_submission("d", 2))
            eventually(lambda: finished(client, 3))
            assert not attempt.exists()
            assert worker.process.poll() is None, worker.output
        finally:
            # The worker has put the folder aside, with its mount. The kernel knows the new
            # place; a walk through the spool would race with the removal of other attempts.
            (busy,) = mount_points(tmp_path)
            subprocess.run(["umount", "-l", busy], check=True)
