"""A recorded run along time: signals, doors, mission; what is drawn, without what reads traces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from grammars.values import Floats

Stretch = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """A signal over time: ``time``, ``values`` (n,), NaN where it is not known.

    ``limits`` [SI] are what oracles compare it with; ``against`` are stretches [s] in which the
    run spoke against an oracle that reads it; ``readers`` name these oracles. ``unit`` is ``bool``
    for what is true or false.
    """

    name: str
    unit: str
    time: Floats
    values: Floats
    limits: tuple[float, ...] = ()
    against: tuple[Stretch, ...] = ()
    readers: tuple[str, ...] = ()

    def at(self, time: float) -> float:
        """Return the value at ``time`` [s]: of the last sample until then, NaN before the first."""
        index = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        return float(self.values[index]) if index >= 0 else float("nan")


@dataclass(frozen=True, slots=True)
class DoorEvent:
    """A joint that leaves (``opens``) or comes back to (not ``opens``) how it is drawn, shut."""

    time: float
    name: str
    opens: bool


@dataclass(frozen=True, slots=True, eq=False)
class Chronicle:
    """Everything of a run along time.

    ``reached`` holds the moments waypoints were done [s] of ``waypoints`` in all; ``decided`` those
    an oracle was decided against.
    """

    start: float
    end: float
    strips: tuple[Strip, ...]
    doors: tuple[DoorEvent, ...]
    reached: tuple[float, ...]
    waypoints: int
    decided: tuple[float, ...]
