"""Reader of traces: columns directly from the bytes, no Python object per frequent message.

Chunks without a selected topic in their index stay compressed. A file that is cut or damaged gives
its readable part as an incomplete trace, or raises :class:`TraceError` when it has none. Faults of
the recording are ``problems`` of the trace.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from daemon.model.spec import RunSpec
from daemon.trace import _decode, layouts, messages
from daemon.trace._mcap_reader import DamagedTraceError, McapContents, decompress, read_mcap
from daemon.trace._model import (
    CommandTrack,
    JointTrack,
    LatencyTrack,
    MotionTrack,
    PoseTrack,
    ScanTrack,
    Trace,
    TraceError,
)
from daemon.trace._signals import common_signals
from daemon.trace.layouts import MessageLayout
from grammars.model.geometry import Floats
from grammars.model.scene import Scene
from grammars.text import codec

MAX_GAP: Final = 0.5
"""Longest time [s] between two ground truth samples in a trace that can be trusted: ten in a row
may be missing, as it is recorded at 20 Hz."""

_SCENE_LIMIT: Final = 64 << 20
"""Size limit of a scene [bytes of JSON], because a file may come from an untrusted source."""


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
    truth = _decode.track(recording, MotionTrack, layouts.odometry("/ground_truth", "map"))
    joints = _decode.joints(recording, scene.joint_names)
    outcome = recording.metadata.get("outcome", {})
    complete = not recording.cut and outcome.get("complete") == "true"
    last = float(truth.time[-1]) if len(truth.time) else 0.0
    valid_until = _decode.number(outcome.get("valid_until", "")) if complete else last
    odometry = _decode.track(recording, MotionTrack, layouts.odometry("/odom", "odom"))
    command = _decode.track(recording, CommandTrack, layouts.command())
    estimate = _decode.track(recording, PoseTrack, layouts.estimate("/pose"))
    summary = layouts.estimate("/particle_cloud/summary")
    cloud = _decode.track(recording, PoseTrack, summary)
    problems = [
        *_backwards({"ground truth": truth, "odometry": odometry, "joint states": joints}),
        *_not_finite("ground truth", truth.time, *_motion_values(truth)),
        *_not_finite("odometry", odometry.time, *_motion_values(odometry)),
        *_not_finite("joint states", joints.time, joints.position),
        *_not_finite("command", command.time, command.vx, command.vy, command.wz),
        *_not_finite("estimate", estimate.time, *_pose_values(estimate)),
        *_not_finite("particle cloud", cloud.time, *_pose_values(cloud)),
        *_gaps(truth.time, valid_until),
    ]
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
        cloud_count=_decode.cloud_count(recording),
        joints=joints,
        contacts=_decode.contacts(recording),
        progress=_decode.progress(recording),
        events=_decode.events(recording),
        scans=_scans(recording, spec) if scans else None,
        plans=_decode.plans(recording),
        latency=_decode.track(recording, LatencyTrack, layouts.latency()),
        reports=_decode.reports(recording),
        costmaps=_decode.costmaps(recording),
    )


def _scans(recording: McapContents, spec: RunSpec) -> tuple[ScanTrack, ...]:
    return tuple(_decode.scans(recording, laser) for laser in spec.robot.lasers)


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
        fault = "was cut before anything was recorded" if recording.cut else "is not a trace"
        raise TraceError(recording.path, f"{fault}: no {name} in it", "run it again")
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


def _motion_values(track: MotionTrack) -> tuple[Floats, ...]:
    return track.x, track.y, track.yaw, track.vx, track.vy, track.wz


def _pose_values(track: PoseTrack) -> tuple[Floats, ...]:
    return track.x, track.y, track.yaw, track.covariance.reshape(-1, 9)


def _not_finite(name: str, time: Floats, *values: Floats) -> list[str]:
    # First without a copy, which is enough for nearly all traces.
    if all(np.isfinite(each).all() for each in values):
        return []
    finite = np.isfinite(np.column_stack(values)).all(axis=1)
    return [f"the {name} at {time[np.argmin(finite)]:g} s is not a number"]


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
