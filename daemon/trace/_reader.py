"""Reader of traces: columns directly from the bytes, no Python object per frequent message.

Chunks without a selected topic in their index stay compressed. A file that is cut or damaged gives
its readable part as an incomplete trace, or raises :class:`TraceError` when it has none. Faults of
the recording are ``problems`` of the trace.
"""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from daemon.model import ros_messages as ros
from daemon.model.spec import RunSpec
from daemon.model.stack_reports import (
    REPORT_TOPICS,
    decode_collision,
    decode_costmap,
    decode_speed_limit,
    decode_tree_log,
)
from daemon.model.sut import BehaviorTreeLog, CollisionMonitorState, CostmapPicture, SpeedLimit
from daemon.trace import layouts, messages
from daemon.trace._mcap_reader import (
    RECORD_STEPS,
    DamagedTraceError,
    McapContents,
    decompress,
    read_mcap,
)
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
    Trace,
    TraceError,
)
from daemon.trace._signals import Columns, common_signals
from daemon.trace._views import decode_path
from daemon.trace.layouts import HEADER, ByteArray, MessageLayout
from grammars.model.geometry import Floats
from grammars.model.robot import Laser
from grammars.model.scene import Scene
from grammars.text import codec

MAX_GAP: Final = 0.5
"""Longest time [s] between two ground truth samples in a trace that can be trusted: ten in a row
may be missing, as it is recorded at 20 Hz."""

_SCENE_LIMIT: Final = 64 << 20
"""Size limit of a scene [bytes of JSON], because a file may come from an untrusted source."""
_RARE_LIMIT: Final = 1 << 20
"""Largest message for rosbags [bytes]; ours cut texts at ten thousand characters."""
_LEVELS: Final = {number: level for level, number in messages.LEVELS.items()}

_UNCHECKED: Final = ("time", "names", "velocity")
"""Fields of tracks that may hold other values than finite numbers."""

T = TypeVar("T")
Track = TypeVar("Track", MotionTrack, CommandTrack, PoseTrack, LatencyTrack, JointTrack, ScanTrack)


def read_trace(path: Path, *, scans: bool = False, views: bool = False) -> Trace:
    """Read a trace, with ``scans`` of all lasers, and with plans and costmaps, its ``views``.

    Raises :class:`TraceError` when the file cannot be opened, is not a trace of
    :class:`TraceWriter`, or has no readable part.
    """
    topics = messages.JUDGED | messages.VIEWS if views else messages.JUDGED

    def select(topic: str) -> bool:
        # The names of the lasers are in the specification, which is read later.
        return topic in topics or (scans and messages.is_scan(topic))

    recording = read_mcap(path, select, layouts=judged_layouts())
    spec = _attached_spec(recording)
    scene = _attached_scene(recording, spec)
    try:
        return decode_trace(recording, spec, scene, scans=scans)
    except DamagedTraceError as error:
        raise TraceError(path, f"damaged: {error}", "run the specification again") from error


def read_spec(path: Path) -> RunSpec:
    """Read only the specification of the run; raises as :func:`read_trace` does."""
    return _attached_spec(read_mcap(path))


def read_scene(path: Path) -> Scene:
    """Read only the scene of a trace; raises as :func:`read_trace` does."""
    recording = read_mcap(path)
    return _attached_scene(recording, _attached_spec(recording))


def read_outputs(path: Path) -> dict[str, str]:
    """Read the output of the system under test, by name; raises as :func:`read_trace` does."""
    attachments = read_mcap(path).attachments.items()
    prefix = messages.OUTPUT_PREFIX
    return {
        name.removeprefix(prefix): data.decode("utf-8", "replace")
        for name, data in attachments
        if name.startswith(prefix)
    }


@functools.cache
def judged_layouts() -> dict[str, MessageLayout]:
    """Return the layouts of the judged topics that are the same in every trace."""
    signals = common_signals().values()
    common = (layout for signal in signals for layout in signal.layouts)
    return {layout.topic: layout for layout in common if layout.topic in messages.JUDGED}


def decode_trace(
    recording: McapContents, spec: RunSpec, scene: Scene, *, scans: bool = False
) -> Trace:
    """Return the trace of a recording; raises :class:`DamagedTraceError` for foreign messages."""
    truth = _track(recording, MotionTrack, layouts.odometry("/ground_truth", "map"))
    joints = _joints(recording, scene.joint_names)
    outcome = recording.metadata.get("outcome", {})
    complete = not recording.cut and outcome.get("complete") == "true"
    last = float(truth.time[-1]) if len(truth.time) else 0.0
    valid_until = _number(outcome.get("valid_until", "")) if complete else last
    odometry = _track(recording, MotionTrack, layouts.odometry("/odom", "odom"))
    command = _track(recording, CommandTrack, layouts.command())
    estimate = _track(recording, PoseTrack, layouts.estimate("/pose"))
    summary = layouts.estimate("/particle_cloud/summary")
    cloud = _track(recording, PoseTrack, summary)
    tracks: dict[str, MotionTrack | JointTrack | CommandTrack | PoseTrack] = {
        "ground truth": truth,
        "odometry": odometry,
        "joint states": joints,
        "command": command,
        "estimate": estimate,
        "particle cloud": cloud,
    }
    problems = [
        *_backwards({"ground truth": truth, "odometry": odometry, "joint states": joints}),
        *(problem for name, track in tracks.items() for problem in _not_finite(name, track)),
        *_gaps(truth.time, valid_until),
    ]
    if recording.cut and not len(truth.time):
        problems[-1] += f": {recording.cut}"
    return Trace(
        path=recording.path,
        spec=spec,
        scene=scene,
        ended=outcome.get("ended") if complete else None,
        note=outcome.get("note", "") if complete else recording.cut or "the recording was cut",
        complete=complete,
        valid_until=valid_until,
        problems=tuple(problems),
        versions=recording.metadata.get("versions", {}),
        ground_truth=truth,
        odometry=odometry,
        command=command,
        estimate=estimate,
        cloud=cloud,
        cloud_count=_fields(recording, layouts.count())["count"].astype(np.int64),
        joints=joints,
        contacts=_contacts(recording),
        progress=_progress(recording),
        events=_events(recording),
        scans=tuple(_scans(recording, x) for x in spec.robot.lasers) if scans else None,
        plans=_plans(recording),
        latency=_track(recording, LatencyTrack, layouts.latency()),
        reports=_reports(recording),
        costmaps=_costmaps(recording),
    )


def _attached_spec(recording: McapContents) -> RunSpec:
    data = _attachment(recording, "spec.json")
    about = recording.metadata.get("run", {})
    # The metadata are the only checksum of this attachment, on which all verdicts depend. Up to
    # engine 4 the digest of a run was that of this text.
    expected = about.get("sha256", about.get("digest"))
    if expected != hashlib.sha256(data).hexdigest():
        raise TraceError(recording.path, "the run specification in the file is damaged")
    try:
        return codec.from_json(RunSpec, data)
    except ValueError as error:
        raise TraceError(
            recording.path,
            "the run specification was written by another version of this program",
            "read it with the version named in its metadata",
        ) from error


def _attached_scene(recording: McapContents, spec: RunSpec) -> Scene:
    packed = _attachment(recording, "scene.json.zst")
    try:
        scene, digest = _cached_scene(packed)
    except (DamagedTraceError, ValueError) as error:
        raise TraceError(recording.path, "the scene in the file is damaged") from error
    if digest != spec.scene:
        raise TraceError(recording.path, "the scene in the file is not the one of the run")
    return scene


def _attachment(recording: McapContents, name: str) -> bytes:
    data = recording.attachments.get(name)
    if data is None:
        message = f"is not the trace of a run: no {name} in it"
        hint = "name an .mcap file that a run left"
        if recording.cut:
            message, hint = f"no {name} can be read: {recording.cut}", "run it again"
        raise TraceError(recording.path, message, hint)
    return data


# The hundreds of traces of a campaign share one or two scenes.
@functools.lru_cache(maxsize=16)
def _cached_scene(packed: bytes) -> tuple[Scene, str]:
    data = decompress(packed, b"zstd", None, _SCENE_LIMIT)
    return codec.from_json(Scene, data), hashlib.sha256(data).hexdigest()


def _backwards(tracks: Mapping[str, MotionTrack | JointTrack]) -> Iterator[str]:
    for name, track in tracks.items():
        time = track.time
        jumps = np.flatnonzero(np.diff(time) < 0)
        if len(jumps):
            before, after = time[jumps[0]], time[jumps[0] + 1]
            yield f"the clock of the {name} jumps back from {before:g} s to {after:g} s"


def _not_finite(
    name: str, track: MotionTrack | JointTrack | CommandTrack | PoseTrack
) -> Iterator[str]:
    # No judge reads the velocities of joints.
    judged = (each.name for each in fields(track) if each.name not in _UNCHECKED)
    finite = [np.isfinite(getattr(track, each)) for each in judged]
    if not all(each.all() for each in finite):
        rows = np.hstack([each.reshape(len(each), -1) for each in finite]).all(axis=1)
        yield f"the {name} at {track.time[np.argmin(rows)]:g} s is not a number"


def _gaps(time: Floats, valid_until: float) -> list[str]:
    if not len(time):
        return ["there is no ground truth"]
    # From the start of the run to the end of the judged time: missing ends are gaps, too.
    edges = np.concatenate(([0.0], time, [valid_until]))
    steps = np.diff(edges)
    worst = int(np.argmax(steps))
    if steps[worst] <= MAX_GAP:
        return []
    return [f"no ground truth from {edges[worst]:g} s to {edges[worst + 1]:g} s"]


def _track(
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


def _joints(recording: McapContents, names: tuple[str, ...]) -> JointTrack:
    """Decode ``/joint_states``; empty for a scene without joints."""
    if not names:
        nothing = np.empty((0, 0))
        return JointTrack((), np.empty(0), nothing, nothing)
    return _track(recording, JointTrack, layouts.joints(names), names=names)


def _scans(recording: McapContents, laser: Laser) -> ScanTrack:
    """Decode the scans of a laser."""
    rows = recording.runs.get(messages.scan_topic(laser), [])
    if not rows:
        nothing = np.empty((0, max(laser.rays, 0)), np.float32)
        return ScanTrack(np.empty(0), nothing, laser.name)
    if not 0 < 4 * laser.rays < rows[0].shape[1] or not laser.rate > 0:
        raise DamagedTraceError("scans of another size than the robot's laser makes")
    return _track(recording, ScanTrack, layouts.scan(laser), laser=laser.name)


def _contacts(recording: McapContents) -> tuple[ContactRecord, ...]:
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


def _progress(recording: McapContents) -> tuple[ProgressRecord, ...]:
    """Decode ``/mission/status``."""
    return tuple(
        ProgressRecord(time, state.current, state.reached, state.state)
        for time, state in _rare(recording, "/mission/status", messages.progress)
    )


def _events(recording: McapContents) -> tuple[EventRecord, ...]:
    """Decode ``/events``, in the order of their times."""
    records = [
        EventRecord(time, str(log.name), str(log.msg), _LEVELS.get(int(log.level), "info"))
        for time, log in _rare(recording, "/events", lambda message: message)
    ]
    return tuple(sorted(records, key=lambda event: event.time))


def _plans(recording: McapContents) -> tuple[PlanRecord, ...]:
    """Decode ``/plan``, in the order of their times."""
    records = _messages(recording, "/plan", lambda data, time: PlanRecord(time, decode_path(data)))
    return tuple(sorted(records, key=lambda plan: plan.time))


def _reports(
    recording: McapContents,
) -> tuple[BehaviorTreeLog | CollisionMonitorState | SpeedLimit, ...]:
    """Decode the reports of a stack, except costmaps, in the order of time."""
    records: list[BehaviorTreeLog | CollisionMonitorState | SpeedLimit] = [
        *_messages(recording, REPORT_TOPICS["behavior tree"][0], decode_tree_log),
        *_messages(recording, REPORT_TOPICS["collision monitor"][0], decode_collision),
        *_messages(recording, REPORT_TOPICS["speed limit"][0], decode_speed_limit),
    ]
    return tuple(sorted(records, key=lambda report: report.time))


def _costmaps(recording: McapContents) -> tuple[CostmapPicture, ...]:
    """Decode the costmaps, in the order of time."""
    pictures: list[CostmapPicture] = []
    for topic, scope in messages.COSTMAPS.items():
        read = functools.partial(decode_costmap, scope=scope, frames={"map": "map", "odom": "odom"})
        pictures += _messages(recording, topic, read)
    return tuple(sorted(pictures, key=lambda costmap: costmap.time))


def _number(text: str) -> float:
    """Read a finite, non-negative number from metadata."""
    try:
        value = float(text)
    except ValueError as error:
        raise DamagedTraceError("the outcome's times are damaged") from error
    if not 0.0 <= value < math.inf:
        raise DamagedTraceError("the outcome's times are damaged")
    return value


def _fields(recording: McapContents, layout: MessageLayout) -> Columns:
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


def _yaw(fields: Columns) -> Floats:
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
