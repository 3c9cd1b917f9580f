"""A tiny kinematic world: rectangles for walls, doors that appear and vanish, a base that obeys."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import shapely

from daemon.model.sut import Briefing, Decision, Estimate, LaserScan, Observation, Odometry
from daemon.stacks.registry import make_sut
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot

TICK = 0.05

SIZE = (9.0, 5.0)
OUTER = [(0, 0, 9, 0.2), (0, 4.8, 9, 5), (0, 0, 0.2, 5), (8.8, 0, 9, 5)]

ONE_DOORWAY = [*OUTER, (4.4, 0, 4.6, 1.1), (4.4, 2.05, 4.6, 5)]
"""Two rooms and a doorway of 0.95 m around y = 1.575."""
DOOR = (4.47, 1.1, 4.52, 2.05)
"""A shut leaf in it."""

TWO_DOORWAYS = [
    *OUTER, (4.4, 0, 4.6, 1.1), (4.4, 2.05, 4.6, 3.4), (4.4, 4.4, 4.6, 5),
]  # fmt: skip
"""The same with a second doorway, 1 m around y = 3.9."""


def a_robot(kind="omnidirectional", *, rays=150, noise=0.01, view=math.pi, odometry=None):
    drive = Drive(
        kind=kind,
        max_vx=1.0, max_vy=1.0 if kind == "omnidirectional" else 0.0, max_wz=1.0,
        max_ax=1.0, max_ay=1.0, max_az=2.0, max_force=100.0, max_torque=100.0, timeout=0.5,
    )  # fmt: skip
    laser = Laser(Mount(0.3), 0.3, -view / 2, view / 2, rays, 0.05, 5.6, 10.0, noise, 0.0)
    x, y = 0.699 / 2, 0.466 / 2
    ring = ((-x, -y), (x, -y), (x, y), (-x, y))
    noisy = odometry or OdometryNoise(20.0, 0.01, 0.02, 0.005)
    return Robot("box", ring, 0.3, 100.0, drive, laser, noisy)


def edges(box):
    x0, y0, x1, y1 = box
    return np.array([(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)])


def draw(walls, size, resolution=0.05):
    """Paint every cell whose centre lies in a wall; free inside ``size``, unknown around it."""
    border = 4
    rows, columns = (round(extent / resolution) + 2 * border for extent in size[::-1])
    cells = np.full((rows, columns), UNKNOWN, dtype=np.int8)
    cells[border:-border, border:-border] = FREE
    origin = -border * resolution
    x = origin + (np.arange(columns) + 0.5) * resolution
    y = origin + (np.arange(rows) + 0.5) * resolution
    for x0, y0, x1, y1 in walls:
        cells[np.ix_((y >= y0) & (y <= y1), (x >= x0) & (x <= x1))] = OCCUPIED
    return OccupancyGrid(resolution, origin, origin, cells)


def cast(segments, origin, angles, reach):
    """Return the range along every ray, inf beyond ``reach``: plain ray-segment intersection."""
    directions = np.column_stack((np.cos(angles + origin.yaw), np.sin(angles + origin.yaw)))
    a = segments[:, :2] - (origin.x, origin.y)
    along = segments[:, 2:] - segments[:, :2]
    cross = directions[:, None, 0] * along[None, :, 1] - directions[:, None, 1] * along[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (a[None, :, 0] * along[None, :, 1] - a[None, :, 1] * along[None, :, 0]) / cross
        u = (
            a[None, :, 0] * directions[:, None, 1] - a[None, :, 1] * directions[:, None, 0]
        ) / cross
    t[~((t > 0.0) & (u >= 0.0) & (u <= 1.0))] = np.inf
    ranges = t.min(axis=1)
    ranges[ranges > reach] = np.inf
    return ranges


@dataclass
class Log:
    """What happened on a drive, sampled at every update."""

    poses: list[Pose2] = field(default_factory=list)
    commands: list[Twist2] = field(default_factory=list)
    estimates: list[tuple[Pose2, Estimate]] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)
    collided: bool = False
    last: Decision | None = None
    time: float = 0.0

    @property
    def state(self):
        return self.last.progress.state

    def said(self, words):
        """Return when an event with ``words`` was first reported."""
        return next((time for time, text in self.events if words in text), None)


def drive(
    walls, size, start, waypoints, *, doors=None, robot=None, limit=120.0, seed=0, **parameters
):
    """Drive a mission; ``doors`` are boxes the map does not show, there when their function says.

    Waypoints are (x, y), (x, y, yaw) or (x, y, yaw, wait).
    """
    robot = robot or a_robot()
    doors = doors or {}
    random = np.random.default_rng(seed)
    goals = tuple(Waypoint(f"w{k}", *waypoint) for k, waypoint in enumerate(waypoints))
    pilot = make_sut("pilot", parameters)
    grid = draw(walls, size)
    mission = Mission("test", start, goals)
    pilot.start(Briefing(robot, grid, mission, start, np.random.SeedSequence(seed)))
    solid = np.vstack([edges(box) for box in walls])
    true, odom, twist = start, Pose2(), Twist2()
    log = Log()
    footprint = np.array(robot.footprint)
    for tick in range(round(limit / TICK)):
        log.time = now = tick * TICK
        there = [edges(box) for box, closed in doors.items() if closed(now)]
        segments = np.vstack([solid, *there])
        scans = []
        for laser in robot.lasers:
            if tick % round(1.0 / (TICK * laser.rate)) == 0:
                angles = np.linspace(laser.angle_min, laser.angle_max, laser.rays)
                ranges = cast(segments, true @ laser.mount, angles, laser.range_max)
                ranges += laser.noise * random.standard_normal(len(ranges))
                scans.append(LaserScan(now, ranges.astype(np.float32), laser.name))
        seen = Observation(now, (Odometry(now, odom, twist),), tuple(scans))
        decision = log.last = pilot.update(seen)
        assert decision.command is not None
        twist = decision.command
        log.poses.append(true)
        log.commands.append(twist)
        log.events += [(now, text) for text in decision.events]
        if decision.estimate is not None:
            log.estimates.append((true, decision.estimate))
        c, s = math.cos(true.yaw), math.sin(true.yaw)
        outline = footprint @ np.array([[c, s], [-s, c]]) + (true.x, true.y)
        solids = shapely.linestrings(segments.reshape(-1, 2, 2))
        log.collided |= bool(shapely.intersects(shapely.Polygon(outline), solids).any())
        if decision.progress.state != "active":
            break
        step = Pose2(twist.vx * TICK, twist.vy * TICK, twist.wz * TICK)
        true = true @ step
        way, turn = math.hypot(step.x, step.y), abs(step.yaw)
        noise = robot.odometry
        stretch = (
            1.0 + (noise.translation / math.sqrt(way) * random.standard_normal()) if way else 1.0
        )
        around = (
            math.sqrt(noise.rotation**2 * turn + noise.drift**2 * way) * random.standard_normal()
        )
        odom = odom @ Pose2(step.x * stretch, step.y * stretch, step.yaw + around)
    return log
