"""Driving a robot by the keys of a terminal, which reports presses but no releases."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, Literal, TypeAlias

from grammars.model.geometry import Twist2
from grammars.model.robot import Drive

Axis: TypeAlias = Literal["vx", "vy", "wz"]

SPEED: Final = 0.5
"""Largest speed of driving [m/s], as far as the drive allows."""
TURNING: Final = 1.0
"""Largest speed of turning [rad/s], as far as the drive allows."""

_FIRST: Final = 0.6
"""Seconds for which a pressed key counts as held. Before its first repetition, after half a second
on most machines, a tap looks like a held key.
"""
_REPEATED: Final = 0.25
"""Seconds for which a repeated key counts as held; repetitions come 20 to 40 times a second."""


class Teleoperation:
    """The command of the held keys; two of them, one per axis, drive a curve."""

    def __init__(self, drive: Drive, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        speeds = (drive.max_vx, drive.max_vy, drive.max_wz)
        most = (SPEED, SPEED, TURNING)
        axes: tuple[Axis, ...] = ("vx", "vy", "wz")
        self._most = {axis: min(a, b) for axis, a, b in zip(axes, speeds, most, strict=True)}
        self._held: dict[Axis, tuple[float, float]] = {}
        self._moving = False

    def press(self, axis: Axis, sign: int) -> None:
        """Take a pressed or repeated key; ``sign`` is 1 or -1."""
        now, value = self._clock(), sign * self._most[axis]
        before, until = self._held.get(axis, (0.0, 0.0))
        again = before == value and now < until
        self._held[axis] = (value, now + (_REPEATED if again else _FIRST))
        # A terminal repeats only the last of two held keys, so its repetition keeps the other.
        for other, (speed, end) in self._held.items():
            if again and other != axis and now < end:
                self._held[other] = (speed, now + _REPEATED)

    def stop(self) -> None:
        """Release all keys."""
        self._held.clear()

    def command(self) -> Twist2 | None:
        """Return the command of the held keys; without any, one stop, then ``None``."""
        now = self._clock()
        speeds = {axis: value for axis, (value, until) in self._held.items() if now < until}
        was_moving, self._moving = self._moving, bool(speeds)
        if speeds:
            return Twist2(speeds.get("vx", 0.0), speeds.get("vy", 0.0), speeds.get("wz", 0.0))
        return Twist2() if was_moving else None
