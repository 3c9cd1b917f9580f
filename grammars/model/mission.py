"""Missions: a start pose and waypoints to visit in strict order."""

from __future__ import annotations

import operator
from dataclasses import dataclass
from typing import Annotated, Final

from pydantic import Field

from grammars.model.geometry import Pose2

MOST_WAYPOINTS: Final = 10_000
"""Waypoints of a mission at most."""


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A pose to reach in the map frame; with ``yaw`` ``None``, any heading is valid.

    The robot gets the next waypoint ``wait`` [s] after it has reached this one.
    """

    id: str
    x: float
    y: float
    yaw: float | None = None
    wait: Annotated[float, Field(exclude_if=operator.not_)] = 0.0


@dataclass(frozen=True, slots=True)
class Mission:
    """A start pose, and waypoints in the order of visiting."""

    name: str
    start: Pose2
    waypoints: tuple[Waypoint, ...]
