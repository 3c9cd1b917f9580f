"""Keys of a ROS 2 stack at the top of a SUT file, with their defaults.

Every key is optional, because a file that is ``like`` another contains differences only.
:mod:`daemon.stacks.ros2.settings` checks a stack as a whole. The key ``files``, which other kinds
have too, is not among them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Final, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationInfo,
    field_validator,
)
from pydantic_core import PydanticUseDefault

from daemon.model.stack_reports import REPORT_TOPICS, ReportName
from daemon.model.sut import TICK_RATE
from grammars.model.robot import LASER_NAME, Laser
from grammars.text.diagnostics import did_you_mean
from grammars.text.documents import ONE_OR_MORE, RemovedKey, StrictModel
from grammars.text.quantity import Duration, Ratio

HIGHEST_DOMAIN: Final = 101
"""Domain ids up to this one fit the ephemeral port range of every system (ROS 2 documentation)."""
TICK: Final = 1.0 / TICK_RATE
"""Periods are multiples of this [s]."""
_ROUNDING: Final = 1e-6
OWN_PREFIX: Final = "SCENARIO_"
"""Prefix of environment variables from the run to the relay."""

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


def _absolute(name: str, info: ValidationInfo) -> str:
    """Return the absolute form of a name; the context has the namespace as written."""
    return _in_namespace((info.context or {}).get("namespace"), _ros_name(name))


def _in_namespace(namespace: object, name: str) -> str:
    return name if name.startswith("/") else f"{_prefix(namespace)}/{name}"


def _prefix(namespace: object) -> str:
    """Return a namespace as the prefix of a name: empty, or with one leading slash."""
    name = str(namespace or "").strip("/")
    return f"/{name}" if name else ""


def _namespace(text: str) -> str:
    return _prefix(text if text in ("", "/") else _ros_name(text))


def _variable(text: str) -> str:
    if not _VARIABLE.fullmatch(text):
        raise ValueError(f'"{text}" is not the name of an environment variable')
    if text.startswith(OWN_PREFIX):
        raise ValueError(f"{text} is set by the run itself")
    return text


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
    """Return a path on the worker's machine, which the loading machine cannot check."""
    if not text.startswith(("/", "~/")):
        raise ValueError(
            f'"{text}" is a path on the machine of the stack: '
            "write it from the root, /opt/ros/jazzy/setup.bash, or from home, ~/ws/install/…"
        )
    return _word(text)


def _network(text: str) -> str:
    if not _NETWORK.fullmatch(text):
        raise ValueError(f'"{text}" is not a network of podman or docker, such as none or host')
    return text


def _domain(value: Any) -> Any:
    if value == "own":
        return value
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= HIGHEST_DOMAIN:
        raise ValueError(f"must be own, or a whole number from 0 to {HIGHEST_DOMAIN}")
    return value


def _period(value: float) -> float:
    ticks = value / TICK
    if abs(ticks - round(ticks)) > _ROUNDING:
        raise ValueError(f"{value:g} s is not a multiple of {TICK:g} s, the step of the simulation")
    return value


def _by_laser(value: Any, check: Callable[[str], str]) -> Any:
    """Check a name, or names by laser; pydantic's union would report errors of both forms."""
    if not isinstance(value, Mapping):
        return check(_text(value))
    if not value:
        raise ValueError("names no laser: write a name, or one for each laser, {front: ...}")
    for laser in value:
        if not isinstance(laser, str) or not re.fullmatch(LASER_NAME, laser):
            raise ValueError(f'"{laser}" is not a name of a laser: write a-z, 0-9 and _')
    return {laser: check(_text(name)) for laser, name in value.items()}


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{value!r} is neither a name nor names by laser")
    return value


def _scan_topics(value: Any, info: ValidationInfo) -> Any:
    return _by_laser(value, lambda name: _absolute(name, info))


def _laser_frames(value: Any) -> Any:
    return _by_laser(value, _frame)


def _report(value: Any) -> Any:
    if value not in REPORT_TOPICS:
        hint = did_you_mean(str(value), REPORT_TOPICS)
        raise ValueError(f'nothing called "{value}" can be recorded: {hint}')
    return value


_Name: TypeAlias = Annotated[str, AfterValidator(_absolute)]
_Variable: TypeAlias = Annotated[str, AfterValidator(_variable)]
_VariableText: TypeAlias = Annotated[str, AfterValidator(_no_nul)]
_Frame: TypeAlias = Annotated[str, AfterValidator(_frame)]
_NamesByLaser: TypeAlias = dict[Annotated[str, Field(pattern=LASER_NAME)], str]
_ScanTopics: TypeAlias = Annotated[
    str | Mapping[str, str],
    PlainValidator(_scan_topics, json_schema_input_type=_Name | _NamesByLaser),
]
_LaserFrames: TypeAlias = Annotated[
    str | Mapping[str, str],
    PlainValidator(_laser_frames, json_schema_input_type=_Frame | _NamesByLaser),
]
_Names: TypeAlias = Annotated[tuple[_Name, ...], ONE_OR_MORE]
_Report: TypeAlias = Annotated[ReportName, BeforeValidator(_report)]
_Setups: TypeAlias = Annotated[
    tuple[Annotated[str, AfterValidator(_worker_path)], ...], ONE_OR_MORE
]
_Domain: TypeAlias = Annotated[
    Annotated[int, Field(ge=0, le=HIGHEST_DOMAIN)] | Literal["own"], BeforeValidator(_domain)
]
MissionMode: TypeAlias = Literal["waypoints", "follow", "through"]
_ACTIONS: Final[Mapping[MissionMode, str]] = MappingProxyType(
    {
        "waypoints": "navigate_to_pose",
        "follow": "follow_waypoints",
        "through": "navigate_through_poses",
    }
)
Reliability: TypeAlias = Literal["best effort", "reliable"]


def _name_of(laser: Laser, names: str | Mapping[str, str], usual: str) -> str:
    """Return the name of a laser's topic or frame among ``names``, or the ``usual`` one."""
    if isinstance(names, str):
        usual = names
    elif laser.name in names:
        return names[laser.name]
    return f"{usual}_{laser.name}" if laser.name else usual


def default_for_null(value: Any) -> Any:
    """Validate null, which removes an inherited value, as the default of its key."""
    if value is None:
        raise PydanticUseDefault
    return value


class _Section(StrictModel):
    """Keys below a key of a SUT file."""

    _null = field_validator("*", mode="before")(default_for_null)


class Ros2Container(_Section):
    """Container in which the stack starts."""

    image: Annotated[str, AfterValidator(_word)] = ""
    """The image, with its tag: my/nav2:1.4."""
    engine: Literal["podman", "docker"] = "podman"
    """The command that runs it."""
    network: Annotated[str, AfterValidator(_network)] = "none"
    """Its network; none is enough for a stack that talks to itself."""
    options: tuple[Annotated[str, AfterValidator(_no_nul)], ...] = ()
    """More options for the command "run", one list item for each word."""


class Ros2Environment(_Section):
    """Environment of the stack: setup files, domain, variables."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[_Variable, _VariableText | None] = Field(init=False)

    setup: _Setups = ()
    """Files to source before the command, in this order; paths on the worker's machine."""
    domain: _Domain = Field(default="own", alias="ROS_DOMAIN_ID")
    """own: a separate domain for each run; or a number from 0 to 101."""

    @property
    def variables(self) -> dict[str, str]:
        """Environment variables by name."""
        return {name: text for name, text in self.__pydantic_extra__.items() if text is not None}


class Ros2Topics(_Section):
    """Names of topics; without a leading slash they are in the namespace."""

    model_config = ConfigDict(validate_default=True)

    scan: _ScanTopics = "scan"
    """Topic of the laser scan. A laser with a name has the suffix _NAME, scan_front, or its own
    topic: {front: front/scan}."""
    odom: _Name = "odom"
    """Topic of the wheel odometry."""
    command: _Name = "cmd_vel"
    """Topic of the velocities for the robot, stamped or not."""
    tf: _Name = "/tf"
    """Transforms of the simulator and of the stack."""
    tf_static: _Name = Field(default="/tf_static", alias="tf-static")
    """Transforms that never change."""
    map: _Name = "map"
    """Topic of the map with "map: published"."""
    initial_pose: _Name = Field(default="initialpose", alias="initial-pose")
    """Topic of the initial pose."""
    plan: _Name = "plan"
    """The stack's global plan, recorded."""
    local_plan: _Name = Field(default="local_plan", alias="local-plan")
    """The stack's local plan, recorded."""
    pose: _Name = "amcl_pose"
    """The stack's pose estimate, recorded."""
    particles: _Name = "particle_cloud"
    """The stack's particles, recorded."""
    behavior_tree: _Name = Field(default="behavior_tree_log", alias="behavior-tree")
    """The log of the stack's behaviour tree, recorded with "record"."""
    global_costmap: _Name = Field(default="global_costmap/costmap", alias="global-costmap")
    """The stack's global costmap, recorded with "record"."""
    local_costmap: _Name = Field(default="local_costmap/costmap", alias="local-costmap")
    """The stack's local costmap, recorded with "record"."""
    collision_monitor: _Name = Field(default="collision_monitor_state", alias="collision-monitor")
    """The state of the stack's collision monitor, recorded with "record"."""
    speed_limit: _Name = Field(default="speed_limit", alias="speed-limit")
    """The speed limit for the stack, recorded with "record"."""


class Ros2Qos(_Section):
    """Reliability of sensor data."""

    scan: Reliability = "best effort"
    """Reliability of the laser scans."""
    odom: Reliability = "best effort"
    """Reliability of the wheel odometry."""


class Ros2Frames(_Section):
    """Names of the frames of REP 105."""

    map: _Frame = "map"
    """The map."""
    odom: _Frame = "odom"
    """The odometry."""
    base: _Frame = "base_link"
    """The robot; also the frame of odometry twists."""
    laser: _LaserFrames = "laser"
    """The frame of scans. A laser with a name has the suffix _NAME, laser_front, or its own frame:
    {front: front_laser_link}."""

    def of_laser(self, laser: Laser) -> str:
        """Return the frame of a laser."""
        return _name_of(laser, self.laser, "laser")


class Ros2Keys(StrictModel):
    """Keys of a ROS 2 stack; all except the start command have defaults."""

    elsewhere: ClassVar[Mapping[str, str | RemovedKey]] = {
        "reuse": RemovedKey("a stack belongs to one run")
    }

    launch: Annotated[str, AfterValidator(_shell_text)] = ""
    """For "kind: ros2": the shell command that starts the stack. It may contain {map}, {start.x}
    and names below "files" in braces, which become quoted values; double braces {{ }} are plain
    ones."""
    container: Ros2Container | None = None
    """For "kind: ros2": start the stack in a container; without "launch" by the image's own
    command."""
    environment: Ros2Environment = Field(default_factory=Ros2Environment)
    """For "kind: ros2": setup files, ROS_DOMAIN_ID, and variables; their values may contain
    placeholders."""
    python: Annotated[str, AfterValidator(_word)] = "python3"
    """For "kind: ros2": the Python with rclpy, searched after the setup files."""
    namespace: Annotated[str, AfterValidator(_namespace)] = ""
    """For "kind: ros2": prefix of topics, actions and nodes without a leading slash."""
    topics: Ros2Topics = Field(default_factory=dict, validate_default=True)
    """For "kind: ros2": names of topics."""
    qos: Ros2Qos = Field(default_factory=Ros2Qos)
    """For "kind: ros2": reliability of the scan and the odometry."""
    frames: Ros2Frames = Field(default_factory=Ros2Frames)
    """For "kind: ros2": names of frames."""
    map: Literal["file", "published"] = "file"
    """For "kind: ros2": file: {map} is the map.yaml written for the run; published: a latched
    topic."""
    transforms: Literal["all", "odom", "none"] = "all"
    """For "kind: ros2": published transforms. all: odom to base and base to laser; odom: odom to
    base; none: the stack publishes them itself."""
    initial_pose: Literal["published", "none"] = Field(default="published", alias="initial-pose")
    """For "kind: ros2": publish the start pose, or not."""
    mission: MissionMode = "waypoints"
    """For "kind: ros2": action for the waypoints. waypoints: NavigateToPose for each; follow:
    FollowWaypoints; through: NavigateThroughPoses."""
    action: _Name = Field(default="", validate_default=True)
    """For "kind: ros2": name of the action, if it differs from Nav2's."""
    ready: _Names = ()
    """For "kind: ros2": lifecycle nodes that must be active before the mission begins."""
    record: tuple[_Report, ...] = ()
    """For "kind: ros2": recordings in addition to plans, pose and particles: the log of the
    behavior tree, costmaps, interventions of the collision monitor, the speed limit."""
    start_up: Duration = Field(default=60.0, alias="start-up", gt=0.0, le=3600.0)
    """For "kind: ros2": wall time until the stack must be ready."""
    attempts: int = Field(default=1, ge=1, le=3)
    """For "kind: ros2": starts within start-up; a failed start is repeated."""
    patience: Duration = Field(default=1.0, gt=0.0, le=60.0)
    """For "kind: ros2": longest wall time for an answer in each cycle; a hanging stack takes it in
    every cycle. More than the period, or a controller on wall time is late in every cycle."""
    late: Ratio = Field(default=0.05, ge=0.0, lt=1.0)
    """For "kind: ros2": share of cycles that may go unanswered before the run is an error."""
    tolerance: Duration = Field(default=0.0, ge=0.0, le=1.0)
    """For "kind: ros2": a command stamped this much before the cycle is its answer too. From a
    period on, the command of the previous cycle counts as an answer."""
    idle: Duration = Field(default=0.02, ge=0.0, le=1.0)
    """For "kind: ros2": wall time of a cycle without an expected command."""
    period: Annotated[Duration, AfterValidator(_period)] = Field(default=0.05, ge=TICK, le=1.0)
    """For "kind: ros2": the period of the stack's controller, a multiple of 0.01 s."""

    def scan_topic(self, laser: Laser) -> str:
        """Return the topic on which the scans of a laser are published."""
        return _name_of(laser, self.topics.scan, _in_namespace(self.namespace, "scan"))

    @property
    def action_kind(self) -> str:
        """Kind of Nav2's action for the mission."""
        return _ACTIONS[self.mission]

    @field_validator("action", mode="before")
    @classmethod
    def _take_usual_action(cls, value: Any, info: ValidationInfo) -> Any:
        return value or _ACTIONS[info.data.get("mission", "waypoints")]


ROS2_KEYS: Final = tuple(field.alias or name for name, field in Ros2Keys.model_fields.items())
"""Keys as written in files."""
