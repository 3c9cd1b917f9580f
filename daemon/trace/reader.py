"""Reading traces fast: columns straight from the bytes, no Python object per frequent message.

Chunks whose index shows nothing of interest are not even decompressed. A file that is cut or
damaged yields its readable prefix as an incomplete trace, or a :class:`TraceError` when there is
none.
"""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path
from typing import Final, TypeVar

from daemon.spec import RunSpec
from daemon.trace import decode
from daemon.trace.model import Trace, TraceError
from daemon.trace.problems import problems
from daemon.trace.recording import DamagedError, Recording, decompress, read_recording
from grammars import codec
from grammars.scene import Scene

_SCENE_LIMIT: Final = 64 << 20
_JUDGED: Final = frozenset(
    {
        "/ground_truth", "/odom", "/joint_states", "/cmd_vel", "/pose", "/contacts",
        "/particle_cloud/summary", "/particle_cloud/count", "/mission/status", "/events",
    }
)  # fmt: skip

T = TypeVar("T")


def read_trace(path: Path, *, scans: bool = False, plans: bool = False) -> Trace:
    """Read a trace, with its laser scans when ``scans`` is set and its plans with ``plans``.

    Raises :class:`TraceError` when the file cannot be opened, is not a trace written by
    :class:`TraceWriter`, or is damaged before anything of it can be used.
    """
    more = {topic for topic, wanted in (("/scan", scans), ("/plan", plans)) if wanted}
    recording = read_recording(path, _JUDGED | more)
    spec = _attached_spec(recording)
    scene = _attached_scene(recording, spec)
    try:
        return _decoded(recording, spec, scene, scans)
    except DamagedError as error:
        raise TraceError(path, f"damaged: {error}", "run the specification again") from error


def read_spec(path: Path) -> RunSpec:
    """Read only what a trace says the run was to be; raises as :func:`read_trace` does."""
    return _attached_spec(read_recording(path, ()))


def read_scene(path: Path) -> Scene:
    """Read only the scene inside of a trace; raises as :func:`read_trace` does."""
    recording = read_recording(path, ())
    return _attached_scene(recording, _attached_spec(recording))


def _decoded(recording: Recording, spec: RunSpec, scene: Scene, scans: bool) -> Trace:
    runs = recording.runs
    truth = decode.motion(runs, "/ground_truth", "map")
    joints = decode.joints(runs, scene.joint_names)
    outcome = recording.metadata.get("outcome", {})
    complete = not recording.cut and outcome.get("complete") == "true"
    last = float(truth.time[-1]) if len(truth.time) else 0.0
    valid_until = decode.number(outcome.get("valid_until", "")) if complete else last
    odometry = decode.motion(runs, "/odom", "odom")
    return Trace(
        path=recording.path,
        spec=spec,
        scene=scene,
        ended=outcome.get("ended") if complete else None,
        note=outcome.get("note", "") if complete else recording.cut or "the recording was cut",
        complete=complete,
        valid_until=valid_until,
        problems=problems(truth, odometry, joints, valid_until),
        versions=recording.metadata.get("versions", {}),
        ground_truth=truth,
        odometry=odometry,
        command=decode.command(runs),
        estimate=decode.poses(runs, "/pose"),
        cloud=decode.poses(runs, "/particle_cloud/summary"),
        cloud_count=decode.cloud_count(runs),
        joints=joints,
        contacts=decode.contacts(runs),
        progress=decode.progress(runs),
        events=decode.events(runs),
        scans=decode.scans(runs, spec.robot.laser) if scans else None,
        plans=decode.plans(runs),
    )


def _attached_spec(recording: Recording) -> RunSpec:
    data = _attachment(recording, "spec.json")
    named = recording.metadata.get("run", {}).get("digest")
    if named != hashlib.sha256(data).hexdigest():
        raise TraceError(recording.path, "the run specification in the file is damaged")
    return _parsed(recording.path, RunSpec, data)


def _attached_scene(recording: Recording, spec: RunSpec) -> Scene:
    packed = _attachment(recording, "scene.json.zst")
    return _scene(recording.path, packed, spec.scene)


def _attachment(recording: Recording, name: str) -> bytes:
    found = recording.attachments.get(name)
    if found is None:
        what = "was cut before anything was recorded" if recording.cut else "is not a trace"
        raise TraceError(recording.path, f"{what}: no {name} in it", "run it again")
    return found


@functools.lru_cache(maxsize=16)
def _cached_scene(packed: bytes) -> tuple[Scene, str]:
    data = decompress(packed, b"zstd", None, _SCENE_LIMIT)
    return codec.from_json(Scene, data), hashlib.sha256(data).hexdigest()


def _scene(path: Path, packed: bytes, digest: str) -> Scene:
    try:
        scene, found = _cached_scene(packed)
    except (DamagedError, ValueError) as error:
        raise TraceError(path, "the scene in the file is damaged") from error
    if found != digest:
        raise TraceError(path, "the scene in the file is not the one of the run")
    return scene


def _parsed(path: Path, kind: type[T], data: bytes) -> T:
    try:
        return codec.from_json(kind, data)
    except ValueError as error:
        raise TraceError(
            path,
            "the run specification was written by another version of this program",
            "read it with the version named in its metadata",
        ) from error
