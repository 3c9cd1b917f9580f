"""Disks and quotas that are full: runs, traces and the ledger want to grow, a daemon starts."""

import os
import shutil
import sqlite3
import subprocess
import time
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from grammars.text.files import matching_paths
from tests.chaos.executor import EXECUTOR
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.make import make_submission
from tests.parts import daemon_at, eventually, finished

SIZE = 64
INODES = 6000
BALLAST = 20_000
SLOTS = 2


def may_mount():
    """Whether this machine lets us mount a file system."""
    return os.geteuid() == 0 and Path("/proc/filesystems").read_text().find("tmpfs") >= 0


@contextmanager
def small_disk(folder):
    """A file system of ``SIZE`` MiB for the block."""
    folder.mkdir()
    options = f"size={SIZE}m,nr_inodes={INODES}"
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def fill(path):
    """Write until nothing more goes in."""
    with suppress(OSError), path.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(65536))
    with suppress(OSError), path.open("ab", buffering=0) as file:
        while True:
            file.write(bytes(512))


def fill_with_names(path):
    """Make empty files until no more can be named."""
    path.mkdir()
    with suppress(OSError):
        for number in range(INODES):
            (path / str(number)).touch()


def full_disk(folder, *, runs=500, times=4, hold=3.0):
    """Fill the disk while runs execute, empty it again; at the end every run has its result.

    Every other time it has room, but no name for another file.
    """
    report = Report("full disk: runs wait, nothing is lost, nobody is blamed")
    if not may_mount():
        report.fact("skipped", "mounting a small file system needs root")
        return report
    gate = folder / "gate"
    with small_disk(folder / "disk") as disk:
        state = disk / "state"
        with (
            daemon_at(state, SLOTS, executor=EXECUTOR, lease=5.0) as daemon,
            daemon.client() as client,
        ):
            for turn in range(times):
                gate.unlink(missing_ok=True)
                asked = {"until": str(gate), "ballast": BALLAST}
                client.submit(make_submission(f"full-{turn}", runs // times, **asked))
                eventually(lambda: client.overview().running == SLOTS)
                _stuff(client, disk / "ballast", gate, hold, fill_with_names if turn % 2 else fill)
                eventually(lambda turn=turn: finished(client, (turn + 1) * (runs // times)))
            eventually(lambda: not list(matching_paths(state / "spool", "*/*/attempt-*")))
        report.fact("times full while runs were under way", times)
        report.fact("runs", runs)
        with closing(sqlite3.connect(state / "ledger.db")) as db:
            blamed = db.execute("SELECT count(*) FROM run WHERE strikes > 0").fetchone()[0]
        report.expect(blamed == 0, f"{blamed} runs were blamed for the full disk")
        verify(report, state, runs)
    return report


def _stuff(client, ballast, gate, hold, how):
    """Fill the disk for a while; the runs under way have something to write when it is full."""
    how(ballast)
    eventually(lambda: "is full" in client.overview().trouble)
    gate.touch()
    time.sleep(hold)
    if ballast.is_dir():
        shutil.rmtree(ballast)
    else:
        ballast.unlink()
