"""Driving a robot by the keys of a terminal, which says when a key goes down and never when up."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, Literal, TypeAlias

from grammars.model.geometry import Twist2
from grammars.model.robot import Drive

Axis: TypeAlias = Literal["vx", "vy", "wz"]

SPEED: Final = 0.5
"""Speed of driving at most [m/s], as far as the drive allows."""
TURNING: Final = 1.0
"""Speed of turning at most [rad/s], as far as the drive allows."""

_FIRST: Final = 0.6
"""A key counts as held for so long [s] after it went down: until it is repeated for the first
time, half a second on most machines, nothing tells a tap from a key that stays down."""
_REPEATED: Final = 0.25
"""And for so long after a repetition, which come 20 to 40 times a second."""


class Teleoperation:
    """The command of the keys held; two of them, one per axis, drive a curve."""

    def __init__(self, drive: Drive, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        speeds = (drive.max_vx, drive.max_vy, drive.max_wz)
        most = (SPEED, SPEED, TURNING)
        axes: tuple[Axis, ...] = ("vx", "vy", "wz")
        self._most = {axis: min(a, b) for axis, a, b in zip(axes, speeds, most, strict=True)}
        self._held: dict[Axis, tuple[float, float]] = {}
        self._moving = False

    def press(self, axis: Axis, sign: int) -> None:
        """Take a key that went down, or was repeated: ``sign`` is 1 or -1."""
        now, value = self._clock(), sign * self._most[axis]
        before, until = self._held.get(axis, (0.0, 0.0))
        again = before == value and now < until
        self._held[axis] = (value, now + (_REPEATED if again else _FIRST))
        # Of two keys that are down a terminal repeats the last one only: it keeps the other.
        for other, (speed, end) in self._held.items():
            if again and other != axis and now < end:
                self._held[other] = (speed, now + _REPEATED)

    def stop(self) -> None:
        """Let all keys go."""
        self._held.clear()

    def command(self) -> Twist2 | None:
        """Return what is commanded now: nothing while no key is held, but once that it stops."""
        now = self._clock()
        held = {axis: value for axis, (value, until) in self._held.items() if now < until}
        was, self._moving = self._moving, bool(held)
        if held:
            return Twist2(held.get("vx", 0.0), held.get("vy", 0.0), held.get("wz", 0.0))
        return Twist2() if was else None
