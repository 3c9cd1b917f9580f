"""When a trace says nothing about the robot: impossible clocks, numbers and motion.

Such a trace is an error of the simulation, the recording or the set-up, never a failure of the
robot, whatever its oracles would say.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from daemon.trace import Trace

_LEAP: Final = 0.5
"""Shortest step [m] between two samples that may be an explosion of the physics."""
_FACTOR: Final = 5.0
_FASTEST: Final = 20.0
"""A step is impossible when it is so many times faster than the robot can drive, or as fast [m/s]
when nothing limits its drive."""
MOVED: Final = 0.01
TURNED: Final = 0.05
"""A robot that has not left a circle of this radius [m], nor turned by this angle [rad], has never
moved. One that turns on the spot and goes nowhere is alive, and fails."""
NEAR: Final = 0.1
"""A mission asks a robot to move when a waypoint is farther [m] than this from where it starts."""


def problems_of(trace: Trace) -> tuple[str, ...]:
    """Return why ``trace`` cannot be trusted, in words; empty when it can.

    What its reader found; numbers that are none; clocks that run backwards; leaps no robot can
    make; a robot that never moved during a whole run although its mission asked it to.
    """
    found = [*trace.problems, *_numbers(trace)]
    if not found:
        found += [*_clock(trace), *_leaps(trace)]
    if not found:
        found += _standstill(trace)
    return tuple(found)


def _numbers(trace: Trace) -> list[str]:
    truth, command = trace.ground_truth, trace.command
    channels = {
        "the ground truth": (truth.time, truth.x, truth.y, truth.yaw, truth.vx, truth.vy, truth.wz),
        "a command": (command.time, command.vx, command.vy, command.wz),
        "the joint states": (trace.joints.time, trace.joints.position),
    }
    for name, track in (("the estimate", trace.estimate), ("the particle cloud", trace.cloud)):
        channels[name] = (track.time, track.x, track.y, track.yaw, track.covariance)
    return [
        f"{name} is not finite"
        for name, arrays in channels.items()
        if not all(np.isfinite(array).all() for array in arrays)
    ]


def _clock(trace: Trace) -> list[str]:
    time = trace.ground_truth.time
    backwards = len(time) > 1 and float(np.diff(time).min()) < 0.0
    return ["the clock runs backwards"] if backwards else []


def _leaps(trace: Trace) -> list[str]:
    truth, drive = trace.ground_truth, trace.spec.robot.drive
    if len(truth.time) < 2:
        return []
    steps = np.hypot(np.diff(truth.x), np.diff(truth.y))
    fastest = min(_FASTEST, _FACTOR * float(np.hypot(drive.max_vx, drive.max_vy)))
    leaps = np.flatnonzero(steps > np.maximum(_LEAP, fastest * np.diff(truth.time)))
    if not len(leaps):
        return []
    first = int(leaps[0])
    return [f"the robot leaps {steps[first]:.2f} m at {truth.time[first + 1]:.2f} s"]


def _standstill(trace: Trace) -> list[str]:
    """Judge whole runs only: as long as a run goes on, the robot may still set off."""
    truth, waypoints = trace.ground_truth, trace.spec.mission.waypoints
    if not trace.complete or not len(truth.time):
        return []
    x, y = truth.x - truth.x[0], truth.y - truth.y[0]
    turned = float(np.ptp(np.unwrap(truth.yaw)))
    farthest = max((np.hypot(w.x - truth.x[0], w.y - truth.y[0]) for w in waypoints), default=0.0)
    if farthest <= NEAR or turned > TURNED or float(np.hypot(x, y).max()) > MOVED:
        return []
    return [f"the robot never moved, though its mission asks it to; {_told(trace)}"]


def _told(trace: Trace) -> str:
    """Say what the robot was told to do, which is where to look for the reason."""
    command = trace.command
    if not len(command.time):
        return "no command was recorded"
    fastest = float(np.hypot(command.vx, command.vy).max())
    turning = float(np.abs(command.wz).max())
    if fastest == 0.0 and turning == 0.0:
        return "every command was zero"
    return f"it was commanded up to {fastest:.2f} m/s and {turning:.2f} rad/s"
