"""Decoder of runs of message records into tracks and records."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from daemon.model import ros_messages as ros
from daemon.model.stack_reports import (
    REPORT_TOPICS,
    decode_collision,
    decode_costmap,
    decode_speed_limit,
    decode_tree_log,
)
from daemon.model.sut import BehaviorTreeLog, CollisionMonitorState, CostmapPicture, SpeedLimit
from daemon.trace import layouts, messages
from daemon.trace._mcap_reader import RECORD_STEPS, DamagedTraceError, McapContents
from daemon.trace._model import (
    CommandTrack,
    ContactRecord,
    EventRecord,
    JointTrack,
    LatencyTrack,
    MotionTrack,
    PlanRecord,
    PoseTrack,
    ProgressRecord,
    ScanTrack,
)
from daemon.trace._views import decode_path
from daemon.trace.layouts import HEADER, ByteArray, MessageLayout
from grammars.model.geometry import Floats
from grammars.model.robot import Laser

Fields = dict[str, npt.NDArray[Any]]
T = TypeVar("T")

_RARE_LIMIT: Final = 1 << 20
"""Largest message for rosbags [bytes]; ours cut texts at ten thousand characters."""
_LEVELS: Final = {number: level for level, number in messages.LEVELS.items()}

Track = TypeVar("Track", MotionTrack, CommandTrack, PoseTrack, LatencyTrack, JointTrack, ScanTrack)


def track(
    recording: McapContents, kind: type[Track], layout: MessageLayout, **constants: Any
) -> Track:
    """Decode the messages of a layout as a track with some ``constants``.

    The other fields come from the messages, ``time`` [s], ``yaw`` and ``covariance``.
    """
    columns = _fields(recording, layout)
    columns["time"] = columns["log_time"] / 1e9
    if "qz" in columns:
        columns["yaw"] = _yaw(columns)
    if "c0" in columns:
        covariance = np.stack([columns[f"c{i}"] for i in range(9)], axis=1)
        columns["covariance"] = covariance.reshape(-1, 3, 3)
    values: dict[str, Any] = {each.name: columns.get(each.name) for each in fields(kind)}
    return kind(**values | constants)


def cloud_count(recording: McapContents) -> npt.NDArray[np.int64]:
    """Decode ``/particle_cloud/count``."""
    return _fields(recording, layouts.count())["count"].astype(np.int64)


def joints(recording: McapContents, names: tuple[str, ...]) -> JointTrack:
    """Decode ``/joint_states``; empty for a scene without joints."""
    if not names:
        nothing = np.empty((0, 0))
        return JointTrack((), np.empty(0), nothing, nothing)
    return track(recording, JointTrack, layouts.joints(names), names=names)


def scans(recording: McapContents, laser: Laser) -> ScanTrack:
    """Decode the scans of a laser."""
    rows = recording.runs.get(messages.scan_topic(laser), [])
    if not rows:
        nothing = np.empty((0, max(laser.rays, 0)), np.float32)
        return ScanTrack(np.empty(0), nothing, laser.name)
    if not 0 < 4 * laser.rays < rows[0].shape[1] or not laser.rate > 0:
        raise DamagedTraceError("scans of another size than the robot's laser makes")
    return track(recording, ScanTrack, layouts.scan(laser), laser=laser.name)


def contacts(recording: McapContents) -> tuple[ContactRecord, ...]:
    """Decode ``/contacts``, in the order of their times."""
    records: list[ContactRecord] = []
    for rows in recording.runs.get("/contacts", []):
        # A run of equal-sized messages may hold several pairs of names of the same length. Take the
        # pair of the first row with all its rows at once, then repeat with the rest.
        while len(rows):
            # A pair of names costs a layout and a check of all rows, about 4 of them a step.
            recording.spend(128 + len(rows) // 4)
            ((first, second),) = _decoded(rows[:1], "/contacts", _contact_names)
            layout = layouts.contact(first, second)
            fits = layout.fits(rows)
            if not fits[0]:
                raise DamagedTraceError("/contacts holds something else")
            records += _contact_records(layout.view(rows[fits]), first, second)
            rows = rows[~fits]
    return tuple(sorted(records, key=lambda contact: contact.time))


def progress(recording: McapContents) -> tuple[ProgressRecord, ...]:
    """Decode ``/mission/status``."""
    return tuple(
        ProgressRecord(time, state.current, state.reached, state.state)
        for time, state in _rare(recording, "/mission/status", messages.progress)
    )


def events(recording: McapContents) -> tuple[EventRecord, ...]:
    """Decode ``/events``, in the order of their times."""
    records = [
        EventRecord(time, str(log.name), str(log.msg), _LEVELS.get(int(log.level), "info"))
        for time, log in _rare(recording, "/events", lambda message: message)
    ]
    return tuple(sorted(records, key=lambda event: event.time))


def plans(recording: McapContents) -> tuple[PlanRecord, ...]:
    """Decode ``/plan``, in the order of their times."""
    records = _messages(recording, "/plan", lambda data, time: PlanRecord(time, decode_path(data)))
    return tuple(sorted(records, key=lambda plan: plan.time))


def reports(
    recording: McapContents,
) -> tuple[BehaviorTreeLog | CollisionMonitorState | SpeedLimit, ...]:
    """Decode the reports of a stack, except costmaps, in the order of time."""
    records: list[BehaviorTreeLog | CollisionMonitorState | SpeedLimit] = [
        *_messages(recording, REPORT_TOPICS["behavior tree"][0], decode_tree_log),
        *_messages(recording, REPORT_TOPICS["collision monitor"][0], decode_collision),
        *_messages(recording, REPORT_TOPICS["speed limit"][0], decode_speed_limit),
    ]
    return tuple(sorted(records, key=lambda report: report.time))


def costmaps(recording: McapContents) -> tuple[CostmapPicture, ...]:
    """Decode the costmaps, in the order of time."""
    pictures: list[CostmapPicture] = []
    for topic, scope in messages.COSTMAPS.items():
        read = functools.partial(decode_costmap, scope=scope, frames={"map": "map", "odom": "odom"})
        pictures += _messages(recording, topic, read)
    return tuple(sorted(pictures, key=lambda costmap: costmap.time))


def number(text: str) -> float:
    """Read a finite, non-negative number from metadata."""
    try:
        value = float(text)
    except ValueError as error:
        raise DamagedTraceError("the outcome's times are damaged") from error
    if not 0.0 <= value < math.inf:
        raise DamagedTraceError("the outcome's times are damaged")
    return value


def _fields(recording: McapContents, layout: MessageLayout) -> Fields:
    """Return the varying fields of all messages on a topic, each of shape (n, ...)."""
    packed = list(recording.packed.get(layout.topic, []))
    for rows in recording.runs.get(layout.topic, []):
        if not layout.fits_all(rows):
            raise DamagedTraceError(f"{layout.topic} holds something else than expected")
        packed.append(layout.pack(rows))
    packed = packed or [layout.pack(np.empty((0, len(layout.template)), np.uint8))]
    # Field by field, because numpy compares the types of whole records for every pair.
    names = packed[0].dtype.names or ()
    return {name: np.concatenate([part[name] for part in packed]) for name in names}


def _yaw(fields: Fields) -> Floats:
    """Return yaws in (-pi, pi], one by one by the C library, so equal on every machine."""
    halves = map(math.atan2, fields["qz"].tolist(), fields["qw"].tolist())
    yaw = 2.0 * np.fromiter(halves, np.float64, len(fields["qz"]))
    yaw[yaw > math.pi] -= math.tau
    yaw[yaw <= -math.pi] += math.tau
    return yaw


def _contact_records(
    records: npt.NDArray[np.void], first: str, second: str
) -> Iterator[ContactRecord]:
    times = (records["log_time"] / 1e9).tolist()
    columns = [records[name].tolist() for name in ("px", "py", "nx", "ny", "depth")]
    for time, px, py, nx, ny, depth in zip(times, *columns, strict=True):
        yield ContactRecord(time, first, second, (px, py), (nx, ny), depth)


def _contact_names(message: Any) -> tuple[str, str]:
    (state,) = message.states
    return state.collision1_name, state.collision2_name


def _rare(
    recording: McapContents, topic: str, read: Callable[[Any], T]
) -> Iterator[tuple[float, T]]:
    """Yield time and content of messages, decoded one by one."""
    for rows in recording.runs.get(topic, []):
        recording.spend(2 * RECORD_STEPS * len(rows))
        yield from zip(_times(rows), _decoded(rows, topic, read), strict=True)


def _messages(
    recording: McapContents, topic: str, read: Callable[[bytes, float], T]
) -> Iterator[T]:
    """Yield the result of ``read`` for the CDR and the time [s] of each message."""
    for rows in recording.runs.get(topic, []):
        recording.spend(2 * RECORD_STEPS * len(rows))
        for time, row in zip(_times(rows), rows[:, HEADER.size :], strict=True):
            try:
                content = read(row.tobytes(), time)
            except Exception as error:
                # struct, numpy and rosbags may raise anything for damaged bytes.
                raise DamagedTraceError(f"a damaged message on {topic}") from error
            yield content


def _decoded(rows: ByteArray, topic: str, read: Callable[[Any], T]) -> Iterator[T]:
    """Yield the results of ``read`` for messages of one size."""
    if rows.shape[1] > _RARE_LIMIT:
        raise DamagedTraceError(f"a message on {topic} is too large")
    for row in rows[:, HEADER.size :]:
        try:
            content = read(ros.deserialize(row.tobytes(), messages.KINDS[topic]))
        except Exception as error:
            # rosbags uses struct, numpy and its own code, which may raise anything.
            raise DamagedTraceError(f"a damaged message on {topic}") from error
        yield content


def _times(rows: ByteArray) -> list[float]:
    """Return the times [s] of message records."""
    return [HEADER.unpack_from(row)[4] / 1e9 for row in rows]
