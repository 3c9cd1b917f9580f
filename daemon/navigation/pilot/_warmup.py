"""Runs every kernel of the room once, with the argument types a run uses."""

from __future__ import annotations

import math

import numpy as np

from daemon.navigation.pilot._parameters import PilotParameters
from daemon.navigation.pilot._pilot import PERIOD, Pilot
from daemon.sut import Briefing, LaserScan, Observation, Odometry
from grammars.grid import FREE, OCCUPIED, OccupancyGrid
from grammars.mission import Mission, Waypoint
from grammars.robot import Drive, Laser, OdometryNoise, Robot
from grammars.values import Pose2, Twist2


def warm_up() -> None:
    """Drive a small robot for a few updates in a small room with an obstacle the map misses."""
    cells = np.full((60, 60), FREE, dtype=np.int8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = (OCCUPIED,) * 4
    grid = OccupancyGrid(0.05, 0.0, 0.0, cells)
    drive = Drive("omnidirectional", 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 100.0, 100.0, 0.0)
    laser = Laser(Pose2(), 0.3, -math.pi / 2, math.pi / 2, 19, 0.05, 5.0, 10.0, 0.01, 0.0)
    ring = ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))
    robot = Robot("warm-up", ring, 0.3, 50.0, drive, laser, OdometryNoise(20.0, 0.0, 0.0, 0.0))
    start = Pose2(0.8, 1.5, 0.0)
    mission = Mission("warm-up", start, (Waypoint("there", 2.2, 1.5, 0.0),))
    pilot = Pilot(PilotParameters(wait_before_replanning=0.0))
    pilot.start(Briefing(robot, grid, mission, start, np.random.SeedSequence(0)))
    angles = np.linspace(laser.angle_min, laser.angle_max, laser.rays)
    walls = np.minimum(2.15 / np.cos(angles).clip(1e-6), 1.45 / np.abs(np.sin(angles)).clip(1e-6))
    ranges = walls.astype(np.float32)
    ranges[laser.rays // 2] = 0.7
    for k in range(4):
        now = k * PERIOD
        sample = Odometry(now, Pose2(), Twist2())
        pilot.update(Observation(now, (sample,), (LaserScan(now, ranges),)))
