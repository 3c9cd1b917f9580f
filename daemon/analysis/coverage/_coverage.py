"""Coverage of a campaign: of its specifications, and of its traces where there are any."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.analysis.coverage._doors import DoorRun, door_counts, door_runs
from daemon.analysis.coverage._features import (
    RecognisedFeatures,
    feature_counts,
    recognise_features,
)
from daemon.analysis.coverage._floor import CoveredCells, covered_cells, floor_area, floor_grid
from daemon.analysis.coverage._results import Coverage, DoorCount, FloorArea, Unreadable
from daemon.analysis.coverage._rules import run_facts
from daemon.analysis.parallel_map import parallel_map
from daemon.model.spec import RunSpec
from daemon.trace import Trace, TraceError, read_trace
from grammars.model.scene import Scene

NEAR: Final = 1.5
"""A door is met when the robot's base comes this near [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class RunCoverage:
    """Contribution of one recorded run; runs of equal ``world`` are in the same building.

    It travels from the process that read the trace, so the cells of its floor are packed.
    """

    world: tuple[str, float]
    scene: Scene
    recognised: RecognisedFeatures
    doors: tuple[DoorRun, ...]
    painted: CoveredCells


def planned_coverage(runs: Iterable[RunSpec], scenes: Iterable[Scene]) -> Coverage:
    """Return the features that runs would exercise, without executing them.

    ``scenes`` are those the specifications name. Raises ``KeyError`` when one is missing.
    """
    by_digest = {scene.digest: scene for scene in scenes}
    features = [recognise_features(run_facts(spec, by_digest[spec.scene])) for spec in runs]
    return Coverage(len(features), 0, NEAR, feature_counts(features))


def trace_coverage(
    traces: Sequence[Path], *, near: float = NEAR, processes: int | None = None
) -> Coverage:
    """Return the coverage of recorded runs: features, doors and floor.

    ``near`` [m] is how near the robot's base has to come to a door to have met it. Traces are
    read on ``processes`` (default: one per core); one that cannot be read is among
    ``unreadable``. Raises :class:`daemon.batch.errors.DaemonError` when a reading process dies.
    """
    read = tuple(parallel_map(_read_coverage, traces, doing="reading traces", processes=processes))
    runs = [one for one in read if isinstance(one, RunCoverage)]
    unreadable = tuple(one for one in read if isinstance(one, Unreadable))
    return dataclasses.replace(sum_coverage(runs, near=near), unreadable=unreadable)


def sum_coverage(runs: Sequence[RunCoverage], *, near: float = NEAR) -> Coverage:
    """Return the coverage of recorded runs together; see :func:`trace_coverage`."""
    worlds: dict[tuple[str, float], list[RunCoverage]] = {}
    for run in runs:
        # At another height the first laser, at which the map is drawn, meets other walls and
        # windows: another floor to be seen.
        worlds.setdefault(run.world, []).append(run)
    doors: list[DoorCount] = []
    floor: list[FloorArea] = []
    for (_, height), group in worlds.items():
        scene = group[0].scene
        doors += door_counts(scene.name, [run.doors for run in group], near)
        floor.append(floor_area(scene, floor_grid(scene, height), [run.painted for run in group]))
    features = feature_counts([run.recognised for run in runs])
    return Coverage(len(runs), len(runs), near, features, tuple(doors), tuple(floor))


def _read_coverage(path: Path) -> RunCoverage | Unreadable:
    """Read one trace and return its contribution, or why it cannot be read."""
    try:
        trace = read_trace(path, scans=True)
    except TraceError as error:
        return Unreadable(str(path), error.diagnostics[0].message)
    return run_coverage(trace)


def run_coverage(trace: Trace) -> RunCoverage:
    """Return the contribution of a trace that was read with its scans."""
    spec, scene = trace.spec, trace.scene
    return RunCoverage(
        world=(spec.scene, spec.robot.laser.z),
        scene=scene,
        recognised=recognise_features(run_facts(spec, scene, trace)),
        doors=door_runs(trace),
        painted=covered_cells(floor_grid(scene, spec.robot.laser.z), trace),
    )
