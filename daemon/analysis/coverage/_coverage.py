"""Coverage of a campaign: of its specifications, and of its traces, if any."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from daemon.analysis.coverage._features import feature_counts, recognise_features
from daemon.analysis.coverage._floor import PackedCells, covered_cells, floor_area, floor_grid
from daemon.analysis.coverage._results import Coverage, DoorCount, FloorArea, Unreadable
from daemon.analysis.coverage._rules import has_moved, run_facts
from daemon.analysis.parallel_map import parallel_map
from daemon.judging.oracles import trace_problems
from daemon.model.spec import RunSpec
from daemon.trace import Trace, TraceError, read_trace
from grammars.model.behaviour import Hold, JointEvent, joint_event
from grammars.model.movers import is_mover, own_joints
from grammars.model.scene import Scene, SceneObject

NEAR: Final = 1.5
"""Distance [m] of the robot's base below which it meets a door."""


@dataclass(frozen=True, slots=True, eq=False)
class RunCoverage:
    """Contribution of one recorded run; runs of equal ``world`` are in the same building.

    ``features`` are planned and done, ``doors`` are counts of one run, ``cells`` of the floor are
    seen and driven on. The cells are packed, because the value travels between processes.
    """

    world: tuple[str, float]
    scene: Scene
    features: tuple[tuple[str, ...], tuple[str, ...]]
    doors: tuple[DoorCount, ...]
    cells: tuple[PackedCells, PackedCells]


def planned_coverage(runs: Iterable[RunSpec], scenes: Iterable[Scene]) -> Coverage:
    """Return the features that runs would exercise, without executing them.

    ``scenes`` are those of the specifications. Raises ``KeyError`` for a missing one.
    """
    by_digest = {scene.digest: scene for scene in scenes}
    features = [recognise_features(run_facts(spec, by_digest[spec.scene])) for spec in runs]
    return Coverage(len(features), 0, NEAR, feature_counts(features))


def trace_coverage(
    traces: Sequence[Path], *, near: float = NEAR, processes: int | None = None
) -> Coverage:
    """Return the coverage of recorded runs: features, doors and floor.

    ``near`` [m] is the distance of the robot's base below which it meets a door. Traces are read on
    ``processes`` (default: one per core); unusable ones are among ``unreadable``. Raises
    :class:`daemon.batch.errors.DaemonError` if a reading process dies.
    """
    task = partial(_read_coverage, near)
    read = tuple(parallel_map(task, traces, doing="reading traces", processes=processes))
    runs = [one for one in read if isinstance(one, RunCoverage)]
    unreadable = tuple(one for one in read if isinstance(one, Unreadable))
    return dataclasses.replace(sum_coverage(runs, near=near), unreadable=unreadable)


def _read_coverage(near: float, path: Path) -> RunCoverage | Unreadable:
    """Read one trace and return its contribution, or why it is unusable."""
    try:
        trace = read_trace(path, scans=True)
    except TraceError as error:
        return Unreadable(str(path), error.findings[0].message)
    # After a clock that jumps or a NaN, no part of the trace can be trusted.
    if problems := trace_problems(trace):
        return Unreadable(str(path), "; ".join(problems))
    return run_coverage(trace, near=near)


def run_coverage(trace: Trace, *, near: float = NEAR) -> RunCoverage:
    """Return the contribution of a trace that was read with its scans."""
    spec, scene = trace.spec, trace.scene
    return RunCoverage(
        world=(spec.scene, spec.robot.laser.z),
        scene=scene,
        features=recognise_features(run_facts(spec, scene, trace)),
        doors=_door_counts(trace, near),
        cells=covered_cells(floor_grid(scene, spec.robot.laser.z), trace),
    )


def sum_coverage(runs: Sequence[RunCoverage], *, near: float = NEAR) -> Coverage:
    """Return the joint coverage of recorded runs; see :func:`trace_coverage`."""
    worlds: dict[tuple[str, float], list[RunCoverage]] = {}
    for run in runs:
        # The map is drawn at the height of the first laser: another height meets other walls and
        # windows, so it gives another floor.
        worlds.setdefault(run.world, []).append(run)
    doors: list[DoorCount] = []
    floor: list[FloorArea] = []
    for (_, height), group in worlds.items():
        scene = group[0].scene
        doors += map(_sum_counts, zip(*(run.doors for run in group), strict=True))
        floor.append(floor_area(scene, floor_grid(scene, height), [run.cells for run in group]))
    features = feature_counts([run.features for run in runs])
    return Coverage(len(runs), len(runs), near, features, tuple(doors), tuple(floor))


def _door_counts(trace: Trace, near: float) -> tuple[DoorCount, ...]:
    """Count the motions of each articulated object of the scene in a recorded run.

    These are the objects with a joint that has room to move, without movers.
    """
    moving = {b.joint for b in trace.spec.behaviours if not isinstance(b, Hold)}
    by_robot = (JointEvent.TRIGGERED, JointEvent.REACTS)
    acted = {e.source for e in trace.events if joint_event(e.text) in by_robot}
    counts = []
    for door in trace.scene.objects:
        joints = {f"{door.name}.{joint.name}" for joint in own_joints(door.joints)}
        if joints and not is_mover(door.joints):
            nearest = _nearest_distance(trace, door)
            counts.append(
                DoorCount(
                    scene=trace.scene.name,
                    door=door.name,
                    runs=1,
                    planned=int(bool(joints & moving)),
                    moved=int(has_moved(trace, joints)),
                    triggered=int(bool(joints & acted)),
                    met=int(nearest is not None and nearest <= near),
                    nearest=nearest,
                )
            )
    return tuple(counts)


def _nearest_distance(trace: Trace, door: SceneObject) -> float | None:
    """Return the least distance of the robot's base from a door's hinges, or from its origin."""
    truth = trace.ground_truth
    hinges = [joint for joint in own_joints(door.joints) if joint.kind == "revolute"]
    points = [door.pose.apply(joint.anchor) for joint in hinges] or [(door.pose.x, door.pose.y)]
    ways = [np.hypot(truth.x - x, truth.y - y) for x, y in points]
    return min((float(way.min()) for way in ways if len(way)), default=None)


def _sum_counts(runs: Sequence[DoorCount]) -> DoorCount:
    """Sum up the counts of one door over runs."""
    summed = {
        name: sum(getattr(run, name) for run in runs)
        for name in ("runs", "planned", "moved", "triggered", "met")
    }
    nearest = min((run.nearest for run in runs if run.nearest is not None), default=None)
    return dataclasses.replace(runs[0], **summed, nearest=nearest)
