"""Judging: all oracles of one run of 700 s, and thousands of old traces again.

Building C (scenario S2 of the paper: doors that swing at random) with the pilot driving; the long
run repeats its mission until 700 s have passed. Judged by every oracle of the paper's layer. The
many traces are one-minute runs of the same scenario, a few different ones under many names, read
from the page cache.
"""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from daemon.analysis.rejudge import rejudge
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.judging import oracles
from daemon.model.spec import OracleText, RunSpec
from daemon.run import execute
from daemon.trace import read_trace
from grammars.model.scene import Scene
from grammars.oracle import load_oracles

PAPER = Path(__file__).parents[2] / "campaigns" / "ortega2024"
SECONDS = 700.0
TRACES = 2000
DIFFERENT = 10
ROUNDS = 7


def main() -> None:
    """Print the measurements."""
    layer = load_oracles(PAPER / "navigation.oracles.yaml")
    written = tuple(OracleText(o.name, o.text) for o in layer.values())
    paper = expand(load_campaign(PAPER / "first.yaml"))
    scenes = {scene.digest: scene for scene in paper.scenes}
    run = next(r for r in paper.runs if r.scenario == "S2")
    oracles.warm_up()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _one_long_run(_longer(run), scenes[run.scene], written, folder / "long.mcap")
        _many_short_runs(run, scenes[run.scene], written, folder / "short")


def _longer(run: RunSpec) -> RunSpec:
    """Return a run that drives its way again and again until the time is up."""
    there = run.mission.waypoints
    mission = replace(run.mission, waypoints=there * 8)
    return replace(run, mission=mission, limit=SECONDS)


def _one_long_run(run: RunSpec, scene: Scene, written: tuple[OracleText, ...], path: Path) -> None:
    simulated = execute(run, scene, trace_path=path).timing.simulated
    read = _cpu(lambda: read_trace(path))
    trace = read_trace(path)
    judge = _cpu(lambda: oracles.judge(trace, written))
    size = path.stat().st_size / 1e6
    print(
        f"one run of {simulated:.0f} s ({size:.1f} MB), {len(written)} oracles: "
        f"judged in {judge:.3f} s CPU, read in {read:.3f} s CPU"
    )
    for one in written:
        cost = _cpu(lambda one=one: oracles.judge(trace, (one,)))
        print(f"    {cost * 1e3:6.1f} ms  {one.text}")


def _many_short_runs(
    run: RunSpec, scene: Scene, written: tuple[OracleText, ...], folder: Path
) -> None:
    folder.mkdir()
    for number in range(DIFFERENT):
        short = replace(run, limit=60.0, seed=number, repeat=number)
        execute(short, scene, trace_path=folder / f"{number}-0.mcap")
    for number in range(DIFFERENT, TRACES):
        original = folder / f"{number % DIFFERENT}-0.mcap"
        os.link(original, folder / f"{number % DIFFERENT}-{number}.mcap")
    traces = sorted(folder.glob("*.mcap"))
    start, own, theirs = time.perf_counter(), os.times(), 0
    for judged in rejudge(traces, written, places=StatePaths(folder / "none")):
        theirs += len(judged.verdicts)
    wall, spent = time.perf_counter() - start, os.times()
    cpu = sum(spent[:4]) - sum(own[:4])
    print(
        f"{len(traces)} traces of 60 s, {theirs} verdicts: {wall:.1f} s, {cpu:.1f} s CPU "
        f"({cpu / len(traces) * 1e3:.1f} ms each)"
    )


def _cpu(work: Callable[[], Any]) -> float:
    costs = []
    for _ in range(ROUNDS):
        start = time.process_time()
        work()
        costs.append(time.process_time() - start)
    return statistics.median(costs)


if __name__ == "__main__":
    main()
