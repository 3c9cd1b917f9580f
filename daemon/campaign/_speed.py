"""How fast a robot is at most under a system that says so."""

from __future__ import annotations

import math

from daemon.model.spec import SutReference
from grammars.model.robot import Robot


def top_speed(sut: SutReference, robot: Robot) -> float:
    """Return a bound of the speed over ground [m/s]; infinite where neither says one."""
    ahead, sideways = robot.drive.max_vx, robot.drive.max_vy
    if robot.drive.kind == "differential":
        sideways = 0.0
    bound = math.inf
    if sut.kind == "pilot":
        from daemon.stacks.pilot import top_speed as of_pilot

        along = of_pilot(sut.parameters)
        ahead, sideways = min(ahead, along), min(sideways, along)
    elif sut.kind == "ros":
        # Loads a compiler, which nobody needs who tests another stack.
        from daemon.stacks.ros1.configuration import read_ros
        from daemon.stacks.ros1.dwa import DwaParameters

        planner = read_ros(sut.parameters).local_planner
        if isinstance(planner, DwaParameters) and planner.max_vel_trans > 0.0:
            bound = planner.max_vel_trans
    return min(bound, math.hypot(ahead, sideways))
