"""Judging and reports: oracles of one run, old traces judged again, one page for 120 runs.

All eight scenarios of the paper in building C with the pilot driving, its mission repeated until
500 s of simulated time have passed. Each scenario is run once; the 120 runs are those eight traces
under many names (three systems, five repeats), read from the page cache: every one is read, sampled
and judged by itself, as in a folder `scenario run` leaves.
"""

import os
import resource
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

from daemon.analysis.recorded import read_traces
from daemon.analysis.rejudge import rejudge
from daemon.analysis.report import (
    read_report_data,
    report_table,
    write_junit,
    write_page,
)
from daemon.analysis.results import read_results
from daemon.analysis.table import write_table
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.judging import oracles
from daemon.model.ids import trace_name
from daemon.model.spec import OracleText
from daemon.run import execute
from daemon.trace import read_trace
from grammars.oracle import load_oracles
from tests.benchmarks import progress
from tests.benchmarks.bench_run import PAPER
from tests.benchmarks.measurement import Measurement, Reference, side_by_side

SECONDS = 500.0
SUTS, REPEATS = ("a2s", "fro-diff", "fro-omni"), 5
ROUNDS = 5


def measure():
    """Execute what everything is about, which is the reference of the report."""
    paper = expand(load_campaign(PAPER / "paper.yaml"))
    scenes = {scene.digest: scene for scene in paper.scenes}
    layer = load_oracles(PAPER / "navigation.oracles.yaml").values()
    written = tuple(OracleText(one.name, one.text) for one in layer)
    with tempfile.TemporaryDirectory() as folder:
        used, paths = _cpu(), {}
        for run in {run.scenario: run for run in reversed(paper.specs)}.values():
            progress.say(f"executing {run.scenario}")
            there = run.mission.waypoints
            mission = replace(run.mission, waypoints=there * (1 + 400 // len(there)))
            path = Path(folder, trace_name("c", run.scenario, "pilot", 0).partition("/")[2])
            long = replace(run, mission=mission, limit=SECONDS)
            execute(long, scenes[run.scene], trace_path=path)
            paths[run.scenario] = path
        executed = (_cpu() - used) / len(paths)
        yield from judged(paths["S2"], written)
        yield again(list(paths.values()) * len(SUTS) * REPEATS, written, Path(folder, "none"))
        yield from reported(folder, executed)


def judged(path, written):
    """Yield one run judged, reading it being the reference, then oracle by oracle."""
    trace = read_trace(path)
    whole = f"{len(written)} oracles"
    works = {
        f"a trace of {path.stat().st_size / 1e6:.1f} MB read": lambda: read_trace(path),
        f"  judged by {whole}": lambda: oracles.judge(trace, written),
        "  with leading margins": lambda: oracles.judge_leading(trace, written),
    }
    yield from side_by_side(works, ROUNDS)
    works = {whole: lambda: oracles.judge(trace, written)} | {
        f"  {one.text}": partial(oracles.judge, trace, (one,)) for one in written
    }
    yield from side_by_side(works, ROUNDS)


def again(paths, written, places):
    """Return what it costs to judge old traces again."""
    progress.say(f"judging {len(paths)} traces again")
    start, before = time.perf_counter(), _cpu()
    count = sum(len(one.verdicts) for one in rejudge(paths, written, places=StatePaths(places)))
    wall, used = time.perf_counter() - start, _cpu() - before
    note = f"{count} verdicts, {wall:.1f} s, {used / len(paths) * 1e3:.1f} CPU ms each"
    return Measurement(f"{len(paths)} traces judged again", used, "CPU s", None, (), note)


def reported(folder, executed):
    source = read_traces(str(folder))
    chosen = read_results(source, source.row)
    records = tuple(
        replace(record, id=f"{record.id}-{sut}-{repeat}", sut=sut, repeat=repeat)
        for record in chosen.rows
        for sut in SUTS
        for repeat in range(REPEATS)
    )
    progress.say(f"the report of {len(records)} runs")
    start, before = time.perf_counter(), _cpu()
    material = read_report_data(replace(chosen, rows=records), tuple(source.specs.values()))
    read = time.perf_counter() - start
    page = write_page(material, lambda run, *_: [(f"scenario judge {run}", "judge it again")])
    drawn = time.perf_counter() - start - read
    beside = Reference("executing as many", executed * len(records))
    yield Measurement(
        f"report of {len(records)} runs", _cpu() - before, "CPU s", beside, (),
        f"on {os.cpu_count()} cores read and judged in {read:.1f} s, drawn in {drawn:.1f} s, "
        f"{len(page.encode()) / 1e6:.2f} MB",
    )  # fmt: skip
    table = report_table(material)
    tables = {
        "csv": partial(write_table, table),
        "parquet": partial(write_table, table),
        "xml": partial(write_junit, material.input.row.name, material.assessment, records),
    }
    for name, write in tables.items():
        path, begun = Path(folder, f"report.{name}"), time.process_time()
        write(path)
        took = time.process_time() - begun
        size = f"{path.stat().st_size / 1e6:.2f} MB"
        yield Measurement(f"  {name}", took, "CPU s", beside, (), size)


def _cpu():
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in used)
