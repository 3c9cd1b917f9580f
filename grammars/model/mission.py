"""Missions: a start pose and waypoints to visit in strict order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from grammars.model.geometry import Pose2

MOST_WAYPOINTS: Final = 10_000
"""Waypoints of a mission at most."""


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A pose to reach in the map frame; with ``yaw`` ``None``, any heading is valid."""

    id: str
    x: float
    y: float
    yaw: float | None = None


@dataclass(frozen=True, slots=True)
class Mission:
    """A start pose, and waypoints in the order of visiting."""

    name: str
    start: Pose2
    waypoints: tuple[Waypoint, ...]
