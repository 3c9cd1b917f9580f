"""navfn over a drive of scenario S1: whole waves against restricted ones, and GlobalPlanner beside.

The global costmap of building C as a2s inflates it, starts along the straight lines between the
waypoints as the robot passes them at 5 Hz, and costs that change in a window around it. Of the
whole waves only every fiftieth is timed and compared.
"""

import time

import numpy as np

from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.global_planner import GlobalPlannerParameters
from daemon.stacks.ros1.global_planner.planner import GlobalPlanner
from daemon.stacks.ros1.navfn import NavfnParameters
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.stacks.ros1.quirks import FIXED
from tests.benchmarks.measurement import Measurement, Reference
from tests.kernels import load_all
from tests.stacks.ros1.navfn import building
from tests.stacks.ros1.navfn.fields import a_field, path

STEP = 0.04
"""Metres between two plans: 136 m in about 3400 plans."""
HALF = 60
COMPARED = 50


def disturb(random, grid, original, at):
    """Make inflated costs around the robot noisy; return the window."""
    column, row = at
    window = (column - HALF, row - HALF, column + HALF, row + HALF)
    rows, columns = slice(window[1], window[3]), slice(window[0], window[2])
    cells = original.cells[rows, columns].astype(np.int64)
    noisy = (cells > 0) & (cells < 253) & (random.random(cells.shape) < 0.05)
    cells[noisy] = (cells[noisy] + random.integers(-20, 20, int(noisy.sum()))).clip(0, 252)
    grid.cells[rows, columns] = cells
    return window


def measure():
    """Yield the mean time of a plan by navfn, then by the planners side by side."""
    load_all()
    yield from waves()
    yield from planners()


def waves():
    """Yield restricted waves, whole ones being the reference."""
    original = building.costmap()
    trips = building.drive(STEP)
    for title, noisy in (("costs at rest", False), ("costs change", True)):
        random = np.random.default_rng(0)
        cells = original.cells.copy()
        grids = [CostGrid(original.resolution, original.x, original.y, cells) for _ in range(2)]
        field = a_field(grids[1])
        slow = a_field(grids[0], margins=())
        taken, whole, same = [], [], 0
        for k, (start, goal) in enumerate(trips):
            here, there = original.cell(start.x, start.y), original.cell(goal.x, goal.y)
            columns = cells.shape[1]
            trip = here[1] * columns + here[0], there[1] * columns + there[0]
            if noisy:
                window = disturb(random, grids[0], original, here)
                for grid in grids:
                    grid.touch(window)
            begin = time.process_time()
            found = path(field, *trip)
            taken.append(time.process_time() - begin)
            if k % COMPARED == 0:
                begin = time.process_time()
                expected = path(slow, *trip)
                whole.append(time.process_time() - begin)
                same += np.array_equal(found, expected)
        beside = Reference("whole waves", np.mean(whole).item() * 1e3)
        yield Measurement(
            title, np.mean(taken).item() * 1e3, "ms", beside, (),
            f"median {np.median(taken) * 1e3:.2f} of {len(trips)}; {field.restricted} "
            f"restricted, {field.whole} whole; {same} of {len(whole)} compared the same",
        )  # fmt: skip


def planners():
    """Yield each kind over the same plans, navfn being the reference."""
    kinds = {
        "navfn": Navfn(NavfnParameters(), FIXED),
        "GlobalPlanner": GlobalPlanner(GlobalPlannerParameters(), FIXED),
        "  old_navfn_behavior": GlobalPlanner(
            GlobalPlannerParameters(old_navfn_behavior=True), FIXED
        ),
    }
    random = np.random.default_rng(0)
    original = building.costmap()
    trips = building.drive(STEP)
    cells = original.cells.copy()
    grids = [CostGrid(original.resolution, original.x, original.y, cells) for _ in range(4)]
    noise, *own = grids
    taken = {name: [] for name in kinds}
    plans = dict.fromkeys(kinds, 0)
    for start, goal in trips:
        window = disturb(random, noise, original, original.cell(start.x, start.y))
        for (name, planner), grid in zip(kinds.items(), own, strict=True):
            grid.touch(window)
            begin = time.process_time()
            plan = planner.plan(grid, start, goal)
            taken[name].append(time.process_time() - begin)
            plans[name] += plan is not None
    base = Reference("navfn", np.mean(taken["navfn"]).item() * 1e3)
    for name, times in taken.items():
        note = f"median {np.median(times) * 1e3:.2f}; {plans[name]} of {len(times)} found a way"
        beside = None if name == base.name else base
        yield Measurement(name, np.mean(times).item() * 1e3, "ms", beside, (), note)
