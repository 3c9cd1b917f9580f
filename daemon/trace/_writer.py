"""Recording a run as MCAP: ROS 2 messages in CDR, simulated time only, same calls same bytes.

Messages lie in the order of time, in the file as in its index, so that it can be played from a
pipe: what may still be followed by something earlier (a plan that waits, an estimate that took a
while) waits for the next chunk. What need not be written is left out where readers lose nothing:
joint states that repeat (see :class:`~daemon.trace.JointSamples`), clock ticks
and door frames beyond 10 Hz, local plans beyond 5 Hz, plans, particles and costmaps beyond 1 Hz
(see :class:`~daemon.trace._views.ViewerMessages`), plans and progress that did not change.
"""

from __future__ import annotations

import functools
import hashlib
import math
import os
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Final

import numpy as np
import numpy.typing as npt
import zstandard

from daemon.model import ros_messages as ros
from daemon.model.spec import RunSpec, TraceInfo
from daemon.model.sut import Cloud, CostmapPicture, Estimate, Odometry, Progress
from daemon.trace import _statics, messages
from daemon.trace._blocks import MessageBlock, MessageRecords, SampleColumns, split_blocks
from daemon.trace._frames import Correction, MapCorrection
from daemon.trace._mcap_writer import McapWriter
from daemon.trace._model import Trace
from daemon.trace._reader import GrowingTrace
from daemon.trace._signals import SignalBuffers
from grammars.model.geometry import Floats, Point2, Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.text import codec
from grammars.text.files import sync_directory

PARTIAL: Final = ".partial"
"""Added to the name of a trace while it is written, and left there when its writer dies."""

_SECOND: Final = 1_000_000_000
_CHUNK: Final = 10 * _SECOND
"""What a chunk covers [ns]."""
_LATEST_ARRIVAL: Final = 1_200_000_000
"""How long after its time a message is recorded at most [ns] to have its place in the order: plans
wait for a second and the next tick of the clock, estimates come within a tenth of one. Chunk and
this are lost when a writer dies, and how far behind somebody is who judges a run as it goes on."""
_EVENT_BYTES: Final = 8 << 20
"""Events waiting for their chunk [bytes]; a system that talks without end must not fill memory.
Those of the latest arrival's time go on waiting."""
_CLOCK_PERIOD: Final = _SECOND // 10
_LATEST: Final = 2.0**31
"""ROS 2 keeps seconds in an int32 [s]."""
_TEXT_LIMIT: Final = 10_000
_CONTACT: Final = ("px", "py", "nx", "ny", "depth")


# More than twenty methods, and on purpose: one per thing that is recorded is its interface.
class TraceWriter:
    """Writes one trace; a context manager.

    Times are simulated seconds in [0, 2**31); calls come in the order things happen. The file
    appears under its name when :meth:`publish` or :meth:`close` return; leaving the context
    without them (or dying) leaves a ``.partial`` file, readable up to the last complete chunk.
    Values of the wrong shape, times out of range and a scene that is not the specified one raise
    ``ValueError``.
    """

    def __init__(
        self, path: Path, spec: RunSpec, scene: Scene, *, versions: Mapping[str, str] | None = None
    ) -> None:
        topics = messages.topics_of(spec.robot)
        self._ids = {topic.name: number for number, topic in enumerate(topics, start=1)}
        self._signals = SignalBuffers(scene, spec.robot.lasers, self._ids)
        self._goals = messages.goal_ids(spec.digest, spec.mission)
        packed = _compress_scene(scene, spec.scene)
        self._spec, self._scene = spec, scene
        self._frames = MapCorrection(spec.mission.start)
        self._progress_last = Progress(-1, -1, "active")
        self._clock_due = 0
        self._due = _CHUNK
        self._late: list[MessageBlock] = []
        self._time, self._now = math.nan, 0
        self._path, self._partial = path, path.with_name(path.name + PARTIAL)
        # What a writer that died left behind. One that still lives, because it was only taken for
        # dead, keeps writing into a file without a name; see _publish.
        self._partial.unlink(missing_ok=True)
        self._file = self._partial.open("xb")
        self._container = McapWriter(self._file)
        self._growing: GrowingTrace | None = None
        _write_preamble(self._container, spec, packed, versions or {})

    def static(self, grid: OccupancyGrid) -> None:
        """Write everything that holds for the whole run, at time 0."""
        latched = latched_payloads(self._scene, self._spec.robot, self._spec.mission)
        drawn = ros.serialize(ros.occupancy_grid(grid), messages.KINDS["/map"])
        blocks = []
        for topic, payload in (("/map", drawn), *latched):
            records = MessageRecords(self._ids[topic])
            records.add(0, payload)
            blocks.append(records.drain())
        self._container.add_chunk(blocks)
        self.progress(0.0, Progress(0, 0, "active"))

    def clock(self, time: float) -> None:
        """Record the simulated time; more than ten times a second are left out."""
        now = self._at(time)
        if now >= self._clock_due:
            self._signals.clock.add(now, ())
            self._clock_due = now + _CLOCK_PERIOD
            # A plan that waits for its second to be over has nothing else to wake it.
            self._signals.views.flush(now)

    def scan(self, time: float, ranges: npt.NDArray[np.float32], laser: str = "") -> None:
        """Record a scan of the laser of that name; ``ranges`` (rays,) float32."""
        now = self._at(time)
        if laser not in self._signals.scans:
            raise ValueError(f"{self._spec.robot.name} has no laser {laser!r}")
        self._signals.scans[laser].add(now, ranges)

    def odometry(self, sample: Odometry) -> None:
        """Record an odometry sample, and odom -> base_link.

        The first one also fixes map -> odom by the pose the mission starts at, which holds
        until there is an estimate.
        """
        now = self._at(sample.time)
        pose, twist = sample.pose, sample.twist
        self._signals.odometry.add(now, (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz))
        self._correct(now, self._frames.odometry(sample))

    def ground_truth(self, time: float, pose: Pose2, twist: Twist2) -> None:
        """Record the true pose in map and the true body twist."""
        now = self._at(time)
        self._signals.truth.add(now, (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz))

    def joints(self, time: float, positions: Floats, velocities: Floats) -> None:
        """Record all joints (k,) in the order of ``scene.joint_names``; repeats are thinned."""
        self._signals.joints.add(self._at(time), positions, velocities)

    def command(self, time: float, twist: Twist2) -> None:
        """Record a velocity command in the body frame."""
        values: Sequence[float]
        values = vx, vy, wz = twist.vx, twist.vy, twist.wz
        if not (type(vx) is type(vy) is type(wz) is float):
            # From a system under test: what is no number is refused now and not with its chunk.
            values = array("d", values)
        self._signals.command.add(self._at(time), values)

    def estimate(self, estimate: Estimate) -> None:
        """Record a pose estimate, and map -> odom as it follows from odometry at that time."""
        now = self._at(estimate.time)
        self._signals.estimate.add(now, estimate_columns(estimate.pose, estimate.covariance))
        self._correct(now, self._frames.estimate(estimate))

    def cloud(self, cloud: Cloud) -> None:
        """Record the summary of a particle cloud and the number of particles."""
        now = self._at(cloud.time)
        belief = estimate_columns(cloud.mean, cloud.covariance)
        self._signals.cloud.add(now, (*belief, float(cloud.count)))

    def plan(self, time: float, points: Floats) -> None:
        """Record a global plan (n, 2) in map when it has changed, at most one a second."""
        self._signals.views.plan(self._at(time), points)

    def local_plan(self, time: float, points: Floats) -> None:
        """Record a local plan (n, 2) in map; more than five a second are left out."""
        self._signals.views.local_plan(self._at(time), points)

    def particles(self, time: float, poses: Floats) -> None:
        """Record particles (n, 3) of x, y, yaw in map; more than once a second is left out."""
        self._signals.views.particles(self._at(time), poses)

    def costmap(self, picture: CostmapPicture) -> None:
        """Record a costmap; more than one a second is left out."""
        self._signals.views.costmap(self._at(picture.time), picture)

    def progress(self, time: float, progress: Progress) -> None:
        """Record where the mission stands when that has changed, and the current waypoint."""
        now = self._at(time)
        if progress == self._progress_last:
            return
        status = messages.status(self._goals, progress)
        self._signals.status.add(now, ros.serialize(status, messages.STATUS))
        waypoints = self._spec.mission.waypoints
        moved = progress.current != self._progress_last.current
        if moved and 0 <= progress.current < len(waypoints):
            target = messages.goal(waypoints[progress.current], now)
            self._signals.goal.add(now, ros.serialize(target, messages.KINDS["/mission/goal"]))
        self._progress_last = progress

    def contact(
        self, time: float, first: str, second: str, point: Point2, normal: Point2, depth: float
    ) -> None:
        """Record two bodies touching; ``normal`` points from first to second, in map."""
        now = self._at(time)
        columns = self._signals.contacts.get((first, second))
        if columns is None:
            columns = self._signals.contacts[first, second] = SampleColumns(_CONTACT)
        columns.add(now, (point[0], point[1], normal[0], normal[1], depth))

    def event(self, time: float, source: str, text: str, *, level: str = "info") -> None:
        """Record a sentence for the log; ``level`` is debug, info, warn, error or fatal."""
        now = self._at(time)
        self._signals.events.add(now, log_payload(now, source, text, level))
        if self._signals.events.size > _EVENT_BYTES:
            self._flush(now - _LATEST_ARRIVAL)

    def latency(self, time: float, seconds: float) -> None:
        """Record how long an external system took to answer [s of wall clock].

        A repeatable run records none: the wall clock would be all that differs between two of them.
        """
        if not self._spec.sut.repeatable:
            self._signals.latency.add(self._at(time), (seconds,))

    def attach(self, name: str, data: bytes) -> None:
        """Put text that a system under test printed beside the messages."""
        self._container.add_attachment(f"{messages.OUTPUT_PREFIX}{name}", "text/plain", data)

    def so_far(self, ended: str | None = None, note: str = "") -> Trace:
        """Return what is recorded by now, as reading the file gives it, and leave that as it is.

        Without scans and plans. With ``ended`` and ``note`` the run is over, otherwise its trace is
        that of a run that was cut. The first call reads the file, the others what has come since.
        Raises :class:`TraceError` when another has written into the file.
        """
        if self._growing is None:
            self._growing = GrowingTrace(self._partial, self._spec, self._scene)
        self._file.flush()
        blocks = (*self._late, *self._signals.peek_judged())
        pending = [block for block in blocks if len(block.times)]
        last = max([self._container.last, *(int(block.times.max()) for block in pending)])
        return self._growing.read(pending, {} if ended is None else _outcome(ended, note, last))

    def finish(self, ended: str, note: str = "") -> Path:
        """Write how the run ended and return where the recording is read until it has its name.

        ``ended`` and ``note`` say why the run ended. Nothing more can be recorded.
        """
        self._signals.joints.keep_last_repeat()
        self._signals.views.flush(0, end=True)
        self._flush()
        outcome = _outcome(ended, note, self._container.last)
        self._container.add_metadata("outcome", outcome)
        self._container.finish()
        self._file.flush()
        return self._partial

    def add_verdicts(self, data: bytes) -> None:
        """Put the verdicts on a finished recording behind it, as ``verdicts.json``."""
        self._container.reopen()
        self._container.add_attachment(messages.VERDICTS, "application/json", data)
        self._container.finish()

    def publish(self) -> TraceInfo:
        """Give a finished recording its name."""
        self._file.flush()
        # Before the rename, or a power cut could leave the final name on an empty file.
        os.fsync(self._file.fileno())
        self._publish()
        container = self._container
        return TraceInfo(container.sha256, container.size, container.messages)

    def close(self, ended: str, note: str = "") -> TraceInfo:
        """Finish the recording and give it its name, without verdicts."""
        self.finish(ended, note)
        return self.publish()

    def _publish(self) -> None:
        """Rename the file; another writer of the same trace must not have taken its place."""
        mine = os.fstat(self._file.fileno())
        self._file.close()
        there = self._partial.stat()
        if (mine.st_dev, mine.st_ino) != (there.st_dev, there.st_ino):
            raise FileExistsError(f"{self._partial} is being written by another process")
        self._partial.replace(self._path)
        sync_directory(self._path.parent)

    def __enter__(self) -> TraceWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if not self._file.closed:
            with self._file:
                if not self._container.finished:
                    self._signals.joints.keep_last_repeat()
                    self._flush()

    def _at(self, time: float) -> int:
        """Return a time in nanoseconds; a chunk is written whenever ten seconds have passed."""
        if time == self._time:
            return self._now
        if not 0.0 <= time < _LATEST:
            raise ValueError(f"a recorded time must be in [0, 2**31) seconds, not {time!r}")
        # Times are multiples of 10 or of 1 ms in binary floats; rounding makes them whole again.
        now = int(time * 1e9 + 0.5)
        if now >= self._due:
            self._flush(now - _LATEST_ARRIVAL)
            self._due = (now // _CHUNK + 1) * _CHUNK
        # Most of what is recorded comes with others of its instant.
        self._time, self._now = time, now
        return now

    def _correct(self, now: int, correction: Correction | None) -> None:
        if correction is not None:
            self._signals.correction.add(now, correction)

    def _flush(self, before: int | None = None) -> None:
        """Write what is earlier than ``before`` [ns], or everything there is."""
        early, self._late = split_blocks([*self._late, *self._signals.drain()], before)
        self._container.add_chunk(early)
        self._file.flush()


def _outcome(ended: str, note: str, last: int) -> dict[str, str]:
    """Return what a trace says of its end; ``last`` [ns] is the time of its latest message."""
    return {
        "ended": utf8_text(ended),
        "complete": "true",
        "valid_until": repr(last / _SECOND),
        "note": utf8_text(note),
    }


def _write_preamble(
    container: McapWriter, spec: RunSpec, scene: bytes, versions: Mapping[str, str]
) -> None:
    """Declare the topics and write what identifies the run, ahead of everything recorded."""
    for topic in messages.topics_of(spec.robot):
        if topic.external and spec.sut.repeatable:
            continue
        qos = {"offered_qos_profiles": messages.latched_qos() if topic.latched else ""}
        container.add_channel(topic.name, topic.kind, ros.schema(topic.kind), qos)
    text = codec.to_json(spec)
    container.add_attachment("spec.json", "application/json", text)
    container.add_attachment("scene.json.zst", "application/zstd", scene)
    facts = {
        "digest": spec.digest,
        "sha256": hashlib.sha256(text).hexdigest(),
        "label": spec.label,
        "campaign": spec.campaign,
        "scenario": spec.scenario,
        "sut": spec.sut.name,
        "repeat": str(spec.repeat),
        "seed": str(spec.seed),
        "limit": repr(spec.limit),
        "scene": spec.scene,
        "robot": spec.robot.name,
        "mission": spec.mission.name,
    }
    container.add_metadata("run", facts)
    container.add_metadata("versions", {"engine": spec.engine, **dict(sorted(versions.items()))})


@functools.lru_cache(maxsize=4)
def latched_payloads(scene: Scene, robot: Robot, course: Mission) -> tuple[tuple[str, bytes], ...]:
    """Return the payloads of the latched topics but the map, the same for every repeat."""
    latched = {
        "/footprint": _statics.footprint(robot),
        "/tf_static": _statics.fixed_frames(robot, scene),
        "/scene": _statics.markers(scene, course),
    }
    return tuple((topic, ros.serialize(m, messages.KINDS[topic])) for topic, m in latched.items())


def _compress_scene(scene: Scene, digest: str) -> bytes:
    """Return the scene's canonical JSON, compressed; it must be the one the run specifies."""
    data = codec.to_json(scene)
    found = hashlib.sha256(data).hexdigest()
    if found != digest:
        raise ValueError(f"scene {found[:12]} given, {digest[:12]} specified")
    return _compressed(data)


# Level 9 and not 1 as for messages: once per scene and process, while every trace carries it.
@functools.lru_cache(maxsize=4)
def _compressed(data: bytes) -> bytes:
    return zstandard.ZstdCompressor(level=9).compress(data)


def log_payload(now: int, source: str, text: str, level: str) -> bytes:
    """Return a sentence for the log at ``now`` [ns]; raises ``ValueError`` for another level."""
    if level not in messages.LEVELS:
        known = ", ".join(messages.LEVELS)
        raise ValueError(f"the level of an event is one of {known}, not {level!r}")
    message = ros.make(
        "rcl_interfaces/msg/Log",
        stamp=ros.time(now), level=messages.LEVELS[level],
        name=utf8_text(source), msg=utf8_text(text),
        file="", function="", line=0,
    )  # fmt: skip
    return ros.serialize(message, messages.KINDS["/events"])


def estimate_columns(pose: Pose2, covariance: Floats) -> tuple[float, ...]:
    """Return pose and covariance (3, 3) as an estimate's layout names them, in its order."""
    if covariance.shape != (3, 3):
        raise ValueError(f"a covariance must have shape (3, 3), not {covariance.shape}")
    return (pose.x, pose.y, *ros.yaw_quaternion(pose.yaw), *covariance.ravel().tolist())


def utf8_text(text: str) -> str:
    """Return text that UTF-8 can hold (what a crashed program says may not be), not endless."""
    if len(text) > _TEXT_LIMIT:
        text = text[: _TEXT_LIMIT - 1] + "…"
    return text.encode("utf-8", "backslashreplace").decode()
