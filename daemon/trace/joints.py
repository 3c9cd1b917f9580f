"""Joint states without their repetitions."""

from __future__ import annotations

from typing import Final

import numpy as np

from daemon.trace.layout import Ints
from grammars.values import Floats

HEARTBEAT: Final = 1_000_000_000
"""Longest time [ns] for which a repeated joint state is left out."""


class JointSamples:
    """Keeps a joint state when it differs from the one before, and once a second.

    The last of a row of equal states is kept too, so that linear interpolation between the kept
    ones gives back every one that was left out.
    """

    __slots__ = ("_due", "_held", "_last", "_states", "_times", "_width")

    def __init__(self, joints: int) -> None:
        self._width = 2 * joints
        self._times: list[int] = []
        self._states: list[bytes] = []
        self._last, self._held, self._due = b"", -1, 0

    def add(self, time: int, positions: Floats, velocities: Floats) -> None:
        """Take a state; raises ``ValueError`` when it is not one float64 per joint, twice."""
        state = positions.tobytes() + velocities.tobytes()
        if not state and not self._width:
            return
        if state == self._last and time < self._due:
            self._held = time
            return
        if len(state) != 8 * self._width:
            raise ValueError(f"joint states must have {self._width // 2} positions and velocities")
        self.release()
        self._times.append(time)
        self._states.append(state)
        self._last, self._due = state, time + HEARTBEAT

    def release(self) -> None:
        """Keep the last repetition, because something else follows (or nothing any more)."""
        if self._held >= 0:
            self._times.append(self._held)
            self._states.append(self._last)
            self._held = -1

    def take(self) -> tuple[Ints, Floats]:
        """Return times (n,) and states (n, 2 k), positions first, and start anew."""
        times = np.array(self._times, np.int64)
        states = np.frombuffer(b"".join(self._states), np.float64)
        self._times, self._states = [], []
        return times, states.reshape(len(times), self._width)
