"""GlobalPlanner and navfn over the same drive of scenario S1, plan by plan side by side.

Starts, goals and costs as in :mod:`.bench_navfn`, with costs that change around the robot.
"""

import time

import numpy as np

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.global_planner import GlobalPlannerParameters
from daemon.stacks.ros1.global_planner.planner import GlobalPlanner
from daemon.stacks.ros1.navfn import NavfnParameters
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.stacks.ros1.quirks import FIXED
from tests.benchmarks.bench_navfn import STEP, disturb
from tests.benchmarks.measurement import Measurement, Reference
from tests.kernels import load_all
from tests.stacks.ros1.navfn import building

KINDS = {
    "navfn": None,
    "GlobalPlanner": GlobalPlannerParameters(),
    "  old_navfn_behavior": GlobalPlannerParameters(old_navfn_behavior=True),
}
"""Parameters, none for navfn."""


def measure():
    """Yield the mean time of a plan of each kind."""
    load_all()
    random = np.random.default_rng(0)
    original = building.costmap()
    trips = building.drive(STEP)
    cells = original.cells.copy()
    grids = {name: CostGrid(original.resolution, original.x, original.y, cells) for name in KINDS}
    planners = {
        name: Navfn(NavfnParameters(), FIXED)
        if parameters is None
        else GlobalPlanner(parameters, FIXED)
        for name, parameters in KINDS.items()
    }
    taken = {name: [] for name in KINDS}
    found = dict.fromkeys(KINDS, 0)
    noise = CostGrid(original.resolution, original.x, original.y, cells)
    for start, goal in trips:
        here = original.cell(start.x, start.y)
        assert here is not None
        window = disturb(random, noise, original, here)
        for name in KINDS:
            grids[name].touch(window)
            begin = time.process_time()
            plan = planners[name].plan(grids[name], start, goal)
            taken[name].append(time.process_time() - begin)
            found[name] += plan is not None
    rows, columns = cells.shape
    base = Reference("navfn", np.mean(taken["navfn"]).item() * 1e3)
    for name, times in taken.items():
        note = f"median {np.median(times) * 1e3:.2f}; {found[name]} of {len(times)} found"
        note += f" on {rows} x {columns} cells"
        beside = None if name == base.name else base
        yield Measurement(name, np.mean(times).item() * 1e3, "ms", beside, (), note)
