"""Missions: where the robot starts and which waypoints it must visit, in strict order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from grammars.model.geometry import Pose2

MOST_WAYPOINTS: Final = 10_000
"""Waypoints of a mission file at most."""


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A pose to reach in the map frame; ``yaw`` is ``None`` when any heading will do."""

    id: str
    x: float
    y: float
    yaw: float | None = None


@dataclass(frozen=True, slots=True)
class Mission:
    """Waypoints in the order they must be visited, from a start pose."""

    name: str
    start: Pose2
    waypoints: tuple[Waypoint, ...]
