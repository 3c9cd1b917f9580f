"""What the ROS stack costs: scenario S1 of the paper with the a2s configuration, a whole run.

Simulated seconds per CPU second, CPU seconds per component, peak memory. A component's time is
what passes inside its calls from the stack; the stack's own is the rest of its updates; the rest
of the run is the simulator, the trace, reading it back and judging.
"""

from __future__ import annotations

import resource
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

from daemon.campaign import expand, load_campaign
from daemon.model.spec import RunSpec
from daemon.run import execute, warm_up
from daemon.stacks.ros1.amcl import Amcl
from daemon.stacks.ros1.costmap import Costmap
from daemon.stacks.ros1.dwa import Dwa
from daemon.stacks.ros1.navfn import Navfn
from daemon.stacks.ros1.stack import RosStack
from grammars.model.files import load_robot
from grammars.model.scene import Scene

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
SUT = "a2s"
METHODS: tuple[tuple[str, type[Any], tuple[str, ...]], ...] = (
    ("navfn", Navfn, ("plan",)),
    ("dwa", Dwa, ("set_plan", "goal_reached", "command")),
    ("costmaps", Costmap, ("update", "clear_square")),
    ("amcl", Amcl, ("scan",)),
    ("stack, all", RosStack, ("start", "update")),
)


def case() -> tuple[RunSpec, Scene]:
    """S1 of the paper, with the robot and the configuration it was made with."""
    with tempfile.TemporaryDirectory() as there:
        for name in ("ortega2024", "robots", "suts"):
            shutil.copytree(CAMPAIGNS / name, Path(there) / name)
        path = Path(there) / "ortega2024" / "paper.yaml"
        path.write_text(path.read_text().replace("sut: [pilot]", f"sut: [{SUT}]"))
        submission = expand(load_campaign(path))
    spec = next(run for run in submission.runs if run.scenario == "S1")
    robot = load_robot(CAMPAIGNS / "robots" / "robile-planar-move.yaml")
    scene = next(scene for scene in submission.scenes if scene.digest == spec.scene)
    return replace(spec, robot=robot), scene


@contextmanager
def stopwatches() -> Iterator[dict[str, list[float]]]:
    """Collect [CPU seconds, calls] of each component while the block runs."""
    spent: dict[str, list[float]] = {}
    patches = []
    for title, owner, names in METHODS:
        spent[title] = [0.0, 0]
        for name in names:
            timed = _timed(getattr(owner, name), spent[title])
            patches.append(mock.patch.object(owner, name, timed))
    for patch in patches:
        patch.start()
    try:
        yield spent
    finally:
        for patch in patches:
            patch.stop()


def _timed(method: Callable[..., Any], total: list[float]) -> Callable[..., Any]:
    def wrapper(*arguments: Any, **named: Any) -> Any:
        begun = time.process_time()
        try:
            return method(*arguments, **named)
        finally:
            total[0] += time.process_time() - begun
            total[1] += 1

    return wrapper


def main() -> None:
    spec, scene = case()
    warm_up()
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        result = execute(spec, scene, trace_path=Path(folder) / "run.mcap")
        cpu = time.process_time() - start
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        simulated = result.timing.simulated
        size = result.trace.size / 1000 / (simulated / 60)
        print(f"S1, {SUT}: {simulated:.0f} s simulated, {result.ended}, {result.outcome}")
        print(f"{cpu:.2f} s CPU, {simulated / cpu:.0f} x real time, trace {size:.0f} kB/min")
        with stopwatches() as spent:
            start = time.process_time()
            execute(spec, scene, trace_path=Path(folder) / "timed.mcap")
            whole = time.process_time() - start
    everything = spent.pop("stack, all")
    rows = {title: tuple(values) for title, values in spent.items()}
    rows["stack itself"] = (everything[0] - sum(v[0] for v in spent.values()), everything[1])
    rows["simulator, trace, oracles"] = (whole - everything[0], 1)
    print(f"{'component':26} {'CPU s':>7} {'share':>6} {'calls':>7} {'us / call':>10}")
    for title, (seconds, calls) in rows.items():
        each = 1e6 * seconds / calls
        print(f"{title:26} {seconds:7.2f} {seconds / whole:6.0%} {calls:7.0f} {each:10.1f}")
    print(f"peak memory of the process after the first run: {peak:.0f} MB")


if __name__ == "__main__":
    main()
