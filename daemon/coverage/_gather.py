"""Coverage of a campaign: of its specifications, and of its traces where there are any."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from daemon import oracles
from daemon.coverage._doors import DoorRun, door_counts, door_runs
from daemon.coverage._facts import facts_of
from daemon.coverage._floor import Painted, floor_area, floor_grid, painted
from daemon.coverage._margins import margin_histograms
from daemon.coverage._model import MODEL, FeatureModel
from daemon.coverage._pairs import Recognised, feature_counts, pair_counts, recognise
from daemon.coverage._types import Coverage, DoorCount, FloorArea, Unreadable
from daemon.spec import RunSpec
from daemon.spread import spread
from daemon.trace import Trace, TraceError, read_trace
from daemon.verdict import Verdict
from grammars.scene import Scene

NEAR: Final = 1.5
"""A door is met when the robot's base comes this near [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Contribution:
    """What one recorded run contributes; with equal ``world`` it is of the same building."""

    world: tuple[str, float]
    scene: Scene
    recognised: Recognised
    doors: tuple[DoorRun, ...]
    painted: Painted
    verdicts: tuple[Verdict, ...]


def planned_coverage(
    runs: Iterable[RunSpec], scenes: Iterable[Scene], *, model: FeatureModel = MODEL
) -> Coverage:
    """Return which features and pairs of features runs would exercise; nothing is executed.

    ``scenes`` are those the specifications name. Raises ``KeyError`` when one is missing.
    """
    known = {scene.digest: scene for scene in scenes}
    found = [recognise(model, facts_of(spec, known[spec.scene])) for spec in runs]
    features = feature_counts(model, found)
    return Coverage(len(found), 0, NEAR, features, pair_counts(model, found))


def coverage_of(
    traces: Sequence[Path],
    *,
    near: float = NEAR,
    model: FeatureModel = MODEL,
    processes: int | None = None,
) -> Coverage:
    """Return what recorded runs have covered: features, doors, floor and margins.

    ``near`` [m] is how near the robot's base has to come to a door to have met it. Traces are
    read on ``processes`` (default: one per core) and judged by the oracles inside of them; one
    that cannot be read is among ``unreadable``. Raises :class:`daemon.errors.DaemonError` when a
    reading process dies.
    """
    told: list[Contribution] = []
    unreadable: list[Unreadable] = []
    oracles.warm_up()
    tell = partial(_tell, model)
    answers = spread(tell, traces, doing="reading traces", processes=processes)
    for path, one in zip(traces, answers, strict=True):
        if isinstance(one, str):
            unreadable.append(Unreadable(str(path), one))
        else:
            told.append(one)
    return dataclasses.replace(summed(told, near=near, model=model), unreadable=tuple(unreadable))


def summed(
    told: Sequence[Contribution], *, near: float = NEAR, model: FeatureModel = MODEL
) -> Coverage:
    """Return what recorded runs have covered together; see :func:`coverage_of`."""
    found = [one.recognised for one in told]
    doors, floor = _worlds(told, near)
    return Coverage(
        runs=len(found),
        recorded=len(found),
        near=near,
        features=feature_counts(model, found),
        pairs=pair_counts(model, found),
        doors=doors,
        floor=floor,
        margins=margin_histograms(v for one in told for v in one.verdicts),
    )


def _tell(model: FeatureModel, path: Path) -> Contribution | str:
    """Read one trace and return what it contributes, or what is wrong with it."""
    try:
        trace = read_trace(path, scans=True)
    except TraceError as error:
        return "; ".join(found.message for found in error.diagnostics)
    return contribution(trace, oracles.judge(trace, trace.spec.oracles), model=model)


def contribution(
    trace: Trace, verdicts: tuple[Verdict, ...], *, model: FeatureModel = MODEL
) -> Contribution:
    """Return what a trace, read with its scans, contributes to coverage."""
    spec, scene = trace.spec, trace.scene
    facts = facts_of(spec, scene, trace)
    return Contribution(
        world=(spec.scene, spec.robot.laser.z),
        scene=scene,
        recognised=recognise(model, facts),
        doors=door_runs(facts, trace),
        painted=painted(floor_grid(scene, spec.robot.laser.z), trace),
        verdicts=verdicts,
    )


def _worlds(
    told: Sequence[Contribution], near: float
) -> tuple[tuple[DoorCount, ...], tuple[FloorArea, ...]]:
    """Sum up doors and floor, scene by scene."""
    groups: dict[tuple[str, float], list[Contribution]] = {}
    for one in told:
        groups.setdefault(one.world, []).append(one)
    doors: list[DoorCount] = []
    floor: list[FloorArea] = []
    for world, group in groups.items():
        scene = group[0].scene
        doors += door_counts(scene.name, [one.doors for one in group], near)
        floor.append(floor_area(scene, floor_grid(scene, world[1]), [one.painted for one in group]))
    return tuple(doors), tuple(floor)
