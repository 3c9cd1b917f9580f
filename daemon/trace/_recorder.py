"""Recorder of a run: turns calls of the engine into samples and messages.

:class:`~daemon.trace.TraceWriter` collects them in a trace, :class:`MessageStream` sends them at
once for a live world, with the same topics, types and bytes.
"""

from __future__ import annotations

import functools
import math
from abc import ABC, abstractmethod
from array import array
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from daemon.model import ros_messages as ros
from daemon.model.spec import RunSpec
from daemon.model.stack_reports import (
    REPORT_TOPICS,
    ReportName,
    encode_collision,
    encode_speed_limit,
    encode_tree_log,
)
from daemon.model.sut import (
    BehaviorTreeLog,
    Cloud,
    CollisionMonitorState,
    CostmapPicture,
    Estimate,
    Odometry,
    Progress,
    SpeedLimit,
    StackReport,
)
from daemon.trace import _statics, messages
from daemon.trace._signals import SampledSignal, contact_signal, run_signals
from daemon.trace._views import encode_costmap, encode_path, encode_poses, thin_plan
from daemon.trace.layouts import HEADER
from grammars.model.geometry import Floats, Point2, Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene

_TEXT_LIMIT: Final = 10_000
_LATCHED: Final = frozenset(topic.name for topic in messages.TOPICS if topic.latched)

Correction: TypeAlias = tuple[float, float, float, float]
"""x, y [m], qz, qw of odom in map."""


# Close to twenty methods on purpose: the interface has one per recorded quantity.
class Recorder(ABC):
    """Recorder of one run. Times are simulated seconds, and calls are in the order of events.

    Values of the wrong shape raise ``ValueError``.
    """

    def __init__(self, spec: RunSpec, scene: Scene) -> None:
        self._spec, self._scene = spec, scene
        self._signals = run_signals(spec.robot, scene)
        self._scans = {
            laser.name: self._signals[messages.scan_topic(laser)] for laser in spec.robot.lasers
        }
        self._contacts: dict[tuple[str, str], SampledSignal] = {}
        self._goals = messages.goal_ids(spec.digest, spec.mission)
        self._corrections = _MapCorrection(spec.mission.start)
        self._progress = Progress(-1, -1, "active")

    @abstractmethod
    def _sample(self, signal: SampledSignal, time: float, values: Sequence[Any]) -> None:
        """Record a sample of a signal."""

    @abstractmethod
    def _message(self, topic: str, time: float, encode: Callable[[int], bytes]) -> None:
        """Record a message; ``encode`` returns its CDR for a time [ns]."""

    @abstractmethod
    def _latch(self, payloads: Mapping[str, bytes]) -> None:
        """Record the latched messages, by topic."""

    def static(self, grid: OccupancyGrid) -> None:
        """Record the latched messages and the first progress, at time 0."""
        grid_map = ros.serialize(ros.occupancy_grid(grid), messages.KINDS["/map"])
        latched = _latched_payloads(self._scene, self._spec.robot, self._spec.mission)
        self._latch({"/map": grid_map, **latched})
        self.progress(0.0, Progress(0, 0, "active"))

    def clock(self, time: float) -> None:
        """Record the simulated time."""
        self._sample(self._signals["/clock"], time, ())

    def scan(self, time: float, ranges: npt.NDArray[np.float32], laser: str = "") -> None:
        """Record a scan of the laser of that name; ``ranges`` (rays,) float32."""
        if laser not in self._scans:
            raise ValueError(f"{self._spec.robot.name} has no laser {laser!r}")
        self._sample(self._scans[laser], time, (ranges,))

    def odometry(self, sample: Odometry) -> None:
        """Record an odometry sample, and odom -> base_link.

        The first one also sets map -> odom by the start of the mission, until there is an
        estimate.
        """
        pose, twist = sample.pose, sample.twist
        row = (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz)
        self._sample(self._signals["/odom"], sample.time, row)
        self._correct(sample.time, self._corrections.odometry(sample))

    def ground_truth(self, time: float, pose: Pose2, twist: Twist2) -> None:
        """Record the true pose in map and the true body twist."""
        row = (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz)
        self._sample(self._signals["/ground_truth"], time, row)

    def joints(self, time: float, positions: Floats, velocities: Floats) -> None:
        """Record all joints (k,) in the order of ``scene.joint_names``, and their frames."""
        self._sample(self._signals["/joint_states"], time, (positions, velocities))

    def command(self, time: float, twist: Twist2) -> None:
        """Record a velocity command in the body frame."""
        values: Sequence[float]
        values = vx, vy, wz = twist.vx, twist.vy, twist.wz
        if not (type(vx) is type(vy) is type(wz) is float):
            # A system under test may give other types: raise now and not with the chunk.
            values = array("d", values)
        self._sample(self._signals["/cmd_vel"], time, values)

    def estimate(self, estimate: Estimate) -> None:
        """Record a pose estimate, and map -> odom from it and odometry of the same time."""
        row = _belief(estimate.pose, estimate.covariance)
        self._sample(self._signals["/pose"], estimate.time, row)
        self._correct(estimate.time, self._corrections.estimate(estimate))

    def cloud(self, cloud: Cloud) -> None:
        """Record the summary of a particle cloud and the number of particles."""
        row = (*_belief(cloud.mean, cloud.covariance), float(cloud.count))
        self._sample(self._signals["/particle_cloud/summary"], cloud.time, row)

    def plan(self, time: float, points: Floats) -> None:
        """Record a global plan (n, 2) in map."""
        thin = thin_plan(points)
        self._message("/plan", time, lambda now: encode_path(now, thin))

    def local_plan(self, time: float, points: Floats) -> None:
        """Record a local plan (n, 2) in map."""
        self._message("/local_plan", time, lambda now: encode_path(now, points))

    def particles(self, time: float, poses: Floats) -> None:
        """Record particles (n, 3) of x, y, yaw in map."""
        self._message(messages.PARTICLES, time, lambda now: encode_poses(now, poses))

    def costmap(self, picture: CostmapPicture) -> None:
        """Record a costmap."""
        self._message(messages.COSTMAP, picture.time, lambda now: encode_costmap(now, picture))

    def report(self, report: StackReport) -> None:
        """Record a report of a stack; the file of the stack must list it."""
        match report:
            case BehaviorTreeLog() as log:
                self._report("behavior tree", log.time, lambda now: encode_tree_log(now, log))
            case CollisionMonitorState() as state:
                self._report("collision monitor", state.time, lambda _: encode_collision(state))
            case SpeedLimit() as limit:
                self._report("speed limit", limit.time, lambda now: encode_speed_limit(now, limit))
            case CostmapPicture() as picture:
                name: ReportName = "local costmap" if picture.scope == "local" else "global costmap"
                self._report(name, picture.time, lambda now: encode_costmap(now, picture))

    def _report(self, name: ReportName, time: float, encode: Callable[[int], bytes]) -> None:
        if name not in self._spec.sut.recorded:
            raise ValueError(f'its file does not ask to record "{name}"')
        self._message(REPORT_TOPICS[name][0], time, encode)

    def progress(self, time: float, progress: Progress) -> None:
        """Record the state of the mission if it has changed, and the current waypoint."""
        if progress == self._progress:
            return
        status = ros.serialize(messages.status(self._goals, progress), messages.STATUS)
        self._message("/mission/status", time, lambda _: status)
        waypoints = self._spec.mission.waypoints
        moved = progress.current != self._progress.current
        if moved and 0 <= progress.current < len(waypoints):
            target = waypoints[progress.current]
            self._message("/mission/goal", time, lambda now: messages.goal(target, now))
        self._progress = progress

    def contact(
        self, time: float, first: str, second: str, point: Point2, normal: Point2, depth: float
    ) -> None:
        """Record a contact of two bodies; ``normal`` points from first to second, in map."""
        row = (point[0], point[1], normal[0], normal[1], depth)
        signal = self._contacts.get((first, second))
        if signal is None:
            signal = self._contacts[first, second] = contact_signal(first, second)
        self._sample(signal, time, row)

    def event(self, time: float, source: str, text: str, *, level: str = "info") -> None:
        """Record a sentence for the log; ``level`` is debug, info, warn, error or fatal."""
        self._message("/events", time, lambda now: _log_payload(now, source, text, level))

    def latency(self, time: float, seconds: float) -> None:
        """Record the wall time of an external system's answer [s].

        Repeatable runs record none, because two of them must not differ.
        """
        if not self._spec.sut.repeatable:
            self._sample(self._signals["/sut/latency"], time, (seconds,))

    def _correct(self, time: float, correction: Correction | None) -> None:
        if correction is not None:
            self._sample(self._signals["/tf"], time, correction)


class MessageStream(Recorder):
    """Recorder that sends every message as topic, time [ns] and CDR, in the order of time.

    It sends clock, joints, plans and costmaps at the rate of the calls. ``is_wanted`` tells for a
    topic whether to make and send its message; latched ones are always sent.
    """

    def __init__(
        self,
        spec: RunSpec,
        scene: Scene,
        send: Callable[[str, int, bytes], None],
        is_wanted: Callable[[str], bool],
    ) -> None:
        super().__init__(spec, scene)
        self._send, self._is_wanted = send, is_wanted

    def _sample(self, signal: SampledSignal, time: float, values: Sequence[Any]) -> None:
        if any(map(self._is_wanted, signal.topics)):
            now = nanoseconds(time)
            signal.add(now, values)
            signal.keep_last()
            for layout, times, columns in signal.messages():
                if self._is_wanted(layout.topic):
                    # A layout describes a record of a file: a header, then the message.
                    for row in layout.encode(0, times, columns)[:, HEADER.size :]:
                        self._send(layout.topic, now, row.tobytes())

    def _message(self, topic: str, time: float, encode: Callable[[int], bytes]) -> None:
        if topic in _LATCHED or self._is_wanted(topic):
            now = nanoseconds(time)
            self._send(topic, now, encode(now))

    def _latch(self, payloads: Mapping[str, bytes]) -> None:
        for topic, payload in payloads.items():
            self._send(topic, 0, payload)


class _MapCorrection:
    """Latest odometry, and map -> odom from it and pose estimates.

    ``start`` is the start of the mission and counts until there is an estimate.
    """

    def __init__(self, start: Pose2) -> None:
        self._start = start
        # Three seconds at 20 Hz: the stamp of an estimate is that of its scan, a few samples ago.
        self._odometers: deque[Odometry] = deque(maxlen=64)
        self._localised = False

    def odometry(self, sample: Odometry) -> Correction | None:
        """Store a sample; return the correction by the start for the first one, else ``None``."""
        self._odometers.append(sample)
        if self._localised:
            return None
        return self._correct(self._start, sample.pose)

    def estimate(self, estimate: Estimate) -> Correction | None:
        """Return the correction by an estimate and the odometry at its time.

        ``None`` for a pose that is not a number: viewers keep the previous frame.
        """
        return self._correct(estimate.pose, self._odometer_at(estimate.time))

    def _odometer_at(self, time: float) -> Pose2:
        """Return base_link in odom, extrapolated by the twist of the last sample."""
        for sample in reversed(self._odometers):
            if sample.time <= time:
                since, twist = time - sample.time, sample.twist
                way = Pose2(since * twist.vx, since * twist.vy, since * twist.wz)
                return sample.pose @ way if since > 0.0 else sample.pose
        return Pose2()

    def _correct(self, pose: Pose2, odometry: Pose2) -> Correction | None:
        """Return map -> odom such that ``odometry`` (base in odom) lies at ``pose`` in map."""
        self._localised = True
        turn = pose.yaw - odometry.yaw
        if not math.isfinite(turn):
            return None
        qz, qw = ros.yaw_quaternion(math.remainder(turn, math.tau))
        c, s = qw * qw - qz * qz, 2.0 * qz * qw
        x = pose.x - c * odometry.x + s * odometry.y
        y = pose.y - s * odometry.x - c * odometry.y
        return x, y, qz, qw


def nanoseconds(time: float) -> int:
    """Return a simulated time [s] in nanoseconds."""
    # Times are multiples of 10 or 1 ms as binary floats; rounding makes them exact.
    return int(time * 1e9 + 0.5)


def utf8_text(text: str) -> str:
    """Return text within the limit of length and without code points that UTF-8 cannot encode."""
    if len(text) > _TEXT_LIMIT:
        text = text[: _TEXT_LIMIT - 1] + "…"
    return text.encode("utf-8", "backslashreplace").decode()


@functools.lru_cache(maxsize=4)
def _latched_payloads(scene: Scene, robot: Robot, course: Mission) -> dict[str, bytes]:
    """Return the payloads of the latched topics except the map, equal for every repeat."""
    latched = {
        "/footprint": _statics.footprint(robot),
        "/tf_static": _statics.fixed_frames(robot, scene),
        "/scene": _statics.markers(scene, course),
    }
    return {topic: ros.serialize(m, messages.KINDS[topic]) for topic, m in latched.items()}


def _log_payload(now: int, source: str, text: str, level: str) -> bytes:
    """Return a message of the log at ``now`` [ns]; raises ``ValueError`` for another level."""
    if level not in messages.LEVELS:
        levels = ", ".join(messages.LEVELS)
        raise ValueError(f"the level of an event is one of {levels}, not {level!r}")
    message = ros.make(
        "rcl_interfaces/msg/Log",
        stamp=ros.time(now), level=messages.LEVELS[level],
        name=utf8_text(source), msg=utf8_text(text),
        file="", function="", line=0,
    )  # fmt: skip
    return ros.serialize(message, messages.KINDS["/events"])


def _belief(pose: Pose2, covariance: Floats) -> tuple[float, ...]:
    """Return pose and covariance (3, 3) in the order of an estimate's layout."""
    if covariance.shape != (3, 3):
        raise ValueError(f"a covariance must have shape (3, 3), not {covariance.shape}")
    return (pose.x, pose.y, *ros.yaw_quaternion(pose.yaw), *covariance.ravel().tolist())
