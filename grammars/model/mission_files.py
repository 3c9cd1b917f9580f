"""Reader of mission files (YAML).

Mission files have the form of task files of navigation stacks: ``waypoints`` with ``id``, ``x``,
``y``, ``yaw`` as plain numbers in metres and radians. They also accept units (``yaw: 90 deg``).
Receivers of run specifications import :mod:`grammars.model.mission` without these models.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from grammars.model.geometry import Pose2
from grammars.model.mission import MOST_WAYPOINTS, Mission, Waypoint
from grammars.model.robot_files import CAMPAIGN_KEYS, ROBOT_KEYS
from grammars.text.diagnostics import Finding, raise_all
from grammars.text.documents import OtherName, StrictModel, YamlDocument, load_yaml, read_model
from grammars.text.quantity import QuantityField

_Metres = Annotated[float, QuantityField("length", plain=True), Field(allow_inf_nan=False)]
_Radians = Annotated[float, QuantityField("angle", plain=True), Field(allow_inf_nan=False)]


class _PlaceText(StrictModel):
    """A place in the frame of the map, in the form of task files."""

    x: _Metres
    y: _Metres
    z: _Metres = 0.0
    """Ignored: the robot drives on the floor."""
    roll: _Radians = 0.0
    """Ignored: the robot drives on the floor."""
    pitch: _Radians = 0.0
    """Ignored: the robot drives on the floor."""


class PoseText(_PlaceText):
    """A pose in the frame of the map."""

    yaw: _Radians = 0.0
    """Heading, counter-clockwise from the x axis of the map."""


class WaypointText(_PlaceText):
    """A place the robot has to reach; the order of waypoints is the order of driving."""

    elsewhere = dict.fromkeys(
        ("pose", "position", "orientation"), "write x, y and yaw of the waypoint itself"
    ) | {"theta": OtherName("yaw"), "name": OtherName("id")}

    yaw: _Radians | None = None
    """Heading at the waypoint, counter-clockwise from the x axis of the map; default: any."""
    id: str = Field(default="", max_length=100)
    """Name in verdicts and the dashboard; default: waypoint-1, waypoint-2, …"""


class MissionText(StrictModel):
    """The keys of a mission file: the start of the robot and the waypoints to visit."""

    elsewhere = ROBOT_KEYS | CAMPAIGN_KEYS

    mission: str = Field(default="", max_length=100)
    """Name of the mission; default: the name of the file."""
    about: str = ""
    """One line for people."""
    start: PoseText | None = None
    """Start pose of the robot; default: the origin of the map."""
    waypoints: list[WaypointText] = Field(
        min_length=1,
        max_length=MOST_WAYPOINTS,
        examples=[[{"id": "kitchen", "x": 1.5, "y": 0.4}]],
    )
    """Places to visit, in this order."""


def load_mission(path: str | Path) -> tuple[Mission, YamlDocument]:
    """Read a mission file; without ``start`` the robot starts at the origin of the map.

    Returns the mission and its document (for places in later messages). Waypoints without an
    ``id`` are called ``waypoint-1``, ``waypoint-2``, …
    Raises :class:`InputError` with every problem of the file.
    """
    document = load_yaml(path)
    return read_mission(document), document


def read_mission(document: YamlDocument) -> Mission:
    """Return the mission of a document; raises :class:`InputError` with all its problems."""
    text = read_model(document, MissionText)
    waypoints = tuple(
        Waypoint(w.id or f"waypoint-{i}", w.x, w.y, w.yaw)
        for i, w in enumerate(text.waypoints, start=1)
    )
    start = Pose2(text.start.x, text.start.y, text.start.yaw) if text.start else Pose2()
    _refuse_ambiguous(waypoints, document)
    name = text.mission or Path(document.file).name.split(".")[0]
    return Mission(name, start, waypoints)


def _refuse_ambiguous(waypoints: Sequence[Waypoint], document: YamlDocument) -> None:
    """Raise :class:`InputError` for waypoints with the same id at different places.

    A mission may visit one place more than once.
    """
    first: dict[str, int] = {}
    problems = []
    for index, waypoint in enumerate(waypoints):
        other = waypoints[first.setdefault(waypoint.id, index)]
        if math.dist((waypoint.x, waypoint.y), (other.x, other.y)) > _SAME_PLACE:
            message = (
                f'two waypoints are called "{waypoint.id}": one at ({other.x:g}, {other.y:g}), '
                f"one at ({waypoint.x:g}, {waypoint.y:g})"
            )
            place = document.where(("waypoints", first[waypoint.id]))
            hint = f"the other one: {place}; verdicts could not tell them apart: rename one"
            problems.append(Finding(document.where(("waypoints", index)), message, hint))
    raise_all(problems)


_SAME_PLACE: Final = 0.01
"""Waypoints with one id up to this distance apart [m] are the same place."""
