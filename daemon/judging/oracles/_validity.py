"""Validity of a trace: a fault of the recording is an error, never the robot's failure.

An invalid trace says nothing about the robot: a damaged recording, impossible clocks, numbers and
motion, a simulator that did not simulate. A stack that gave up before it set off, claimed success
at once or never gave a command has been tested, and is judged.
"""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np

from daemon.trace import CommandTrack, Trace
from grammars.model.geometry import Floats
from grammars.model.robot import Drive

_SHORTEST_LEAP: Final = 0.5
"""Shortest step [m] between two samples that may be an explosion of the physics: ten steps of a
fast robot (1 m/s)."""
_LEAP_SPEED_FACTOR: Final = 5.0
_FASTEST_ROBOT: Final = 20.0
"""A step is impossible if it is this many times faster than the robot can drive, or this fast [m/s]
if the drive has no limit."""
MOVED_DISTANCE: Final = 0.01
MOVED_ANGLE: Final = 0.05
"""A robot that has not left a circle of this radius [m], nor turned by this angle [rad], has never
moved; a door or a person may have pushed it a little."""
AT_START_DISTANCE: Final = 0.1
"""A mission requires motion if a waypoint is farther [m] than this from the start."""
_CLEAR_FACTOR: Final = 10.0
"""A command is clear if it asks for this many times the way that counts as motion: the drive and
friction take less than that away."""


def trace_problems(trace: Trace) -> tuple[str, ...]:
    """Return the reasons not to trust ``trace``, in words.

    These are problems of its recording, impossible leaps, and a robot that was commanded to move,
    touched nothing and stood still for a whole run.
    """
    # In this order: a problem makes the checks after it meaningless.
    return trace.problems or tuple(_leaps(trace) or _without_effect(trace))


def _leaps(trace: Trace) -> list[str]:
    truth, drive = trace.ground_truth, trace.spec.robot.drive
    if len(truth.time) < 2:
        return []
    steps = np.hypot(np.diff(truth.x), np.diff(truth.y))
    # The factor is generous: a door may push a robot faster than it can drive.
    fastest = min(_FASTEST_ROBOT, _LEAP_SPEED_FACTOR * float(np.hypot(drive.max_vx, drive.max_vy)))
    leaps = np.flatnonzero(steps > np.maximum(_SHORTEST_LEAP, fastest * np.diff(truth.time)))
    if not len(leaps):
        return []
    first = int(leaps[0])
    return [f"the robot leaps {steps[first]:.2f} m at {truth.time[first + 1]:.2f} s"]


def _without_effect(trace: Trace) -> list[str]:
    """Report commands without effect: then the world stood still, not the robot's stack."""
    if not never_moved(trace) or trace.contacts or not _was_commanded_to_move(trace):
        return []
    return [f"the robot never moved and touched nothing, though {_command_summary(trace)}"]


def never_moved(trace: Trace) -> bool:
    """Return whether the robot stood still for a whole run that required motion.

    ``False`` for an unfinished run, in which the robot may still set off.
    """
    truth, waypoints = trace.ground_truth, trace.spec.mission.waypoints
    if not trace.complete or not len(truth.time):
        return False
    x, y = truth.x - truth.x[0], truth.y - truth.y[0]
    turned = float(np.ptp(np.unwrap(truth.yaw)))
    farthest = max((np.hypot(w.x - truth.x[0], w.y - truth.y[0]) for w in waypoints), default=0.0)
    moved = turned > MOVED_ANGLE or float(np.hypot(x, y).max()) > MOVED_DISTANCE
    return bool(farthest > AT_START_DISTANCE) and not moved


def _was_commanded_to_move(trace: Trace) -> bool:
    """Return whether a command lasted so long that any robot with this drive must have moved."""
    command, drive = trace.command, trace.spec.robot.drive
    lasts = _durations(command, drive, float(trace.ground_truth.time[-1]))
    way, angle = _CLEAR_FACTOR * MOVED_DISTANCE, _CLEAR_FACTOR * MOVED_ANGLE
    sideways = drive.kind == "omnidirectional"
    loss, spin = drive.friction_loss, drive.turning_loss
    return (
        _farthest(command.vx, lasts, drive.max_vx, drive.max_ax, loss) >= way
        or (sideways and _farthest(command.vy, lasts, drive.max_vy, drive.max_ay, loss) >= way)
        or _farthest(command.wz, lasts, drive.max_wz, drive.max_az, spin) >= angle
    )


def _durations(command: CommandTrack, drive: Drive, end: float) -> Floats:
    """Return the duration [s] of each command: until the next one, or its timeout."""
    lasts = np.diff(command.time, append=end)
    return np.minimum(lasts, drive.timeout) if drive.timeout > 0.0 else lasts


def _farthest(
    speed: Floats, lasts: Floats, fastest: float, acceleration: float, loss: float
) -> float:
    """Return the least way that one unbroken series of commands in one direction asks for.

    The unit is that of ``speed`` times seconds; a base at rest needs part of it to accelerate.
    """
    remaining = np.maximum(np.minimum(np.abs(speed), fastest) - loss, 0.0)
    direction = np.where(remaining > 0.0, np.sign(speed), 0.0)
    edges = np.flatnonzero(np.diff(direction, prepend=0.0, append=0.0))
    best = 0.0
    for first, last in itertools.pairwise(edges.tolist()):
        if direction[first]:
            way = np.cumsum(remaining[first:last] * lasts[first:last])
            elapsed = np.cumsum(lasts[first:last])
            best = max(best, float(np.minimum(way, 0.5 * acceleration * elapsed**2).max()))
    return best


def _command_summary(trace: Trace) -> str:
    """Return the extent of the commands, as a hint to the reason."""
    command = trace.command
    if not len(command.time):
        return "no command was given"
    fastest = float(np.hypot(command.vx, command.vy).max())
    turning = float(np.abs(command.wz).max())
    if fastest == 0.0 and turning == 0.0:
        return "every command was zero"
    return f"it was commanded up to {fastest:.2f} m/s and {turning:.2f} rad/s"


def standstill_note(trace: Trace) -> str:
    """Return why a robot never moved, by the reports of its stack; empty if it moved."""
    if not never_moved(trace):
        return ""
    note = f"the robot never moved: {_command_summary(trace)}"
    last = trace.progress[-1] if trace.progress else None
    if last is not None and last.state == "aborted":
        note += f", the mission was given up at {last.time:.2f} s"
    elif last is not None and last.state == "succeeded":
        note += f", the mission was called done at {last.time:.2f} s"
    return note
