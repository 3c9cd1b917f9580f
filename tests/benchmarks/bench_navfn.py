"""navfn over a drive of scenario S1: whole waves against restricted ones, and how often they fail.

The global costmap of building C as a2s inflates it, starts along the straight lines between the
waypoints as the robot passes them at 5 Hz, and costs that change in a window around it. Of the
whole waves only every fiftieth is timed and compared.
"""

import time

import numpy as np

from daemon.stacks.ros1.cost_grid import CostGrid
from tests.benchmarks.measurement import Measurement, Reference
from tests.kernels import load_all
from tests.stacks.ros1.navfn import building
from tests.stacks.ros1.navfn.fields import a_field, path

STEP = 0.04
"""Metres between two plans: 136 m in about 3400 plans."""
HALF = 60
COMPARED = 50


def disturb(random, grid, original, at):  # fmt: skip
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
    """Yield the mean time of a plan, whole waves being the reference."""
    load_all()
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
            assert here is not None
            assert there is not None
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
