"""One update of AMCL, compiled and in plain numpy, and how long a large map takes.

A corridor with niches on a map of 1700 x 1730
cells is driven down with the published parameters: 2000 particles at most, 30 beams, resampled
every second update. Both filters take the same scans in turns in one process.
"""

import statistics
from functools import partial

import numpy as np

from daemon.stacks.ros1.amcl.distance_field import distance_field
from daemon.stacks.ros1.amcl.node import Amcl
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Pose2
from grammars.model.grid import FREE, OCCUPIED, OccupancyGrid
from tests.benchmarks.measurement import Measurement, Reference, microseconds
from tests.kernels import load_all
from tests.stacks.ros1.amcl.plain import PlainAmcl
from tests.stacks.ros1.amcl.world import LASER, PUBLISHED, see

UPDATES = 120
BLOCK = 20
STEP = 0.11


def corridor():
    """Two thick walls with a niche's end every 2.25 m: the map, and its walls as boxes [m]."""
    cells = np.full((1730, 1700), FREE, dtype=np.int8)
    cells[860:865], cells[905:910] = OCCUPIED, OCCUPIED
    walls = [(-42.5, -0.25, 42.5, 0.0), (-42.5, 2.0, 42.5, 2.25)]
    for column in range(0, 1700, 45):
        cells[865:880, column : column + 4] = OCCUPIED
        walls.append((-42.5 + 0.05 * column, 0.0, -42.3 + 0.05 * column, 0.75))
    return OccupancyGrid(0.05, -42.5, -43.25, cells), walls


def measure():
    """Yield an update and the building of a filter."""
    load_all()
    grid, walls = corridor()
    poses = [Pose2(STEP * k, 0.9, 0.0) for k in range(UPDATES)]
    scans = [see(walls, pose) for pose in poses]

    def build():
        return Amcl(PUBLISHED, FAST, grid, (LASER,), poses[0], np.random.SeedSequence(1))

    first, again = microseconds(build), microseconds(build)
    amcl = build()
    cap = PUBLISHED.laser_likelihood_max_dist
    field = distance_field(grid, cap, brushfire=FAST.amcl_brushfire_distances)
    away = field.distances(cap)
    reference = PlainAmcl(PUBLISHED, grid, LASER, poses[0], 1, away[field.squared[1:-1, 1:-1]])

    def compiled(begin):
        for k in range(begin, begin + BLOCK):
            amcl.scan(0.1 * k, scans[k], poses[k])

    def plain(begin):
        for k in range(begin, begin + BLOCK):
            reference.update(scans[k], poses[k])

    rows = {"compiled": [], "plain": []}
    counts = []
    worst = 0.0
    for begin in range(0, UPDATES, BLOCK):
        rows["compiled"].append(microseconds(partial(compiled, begin)) / BLOCK)
        rows["plain"].append(microseconds(partial(plain, begin)) / BLOCK)
        counts.append(len(amcl.particles))
        worst = max(worst, float(np.abs(amcl.particles - reference.poses).max()))
    sizes = f"map of {grid.cells.shape[1]} x {grid.cells.shape[0]} cells, {LASER.rays} rays"
    plainly = Reference("plain numpy, same random numbers", statistics.median(rows["plain"]))
    particles = f"particles {', '.join(str(count) for count in counts)}, differ by {worst:.1e}"
    yield Measurement(
        "an update, compiled", statistics.median(rows["compiled"]), "us", plainly, (), particles
    )
    known = Reference("for a known one", again / 1e3)
    yield Measurement("built for a new map", first / 1e3, "ms", known, (), sizes)
