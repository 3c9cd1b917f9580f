"""The messages of a trace one at a time, as they happen: for those who listen to a live world.

The same calls as :class:`~daemon.trace.TraceWriter` takes, the same topics, types and bytes; only
nothing is collected, so clock, joints, plans and costmaps come as often as they are told.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from daemon.model import ros_messages as ros
from daemon.model.spec import RunSpec
from daemon.model.sut import Cloud, CostmapPicture, Estimate, Odometry, Progress
from daemon.trace import layouts, messages
from daemon.trace._frames import Correction, MapCorrection
from daemon.trace._signals import COVARIANCE, DOOR_PERIOD, POSE, TWIST
from daemon.trace._statics import MovingLinks
from daemon.trace._views import (
    COSTMAP,
    PARTICLES,
    encode_costmap,
    encode_path,
    encode_poses,
    thin_plan,
)
from daemon.trace._writer import estimate_columns, latched_payloads, log_payload
from daemon.trace.layouts import HEADER, MessageLayout
from grammars.model.geometry import Floats, Point2, Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.scene import Scene


# As many methods as there are things to tell: this is what a run says, see TraceWriter.
class Recorder(Protocol):
    """What a run is told to, see :class:`~daemon.trace.TraceWriter`; times in simulated seconds."""

    def static(self, grid: OccupancyGrid) -> None: ...
    def clock(self, time: float) -> None: ...
    def scan(self, time: float, ranges: npt.NDArray[np.float32], laser: str = "") -> None: ...
    def odometry(self, sample: Odometry) -> None: ...
    def ground_truth(self, time: float, pose: Pose2, twist: Twist2) -> None: ...
    def joints(self, time: float, positions: Floats, velocities: Floats) -> None: ...
    def command(self, time: float, twist: Twist2) -> None: ...
    def estimate(self, estimate: Estimate) -> None: ...
    def cloud(self, cloud: Cloud) -> None: ...
    def plan(self, time: float, points: Floats) -> None: ...
    def local_plan(self, time: float, points: Floats) -> None: ...
    def particles(self, time: float, poses: Floats) -> None: ...
    def costmap(self, picture: CostmapPicture) -> None: ...
    def progress(self, time: float, progress: Progress) -> None: ...
    def contact(
        self, time: float, first: str, second: str, point: Point2, normal: Point2, depth: float
    ) -> None: ...
    def event(self, time: float, source: str, text: str, *, level: str = "info") -> None: ...
    def latency(self, time: float, seconds: float) -> None: ...


class MessageStream:
    """Hands over every message as topic, time [ns] and CDR, in the order of time.

    ``wanted`` is asked before a message of a topic is made; latched ones are always made.
    """

    def __init__(
        self,
        spec: RunSpec,
        scene: Scene,
        send: Callable[[str, int, bytes], None],
        wanted: Callable[[str], bool] = lambda _: True,
    ) -> None:
        self._spec, self._scene = spec, scene
        self._send, self._wanted = send, wanted
        self._lasers = {laser.name: laser for laser in spec.robot.lasers}
        self._goals = messages.goal_ids(spec.digest, spec.mission)
        self._moving = MovingLinks.of(scene)
        self._frames = MapCorrection(spec.mission.start)
        self._progress: Progress | None = None
        self._doors_due = 0

    def static(self, grid: OccupancyGrid) -> None:
        """Hand over what holds as long as the world does."""
        self._send("/map", 0, ros.serialize(ros.occupancy_grid(grid), messages.KINDS["/map"]))
        latched = latched_payloads(self._scene, self._spec.robot, self._spec.mission)
        for topic, payload in latched:
            self._send(topic, 0, payload)
        self.progress(0.0, Progress(0, 0, "active"))

    def clock(self, time: float) -> None:
        """Hand over the simulated time."""
        self._sample("/clock", time, layouts.clock(), (), ())

    def scan(self, time: float, ranges: npt.NDArray[np.float32], laser: str = "") -> None:
        """Hand over a scan of the laser of that name; ``ranges`` (rays,) float32."""
        layout = layouts.scan(self._lasers[laser])
        self._sample(layout.topic, time, layout, ("ranges",), (ranges,))

    def odometry(self, sample: Odometry) -> None:
        """Hand over an odometry sample, odom -> base_link and, the first time, map -> odom."""
        row = _moving_columns(sample.pose, sample.twist)
        layout = layouts.odometry("/odom", "odom")
        self._sample("/odom", sample.time, layout, POSE + TWIST, row)
        self._transform(sample.time, "odom", "base_link", row[:4])
        self._correct(sample.time, self._frames.odometry(sample))

    def ground_truth(self, time: float, pose: Pose2, twist: Twist2) -> None:
        """Hand over the true pose in map and the true body twist."""
        layout = layouts.odometry("/ground_truth", "map")
        self._sample("/ground_truth", time, layout, POSE + TWIST, _moving_columns(pose, twist))

    def joints(self, time: float, positions: Floats, velocities: Floats) -> None:
        """Hand over all joints (k,), and where the links are that they move."""
        names = self._scene.joint_names
        if not names:
            return
        layout = layouts.joints(names)
        row = (positions, velocities)
        self._sample("/joint_states", time, layout, ("position", "velocity"), row)
        now = _nanoseconds(time)
        if now >= self._doors_due and self._moving.names and self._wanted("/tf"):
            self._doors_due = now + DOOR_PERIOD
            poses = self._moving.poses(positions.reshape(1, -1))[0]
            columns = [f"{name}{i}" for i in range(len(poses)) for name in POSE]
            layout = layouts.transforms(tuple(("map", name) for name in self._moving.names))
            self._sample("/tf", time, layout, columns, poses.ravel().tolist())

    def command(self, time: float, twist: Twist2) -> None:
        """Hand over a velocity command that the robot follows."""
        row = (twist.vx, twist.vy, twist.wz)
        self._sample("/cmd_vel", time, layouts.command(), TWIST, row)

    def estimate(self, estimate: Estimate) -> None:
        """Hand over a pose estimate, and map -> odom as it follows."""
        row = estimate_columns(estimate.pose, estimate.covariance)
        layout = layouts.estimate("/pose")
        self._sample("/pose", estimate.time, layout, POSE + COVARIANCE, row)
        self._correct(estimate.time, self._frames.estimate(estimate))

    def cloud(self, cloud: Cloud) -> None:
        """Hand over the summary of a particle cloud and the number of particles."""
        row = estimate_columns(cloud.mean, cloud.covariance)
        layout = layouts.estimate("/particle_cloud/summary")
        self._sample("/particle_cloud/summary", cloud.time, layout, POSE + COVARIANCE, row)
        count = (cloud.count,)
        self._sample("/particle_cloud/count", cloud.time, layouts.count(), ("count",), count)

    def plan(self, time: float, points: Floats) -> None:
        """Hand over a global plan (n, 2) in map, thinned as in a trace."""
        self._made("/plan", time, lambda now: encode_path(now, thin_plan(points)))

    def local_plan(self, time: float, points: Floats) -> None:
        """Hand over a local plan (n, 2) in map."""
        self._made("/local_plan", time, lambda now: encode_path(now, points))

    def particles(self, time: float, poses: Floats) -> None:
        """Hand over particles (n, 3) of x, y, yaw in map."""
        self._made(PARTICLES, time, lambda now: encode_poses(now, poses))

    def costmap(self, picture: CostmapPicture) -> None:
        """Hand over a costmap."""
        self._made(COSTMAP, picture.time, lambda now: encode_costmap(now, picture))

    def progress(self, time: float, progress: Progress) -> None:
        """Hand over where the mission stands when that has changed, and the current waypoint."""
        before, self._progress = self._progress, progress
        if progress == before:
            return
        now, waypoints = _nanoseconds(time), self._spec.mission.waypoints
        status = messages.status(self._goals, progress)
        self._send("/mission/status", now, ros.serialize(status, messages.STATUS))
        moved = before is None or progress.current != before.current
        if moved and 0 <= progress.current < len(waypoints):
            target = messages.goal(waypoints[progress.current], now)
            kind = messages.KINDS["/mission/goal"]
            self._send("/mission/goal", now, ros.serialize(target, kind))

    def contact(
        self, time: float, first: str, second: str, point: Point2, normal: Point2, depth: float
    ) -> None:
        """Hand over two bodies touching; ``normal`` points from first to second, in map."""
        names = ("px", "py", "nx", "ny", "depth")
        row = (*point, *normal, depth)
        self._sample("/contacts", time, layouts.contact(first, second), names, row)

    def event(self, time: float, source: str, text: str, *, level: str = "info") -> None:
        """Hand over a sentence for the log."""
        self._made("/events", time, lambda now: log_payload(now, source, text, level))

    def latency(self, time: float, seconds: float) -> None:
        """Hand over how long a system that is not repeatable took to answer [s of wall clock]."""
        if not self._spec.sut.repeatable:
            self._sample("/sut/latency", time, layouts.latency(), ("seconds",), (seconds,))

    def _sample(
        self, topic: str, time: float, layout: MessageLayout, names: Sequence[str],
        values: Sequence[Any],
    ) -> None:  # fmt: skip
        if not self._wanted(topic):
            return
        now = _nanoseconds(time)
        row = layout.encode(0, np.array([now]), dict(zip(names, values, strict=True)))[0]
        # A layout is that of a record in a file; the message is what follows the record's head.
        self._send(topic, now, row[HEADER.size :].tobytes())

    def _made(self, topic: str, time: float, encode: Callable[[int], bytes]) -> None:
        if self._wanted(topic):
            now = _nanoseconds(time)
            self._send(topic, now, encode(now))

    def _transform(self, time: float, parent: str, child: str, row: Sequence[float]) -> None:
        columns = [f"{name}0" for name in POSE]
        self._sample("/tf", time, layouts.transforms(((parent, child),)), columns, row)

    def _correct(self, time: float, correction: Correction | None) -> None:
        if correction is not None:
            self._transform(time, "map", "odom", correction)


def _moving_columns(pose: Pose2, twist: Twist2) -> tuple[float, ...]:
    return (pose.x, pose.y, *ros.yaw_quaternion(pose.yaw), twist.vx, twist.vy, twist.wz)


def _nanoseconds(time: float) -> int:
    # Times are multiples of 10 or of 1 ms in binary floats; rounding makes them whole again.
    return int(time * 1e9 + 0.5)
