"""The disk is full again and again while runs, traces and the ledger want to grow."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from daemon.batch.client import Client
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.daemon.batch.harness import daemon_at, eventually, finished
from tests.daemon.batch.samples import make_submission

EXECUTOR = "tests.chaos.executor:execute"
SIZE = 64
BALLAST = 100_000


def may_mount() -> bool:
    """Whether this machine lets us mount a file system."""
    return os.geteuid() == 0 and Path("/proc/filesystems").read_text().find("tmpfs") >= 0


@contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    """A file system of ``SIZE`` MiB for the block."""
    folder.mkdir()
    options = f"size={SIZE}m"
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def _fill(path: Path) -> None:
    """Write until nothing more goes in."""
    with suppress(OSError), path.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(65536))
    with suppress(OSError), path.open("ab", buffering=0) as file:
        while True:
            file.write(bytes(512))


def full_disk(folder: Path, *, runs: int = 60, times: int = 4, hold: float = 3.0) -> Report:
    """Fill the disk while runs execute, empty it again; at the end every run has its result."""
    report = Report("full disk: runs wait, nothing is lost, nobody is blamed")
    if not may_mount():
        report.fact("skipped", "mounting a small file system needs root")
        return report
    with small_disk(folder / "disk") as disk:
        state = disk / "state"
        with (
            daemon_at(state, 2, executor=EXECUTOR, lease=5.0) as daemon,
            daemon.client() as client,
        ):
            client.submit(make_submission("full", runs, sleep=0.1, ballast=BALLAST))
            stuffed = [_stuff(client, disk / "ballast", hold) for _ in range(times)]
            eventually(lambda: finished(client, runs), 60.0)
            eventually(lambda: not list((state / "spool").glob("*/*/attempt-*")))
        report.fact("times full while runs were under way", sum(stuffed))
        report.fact("runs", runs)
        with closing(sqlite3.connect(state / "ledger.db")) as db:
            blamed = db.execute("SELECT count(*) FROM run WHERE strikes > 0").fetchone()[0]
        report.expect(blamed == 0, f"{blamed} runs were blamed for the full disk")
        report.expect(sum(stuffed) > 0, "the disk never was full while something ran")
        verify(report, state, runs)
    return report


def _stuff(client: Client, ballast: Path, hold: float) -> bool:
    """Fill the disk for a while; returns whether something ran and the daemon said so."""
    before = client.overview()
    eventually(lambda: (now := client.overview()).done > before.done or not now.queued)
    _fill(ballast)
    under_way = client.overview().running + client.overview().queued
    told = eventually(lambda: "is full" in client.overview().trouble)
    time.sleep(hold)
    ballast.unlink()
    return bool(under_way and told)
