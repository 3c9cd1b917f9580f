"""A daemon on a full disk, where others can write, on a damaged ledger; what a kill leaves."""

import json
import os
import stat
import subprocess
import sys

import pytest

from tests.make import make_submission
from tests.parts import daemon_at, eventually

ROOT = os.geteuid() == 0


def test_in_a_pause_nothing_hangs_on_the_wal(tmp_path):
    with daemon_at(tmp_path / "state") as daemon:
        with daemon.client() as client:
            for number in range(5):
                client.submit(make_submission(f"calm-{number}", 1))
        journal = daemon.state / "ledger.db-wal"
        eventually(lambda: journal.stat().st_size == 0)
        daemon.kill()
        journal.write_bytes(b"")
        daemon.restart()
        with daemon.client() as client:
            assert client.overview().campaigns == 5


@pytest.mark.skipif(not ROOT, reason="a small file system is mounted by root only")
def test_a_daemon_on_a_full_disk_says_so_and_leaves(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", str(disk)]
    if subprocess.run(mounting, capture_output=True, check=False).returncode:
        pytest.skip("file systems cannot be mounted here")
    try:
        with daemon_at(disk / "state") as daemon:
            with daemon.client() as client:
                client.submit(make_submission("early", 1))
            daemon.kill()
            _fill(disk / "ballast")
            code, words = served(daemon.state)
            assert code == 3
            assert "No space left on device" in words or "is full" in words
            assert "Traceback" not in words
            (disk / "ballast").unlink()
            daemon.restart()
            with daemon.client() as client:
                assert client.overview().queued == 1
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)


def _fill(path):
    with path.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            return


def served(state):
    """Start a daemon that is expected to refuse; returns its code and its words."""
    order = json.dumps({"state": str(state), "slots": 0})
    command = [sys.executable, "-m", "daemon", "serve", order]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    return done.returncode, done.stderr


def test_others_may_neither_write_nor_read_there(tmp_path):
    state = tmp_path / "state"
    state.mkdir()
    state.chmod(0o770)
    code, words = served(state)
    assert code == 3
    assert words.startswith(f"others can write in {state}, and so decide")
    assert "Traceback" not in words
    state.chmod(0o755)
    before = os.umask(0)
    try:
        with daemon_at(state) as daemon, daemon.client() as client:
            client.submit(make_submission("c", 1))
            assert daemon.noted("closed to others")[0]["paths"] == [str(state)]
            folders = {path: _mode(path) for path in (state, *state.iterdir()) if path.is_dir()}
            files = {path.name: _mode(path) for path in state.iterdir() if path.is_file()}
    finally:
        os.umask(before)
    assert set(folders.values()) == {0o700}
    assert set(files.values()) == {0o600}
    assert {"ledger.db-wal", "ledger.db-shm", "daemon.log", "daemon.json"} <= set(files)


def _mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda state: (state / "ledger.db").write_bytes(b"\xdd?" * 5000),
        lambda state: (state.rmdir(), state.touch()),
    ],
)
def test_a_daemon_that_cannot_work_there_says_why_and_leaves(tmp_path, spoil):
    state = tmp_path / "state"
    state.mkdir(mode=0o700)
    spoil(state)
    code, words = served(state)
    assert code == 3
    assert str(state) in words
    assert "Traceback" not in words
