"""Value types of a trace in memory, as flat arrays.

Times are simulated seconds (float64). Arrays of one track share their first dimension.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from daemon.model.spec import RunSpec
from daemon.model.sut import BehaviorTreeLog, CollisionMonitorState, CostmapPicture, SpeedLimit
from grammars.model.geometry import Floats
from grammars.model.scene import Scene
from grammars.text.diagnostics import Finding, InputError, Where


class TraceError(InputError):
    """Unusable trace file, with its path, the fault and a remedy."""

    def __init__(self, path: Path | str, message: str, hint: str = "") -> None:
        super().__init__(Finding(Where(str(path)), message, hint))


# ``eq=False`` for types with arrays: == of arrays gives an array.
@dataclass(frozen=True, slots=True, eq=False)
class MotionTrack:
    """Motion of a base: ``time`` (n,), pose ``x, y`` [m] and ``yaw`` [rad, wrapped], body twist.

    ``vx, vy`` [m/s] and ``wz`` [rad/s] are in the body frame (REP 103), all of shape (n,).
    """

    time: Floats
    x: Floats
    y: Floats
    yaw: Floats
    vx: Floats
    vy: Floats
    wz: Floats


@dataclass(frozen=True, slots=True, eq=False)
class CommandTrack:
    """Velocity commands of the system under test in the body frame, shape (n,)."""

    time: Floats
    vx: Floats
    vy: Floats
    wz: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PoseTrack:
    """Pose estimates in the map frame, shape (n,); ``covariance`` (n, 3, 3) over x, y, yaw."""

    time: Floats
    x: Floats
    y: Floats
    yaw: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class JointTrack:
    """Joint states: ``position`` and ``velocity`` (n, k) in the order of ``names``.

    A trace leaves out samples that repeat the previous one, except the last before a change.
    Linear interpolation between the others gives every recorded sample.
    """

    names: tuple[str, ...]
    time: Floats
    position: Floats
    velocity: Floats


@dataclass(frozen=True, slots=True, eq=False)
class LatencyTrack:
    """Wall time ``seconds`` (n,) that an external system took to answer, by simulated ``time``."""

    time: Floats
    seconds: Floats


@dataclass(frozen=True, slots=True, eq=False)
class ScanTrack:
    """Scans of one laser: ``ranges`` (n, rays) float32; ``inf`` no return, ``nan`` lost (REP 117).

    ``laser`` is its name, empty for one without.
    """

    time: Floats
    ranges: npt.NDArray[np.float32]
    laser: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class PlanRecord:
    """Global plan of the system under test from ``time`` [s] on: ``points`` (n, 2) [m]."""

    time: float
    points: Floats


@dataclass(frozen=True, slots=True)
class ContactRecord:
    """Contact of two bodies at ``point`` [m, map frame]; ``depth`` [m] of penetration.

    ``normal`` points from ``first`` to ``second``.
    """

    time: float
    first: str
    second: str
    point: tuple[float, float]
    normal: tuple[float, float]
    depth: float


@dataclass(frozen=True, slots=True)
class ProgressRecord:
    """Change of the mission: number of ``reached`` waypoints, and index of the ``current`` one.

    ``current`` equals the number of waypoints after the last one.
    """

    time: float
    current: int
    reached: int
    state: Literal["active", "succeeded", "aborted"]


@dataclass(frozen=True, slots=True)
class EventRecord:
    """Sentence of ``source`` in the log of the run."""

    time: float
    source: str
    text: str
    level: str = "info"


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """One recorded run.

    ``ended`` is ``None`` and ``complete`` false for a trace without an end, because its writer
    died; the part up to ``valid_until`` [s] can still be judged. ``problems`` are faults of the
    recording: a judge must not trust a trace that has any. ``scans`` has an item for every laser of
    the robot, in that order. Without a request for them, ``scans`` is ``None``, and ``plans`` and
    ``costmaps`` are empty. ``reports`` of a stack are in the order of time.
    """

    path: Path
    spec: RunSpec
    scene: Scene
    ended: str | None
    note: str
    complete: bool
    valid_until: float
    problems: tuple[str, ...]
    versions: dict[str, str]
    ground_truth: MotionTrack
    odometry: MotionTrack
    command: CommandTrack
    estimate: PoseTrack
    cloud: PoseTrack
    cloud_count: npt.NDArray[np.int64]
    joints: JointTrack
    contacts: tuple[ContactRecord, ...]
    progress: tuple[ProgressRecord, ...]
    events: tuple[EventRecord, ...]
    scans: tuple[ScanTrack, ...] | None
    plans: tuple[PlanRecord, ...] = ()
    latency: LatencyTrack = field(default_factory=lambda: LatencyTrack(np.empty(0), np.empty(0)))
    reports: tuple[BehaviorTreeLog | CollisionMonitorState | SpeedLimit, ...] = ()
    costmaps: tuple[CostmapPicture, ...] = ()
