"""Judging: all oracles of one run of 700 s, also with leading margins, and many old traces again.

Building C (scenario S2 of the paper: doors that swing at random) with the pilot driving; the long
run repeats its mission until 700 s have passed. Judged by every oracle of the paper's layer. The
many traces are one-minute runs of the same scenario, a few different ones under many names, read
from the page cache.
"""

import os
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from daemon.analysis.rejudge import rejudge
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.judging import oracles
from daemon.model.spec import OracleText
from daemon.run import execute
from daemon.trace import read_trace
from grammars.oracle import load_oracles
from tests.benchmarks.measurement import Measurement, Reference
from tests.kernels import load_all

PAPER = Path(__file__).parents[2] / "campaigns" / "ortega2024"
SECONDS = 700.0
TRACES = 2000
DIFFERENT = 10
ROUNDS = 7


LONG = "2000 traces, judged again"


def measure():
    """Yield one long run, oracle by oracle, and many short ones."""
    layer = load_oracles(PAPER / "navigation.oracles.yaml")
    written = tuple(OracleText(o.name, o.text) for o in layer.values())
    paper = expand(load_campaign(PAPER / "first.yaml"))
    scenes = {scene.digest: scene for scene in paper.scenes}
    run = next(r for r in paper.specs if r.scenario == "S2")
    load_all()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield from _one_long_run(_longer(run), scenes[run.scene], written, folder / "long.mcap")
        yield _many_short_runs(run, scenes[run.scene], written, folder / "short")


def _longer(run):
    """Return a run that drives its way again and again until the time is up."""
    there = run.mission.waypoints
    mission = replace(run.mission, waypoints=there * 8)
    return replace(run, mission=mission, limit=SECONDS)


def _one_long_run(run, scene, written, path):
    simulated = execute(run, scene, trace_path=path).timing.simulated
    read = _cpu(lambda: read_trace(path))
    trace = read_trace(path)
    judge = _cpu(lambda: oracles.judge(trace, written))
    size = path.stat().st_size / 1e6
    reading = Reference("reading it", 1e3 * read)
    what = f"{len(written)} oracles, {size:.1f} MB"
    yield Measurement(f"one run of {simulated:.0f} s judged", 1e3 * judge, "ms", reading, (), what)
    together = Reference("all of them", 1e3 * judge)
    leading = _cpu(lambda: oracles.judge_leading(trace, written))
    yield Measurement("  with leading margins", 1e3 * leading, "ms", together)
    for one in written:
        cost = _cpu(lambda one=one: oracles.judge(trace, (one,)))
        yield Measurement(f"  {one.text}", 1e3 * cost, "ms", together)


def _many_short_runs(run, scene, written, folder):
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
    note = f"{theirs} verdicts, {wall:.1f} s, {cpu / len(traces) * 1e3:.1f} CPU ms each"
    return Measurement(f"{len(traces)} traces of 60 s", cpu, "CPU s", None, (), note)


def _cpu(work):
    costs = []
    for _ in range(ROUNDS):
        start = time.process_time()
        work()
        costs.append(time.process_time() - start)
    return statistics.median(costs)
