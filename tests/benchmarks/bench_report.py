"""Reports: one page for 120 runs in 24 cells.

All eight scenarios of the paper in building C with the pilot driving, its mission repeated until
500 s of simulated time have passed. Each scenario is run once; the 120 runs of the report are those
eight traces under many names (three systems, five repeats), read from the page cache: every one is
read, sampled and judged by itself, as in a folder `scenario run` leaves.
"""

import os
import resource
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

from daemon.analysis.recorded import read_traces
from daemon.analysis.report import (
    SuggestedCommand,
    read_report_data,
    report_table,
    write_junit,
    write_page,
)
from daemon.analysis.results import read_results
from daemon.analysis.table import write_table
from daemon.campaign import expand, load_campaign
from daemon.model.ids import trace_name
from daemon.run import execute
from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference

PAPER = Path(__file__).parents[2] / "campaigns" / "ortega2024" / "paper.yaml"
SECONDS = 500.0
SUTS, REPEATS = ("a2s", "fro-diff", "fro-omni"), 5


def measure():
    """Yield the page and the tables; executing what they are about is the reference."""
    paper = expand(load_campaign(PAPER))
    scenes = {scene.digest: scene for scene in paper.scenes}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs = []
        for run in {run.scenario: run for run in reversed(paper.specs)}.values():
            there = run.mission.waypoints
            mission = replace(run.mission, waypoints=there * (1 + 400 // len(there)))
            runs.append(replace(run, mission=mission, limit=SECONDS))
        used = _cpu()
        for run in runs:
            progress.say(f"executing {run.scenario}")
            path = folder / trace_name("c", run.scenario, "pilot", 0).partition("/")[2]
            execute(run, scenes[run.scene], trace_path=path)
        each = (_cpu() - used) / len(runs)
        yield from _report(folder, each)


def _report(folder, executed):
    source = read_traces(str(folder))
    chosen = read_results(source, source.row)
    records = tuple(
        replace(record, id=f"{record.id}-{sut}-{repeat}", sut=sut, repeat=repeat)
        for record in chosen.rows
        for sut in SUTS
        for repeat in range(REPEATS)
    )
    chosen = replace(chosen, rows=records)
    progress.say(f"the report of {len(records)} runs")
    wall, cpu = time.perf_counter(), _cpu()
    material = read_report_data(chosen, tuple(source.specs.values()))
    read = time.perf_counter()
    page = write_page(material, (SuggestedCommand("scenario judge {run}", "judge it again"),))
    drawn = time.perf_counter()
    beside = Reference("executing as many", executed * len(records))
    yield Measurement(
        f"report of {len(records)} runs", _cpu() - cpu, "CPU s", beside, (),
        f"{drawn - wall:.1f} s on {os.cpu_count()} cores, read and judged in {read - wall:.1f} s, "
        f"drawn in {drawn - read:.1f} s, {len(page.encode()) / 1e6:.2f} MB",
    )  # fmt: skip
    assessed = material.input.row.name, material.assessment, records
    table = report_table(material)
    tables = {
        "csv": partial(write_table, table),
        "parquet": partial(write_table, table),
        "xml": partial(write_junit, *assessed),
    }
    for name, write in tables.items():
        begun = time.process_time()
        write(folder / f"report.{name}")
        took = time.process_time() - begun
        size = f"{(folder / f'report.{name}').stat().st_size / 1e6:.2f} MB"
        yield Measurement(f"  {name}", took, "CPU s", beside, (), size)


def _cpu():
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in used)
