"""A whole campaign on a daemon of its own with two workers' slots: ``make bench-campaign``.

``python -m tests.benchmarks campaign [FILE]``. The 120
runs of the published experiment unless told otherwise, from the submission to the written report,
on a state directory that is removed afterwards. Before and after it one run, S1 with a2s, is
executed alone: its CPU seconds are the reference, since they tell how quick the machine is today.
At the end it says how many runs ended how, and how many were lost.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import psutil

from daemon.campaign import expand, load_campaign
from daemon.model.execution import DEFAULT_EXECUTOR
from tests.benchmarks import progress
from tests.benchmarks.bench_ros import CAMPAIGN
from tests.benchmarks.case_process import REFERENCE
from tests.benchmarks.measurement import Measurement, Reference, at_most
from tests.parts import daemon_at, eventually, family
from tests.people.terminal.pseudo_terminal import scenario

SLOTS = 2
GOAL = 270.0
"""Seconds for all of them and the report, on two cores."""
LOOK = 0.5
"""Seconds between two questions how far it is: a question costs the daemon half a millisecond."""
LINES = 12
"""In which the progress is told where it is kept."""


def reference():
    """CPU and simulated seconds of the run that everything is held against, in a process of its
    own.
    """
    progress.say("one S1 alone")
    program = f"from tests.benchmarks.case_process import tell_cpu; tell_cpu({REFERENCE!r})"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    used, simulated = json.loads(said.stdout)
    return used, simulated


def cpu(daemon):
    """CPU seconds so far of the daemon and its worker, and of the processes of runs."""
    own = runs = 0.0
    for process in family(daemon.pid):
        try:
            used = process.cpu_times()
            in_run = process.nice() > 0
        except psutil.NoSuchProcess:  # a run that has just ended: its zygote has its times
            continue
        if in_run:
            runs += used.user + used.system
        else:
            own += used.user + used.system
        runs += used.children_user + used.children_system
    return own, runs


def finish(client, start):
    """Wait for the end; return the campaign, and the seconds in which a slot had nothing to do."""
    idle, last = 0.0, time.monotonic()
    while True:
        time.sleep(LOOK)
        (row,) = client.campaigns()
        now = time.monotonic()
        if row.queued == 0:
            idle += (SLOTS - min(SLOTS, row.running)) * (now - last) / SLOTS
        last = now
        if row.finished:
            return row, idle
        ended = row.total - row.queued - row.running
        progress.say(
            f"{ended} of {row.total} runs after {now - start:.0f} s, {row.lost} lost",
            ended * LINES // row.total,
        )


def measured(submission, goal):
    """Execute it and yield what it took."""
    before = reference()
    with (
        tempfile.TemporaryDirectory(prefix="bench-campaign-") as name,
        daemon_at(Path(name, "state"), SLOTS, executor=DEFAULT_EXECUTOR) as daemon,
        daemon.client(timeout=60.0) as client,
    ):
        eventually(lambda: client.overview().workers, 600.0)
        begun, start = cpu(daemon), time.monotonic()
        client.submit(submission)
        row, tail = finish(client, start)
        took = time.monotonic() - start
        own, runs = (b - a for a, b in zip(begun, cpu(daemon), strict=True))
        ended = list(all_runs(client, row))
        busy = sum(run.wall for run in ended)
        progress.say("the report")
        usage = os.times()
        written = time.monotonic()
        page = str(Path(name, "report.html"))
        command = scenario("report", row.id, "-o", page, "--connect", daemon.endpoint)
        subprocess.run(command, check=True, capture_output=True)
        report, now = time.monotonic() - written, os.times()
        report_cpu = sum(now[2:4]) - sum(usage[2:4])
    after = reference()
    one = (before[0] + after[0]) / 2.0
    beside = Reference("CPU s of one S1", one)
    count = len(submission.runs)
    yield Measurement(
        f"{count} runs on {SLOTS} slots, and the report", took + report, "s", beside,
        () if goal is None else (at_most(goal),),
    )  # fmt: skip
    yield Measurement(
        "  until the last result", took, "s", beside, (), f"{count / took:.2f} runs/s"
    )
    yield Measurement("  the report", report, "s", beside, (), f"{report_cpu:.1f} CPU s")
    yield Measurement(
        "  the runs", runs, "CPU s", beside, (), f"{runs / count:.2f} CPU s each, wall {busy:.1f} s"
    )
    yield Measurement(
        "  daemon and worker", own, "CPU s", Reference("the runs", runs), (),
        f"{1e3 * own / count:.1f} ms a run",
    )  # fmt: skip
    everything = runs + own + report_cpu
    yield Measurement("  all of these", everything, "CPU s", beside)
    simulated = sum(run.simulated for run in ended)
    yield Measurement(
        "  simulated, in the CPU time of all", simulated / everything, "x real time",
        Reference("one S1", after[1] / one), (), f"{simulated:.0f} s simulated",
    )  # fmt: skip
    there = SLOTS * took
    idle = there - busy
    yield Measurement(
        "  slots idle", 100.0 * idle / there, "%", Reference("all the time", 100.0), (),
        f"{idle:.1f} of {there:.1f} s, {SLOTS * tail:.1f} s of it when no run was left to start",
    )  # fmt: skip
    yield from outcomes(row)


def outcomes(row):
    """How many runs ended how; of these only the lost are always said."""
    every = Reference("all runs", row.total)
    for name, runs in (
        ("passed", row.passed),
        ("failed", row.failed),
        ("inconclusive", row.inconclusive),
        ("errors", row.errors),
        ("cancelled", row.cancelled),
    ):
        if runs:
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
    parser.add_argument("file", nargs="?", type=Path, default=CAMPAIGN)
    file = parser.parse_args(arguments).file
    submission = replace(expand(load_campaign(file)), reserve=(), fresh=True)
    yield from measured(submission, GOAL if file == CAMPAIGN else None)
