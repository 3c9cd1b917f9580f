"""Messages of a stack except commands, for the trace: pose, plan, particles, log, reports.

A damaged message causes one warning and is ignored.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import numpy as np

from daemon.model.stack_reports import (
    COSTMAP,
    REPORT_TOPICS,
    ReportName,
    decode_collision,
    decode_costmap,
    decode_speed_limit,
    decode_tree_log,
)
from daemon.model.sut import (
    Cloud,
    CostmapPicture,
    Decision,
    Estimate,
    Odometry,
    Progress,
    StackReport,
    SutEvent,
)
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.keys import Ros2Frames, Ros2Keys
from daemon.stacks.ros2.link import ReceivedMessage, TopicSetup
from grammars.model.geometry import Floats, Pose2, Twist2

ROSOUT: Final = "/rosout"
LOG: Final = "rcl_interfaces/msg/Log"
PATH: Final = "nav_msgs/msg/Path"
POSE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
PARTICLES: Final = "nav2_msgs/msg/ParticleCloud"

_LOG_LEVELS: Final = {10: "debug", 20: "info", 30: "warn", 40: "error", 50: "fatal"}
_MOST_LOG_LINES: Final = 5000
"""Most lines of the stack's log in a trace; its whole output is kept beside the trace."""
_PLANE: Final = (0, 1, 5)
"""Rows of x, y and yaw in a (6, 6) covariance."""
_PARTICLE: Final = np.dtype([("position", "<f8", 3), ("orientation", "<f8", 4), ("weight", "<f8")])
_SHOWN_PARTICLES: Final = 100
_DECODERS: Final[Mapping[str, Callable[[bytes, float], StackReport]]] = {
    "behavior tree": decode_tree_log,
    "collision monitor": decode_collision,
    "speed limit": decode_speed_limit,
}
_TREE_DEPTH: Final = 100
"""Number of logs that may wait for a cycle; a tree ticks up to a hundred times a second."""


@dataclass(slots=True)
class StackNews:
    """Content of the messages of one cycle; ``None`` for anything without news."""

    estimate: Estimate | None = None
    cloud: Cloud | None = None
    particles: Floats | None = None
    plan: Floats | None = None
    local_plan: Floats | None = None
    events: list[SutEvent] = field(default_factory=list)
    reports: list[StackReport] = field(default_factory=list)
    log: list[str] = field(default_factory=list)

    def decision(
        self,
        progress: Progress,
        command: Twist2 | None = None,
        *,
        latency: float | None = None,
        events: Sequence[SutEvent],
    ) -> Decision:
        """Return the news as the answer of a system under test."""
        return Decision(
            command=command,
            progress=progress,
            estimate=self.estimate,
            cloud=self.cloud,
            plan=self.plan,
            local_plan=self.local_plan,
            events=tuple(events),
            particles=self.particles,
            latency=latency,
            reports=tuple(self.reports),
        )


class TransformTree:
    """Newest transforms between frames, in the plane."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Pose2]] = {}

    def add(self, parent: str, child: str, pose: Pose2) -> None:
        """Take a transform child -> parent."""
        self._parents[child.lstrip("/")] = (parent.lstrip("/"), pose)

    def find(self, child: str, parent: str) -> Pose2 | None:
        """Return the pose of ``child`` in its ancestor ``parent``, ``None`` if unknown."""
        frame, pose = child, Pose2()
        # At most as many steps as frames, because foreign transforms may form a circle.
        for _ in range(len(self._parents) + 1):
            if frame == parent:
                return pose
            if frame not in self._parents:
                return None
            frame, above = self._parents[frame]
            pose = above @ pose
        return None


class Telemetry:
    """Reader of a stack's messages during one run."""

    def __init__(self, settings: Ros2Keys) -> None:
        self._topics, self._frames = settings.topics, settings.frames
        self._reports = report_topics(settings)
        self._tree = TransformTree()
        self._covariance = np.zeros((3, 3))
        self._warnings: set[str] = set()
        self._log_lines = 0

    def pose(self) -> Pose2 | None:
        """Return the stack's estimate of the base in the map, ``None`` while unknown."""
        return self._tree.find(self._frames.base, self._frames.map)

    def forget(self) -> None:
        """Drop all transforms, because the world has restarted."""
        self._tree = TransformTree()

    def move(self, sample: Odometry) -> None:
        """Take the robot's own odometry; this side publishes odom -> base."""
        self._tree.add(self._frames.odom, self._frames.base, sample.pose)

    def read(
        self,
        messages: tuple[ReceivedMessage, ...],
        now: float,
        odometry: Odometry,
        dropped: tuple[str, ...] = (),
    ) -> StackNews:
        """Read the messages of one cycle at the simulated time ``now`` [s].

        ``odometry`` is the newest sample, which combines with map -> odom to an estimate.
        ``dropped`` names the topics with too many messages for the cycle.
        """
        news = StackNews()
        for topic in dropped:
            text = f"{topic} had more messages in one cycle than are taken: old ones are lost"
            self._warn_once(text, news)
        is_localised = False
        for message in messages:
            try:
                is_localised |= self._read_one(message, news, now)
            except (ValueError, AttributeError, TypeError) as error:
                self._warn_once(f"{message.topic} cannot be read: {error}", news)
        if is_localised:
            self._tree.add(self._frames.odom, self._frames.base, odometry.pose)
            pose = self.pose()
            if pose is not None and math.isfinite(pose.x + pose.y + pose.yaw):
                news.estimate = Estimate(odometry.time, pose, self._covariance)
        return news

    def _read_one(self, message: ReceivedMessage, news: StackNews, now: float) -> bool:
        """Read a message; return whether it localises the robot."""
        topics = self._topics
        if message.topic in (topics.tf, topics.tf_static):
            return self._read_transforms(sensors.read_message(message.data, sensors.TRANSFORMS))
        if message.topic == ROSOUT:
            self._read_log(sensors.read_message(message.data, LOG), news)
        elif message.topic == topics.pose:
            self._read_pose(sensors.read_message(message.data, POSE), news, now)
        elif message.topic == topics.plan:
            news.plan = self._read_path(message, news)
        elif message.topic == topics.local_plan:
            news.local_plan = self._read_path(message, news)
        elif message.topic == topics.particles:
            self._read_particles(message.data, news, now)
        elif message.topic in self._reports:
            report = _read_report(self._reports[message.topic], message, now, self._frames)
            if isinstance(report, CostmapPicture):
                frame = self._frames.map if report.frame == "map" else self._frames.odom
                report = replace(report, frame_pose=self._tree.find(frame, self._frames.map))
            news.reports.append(report)
        return False

    def _read_transforms(self, message: Any) -> bool:
        localises = False
        for transform in message.transforms:
            parent = transform.header.frame_id.lstrip("/")
            child = transform.child_frame_id.lstrip("/")
            motion = transform.transform
            # Transforms of this side come back on the same topic.
            if child == self._frames.base and parent == self._frames.odom:
                continue
            self._tree.add(parent, child, sensors.plane_pose(motion.translation, motion.rotation))
            localises |= parent == self._frames.map
        return localises

    def _read_log(self, message: Any, news: StackNews) -> None:
        text = str(message.msg)
        news.log.append(text)
        level = _LOG_LEVELS.get(int(message.level), "info")
        if level == "debug":
            return
        self._log_lines += 1
        if self._log_lines > _MOST_LOG_LINES:
            self._warn_once("the rest of the stack's log is left out here", news)
            return
        news.events.append(SutEvent(text, level, str(message.name)))  # type: ignore[arg-type]

    def _read_pose(self, message: Any, news: StackNews, now: float) -> None:
        full = np.asarray(message.pose.covariance, np.float64).reshape(6, 6)
        covariance = full[np.ix_(_PLANE, _PLANE)]
        if np.isfinite(covariance).all():
            self._covariance = covariance
        # This is the only pose of a stack that sends no transforms.
        if self.pose() is None and message.header.frame_id.lstrip("/") == self._frames.map:
            pose = sensors.plane_pose(message.pose.pose.position, message.pose.pose.orientation)
            if math.isfinite(pose.x + pose.y + pose.yaw):
                news.estimate = Estimate(now, pose, self._covariance)

    def _read_path(self, message: ReceivedMessage, news: StackNews) -> Floats | None:
        path = sensors.read_message(message.data, PATH)
        frame = path.header.frame_id.lstrip("/")
        to_map = self._tree.find(frame, self._frames.map)
        if to_map is None:
            self._warn_once(f"{message.topic} is in frame {frame!r}, which is not known here", news)
            return None
        points = [to_map.apply((pose.pose.position.x, pose.pose.position.y)) for pose in path.poses]
        way = np.array(points, np.float64).reshape(-1, 2)
        return way if np.isfinite(way).all() else None

    def _read_particles(self, data: bytes, news: StackNews, now: float) -> None:
        """Read a ``nav2_msgs/ParticleCloud``, unknown to rosbags: a header, then a table."""
        frame_length = int.from_bytes(data[12:16], "little")
        # After the encapsulation: stamp (8), frame, number of rows (4), all aligned to 4, then rows
        # of doubles aligned to 8; alignment counts from behind the encapsulation.
        at = 12 + frame_length
        at += -at % 4
        count = int.from_bytes(data[4 + at : 8 + at], "little")
        start = 4 + at + 4 + (-(at + 4) % 8)
        rows = data[start : start + count * _PARTICLE.itemsize]
        if len(rows) != count * _PARTICLE.itemsize or not count:
            raise ValueError("a particle cloud of another size")
        table = np.frombuffer(rows, _PARTICLE)
        z, w = table["orientation"][:, 2], table["orientation"][:, 3]
        poses = np.column_stack((table["position"][:, :2], 2.0 * np.arctan2(z, w)))
        if not np.isfinite(poses).all():
            raise ValueError("particles that are not finite")
        news.particles = poses[:: max(1, count // _SHOWN_PARTICLES)]
        news.cloud = _summary(poses, now)

    def _warn_once(self, text: str, news: StackNews) -> None:
        """Add a warning, each text once in a run."""
        if text not in self._warnings:
            self._warnings.add(text)
            news.events.append(SutEvent(text, "warn"))


def _summary(poses: Floats, now: float) -> Cloud:
    """Return mean and covariance of particles (n, 3); headings by their mean direction."""
    yaw = math.atan2(float(np.sin(poses[:, 2]).mean()), float(np.cos(poses[:, 2]).mean()))
    mean = Pose2(float(poses[:, 0].mean()), float(poses[:, 1].mean()), yaw)
    off = poses - (mean.x, mean.y, mean.yaw)
    off[:, 2] = np.remainder(off[:, 2] + math.pi, math.tau) - math.pi
    return Cloud(now, len(poses), mean, off.T @ off / len(poses))


def report_topics(settings: Ros2Keys) -> dict[str, ReportName]:
    """Return the reports to record, by topic."""
    topics = settings.topics
    names: dict[ReportName, str] = {
        "behavior tree": topics.behavior_tree,
        "global costmap": topics.global_costmap,
        "local costmap": topics.local_costmap,
        "collision monitor": topics.collision_monitor,
        "speed limit": topics.speed_limit,
    }
    return {names[report]: report for report in settings.record}


def report_subscriptions(settings: Ros2Keys) -> Iterator[TopicSetup]:
    """Yield the subscriptions for these topics."""
    for topic, report in report_topics(settings).items():
        kind = REPORT_TOPICS[report][1]
        if report == "behavior tree":
            yield TopicSetup(topic, kind, depth=_TREE_DEPTH, keep="all")
        else:
            # Costmaps are latched, because an unchanged one is sent once, perhaps before the run.
            yield TopicSetup(topic, kind, "latched" if kind == COSTMAP else "reliable", 1)


def _read_report(
    report: ReportName, message: ReceivedMessage, now: float, frames: Ros2Frames
) -> StackReport:
    """Read a report that came at ``now`` [s].

    Raises ``ValueError`` for a damaged message, and for a costmap in a frame other than those of
    the map and of odometry.
    """
    names: dict[str, Literal["map", "odom"]] = {frames.map: "map", frames.odom: "odom"}
    try:
        if report in _DECODERS:
            return _DECODERS[report](message.data, now)
        scope: Literal["local", "global"] = "local" if report == "local costmap" else "global"
        return decode_costmap(message.data, now, scope, names)
    except ValueError:
        raise
    except Exception as error:
        # rosbags reads damaged bytes with struct, numpy and its own code.
        raise ValueError(f"a damaged {message.kind}: {error}") from error
