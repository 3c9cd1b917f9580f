"""Reader of mission files (YAML).

Mission files have the form of task files of navigation stacks: ``waypoints`` with ``id``, ``x``,
``y``, ``yaw`` as plain numbers in metres and radians. They also accept units (``yaw: 90 deg``) and
poses as ROS prints them, with ``position`` and ``orientation``.
Receivers of run specifications import :mod:`grammars.model.mission` without these models.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final

from pydantic import AfterValidator, BeforeValidator, Field

from grammars.model.geometry import Pose2
from grammars.model.mission import MOST_WAYPOINTS, Mission, Waypoint
from grammars.model.robot_files import CAMPAIGN_KEYS, ROBOT_KEYS
from grammars.text.diagnostics import Finding, Findings, Where, raise_all
from grammars.text.documents import OtherName, StrictModel, YamlDocument, load_yaml, read_model
from grammars.text.quantity import Duration, QuantityField
from grammars.text.yaml_composer import KeyPath

_Metres = Annotated[float, QuantityField("length", plain=True), Field(allow_inf_nan=False)]
_Radians = Annotated[float, QuantityField("angle", plain=True), Field(allow_inf_nan=False)]
_LEAN: Final = 0.35
"""Largest roll and pitch that a floor may have [rad]."""


def _check_lean(angle: float) -> float:
    if abs(angle) > _LEAN:
        lean = f"{math.degrees(angle):.0f} deg"
        raise ValueError(f"is {lean}, but the robot drives on the floor; its heading is yaw")
    return angle


_Lean = Annotated[_Radians, AfterValidator(_check_lean)]


class _PlaceText(StrictModel):
    """A place in the frame of the map, in the form of task files."""

    x: _Metres
    y: _Metres
    z: _Metres = 0.0
    """Ignored: the robot drives on the floor."""
    roll: _Lean = 0.0
    """Ignored: the robot drives on the floor."""
    pitch: _Lean = 0.0
    """Ignored: the robot drives on the floor."""


class _OrientationText(StrictModel):
    """A unit quaternion about the vertical axis."""

    x: float = 0.0
    y: float = 0.0
    z: float
    w: float


class _MessageText(StrictModel):
    """A pose as ROS prints it."""

    position: _PlaceText
    orientation: _OrientationText


class StampedText(StrictModel):
    """A waypoint or start as a message of ROS (geometry_msgs/PoseStamped)."""

    header: dict[str, Any] = Field(default_factory=dict)
    """Stamp, which is ignored, and frame, which must be that of the map."""
    pose: dict[str, Any]
    """Pose in the frame of the map, with position and orientation as ROS prints them."""
    wait: Annotated[Duration, Field(ge=0.0)] = 0.0
    """Stay at the waypoint before the next one is given."""
    id: str = Field(default="", max_length=100)
    """Name in verdicts and the dashboard; default: waypoint-1, waypoint-2, …"""


class PoseText(_PlaceText):
    """A pose in the frame of the map."""

    yaw: _Radians = 0.0
    """Heading, counter-clockwise from the x axis of the map."""


class WaypointText(_PlaceText):
    """A place the robot has to reach; the order of waypoints is the order of driving."""

    elsewhere: ClassVar[Mapping[str, str | OtherName]] = {
        **dict.fromkeys(
            ("position", "orientation"), "write x, y and yaw of the waypoint, or both under pose:"
        ),
        **dict.fromkeys(
            ("w", "qx", "qy", "qz", "qw"),
            "write yaw, or a quaternion as pose: {position: …, orientation: …}",
        ),
        **dict.fromkeys(("pause", "dwell", "delay", "stay", "duration"), OtherName("wait")),
        "frame_id": "a mission is in the frame of the map: remove it",
        "theta": OtherName("yaw"),
        "name": OtherName("id"),
    }

    yaw: _Radians | None = None
    """Heading at the waypoint, counter-clockwise from the x axis of the map; default: any."""
    wait: Annotated[Duration, Field(ge=0.0)] = 0.0
    """Stay at the waypoint before the next one is given."""
    id: str = Field(default="", max_length=100)
    """Name in verdicts and the dashboard; default: waypoint-1, waypoint-2, …"""


def _or_message(kind: type[StrictModel]) -> BeforeValidator:
    """Describe in schemas that a message of ROS may stand for plain keys."""
    return BeforeValidator(lambda text: text, json_schema_input_type=kind | StampedText)


class MissionText(StrictModel):
    """The keys of a mission file: the start of the robot and the waypoints to visit."""

    elsewhere = ROBOT_KEYS | CAMPAIGN_KEYS | {"poses": OtherName("waypoints")}

    mission: str = Field(default="", max_length=100)
    """Name of the mission; default: the name of the file."""
    about: str = ""
    """One line for people."""
    start: Annotated[PoseText, _or_message(PoseText)] | None = None
    """Start pose of the robot; default: the origin of the map."""
    waypoints: list[Annotated[WaypointText, _or_message(WaypointText)]] = Field(
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
    text = read_model(_without_messages(document), MissionText)
    waypoints = tuple(
        Waypoint(w.id or f"waypoint-{i}", w.x, w.y, w.yaw, w.wait)
        for i, w in enumerate(text.waypoints, start=1)
    )
    start = Pose2(text.start.x, text.start.y, text.start.yaw) if text.start else Pose2()
    _refuse_ambiguous(waypoints, document)
    name = text.mission or Path(document.file).name.split(".")[0]
    return Mission(name, start, waypoints)


def _without_messages(document: YamlDocument) -> YamlDocument:
    """Return a document with x, y and yaw for each pose written as a message of ROS."""
    data, findings = document.data, Findings()
    if not isinstance(data, dict):
        return document
    places: dict[KeyPath, dict[KeyPath, Where]] = defaultdict(dict)
    for path, place in document.places.items():
        for length in (1, 2):
            places[path[:length]][path[length:]] = place

    def plain(value: Any, *path: str | int) -> Any:
        if not isinstance(value, dict) or "pose" not in value:
            return value
        with findings.collecting():
            return _plain_pose(replace(document, data=value, places=places[path]))
        return value

    stops = data.get("waypoints")
    data = {**data, "start": plain(data.get("start"), "start")}
    if isinstance(stops, list):
        data["waypoints"] = [plain(stop, "waypoints", i) for i, stop in enumerate(stops)]
    findings.raise_errors()
    return replace(document, data=data)


def _plain_pose(part: YamlDocument) -> dict[str, Any]:
    """Return a message of ROS as plain keys."""
    value, text = part.data, read_model(part, StampedText)
    inner = {path[1:]: place for path, place in part.places.items() if path[:1] == ("pose",)}
    pose = read_model(replace(part, data=text.pose, places=inner), _MessageText)
    frame = str(text.header.get("frame_id") or "map").removeprefix("/")
    findings = Findings()
    if frame != "map":
        message = f"the pose is in the frame {frame}, but a mission is in that of the map"
        findings.error(part.where(("header", "frame_id")), message, "transform it, or write map")
    q = pose.orientation
    where, words = part.where(("pose", "orientation")), f"({q.x:g}, {q.y:g}, {q.z:g}, {q.w:g})"
    length = math.hypot(q.x, q.y, q.z, q.w)
    lean = 2.0 * math.atan2(math.hypot(q.x, q.y), math.hypot(q.z, q.w))
    if abs(length - 1.0) > _UNIT_LENGTH:
        hint = "its parts are x, y, z, w; for no turn write {x: 0, y: 0, z: 0, w: 1}"
        message = f"the quaternion {words} has the length {length:.3g}, not 1"
        findings.error(where, message, hint)
    elif lean > _LEAN:
        message = (
            f"the quaternion {words} rolls or pitches the robot by {math.degrees(lean):.0f} deg"
        )
        hint = "the robot drives on the floor; the parts are x, y, z, w"
        findings.error(where, message, hint)
    findings.raise_errors()
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
    rest = {key: value[key] for key in ("id", "wait") if key in value}
    return {**text.pose["position"], "yaw": yaw, **rest}


_UNIT_LENGTH: Final = 0.01
"""Tolerance of the length of a quaternion, that of tf2."""


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
