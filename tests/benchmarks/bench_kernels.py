"""The kernels of the ROS stack beside plain versions that decide the same.

AMCL on a map of 1700 x 1730 cells, with the published parameters: 2000 particles at most, 30
beams. The sampling controller along a corridor, TrajectoryPlannerROS of five published robots in
a bend beside two boxes. navfn and the costmaps in building C, with the parameters of a2s and costs
that change around the robot: restricted waves beside whole ones, and an update of the global
costmap beside the same bounds done over as costmap_2d does. CPU of this process.
"""

import math
import statistics
from dataclasses import replace
from functools import partial

import numpy as np

from daemon.simulator import World
from daemon.stacks.ros1.amcl.distance_field import distance_field
from daemon.stacks.ros1.amcl.node import Amcl
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.costmap import SensedScan
from daemon.stacks.ros1.costmap._inflation import inflate
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    StaticLayer,
)
from daemon.stacks.ros1.costmap.master_grid import merge_window
from daemon.stacks.ros1.dwa.controller import Dwa
from daemon.stacks.ros1.quirks import FAST
from daemon.stacks.ros1.trajectory_planner._parameters import strafe_speeds
from daemon.stacks.ros1.trajectory_planner._rollout import settings_of
from daemon.stacks.ros1.trajectory_planner.controller import TrajectoryPlanner
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import FREE, OCCUPIED, OccupancyGrid
from templates.occupancy import occupancy_grid
from tests.benchmarks.case_process import run_of
from tests.benchmarks.measurement import Measurement, Reference, microseconds
from tests.kernels import load_all
from tests.parts import ROOT
from tests.stacks.ros1.amcl.plain import PlainAmcl
from tests.stacks.ros1.amcl.world import LASER, PUBLISHED, see
from tests.stacks.ros1.dwa.helpers import A2S, LARGE, OMNI, SMALL, Problem, settings, singles
from tests.stacks.ros1.navfn import building
from tests.stacks.ros1.navfn.fields import a_field, path
from tests.stacks.ros1.trajectory_planner.helpers import ROBOTS, costs_around
from tests.stacks.ros1.trajectory_planner.plain import PlainPlanner

UPDATES, BLOCK, STEP = 120, 20, 0.11
PROBLEMS, CYCLES, REPEATS = 24, 6, 5
CONTROLLERS = {"a2s": (A2S, SMALL), "fro-diff": (A2S, LARGE), "fro-omni": (OMNI, LARGE)}
BOXES = ((1.0, -1.6, 1.4, -0.9), (0.6, 1.0, 1.2, 1.5))
BETWEEN_PLANS, HALF, COMPARED = 0.04, 60, 50
"""[m], cells of a window that changes, and plans of which one is compared."""
BEGIN, END, SPEED = (-12.86, 12.46), (20.76, 60.46), 0.22
FOOTPRINT = ((-0.08, -0.075), (-0.08, 0.075), (0.105, 0.075), (0.105, -0.075))
SEEN = ObstacleLayer(
    sources=(ObservationSource("scan", "/scan", clearing=True, obstacle_range=3.0,
                               raytrace_range=3.5),)
)  # fmt: skip
INFLATION = InflationLayer(inflation_radius=0.5, cost_scaling_factor=3.0)


def heard(topic):
    """Return the name of the only laser."""
    return ("",)


GLOBAL = LayeredCostmap((StaticLayer(), SEEN, INFLATION), footprint=FOOTPRINT)
LOCAL = LayeredCostmap(
    (SEEN, replace(INFLATION, inflation_radius=0.55, cost_scaling_factor=5.0)), "odom",
    footprint=FOOTPRINT, rolling_window=True, width=3.0, height=3.0,
)  # fmt: skip


def measure():
    """Yield what each kernel has to say."""
    load_all()
    yield from particles()
    for name, (parameters, outline) in CONTROLLERS.items():
        yield from controller(name, parameters, outline)
    for name, robot in ROBOTS.items():
        yield trajectories(name, robot)
    yield from waves()
    yield from costmaps()


def corridor():
    """Two thick walls with a niche's end every 2.25 m: the map, and its walls as boxes [m]."""
    cells = np.full((1730, 1700), FREE, dtype=np.int8)
    cells[860:865], cells[905:910] = OCCUPIED, OCCUPIED
    walls = [(-42.5, -0.25, 42.5, 0.0), (-42.5, 2.0, 42.5, 2.25)]
    for column in range(0, 1700, 45):
        cells[865:880, column : column + 4] = OCCUPIED
        walls.append((-42.5 + 0.05 * column, 0.0, -42.3 + 0.05 * column, 0.75))
    return OccupancyGrid(0.05, -42.5, -43.25, cells), walls


def particles():
    """Yield an update of AMCL and the building of a filter; both take the same scans."""
    grid, walls = corridor()
    poses = [Pose2(STEP * k, 0.9, 0.0) for k in range(UPDATES)]
    scans = [see(walls, pose) for pose in poses]
    build = partial(Amcl, PUBLISHED, FAST, grid, (LASER,), poses[0], np.random.SeedSequence(1))
    first, again = microseconds(build) / 1e3, microseconds(build) / 1e3
    amcl, cap = build(), PUBLISHED.laser_likelihood_max_dist
    field = distance_field(grid, cap, brushfire=FAST.amcl_brushfire_distances)
    away = field.distances(cap)[field.squared[1:-1, 1:-1]]
    plain = PlainAmcl(PUBLISHED, grid, LASER, poses[0], 1, away)
    updates = (
        lambda k: amcl.scan(0.1 * k, scans[k], poses[k]),
        lambda k: plain.update(scans[k], poses[k]),
    )
    took, counts = ([], []), []
    for begin in range(0, UPDATES, BLOCK):
        for update, times in zip(updates, took, strict=True):
            block = range(begin, begin + BLOCK)
            times.append(microseconds(lambda u=update, b=block: list(map(u, b))) / BLOCK)
        counts.append(str(len(amcl.particles)))
    ours, plainly = map(statistics.median, took)
    beside = Reference("plain numpy, same random numbers", plainly)
    note = f"particles {', '.join(counts)}"
    yield Measurement("AMCL: an update", ours, "us", beside, (), note)
    yield Measurement("  built for a new map", first, "ms", Reference("for a known one", again))


def around(x, y):
    """Return the costmap around (x, y) of a corridor along y = 40 that is 2.4 m wide."""
    local = CostGrid(0.05, x - 1.5, y - 1.5, np.zeros((60, 60), dtype=np.uint8))
    rows = local.y + 0.05 * (np.arange(60) + 0.5)
    wall = np.maximum(1.2 - np.abs(rows - 40.0), 0.0)
    cost = np.where(wall < 0.025, 254, np.where(wall < 0.085, 253, 252 * np.exp(0.425 - 5 * wall)))
    local.cells[:] = np.where(wall < 0.55, cost, 0.0).astype(np.uint8)[:, None]
    return local


def problems(parameters, outline):
    """Return cycles along a path that weaves through the corridor."""
    built, out = settings(parameters), []
    for k, x in enumerate(np.linspace(20.0, 40.0, PROBLEMS).tolist()):
        along = np.arange(x - 0.3, x + 1.5, 0.025)
        plan = np.column_stack([along, 40.3 + 0.4 * np.sin(along)])
        y = 40.3 + 0.4 * math.sin(x)
        yaw = math.atan(0.4 * math.cos(x)) + 0.2 * math.sin(3.0 * k)
        state = singles(x, y + 0.02 * math.cos(k), yaw, 0.2, 0.0, 0.2 * math.sin(k))
        front = plan[-1] + 0.325 * np.array((1.0, 0.0))
        banned = np.zeros(6, dtype=np.int32)
        local = around(x - 0.011 * (k % 10), y)
        out.append(Problem(state, plan, front, True, built, local, outline, banned))
    return out


def controller(name, parameters, outline):
    """Yield a cycle of the sampling controller and a whole call of it."""

    def whole(p):
        dwa = Dwa(parameters, FAST, p.outline, 0.1)
        dwa.set_plan(np.column_stack([p.plan, np.zeros(len(p.plan))]))
        pose, twist = Pose2(*p.state[:3].tolist()), Twist2(*p.state[3:].tolist())
        return partial(dwa.command, pose, twist, Pose2(), p.local)

    cycles = problems(parameters, outline)
    # The plain one takes as long as all the others together: once is enough, when it is loaded.
    cycles[0].plain()
    plain = Reference("plain", statistics.mean(microseconds(p.plain) for p in cycles))
    fast = typical([p.cycle()[0] for p in cycles])
    yield Measurement(f"DWA, {name}: a cycle", fast, "us", plain)
    beside = Reference("the cycle alone", fast)
    yield Measurement("  whole call", typical(list(map(whole, cycles))), "us", beside)


def typical(works):
    """Return the median of rounds of the mean time of works [us]."""
    rounds = (statistics.mean(microseconds(one, 20) for one in works) for _ in range(REPEATS))
    return statistics.median(rounds)


def trajectories(name, robot):
    """Return a command of TrajectoryPlannerROS; the plain one tries every trajectory in turn."""
    works, plain = [], []
    p, period = robot.parameters, 1.0 / robot.frequency
    along = np.arange(0.0, 1.2, 0.05)
    plan = np.column_stack([along, 0.3 * np.sin(along), np.zeros(len(along))])
    slow = PlainPlanner(
        settings_of(p, FAST, robot.resolution, period), strafe_speeds(p), robot.outline
    )
    for k in range(CYCLES):
        pose, twist = Pose2(0.01 * k, 0.02, 0.1 * k), Twist2(0.2, 0.0, 0.05 * k)
        local = costs_around(pose, robot.cells, robot.resolution, *BOXES)
        planner = TrajectoryPlanner(p, FAST, robot.outline, period)
        planner.set_plan(plan)
        works.append(partial(planner.command, pose, twist, Pose2(), local))
        row = (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz)
        state = np.array(row, dtype=np.float32).astype(np.float64)
        plain.append(microseconds(partial(slow.best, state, plan[:, :2], local)))
    return Measurement(
        f"TrajectoryPlannerROS, {name}: a command", typical(works), "us",
        Reference("plain", statistics.mean(plain)),
    )  # fmt: skip


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


def waves():
    """Yield restricted waves of navfn over a drive of S1; few of the whole ones are made."""
    original, trips = building.costmap(), building.drive(BETWEEN_PLANS)
    for title, noisy in (("costs at rest", False), ("costs change", True)):
        random, cells = np.random.default_rng(0), original.cells.copy()
        grids = [CostGrid(original.resolution, original.x, original.y, cells) for _ in range(2)]
        field, slow = a_field(grids[1]), a_field(grids[0], margins=())
        taken, whole = [], []
        for k, ends in enumerate(trips):
            here, there = (original.cell(end.x, end.y) for end in ends)
            trip = [row * cells.shape[1] + column for column, row in (here, there)]
            if noisy:
                window = disturb(random, grids[0], original, here)
                for grid in grids:
                    grid.touch(window)
            taken.append(microseconds(partial(path, field, *trip)) / 1e3)
            if k % COMPARED == 0:
                whole.append(microseconds(partial(path, slow, *trip)) / 1e3)
        yield Measurement(
            f"navfn, {title}: a plan", statistics.mean(taken), "ms",
            Reference("whole waves", statistics.mean(whole)), (),
            f"median {np.median(taken):.2f} of {len(trips)}; {field.restricted} "
            f"restricted, {field.whole} whole",
        )  # fmt: skip


def building_c():
    """Return the scene of S2, the robot with the laser of a2s, and the map."""
    run, scene = run_of(ROOT / "campaigns" / "ortega2024" / "first.yaml", "S2")
    robot = replace(run.robot, laser=replace(run.robot.laser, rays=150, range_max=5.6))
    return scene, robot, occupancy_grid(scene, laser_height=robot.laser.z)


def drive(scene, robot):
    """Return estimates of the base with the scan as seen from there and from the true pose.

    Between the far corners, ten a second; the estimate is off by up to 0.1 m along the way and
    jumps every 0.2 m, as AMCL's does.
    """
    laser = robot.laser
    world = World(scene, robot, Pose2(*BEGIN, 0.0), (), np.random.SeedSequence(1))
    angles = np.linspace(laser.angle_min, laser.angle_max, laser.rays)
    dx, dy = END[0] - BEGIN[0], END[1] - BEGIN[1]
    length, yaw = math.hypot(dx, dy), math.atan2(dy, dx)
    steps, bodies = [], world._bodies.at(0)
    for k in range(int(length / SPEED * 10.0)):
        done = k * SPEED / 10.0
        aside = 0.4 * math.sin(done / 5.0) - 0.7
        true = Pose2(*BEGIN, yaw) @ Pose2(done, aside, 0.1 * math.cos(done / 5.0))
        jump = int(done / 0.2)
        error = Pose2(0.1 * math.sin(jump), 0.02 * math.cos(3 * jump), 0.01 * math.sin(7 * jump))
        ranges = world._scanner(None).scan(true, bodies, world._bodies.version)
        base = true @ error
        seen = (
            SensedScan(at @ laser.mount, ranges, angles, laser.range_min, laser.range_max, laser.z)
            for at in (base, true)
        )
        steps.append((base, *seen))
    return steps


def over_again(costmap, window):
    """Return the time that the plain cycle takes in a window [us]."""
    grid, table, changed = costmap._master, costmap._inflated.table, costmap._changed.copy()
    copy = grid._replace(cells=grid.cells.copy())

    def cycle():
        merge_window(copy, costmap._merged, window)
        inflate(copy, table, window, changed)

    return microseconds(cycle)


def costmaps():
    """Yield the building and the updates of both costmaps."""
    scene, robot, world_map = building_c()
    steps = drive(scene, robot)
    build = partial(Costmap, GLOBAL, GLOBAL.padded_footprint(), FAST, world_map, heard)
    first, again = microseconds(build) / 1e3, microseconds(build) / 1e3
    yield Measurement("global costmap, built", first, "ms", Reference("again", again))
    local = Costmap(LOCAL, LOCAL.padded_footprint(), FAST, world_map, heard)
    whole = build()
    times, plain, locally = [], [], []
    for k, (base, scan, exact) in enumerate(steps):
        times.append(microseconds(partial(whole.update, base, (scan,))))
        if k % 20 == 5:
            plain.append(over_again(whole, whole._work.window(whole._master.frame)))
        if k % 10 == 0:
            locally.append(microseconds(partial(local.update, base, (exact,))))
    mean, plainly = statistics.mean(times[2:]), Reference("the plain cycle", statistics.mean(plain))
    note = f"99 %: {np.percentile(times, 99):.1f} us"
    yield Measurement("  an update", mean, "us", plainly, (), note)
    beside = Reference("global", mean)
    yield Measurement("local costmap, an update", statistics.mean(locally), "us", beside)
