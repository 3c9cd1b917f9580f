"""A daemon on a full disk, where others can write, on a damaged ledger; what a kill leaves."""

import os
import sqlite3
import stat
import subprocess
import sys
from contextlib import closing, contextmanager

import pytest

from daemon.batch.errors import Unavailable
from daemon.batch.ledger import damaged_copies, read_wal
from tests.daemon.batch.harness import daemon_at, eventually
from tests.daemon.batch.samples import make_submission

ROOT = os.geteuid() == 0


def wal(daemon):
    return daemon.state / "ledger.db-wal"


def flip_a_bit(path, at):
    data = bytearray(path.read_bytes())
    data[at] ^= 4
    path.write_bytes(data)


@contextmanager
def old_state_in_use(ledger):
    """Read an older state meanwhile, so that what comes then has to stay in the WAL."""
    with closing(sqlite3.connect(f"{ledger.as_uri()}?mode=ro", uri=True)) as db:
        db.execute("BEGIN")
        db.execute("SELECT count(*) FROM run").fetchone()
        yield


def test_no_wrong_bit_in_a_wal_costs_something_without_a_word(tmp_path):
    with daemon_at(tmp_path / "state") as daemon:
        with daemon.client() as client:
            for number in range(5):
                client.submit(make_submission(f"calm-{number}", 1))
        # After a pause nothing that was acknowledged hangs on the WAL.
        eventually(lambda: wal(daemon).stat().st_size == 0)
        daemon.kill()
        index = daemon.state / "ledger.db-shm"
        flip_a_bit(index, index.stat().st_size // 2)
        daemon.restart()
        with daemon.client() as client:
            assert (client.overview().campaigns, client.overview().troubles) == (5, ())
            with old_state_in_use(daemon.state / "ledger.db"):
                for number in range(5):
                    client.submit(make_submission(f"busy-{number}", 1))
                daemon.kill()
        # Without a pause SQLite drops what is behind the damage: then it is said.
        flip_a_bit(wal(daemon), wal(daemon).stat().st_size // 2)
        daemon.restart()
        with daemon.client() as client:
            now = client.overview()
        assert 5 < now.campaigns < 10
        (trouble,) = now.troubles
        assert "acknowledged changes are lost" in trouble
        (copy,) = damaged_copies(daemon.state / "ledger.db")
        assert str(copy) in trouble
        assert daemon.noted("ledger damaged")


def test_a_daemon_waits_for_room_and_says_so(tmp_path):
    full = tmp_path / "full"
    full.touch()
    with daemon_at(tmp_path / "state", module="tests.daemon.batch.full_disk") as daemon:
        with daemon.client() as client:
            trouble = client.overview().trouble
            assert "No space left on device" in trouble
            assert client.workers() == ()
            with pytest.raises(Unavailable, match="No space left on device"):
                client.submit(make_submission("early", 1))
            full.unlink()
            eventually(lambda: (daemon.state / "daemon.json").exists())
        with daemon.client() as client:
            client.submit(make_submission("late", 1))
            assert (client.overview().queued, client.overview().trouble) == (1, "")


@pytest.mark.skipif(not ROOT, reason="a small file system is mounted by root only")
def test_a_daemon_starts_again_on_a_disk_that_is_really_full(tmp_path):
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
            daemon.restart()
            with daemon.client() as client:
                trouble = eventually(lambda: client.overview().trouble)
                assert "the disk of" in trouble
                (disk / "ballast").unlink()
                eventually(lambda: client.overview().queued == 1)
                client.submit(make_submission("late", 1))
                eventually(lambda: not client.overview().trouble)
            assert daemon.process.poll() is None
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
    command = [sys.executable, "-m", "daemon", "serve", "--state", str(state), "--slots", "0"]
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
    (state / "ledger.db").touch()
    (state / "ledger.db").chmod(0o644)  # whatever the umask is
    before = os.umask(0)
    try:
        with daemon_at(state) as daemon, daemon.client() as client:
            client.submit(make_submission("c", 1))
            assert str(state / "ledger.db") in daemon.noted("closed to others")[0]["paths"]
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
    if state.is_dir():
        assert not read_wal(state / "ledger.db").damaged
