"""All artefacts of building C: how long each takes, and all of them together.

Run with ``python -m tests.benchmarks.bench_artefacts``. One process per row, so that every row
pays for the libraries it imports; the second number is a repeat in the same process. Loading the
plan and composing the scene is a row of its own.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from templates.artefacts import KINDS

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
PUBLISHED = 22.0
"""Seconds the published tools need for mesh, grid, tasks, Gazebo and key frames (measured)."""


def measure(kinds: list[str]) -> None:
    """Print what loading took, first and second time for ``kinds``, files and bytes."""
    from scenario_tui.cli.export import world_of_plan, worlds_of_campaign
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


def _row(name: str, *kinds: str) -> float:
    command = [sys.executable, "-m", "tests.benchmarks.bench_artefacts", "--measure", *kinds]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    loading, first, second, files, size = (float(word) for word in said)
    print(
        f"{name:10} {first * 1000:9.0f} ms {second * 1000:9.0f} ms again {files:5.0f} files "
        f"{size / 1e6:7.2f} MB"
    )
    return loading


def _command(source: str) -> float:
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


def main() -> None:
    """Print the table."""
    print("building C with eleven moving doors: first and second time, a process per row")
    for kind in KINDS:
        _row(kind, kind)
    loading = _row("all")
    print(f"{'loading':10} {loading * 1000:9.0f} ms  plan and campaign, scene, behaviours")
    sources = {
        "building_c.fpm": "the plan",
        "first.yaml": "two worlds",
        "campaign.yaml": "eight worlds",
    }
    for source, worlds in sources.items():
        seconds = _command(source)
        print(
            f"scenario export {source} all: {seconds:.2f} s ({worlds}); published tools "
            f"{PUBLISHED:.0f} s, {PUBLISHED / seconds:.1f} times as long"
        )


if __name__ == "__main__":
    if "--measure" in sys.argv:
        measure(sys.argv[2:])
    else:
        main()
