"""All artefacts of building C: how long each takes, and all of them together.

One process per row, so that every row
pays for the libraries it imports; the second number is a repeat in the same process. Loading the
plan and composing the scene is a row of its own.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from templates.artefacts import KINDS
from tests.benchmarks.measurement import Measurement, Reference

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
PUBLISHED = 22.0
"""Seconds that mesh, grid, tasks, Gazebo and key frames once took by the published tools."""


def tell(kinds):
    """Print what loading took, first and second time for ``kinds``, files and bytes."""
    from daemon.analysis.campaign_worlds import worlds_of_campaign
    from scenario_tui.cli.export import world_of_plan
    from templates.artefacts import export

    begin = time.perf_counter()
    plan, _ = world_of_plan(CAMPAIGNS / "ortega2024" / "building_c.fpm")
    worlds, _ = worlds_of_campaign(CAMPAIGNS / "ortega2024" / "first.yaml")
    loading = time.perf_counter() - begin
    world = next(w for w in (worlds[-1], plan) if all(KINDS[kind].fits(w) for kind in kinds))
    times = []
    for _ in range(2):
        with tempfile.TemporaryDirectory() as folder:
            begin = time.perf_counter()
            done = export(world, kinds or ["all"], Path(folder))
            times.append(time.perf_counter() - begin)
            size = sum(path.stat().st_size for path in done.paths)
    print(f"{loading:.6f} {times[0]:.6f} {times[1]:.6f} {len(done.paths)} {size}")


def _row(name, *kinds):
    """What the kinds take, and what loading took [ms]."""
    program = f"import sys; from {__name__} import tell; tell(sys.argv[1:])"
    command = [sys.executable, "-c", program, *kinds]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    loading, first, second, files, size = (float(word) for word in said)
    note = f"{files:.0f} files, {size / 1e6:.2f} MB"
    beside = Reference("again", 1e3 * second)
    return Measurement(name, 1e3 * first, "ms", beside, (), note), 1e3 * loading


def _command(source):
    """Return the seconds ``scenario export SOURCE all`` takes, from start to end."""
    code = "import sys; from scenario_tui.cli import main; main(sys.argv[1:])"
    with tempfile.TemporaryDirectory() as folder:
        path = str(CAMPAIGNS / "ortega2024" / source)
        begin = time.perf_counter()
        subprocess.run(
            [sys.executable, "-c", code, "export", path, "all", "-o", folder],
            capture_output=True,
            check=True,
        )
        return time.perf_counter() - begin


def measure():
    """Yield each kind in a process of its own, and whole commands."""
    for kind in KINDS:
        yield _row(kind, kind)[0]
    everything, loading = _row("all")
    yield everything
    together = Reference("all artefacts", everything.value)
    yield Measurement("plan and campaign read, scene composed", loading, "ms", together)
    sources = {
        "building_c.fpm": "the plan",
        "first.yaml": "two worlds",
        "campaign.yaml": "eight worlds",
    }
    in_one = Reference("all artefacts of one world", everything.value / 1e3)
    for source, worlds in sources.items():
        seconds = _command(source)
        note = f"{worlds}; the published tools took {PUBLISHED:.0f} s for a part of it"
        yield Measurement(f"scenario export {source} all", seconds, "s", in_one, (), note)
