"""A whole campaign on a daemon of its own with two workers' slots: ``make bench-campaign``.

``python -m tests.benchmarks campaign [FILE]``. The 120 runs of the published experiment unless told
otherwise, from the submission to the written report, on a state directory that is removed
afterwards. Before and after it one run, S1 with a2s, is executed alone: its CPU seconds are the
reference, since they tell how quick the machine is today. At the end it says how many runs ended
how, and how many were lost.
"""

import argparse
import os
import subprocess
import time
from dataclasses import replace
from pathlib import Path

from daemon.campaign import expand, load_campaign
from daemon.model.execution import DEFAULT_EXECUTOR
from tests.benchmarks import progress
from tests.benchmarks.bench_daemon import fresh, used_by
from tests.benchmarks.bench_run import PAPER
from tests.benchmarks.case_process import REFERENCE, cpu_of_case
from tests.benchmarks.measurement import Measurement, Reference, at_most, told
from tests.parts import eventually
from tests.people.terminal.pseudo_terminal import scenario

PUBLISHED = PAPER / "campaign.yaml"
SLOTS = 2
GOAL = 270.0
"""Seconds for all of them and the report, on two cores."""
LOOK = 0.5
"""Seconds between two questions how far it is: a question costs the daemon half a millisecond."""
LINES = 12
"""In which the progress is told where it is kept."""
OUTCOMES = ("passed", "failed", "inconclusive", "errors", "cancelled")


def finish(client, start):
    """Wait for the end; return the campaign, and the seconds in which a slot had nothing to do."""
    idle, last = 0.0, time.monotonic()
    while True:
        time.sleep(LOOK)
        (row,) = client.campaigns()
        now = time.monotonic()
        if row.queued == 0:
            idle += (SLOTS - min(SLOTS, row.running)) * (now - last)
        last = now
        if row.finished:
            return row, idle
        ended = row.total - row.queued - row.running
        progress.say(
            f"{ended} of {row.total} runs after {now - start:.0f} s, {row.lost} lost",
            ended * LINES // row.total,
        )


def measured(submission, goals):
    """Execute it and yield what it took."""
    progress.say("one S1 alone")
    alone, _ = told(cpu_of_case, REFERENCE)
    with fresh(SLOTS, executor=DEFAULT_EXECUTOR) as daemon, daemon.client(timeout=60.0) as client:
        eventually(lambda: client.overview().workers, 600.0)
        begun, start = used_by(daemon.pid), time.monotonic()
        client.submit(submission)
        row, tail = finish(client, start)
        took = time.monotonic() - start
        own, runs = (b - a for a, b in zip(begun, used_by(daemon.pid), strict=True))
        ended = list(all_runs(client, row))
        progress.say("the report")
        usage, written = os.times(), time.monotonic()
        page = str(daemon.state.parent / "report.html")
        command = scenario("report", row.id, "-o", page, "--connect", daemon.endpoint)
        subprocess.run(command, check=True, capture_output=True)
        report, now = time.monotonic() - written, os.times()
        report_cpu = sum(now[2:4]) - sum(usage[2:4])
    progress.say("one S1 alone")
    again, simulated = told(cpu_of_case, REFERENCE)
    one, count = (alone + again) / 2.0, len(submission.runs)
    beside, everything = Reference("CPU s of one S1", one), runs + own + report_cpu
    driven, busy = sum(run.simulated for run in ended), sum(run.wall for run in ended)
    there = SLOTS * took
    for name, value, unit, reference, note in (
        (f"{count} runs on {SLOTS} slots, and the report", took + report, "s", beside, ""),
        ("  until the last result", took, "s", beside, f"{count / took:.2f} runs/s"),
        ("  the report", report, "s", beside, f"{report_cpu:.1f} CPU s"),
        ("  the runs", runs, "CPU s", beside, f"{runs / count:.2f} CPU s each, wall {busy:.1f} s"),
        ("  daemon and worker", own, "CPU s", Reference("the runs", runs),
         f"{1e3 * own / count:.1f} ms a run"),
        ("  all of these", everything, "CPU s", beside, ""),
        ("  simulated, in the CPU time of all", driven / everything, "x real time",
         Reference("one S1", simulated / again), f"{driven:.0f} s simulated"),
        ("  slots idle", 100.0 * (there - busy) / there, "%", Reference("all the time", 100.0),
         f"{there - busy:.1f} of {there:.1f} s, {tail:.1f} s of it when no run was left to start"),
    ):  # fmt: skip
        yield Measurement(name, value, unit, reference, goals, note)
        goals = ()
    every = Reference("all runs", row.total)
    for name in OUTCOMES:
        if runs := getattr(row, name):
            yield Measurement(f"  {name}", runs, "runs", every)
    yield Measurement("  lost", row.lost, "runs", every, (at_most(0.0),))


def all_runs(client, row):
    """Every run of the campaign, page by page."""
    seen = 0
    while seen < row.total:
        page = client.runs(row.id, offset=seen)
        yield from page.rows
        seen += len(page.rows)


def main(arguments):
    """Measure the campaign of a file, of the published experiment without one."""
    parser = argparse.ArgumentParser("tests.benchmarks campaign", description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, default=PUBLISHED)
    file = parser.parse_args(arguments).file
    submission = replace(expand(load_campaign(file)), reserve=(), fresh=True)
    yield from measured(submission, (at_most(GOAL),) if file == PUBLISHED else ())
