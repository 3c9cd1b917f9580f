"""The tables of ``docs/fast-planner.md``: the exact planner of the ROS stack and the incremental.

``python -m tests.planner_comparison FOLDER`` runs every cell of the paper's campaign with both,
one after the other in one process, ``--repeats`` times, in two processes, and prints the tables;
with ``--write`` they take the place of those in the page. FOLDER keeps what came out of each pair
of runs: a comparison that was interrupted goes on, and further repeats are added to those there.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from statistics import mean, stdev
from typing import Any

from daemon.campaign import expand, load_campaign
from daemon.model.verdicts import Outcome

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "fast-planner.md"
CAMPAIGN = ROOT / "campaigns" / "ortega2024" / "campaign.yaml"
PLANNERS = ("exact", "incremental")
MEASURES = {"duration": 1, "distance": 1, "loc-mean": 3}
"""Measures of the campaign in the table, with their decimals."""
_PROCESSES = 2
_BLOCK = re.compile(r"(<!-- table (?P<name>[a-z]+)[^>]*-->\n).*?(<!-- end of table -->)", re.DOTALL)
Row = dict[str, Any]


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """A place in the campaign: one repeat of one cell."""

    scenario: str
    sut: str
    repeat: int

    @property
    def file(self):
        """Return the name of the file that keeps what came out."""
        return f"{self.scenario}-{self.sut}-{self.repeat}.json"


@cache
def _submission():
    return expand(load_campaign(CAMPAIGN))


def planned_by(spec, planner):
    """Return ``spec`` with another planner; nothing else differs, the seed neither."""
    if planner == "exact":
        return spec
    parameters = spec.sut.parameters | {"planner": planner}
    return replace(spec, sut=replace(spec.sut, parameters=parameters))


def places(repeats):
    """Return all places of the campaign's first ``repeats``, those of one repeat together."""
    runs = [Place(r.scenario, r.sut.name, r.repeat) for r in _submission().runs]
    there = [place for place in runs if place.repeat < repeats]
    return sorted(there, key=lambda place: place.repeat)


def run_pair(place, folder):
    """Run one place with both planners and keep what came out; return the file."""
    from daemon.run import execute

    _warm()
    submission = _submission()
    spec = next(
        run
        for run in submission.runs
        if (run.scenario, run.sut.name, run.repeat) == (place.scenario, place.sut, place.repeat)
    )
    scene = next(scene for scene in submission.scenes if scene.digest == spec.scene)
    rows = {}
    with tempfile.TemporaryDirectory() as there:
        for planner in PLANNERS:
            begun = time.process_time()
            result = execute(planned_by(spec, planner), scene, trace_path=Path(there) / "run.mcap")
            spent = time.process_time() - begun
            rows[planner] = {
                "cpu": spent,
                "simulated": result.timing.simulated,
                "verdicts": {
                    verdict.oracle: verdict.outcome.value
                    for verdict in result.verdicts
                    if verdict.outcome is not Outcome.MEASURE
                },
                "measures": {
                    verdict.oracle: verdict.evidence.value
                    for verdict in result.verdicts
                    if verdict.oracle in MEASURES
                },
            }
    path = folder / place.file
    written = path.with_suffix(".tmp")
    written.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    return written.replace(path)


@cache
def _warm():
    """Compile before anything is timed."""
    from daemon.run import warm_up
    from daemon.stacks.ros1.navfn import warm_up_incremental

    warm_up()
    warm_up_incremental()


def run_missing(folder, repeats):
    """Run what ``folder`` does not hold yet; yield each place when it is done."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = [place for place in places(repeats) if not (folder / place.file).exists()]
    if not missing:
        return
    with ProcessPoolExecutor(_PROCESSES, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(run_pair, place, folder): place for place in missing}
        for future in as_completed(running):
            future.result()
            yield running[future]


def read_pairs(folder, repeats):
    """Return what was run of every cell, in the order of the campaign."""
    cells = {}
    for place in sorted(places(repeats), key=lambda each: each.scenario):
        path = folder / place.file
        if path.exists():
            rows = json.loads(path.read_text("utf-8"))
            cells.setdefault((place.scenario, place.sut), []).append(rows)
    return cells


def verdicts_text(pairs):
    """Return how often each oracle passed with either planner, where they differ."""
    names = list(pairs[0]["exact"]["verdicts"])
    found = []
    for name in names:
        passed = [_passed(pairs, planner, name) for planner in PLANNERS]
        if any(p["exact"]["verdicts"][name] != p["incremental"]["verdicts"][name] for p in pairs):
            found.append(f"{name} {passed[0]} → {passed[1]} of {len(pairs)}")
    return "; ".join(found) or "the same"


def _passed(pairs, planner, oracle):
    return sum(pair[planner]["verdicts"][oracle] == Outcome.PASS.value for pair in pairs)


def number_text(values, decimals):
    """Return the mean of the values there are, with their standard deviation if there are more."""
    known = [value for value in values if value is not None]
    if not known:
        return "–"
    text = f"{mean(known):.{decimals}f}"
    return text if len(known) < 2 else f"{text} ± {stdev(known):.{decimals}f}"


def table(cells):
    """Return the table of all cells, exact before incremental in every column with an arrow."""
    head = ["scenario", "SUT", "runs", "verdicts passed", "duration [s]", "distance [m]"]
    head += ["localisation error [m]", "CPU [s]", "times as fast"]
    lines = [head, ["---"] * len(head)]
    for (scenario, sut), pairs in cells.items():
        row = [scenario, sut, str(len(pairs)), verdicts_text(pairs)]
        for name, decimals in MEASURES.items():
            values = [[pair[p]["measures"].get(name) for pair in pairs] for p in PLANNERS]
            row.append(" → ".join(number_text(each, decimals) for each in values))
        exact, quick = ([pair[p]["cpu"] for pair in pairs] for p in PLANNERS)
        row.append(f"{number_text(exact, 1)} → {number_text(quick, 1)}")
        row.append(f"{sum(exact) / sum(quick):.2f}")
        lines.append(row)
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def summary(cells):
    """Return what the cells come to together, a line for each thing."""
    pairs = [pair for each in cells.values() for pair in each]
    both = [
        (pair["exact"]["verdicts"][name], pair["incremental"]["verdicts"][name])
        for pair in pairs
        for name in pair["exact"]["verdicts"]
    ]
    whole = sum(pair["exact"]["verdicts"] == pair["incremental"]["verdicts"] for pair in pairs)
    spent = [sum(pair[planner]["cpu"] for pair in pairs) for planner in PLANNERS]
    simulated = [sum(pair[planner]["simulated"] for pair in pairs) for planner in PLANNERS]
    speeds = [f"{s / c:.0f}" for s, c in zip(simulated, spent, strict=True)]
    return (
        f"| cells | pairs of runs | with the same verdicts | verdicts | of them the same | CPU [s] "
        f"| simulated seconds per CPU second | times as fast |\n{'| --- ' * 8}|\n"
        f"| {len(cells)} | {len(pairs)} | {whole} | {len(both)} | {sum(a == b for a, b in both)} "
        f"| {spent[0]:.0f} → {spent[1]:.0f} | {speeds[0]} → {speeds[1]} "
        f"| {spent[0] / spent[1]:.2f} |\n"
    )


def page_with(page, tables):
    """Return the text of a page with its tables replaced between their markers."""
    return _BLOCK.sub(lambda m: f"{m[1]}{tables.get(m['name'], '')}{m[3]}", page)


def main():
    """Run what is missing, print the tables, write them into the page if asked to."""
    parser = argparse.ArgumentParser(prog="python -m tests.planner_comparison")
    parser.add_argument("folder", type=Path, help="where what came out is kept")
    parser.add_argument("--repeats", type=int, default=1, help="of the campaign's 5")
    parser.add_argument("--write", action="store_true", help="into the page as well")
    given = parser.parse_args()
    for place in run_missing(given.folder, given.repeats):
        print(f"{place.scenario} {place.sut} {place.repeat}", flush=True)
    cells = read_pairs(given.folder, given.repeats)
    tables = {"summary": summary(cells), "cells": table(cells)}
    print("\n".join(tables.values()))
    if given.write:
        PAGE.write_text(page_with(PAGE.read_text("utf-8"), tables), "utf-8")


if __name__ == "__main__":
    main()
