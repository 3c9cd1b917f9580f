"""The keys that describe a ROS 2 stack, as people write them at the top of a SUT file.

The key ``files``, which other kinds have too, is not among them. Every key may be left out, for a
file that is ``like`` another says only what differs; what a stack needs as a whole is checked by
:mod:`daemon.stacks.ros2.settings`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field

from daemon.model.sut import TICK_RATE
from grammars.model.robot import LASER_NAME
from grammars.text.documents import Duration, Ratio, RemovedKey, StrictModel

HIGHEST_DOMAIN: Final = 101
"""Domain ids up to this one fit the ephemeral port range of every system (ROS 2 documentation)."""
TICK: Final = 1.0 / TICK_RATE
"""A period is a multiple of this [s]."""
_ROUNDING: Final = 1e-6
OWN_PREFIX: Final = "SCENARIO_"
"""Environment variables of this prefix say to the relay where the run is."""

_TOKEN: Final = r"[A-Za-z_][A-Za-z0-9_]*"
_ROS_NAME: Final = re.compile(rf"/?{_TOKEN}(?:/{_TOKEN})*")
_VARIABLE: Final = re.compile(_TOKEN)
_FRAME: Final = re.compile(r"[^\s/][^\s]*")
_NETWORK: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.:,=/-]*")
_LONGEST_NAME: Final = 255


def _ros_name(text: str) -> str:
    if not _ROS_NAME.fullmatch(text) or "__" in text or len(text) > _LONGEST_NAME:
        raise ValueError(
            f'"{text}" is not a ROS name: letters, digits and single _ between slashes, '
            "such as scan or /robot1/scan"
        )
    return text


def _variable(text: str) -> str:
    if not _VARIABLE.fullmatch(text):
        raise ValueError(f'"{text}" is not the name of an environment variable')
    if text.startswith(OWN_PREFIX):
        raise ValueError(f"{text} is set by the run itself")
    return text


def _namespace(text: str) -> str:
    return text if text in ("", "/") else _ros_name(text)


def _frame(text: str) -> str:
    if not _FRAME.fullmatch(text):
        raise ValueError(f'"{text}" is not a frame of tf2: no blanks, no slash before it')
    return text


def _shell_text(text: str) -> str:
    if not text.strip():
        raise ValueError("is empty: write the command that starts the stack")
    return _no_nul(text)


def _no_nul(text: str) -> str:
    if "\0" in text:
        raise ValueError("has a NUL character in it")
    return text


def _word(text: str) -> str:
    if not text.strip() or text != text.strip() or "\n" in text:
        raise ValueError(f'"{text}" has blanks around it or is empty')
    return _no_nul(text)


def _worker_path(text: str) -> str:
    """Take a path on the machine of the worker, of which nothing is known here."""
    if not text.startswith(("/", "~/")):
        raise ValueError(
            f'"{text}" is looked for on the machine the stack runs on: '
            "write it from the root, /opt/ros/jazzy/setup.bash, or from home, ~/ws/install/…"
        )
    return _word(text)


def _network(text: str) -> str:
    if not _NETWORK.fullmatch(text):
        raise ValueError(f'"{text}" is not a network of podman or docker, such as none or host')
    return text


def _domain(value: Any) -> Any:
    if value is None or value == "own":
        return value
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= HIGHEST_DOMAIN:
        raise ValueError(f"must be own, or a whole number from 0 to {HIGHEST_DOMAIN}")
    return value


def _period(value: float) -> float:
    ticks = value / TICK
    if abs(ticks - round(ticks)) > _ROUNDING or not math.isfinite(ticks):
        raise ValueError(f"{value:g} s is not a multiple of {TICK:g} s, the step of the simulation")
    return value


def _by_laser(value: Any, check: Callable[[str], str]) -> Any:
    """Check a name, or names by laser, one type of two for which messages are about one."""
    if value is None:
        return None
    if not isinstance(value, Mapping):
        return check(_text(value))
    if not value:
        raise ValueError("names no laser: write a name, or one for each laser, {front: ...}")
    for laser in value:
        if not isinstance(laser, str) or not re.fullmatch(LASER_NAME, laser):
            raise ValueError(f'"{laser}" is no name of a laser: write a-z, 0-9 and _')
    return {laser: check(_text(name)) for laser, name in value.items()}


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{value!r} is neither a name nor names by laser")
    return value


def _scan_topics(value: Any) -> Any:
    return _by_laser(value, _ros_name)


def _laser_frames(value: Any) -> Any:
    return _by_laser(value, _frame)


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


_Name: TypeAlias = Annotated[str, AfterValidator(_ros_name)]
_Variable: TypeAlias = Annotated[str, AfterValidator(_variable)]
_Frame: TypeAlias = Annotated[str, AfterValidator(_frame)]
_NamesByLaser: TypeAlias = dict[Annotated[str, Field(pattern=LASER_NAME)], str]
_ScanTopics: TypeAlias = Annotated[
    Any, BeforeValidator(_scan_topics, json_schema_input_type=_Name | _NamesByLaser)
]
_LaserFrames: TypeAlias = Annotated[
    Any, BeforeValidator(_laser_frames, json_schema_input_type=_Frame | _NamesByLaser)
]
_Names: TypeAlias = Annotated[
    list[_Name], BeforeValidator(_as_list, json_schema_input_type=str | list[str])
]
_Setups: TypeAlias = Annotated[
    list[Annotated[str, AfterValidator(_worker_path)]],
    BeforeValidator(_as_list, json_schema_input_type=str | list[str]),
]
_Domain: TypeAlias = Annotated[
    Any,
    BeforeValidator(
        _domain,
        json_schema_input_type=Annotated[int, Field(ge=0, le=HIGHEST_DOMAIN)] | Literal["own"],
    ),
]
Reliability: TypeAlias = Literal["best effort", "reliable"]
Mission: TypeAlias = Literal["waypoints", "follow", "through"]


class _Ros2ContainerText(StrictModel):
    """An image that the stack is started in."""

    image: Annotated[str, AfterValidator(_word)] | None = None
    """The image, with its tag: my/nav2:1.4."""
    engine: Literal["podman", "docker"] | None = None
    """The command that runs it; podman when left out."""
    network: Annotated[str, AfterValidator(_network)] | None = None
    """Its network; none when left out, which is enough for a stack that talks to itself."""
    options: list[Annotated[str, AfterValidator(_no_nul)]] | None = None
    """More options for the command "run", one list item for each word."""


class _Ros2EnvironmentText(StrictModel):
    """What the stack finds in its environment: files that are sourced, domain, variables."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[_Variable, Annotated[str, AfterValidator(_no_nul)] | None] = Field(
        init=False
    )

    setup: _Setups | None = None
    """Files that are sourced before the command, in this order; paths on the worker's machine."""
    domain: _Domain = Field(default=None, alias="ROS_DOMAIN_ID")
    """own (when left out): a domain for each run alone; or a number from 0 to 101."""


class _Ros2TopicsText(StrictModel):
    """Topics under other names than the usual ones; without a slash they are in the namespace."""

    scan: _ScanTopics = None
    """The laser scan is published here; scan when left out. A laser with a name is published with
    _NAME behind it, scan_front, or where it is said by its name: {front: front/scan}."""
    odom: _Name | None = None
    """The wheel odometry is published here; odom when left out."""
    command: _Name | None = None
    """Here the robot listens for velocities, stamped or not; cmd_vel when left out."""
    tf: _Name | None = None
    """/tf when left out."""
    tf_static: _Name | None = Field(default=None, alias="tf-static")
    """/tf_static when left out."""
    map: _Name | None = None
    """The map is published here with "map: published"; map when left out."""
    initial_pose: _Name | None = Field(default=None, alias="initial-pose")
    """The initial pose is published here; initialpose when left out."""
    plan: _Name | None = None
    """The stack's global plan, recorded; plan when left out."""
    local_plan: _Name | None = Field(default=None, alias="local-plan")
    """The stack's local plan, recorded; local_plan when left out."""
    pose: _Name | None = None
    """The stack's pose estimate, recorded; amcl_pose when left out."""
    particles: _Name | None = None
    """The stack's particles, recorded; particle_cloud when left out."""


class _Ros2QosText(StrictModel):
    """How sensor data is published; "best effort" when left out, as sensors do."""

    scan: Reliability | None = None
    """Of the laser scans."""
    odom: Reliability | None = None
    """Of the wheel odometry."""


class _Ros2FramesText(StrictModel):
    """Names of the frames of REP 105."""

    map: _Frame | None = None
    """map when left out."""
    odom: _Frame | None = None
    """odom when left out."""
    base: _Frame | None = None
    """base_link when left out; also the frame of odometry twists."""
    laser: _LaserFrames = None
    """laser when left out; the frame of scans. That of a laser with a name has _NAME behind it,
    laser_front, or is said by its name: {front: front_laser_link}."""


class Ros2Keys(StrictModel):
    """Keys of a ROS 2 stack; all that is left out has a default, except how it is started."""

    elsewhere: ClassVar[Mapping[str, str | RemovedKey]] = {
        "reuse": RemovedKey("a stack belongs to one run")
    }

    launch: Annotated[str, AfterValidator(_shell_text)] | None = None
    """For "kind: ros2": the command that starts the stack, for a shell. {map}, {start.x} and names
    below "files" in braces are filled in, quoted; double braces {{ }} are plain ones."""
    container: _Ros2ContainerText | None = None
    """For "kind: ros2": start the stack in a container; without "launch" by the image's own
    command."""
    environment: _Ros2EnvironmentText | None = None
    """For "kind: ros2": setup files, ROS_DOMAIN_ID, and variables; their values may contain
    placeholders."""
    python: Annotated[str, AfterValidator(_word)] | None = None
    """For "kind: ros2": the Python that has rclpy, found after the setup files; python3 when left
    out."""
    namespace: Annotated[str, AfterValidator(_namespace)] | None = None
    """For "kind: ros2": comes before topics, actions and nodes that do not begin with a slash."""
    topics: _Ros2TopicsText | None = None
    """For "kind: ros2": topics under other names than the usual ones."""
    qos: _Ros2QosText | None = None
    """For "kind: ros2": reliability of the scan and the odometry."""
    frames: _Ros2FramesText | None = None
    """For "kind: ros2": names of frames."""
    map: Literal["file", "published"] | None = None
    """For "kind: ros2": file (when left out): {map} is the map.yaml written for the run;
    published: a latched topic."""
    transforms: Literal["all", "odom", "none"] | None = None
    """For "kind: ros2", what is published of tf: all (when left out): odom to base and base to
    laser; odom: odom to base; none: the stack does it itself."""
    initial_pose: Literal["published", "none"] | None = Field(default=None, alias="initial-pose")
    """For "kind: ros2": whether the start pose is told; published when left out."""
    mission: Mission | None = None
    """For "kind: ros2": how waypoints are sent. waypoints (when left out): NavigateToPose for each;
    follow: FollowWaypoints; through: NavigateThroughPoses."""
    action: _Name | None = None
    """For "kind: ros2": the action they are sent to, when it is not called as Nav2 calls it."""
    ready: _Names | None = None
    """For "kind: ros2": lifecycle nodes that must be active before the mission begins."""
    start_up: Duration | None = Field(default=None, alias="start-up", gt=0.0, le=3600.0)
    """For "kind: ros2": wall time until it must be ready; 60 s when left out."""
    patience: Duration | None = Field(default=None, gt=0.0, le=600.0)
    """For "kind: ros2": wall time an answer is waited for in each cycle; 1 s when left out."""
    late: Ratio | None = Field(default=None, ge=0.0, le=1.0)
    """For "kind: ros2": share of cycles that may go unanswered before the run is an error; 5 %
    when left out."""
    tolerance: Duration | None = Field(default=None, ge=0.0, le=10.0)
    """For "kind: ros2": a command stamped this much before the cycle is its answer too; 0 s when
    left out."""
    idle: Duration | None = Field(default=None, ge=0.0, le=10.0)
    """For "kind: ros2": wall time a cycle takes while nothing is expected; 0.02 s when left out."""
    period: Annotated[Duration, AfterValidator(_period)] | None = Field(
        default=None, ge=TICK, le=1.0
    )
    """For "kind: ros2": the period of the stack's controller, a multiple of 0.01 s; 0.05 s when
    left out."""


ROS2_KEYS: Final = tuple(field.alias or name for name, field in Ros2Keys.model_fields.items())
"""The keys as they are written."""
