"""Where a sampled velocity takes the robot."""

from __future__ import annotations

import math

from daemon.navigation.kernels import kernel
from daemon.navigation.ros.dwa._samples import single, speed_of, steps_of
from daemon.navigation.ros.dwa._settings import Settings
from grammars.values import Floats


@kernel
def _towards(target: float, speed: float, change: float) -> float:
    if speed < target:
        return single(min(target, speed + change))
    return single(max(target, speed - change))


@kernel
def simulate(
    state: Floats, vx: float, vy: float, wz: float, s: Settings, points: Floats, moving: Floats
) -> int:
    """Write the trajectory of a sample to ``points`` and return the number of points, maybe 0.

    A row of ``points`` is x, y, yaw and the cosine and sine of yaw; the first row is the pose in
    ``state``, the end pose is left out. ``moving`` receives the velocity of the trajectory, which
    is the sample unless trajectories accelerate. Poses are integrated after Euler and rounded to
    single precision at every step (``SimpleTrajectoryGenerator``).
    """
    moving[:] = 0.0
    n = steps_of(speed_of(vx, vy), wz, s)
    if n == 0:
        return 0
    dt = s.sim_time / n
    ux, uy, uw = vx, vy, wz
    if not s.use_dwa:
        ux = _towards(vx, state[3], s.acc_x * dt)
        uy = _towards(vy, state[4], s.acc_y * dt)
        uw = _towards(wz, state[5], s.acc_theta * dt)
    moving[0], moving[1], moving[2] = ux, uy, uw
    x, y, yaw = state[0], state[1], state[2]
    for i in range(n):
        c, d = math.cos(yaw), math.sin(yaw)
        points[i, 0], points[i, 1], points[i, 2] = x, y, yaw
        points[i, 3], points[i, 4] = c, d
        if not s.use_dwa:
            ux = _towards(vx, ux, s.acc_x * dt)
            uy = _towards(vy, uy, s.acc_y * dt)
            uw = _towards(wz, uw, s.acc_theta * dt)
        along_x, along_y = ux * c, ux * d
        if uy != 0.0:
            along_x += uy * math.cos(math.pi / 2.0 + yaw)
            along_y += uy * math.sin(math.pi / 2.0 + yaw)
        x, y, yaw = single(x + along_x * dt), single(y + along_y * dt), single(yaw + uw * dt)
    return n
