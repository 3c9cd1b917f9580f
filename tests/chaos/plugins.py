"""Systems under test that misbehave in every way: one verdict each, and nothing is left of them."""

import os
import sqlite3
import subprocess
from collections import Counter
from contextlib import closing, contextmanager, suppress
from dataclasses import replace

import psutil
import pytest

from daemon.model.execution import DEFAULT_EXECUTOR
from daemon.model.spec import SutReference
from grammars.text.files import matching_paths
from tests.chaos.programs.hostile import DEEDS
from tests.chaos.report import Report
from tests.chaos.verify import check_book
from tests.make import make_spec, submission_of
from tests.parts import ROOT, daemon_at, eventually, finished

MARK = "SCENARIO_CHAOS_PLUGINS"
HONEST = 4
"""Runs of a system that behaves, between the others."""
WALL = 10.0
SLOTS = 4
MEMORY = 3 * 2**30


def plugins(folder, *, deeds=tuple(DEEDS)):
    """Let one worker execute each system; daemon and worker stay, and honest runs are judged."""
    report = Report("plugins: systems under test that misbehave")
    names = [*deeds, *["behave"] * HONEST]
    specs = [
        replace(make_spec(number), sut=SutReference(name, "hostile", {"deed": name}))
        for number, name in enumerate(names)
    ]
    how = {"executor": DEFAULT_EXECUTOR, "wall": WALL, "memory": MEMORY, "attempts": 1}
    with (
        _installed(folder),
        daemon_at(folder / "state", SLOTS, **how) as daemon,
        daemon.client() as client,
    ):
        worker = eventually(client.workers)[0]
        client.submit(submission_of("hostile", *specs))
        eventually(lambda: finished(client, len(specs)), 600.0)
        rows = client.runs("hostile").rows
        for state, count in Counter(str(row.state) for row in rows).items():
            report.fact(f"runs {state}", count)
        for row in rows:
            told = row.outcome if row.state == "done" else row.reason
            report.expect(bool(told), f"{row.sut}: {row.state}, and nothing is said of it")
        honest = [row for row in rows if row.sut == "behave"]
        report.expect(
            all(row.state == "done" and row.attempt == 1 for row in honest),
            f"honest runs suffered: {[(row.state, row.attempt) for row in honest]}",
        )
        report.expect(
            [row.id for row in client.workers()] == [worker.id], "the worker did not survive"
        )
        report.expect(daemon.process.poll() is None, "the daemon did not survive")
        _expect_nothing_left(report, folder, daemon, worker.pid)
    check_book(report, folder / "state" / "ledger.db")
    with closing(sqlite3.connect(folder / "state" / "ledger.db")) as db:
        done = db.execute("SELECT count(*) FROM run WHERE state = 'done'").fetchone()
        results = db.execute("SELECT count(*) FROM result").fetchone()
    report.expect(done == results, f"{results[0]} results of {done[0]} runs")
    report.runs = len(specs)
    return report


def _expect_nothing_left(report, folder, daemon, worker):
    """Look for processes of runs and for attempts, where they may need a moment to go."""
    with suppress(AssertionError):
        eventually(lambda: not _strangers(folder, worker), 30.0)
    left = _strangers(folder, worker)
    report.expect(not left, f"processes are left: {left[:3]}")
    spools = list(matching_paths(daemon.state / "spool", "*/*/attempt-*"))
    report.expect(not spools, f"spools keep {len(spools)} attempts: {spools[:3]}")
    aside = daemon.state / "aside"
    report.fact("moved aside", len(list(aside.iterdir())) if aside.is_dir() else 0)
    for process in left:
        process.kill()


def _strangers(folder, worker):
    """Processes of a run: with our mark in their environment and a guardian or nobody above."""
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            marked = process.environ().get(MARK) == str(folder)
            words = process.cmdline()
            sleeper = "time.sleep(1000)" in " ".join(words)
            if marked and (sleeper or (process.ppid() == 1 and process.pid != worker)):
                found.append(process)
    return found


@contextmanager
def _installed(folder):
    """Install the package for daemons that are started meanwhile, and mark their processes."""
    place = folder / "plugins"
    info = place / "hostile-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hostile\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[scenario.suts]\nhostile = tests.chaos.programs.hostile:Hostile\n"
    )
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PYTHONPATH", f"{place}{os.pathsep}{ROOT}")
            patch.setenv(MARK, str(folder))
            yield
    finally:
        subprocess.run(["chattr", "-R", "-i", str(folder)], check=False, capture_output=True)
