"""The ROS 2 messages in a trace: topics, types, and the mission.

Progress of a mission is an ``action_msgs/GoalStatusArray``; this module encodes and decodes it.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from daemon.model import ros_messages as ros
from daemon.model.spec import SutReference
from daemon.model.stack_reports import COSTMAP as GRID
from daemon.model.stack_reports import REPORT_TOPICS, ReportName
from daemon.model.sut import Progress
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Laser, Robot

LEVELS: Final = {"debug": 10, "info": 20, "warn": 30, "error": 40, "fatal": 50}
"""Levels of ``rcl_interfaces/msg/Log``."""


@dataclass(frozen=True, slots=True)
class Topic:
    """Topic of a trace; ``latched`` ones are published once and kept (transient local).

    ``external`` topics are only in traces of systems outside of the simulator. Judges read
    ``judged`` topics. A trace keeps one message per ``period`` [ns], or all if it is zero.
    ``report`` is the name of the topic in the list of recorded reports of a system.
    """

    name: str
    kind: str
    latched: bool = False
    external: bool = False
    judged: bool = False
    period: int = 0
    report: ReportName | None = None

    def is_recorded(self, sut: SutReference) -> bool:
        """Return True if a trace of a system has the topic."""
        if self.report is not None:
            return self.report in sut.recorded
        return not (self.external and sut.repeatable)

    @property
    def is_costmap_report(self) -> bool:
        """True for a costmap among the reports of a system."""
        return self.report is not None and self.kind == GRID


PARTICLES: Final = "/particlecloud"
COSTMAP: Final = "/move_base/local_costmap/costmap"

_SECOND: Final = 1_000_000_000

TOPICS: Final = (
    Topic("/map", GRID, latched=True),
    Topic("/footprint", "geometry_msgs/msg/PolygonStamped", latched=True),
    Topic("/scene", "visualization_msgs/msg/MarkerArray", latched=True),
    Topic("/tf_static", "tf2_msgs/msg/TFMessage", latched=True),
    Topic("/clock", "rosgraph_msgs/msg/Clock"),
    Topic("/tf", "tf2_msgs/msg/TFMessage"),
    Topic("/scan", "sensor_msgs/msg/LaserScan"),
    Topic("/odom", "nav_msgs/msg/Odometry", judged=True),
    Topic("/ground_truth", "nav_msgs/msg/Odometry", judged=True),
    Topic("/joint_states", "sensor_msgs/msg/JointState", judged=True),
    Topic("/cmd_vel", "geometry_msgs/msg/TwistStamped", judged=True),
    Topic("/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", judged=True),
    Topic("/particle_cloud/summary", "geometry_msgs/msg/PoseWithCovarianceStamped", judged=True),
    Topic("/particle_cloud/count", "std_msgs/msg/UInt32", judged=True),
    Topic("/plan", "nav_msgs/msg/Path", period=_SECOND),
    Topic("/local_plan", "nav_msgs/msg/Path", period=_SECOND // 5),
    Topic("/contacts", ros.CONTACTS, judged=True),
    Topic("/mission/status", "action_msgs/msg/GoalStatusArray", latched=True, judged=True),
    Topic("/mission/goal", "geometry_msgs/msg/PoseStamped", latched=True),
    Topic("/events", "rcl_interfaces/msg/Log", judged=True),
    Topic(PARTICLES, "geometry_msgs/msg/PoseArray", period=_SECOND),
    Topic(COSTMAP, GRID, period=_SECOND),
    Topic("/sut/latency", "std_msgs/msg/Float64", external=True, judged=True),
    *(
        Topic(name, kind, external=True, report=report, judged=True)
        if kind != GRID
        else Topic(name, kind, external=True, report=report, period=_SECOND)
        for report, (name, kind) in REPORT_TOPICS.items()
    ),
)
"""All topics of a trace if the robot's only laser has no name, see :func:`topics_of`. Channel ids
follow this order. External topics are last, so that the ids of the others do not depend on them."""

SCAN: Final = "/scan"


def scan_topic(laser: Laser) -> str:
    """Return the topic of a laser's scans: ``/scan``, or ``/scan_NAME`` for one with a name."""
    return f"/{laser.topic}"


def is_scan(topic: str) -> bool:
    """Return True for a topic that may hold the scans of a laser."""
    return topic == SCAN or topic.startswith(f"{SCAN}_")


def topics_of(robot: Robot) -> tuple[Topic, ...]:
    """Return all topics of the trace of a robot, with a scan for each of its lasers.

    They are :data:`TOPICS` for a robot whose only laser has no name.
    """
    topics: list[Topic] = []
    for topic in TOPICS:
        if topic.name == SCAN:
            topics += (Topic(scan_topic(laser), topic.kind) for laser in robot.lasers)
        else:
            topics.append(topic)
    return tuple(topics)


VERDICTS: Final = "verdicts.json"
"""Name of the attachment with the verdicts of a recorded run."""

OUTPUT_PREFIX: Final = "output/"
"""Beginning of the names of attachments with the output of a system under test."""

KINDS: Final = {topic.name: topic.kind for topic in TOPICS}
JUDGED: Final = frozenset(topic.name for topic in TOPICS if topic.judged)
COSTMAPS: Final[dict[str, Literal["local", "global"]]] = {
    COSTMAP: "local",
    REPORT_TOPICS["local costmap"][0]: "local",
    REPORT_TOPICS["global costmap"][0]: "global",
}
"""Topics of costmaps, and the scope of each."""
VIEWS: Final = frozenset({"/plan", *COSTMAPS})
"""Topics for viewers, read only on request."""


def warm_up() -> None:
    """Make the code and the definitions of all types once, for this process and forked children."""
    for kind in KINDS.values():
        # rosbags generates and compiles the serializer of a type at its first use; a forked child
        # inherits it.
        ros.typestore().get_msgdef(kind)
        ros.schema(kind)


def latched_qos() -> str:
    """Return the ``offered_qos_profiles`` of a latched topic in the YAML of rosbag2.

    The profile is keep last 1, reliable, transient local, in the numbers of ``rmw``.
    """
    forever = "{sec: 2147483647, nsec: 4294967295}"
    return (
        "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
        f"  deadline: {forever}\n  lifespan: {forever}\n"
        f"  liveliness: 1\n  liveliness_lease_duration: {forever}\n"
        "  avoid_ros_namespace_conventions: false\n"
    )


STATUS: Final = "action_msgs/msg/GoalStatusArray"
# action_msgs/GoalStatus: STATUS_ACCEPTED, STATUS_EXECUTING, STATUS_SUCCEEDED, STATUS_ABORTED.
_ACCEPTED, _EXECUTING, _SUCCEEDED, _ABORTED = 1, 2, 4, 6
_STATES: Final[dict[int, Literal["active", "succeeded", "aborted"]]] = {
    _EXECUTING: "active",
    _SUCCEEDED: "succeeded",
    _ABORTED: "aborted",
}
_CODES: Final = {state: code for code, state in _STATES.items()}


def goal_ids(run: str, mission: Mission) -> tuple[Any, ...]:
    """Return the UUID messages of all waypoints and of the mission, for the run's digest."""
    names = [*(f"{i}/{w.id}" for i, w in enumerate(mission.waypoints)), "mission"]
    raw_ids = (uuid.uuid5(uuid.NAMESPACE_URL, f"run:{run}/goal/{name}").bytes for name in names)
    kind = "unique_identifier_msgs/msg/UUID"
    return tuple(ros.make(kind, uuid=np.frombuffer(raw, np.uint8)) for raw in raw_ids)


def status(goals: tuple[Any, ...], progress: Progress) -> Any:
    """Return the status of all goals."""
    if progress.state not in _CODES:
        raise ValueError(f"a mission is {', '.join(_CODES)}, not {progress.state!r}")
    count = len(goals) - 1
    reached = min(max(progress.reached, 0), count)
    codes = [_SUCCEEDED] * reached + [_ACCEPTED] * (count - reached)
    current = max(progress.current, reached)
    if current < count and progress.state != "succeeded":
        codes[current] = _CODES[progress.state]
    codes.append(_CODES[progress.state])
    return ros.make(
        STATUS,
        status_list=[
            ros.make(
                "action_msgs/msg/GoalStatus",
                goal_info=ros.make("action_msgs/msg/GoalInfo", goal_id=goal, stamp=ros.time(0)),
                status=code,
            )
            for goal, code in zip(goals, codes, strict=True)
        ],
    )


def progress(message: Any) -> Progress:
    """Return the progress of a status message; raises ``ValueError`` if it has none."""
    codes = [int(goal.status) for goal in message.status_list]
    if not codes or codes[-1] not in _STATES:
        raise ValueError("a mission status without the mission's own goal")
    waypoints = codes[:-1]
    reached = waypoints.count(_SUCCEEDED)
    here = [i for i, code in enumerate(waypoints) if code in (_EXECUTING, _ABORTED)]
    return Progress(here[0] if here else reached, reached, _STATES[codes[-1]])


def goal(waypoint: Waypoint, stamp: int) -> bytes:
    """Return the current waypoint as the CDR of a ``geometry_msgs/PoseStamped``."""
    message = ros.make(
        "geometry_msgs/msg/PoseStamped",
        header=ros.header(ros.time(stamp), "map"),
        pose=ros.pose(waypoint.x, waypoint.y, *ros.yaw_quaternion(waypoint.yaw or 0.0)),
    )
    return ros.serialize(message, KINDS["/mission/goal"])
