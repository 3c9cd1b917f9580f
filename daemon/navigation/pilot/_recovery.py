"""Ways out of a tight spot: short slow motions, the freest one first."""

from __future__ import annotations

from dataclasses import dataclass

from daemon.navigation.pilot._pursuit import Limits
from daemon.navigation.pilot._safety import Guard, Surroundings
from grammars.values import Pose2, Twist2

_SHORTEST = 0.4
"""A way out must be free for at least this long [s]."""
_MARGIN = 0.02
"""What is kept around the footprint [m]."""
_SPEED, _SIDEWAYS, _TURN = 0.15, 0.12, 0.5


@dataclass(frozen=True, slots=True)
class Escape:
    """A motion to keep up until a time [s]; ``name`` completes "stuck, ..."."""

    name: str
    command: Twist2
    until: float


def find_escape(
    guard: Guard,
    limits: Limits,
    pose: Pose2,
    around: Surroundings,
    now: float,
    *,
    longest: float = 2.5,
    hurry: float = 1.0,
    turns: bool = True,
) -> Escape | None:
    """Return the motion that stays free longest, backing off first among equals, or ``None``.

    It lasts up to ``longest`` [s] and is ``hurry`` times as fast as usual. Turns on the
    spot count unless ``turns`` is false.
    """
    choices = [("backing off", Twist2(-_SPEED, 0.0, 0.0))]
    if limits.holonomic:
        choices.append(("stepping left", Twist2(0.0, _SIDEWAYS, 0.0)))
        choices.append(("stepping right", Twist2(0.0, -_SIDEWAYS, 0.0)))
    if turns:
        choices.append(("turning left", Twist2(0.0, 0.0, _TURN)))
        choices.append(("turning right", Twist2(0.0, 0.0, -_TURN)))
    best: Escape | None = None
    best_time = _SHORTEST
    for name, usual in choices:
        command = Twist2(hurry * usual.vx, hurry * usual.vy, hurry * usual.wz)
        walls, others, _ = guard.free(command, pose, around, longest, _MARGIN)
        free = min(walls, others)
        if free > best_time:
            best, best_time = Escape(name, command, now + free), free
    return best
