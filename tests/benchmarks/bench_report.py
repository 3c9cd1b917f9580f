"""Reports: one page for 120 runs in 24 cells.

All eight scenarios of the paper in building C with the pilot driving, its mission repeated until
500 s of simulated time have passed. Each scenario is run once; the 120 runs of the report are those
eight traces under many names (three systems, five repeats), read from the page cache: every one is
read, sampled and judged by itself, as in a folder `scenario run` leaves.
"""

from __future__ import annotations

import os
import resource
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from daemon.analysis.report import (
    SuggestedCommand,
    folder_input,
    read_report_data,
    write_csv,
    write_junit,
    write_page,
    write_parquet,
)
from daemon.campaign import expand, load_campaign
from daemon.model.ids import trace_name
from daemon.run import execute

PAPER = Path(__file__).parents[2] / "campaigns" / "ortega2024" / "paper.yaml"
SECONDS = 500.0
SUTS, REPEATS = ("a2s", "fro-diff", "fro-omni"), 5


def main() -> None:
    """Print the measurements."""
    paper = expand(load_campaign(PAPER))
    scenes = {scene.digest: scene for scene in paper.scenes}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs = []
        for run in {run.scenario: run for run in reversed(paper.runs)}.values():
            there = run.mission.waypoints
            mission = replace(run.mission, waypoints=there * (1 + 400 // len(there)))
            runs.append(replace(run, mission=mission, limit=SECONDS))
        for run in runs:
            path = folder / trace_name("c", run.scenario, "pilot", 0).partition("/")[2]
            took = execute(run, scenes[run.scene], trace_path=path).timing.simulated
            print(f"    {run.scenario}: {took:.0f} s simulated, {path.stat().st_size / 1e6:.1f} MB")
        _report(folder)


def _report(folder: Path) -> None:
    chosen = folder_input(folder)
    records = tuple(
        replace(record, id=f"{record.id}-{sut}-{repeat}", sut=sut, repeat=repeat)
        for record in chosen.records
        for sut in SUTS
        for repeat in range(REPEATS)
    )
    chosen = replace(chosen, records=records)
    wall, cpu = time.perf_counter(), _cpu()
    material = read_report_data(chosen)
    read = time.perf_counter()
    page = write_page(material, (SuggestedCommand("scenario judge {run}", "judge it again"),))
    drawn = time.perf_counter()
    print(
        f"report of {len(records)} runs: {drawn - wall:.1f} s on {os.cpu_count()} cores "
        f"(read and judged in {read - wall:.1f} s, drawn in {drawn - read:.1f} s), "
        f"{_cpu() - cpu:.1f} s CPU, {len(page.encode()) / 1e6:.2f} MB"
    )
    for write, name in ((write_csv, "csv"), (write_parquet, "parquet"), (write_junit, "xml")):
        begun = time.perf_counter()
        write(material, folder / f"report.{name}")
        size = (folder / f"report.{name}").stat().st_size / 1e6
        print(f"    {name}: {time.perf_counter() - begun:.2f} s, {size:.2f} MB")


def _cpu() -> float:
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


if __name__ == "__main__":
    main()
