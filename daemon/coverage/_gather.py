"""Coverage of a campaign: of its specifications, and of its traces where there are any."""

from __future__ import annotations

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
from daemon.trace import TraceError, read_trace
from daemon.verdict import Verdict
from grammars.scene import Scene

NEAR: Final = 1.5
"""A door is met when the robot's base comes this near [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """What one trace contributes; scenes with equal ``world`` are the same building."""

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
    told: list[_Told] = []
    unreadable: list[Unreadable] = []
    oracles.warm_up()
    tell = partial(_tell, model)
    answers = spread(tell, traces, doing="reading traces", processes=processes)
    for path, one in zip(traces, answers, strict=True):
        if isinstance(one, str):
            unreadable.append(Unreadable(str(path), one))
        else:
            told.append(one)
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
        unreadable=tuple(unreadable),
    )


def _tell(model: FeatureModel, path: Path) -> _Told | str:
    """Read one trace and return what it contributes, or what is wrong with it."""
    try:
        trace = read_trace(path, scans=True)
    except TraceError as error:
        return "; ".join(found.message for found in error.diagnostics)
    spec, scene = trace.spec, trace.scene
    facts = facts_of(spec, scene, trace)
    world = (spec.scene, spec.robot.laser.z)
    return _Told(
        world=world,
        scene=scene,
        recognised=recognise(model, facts),
        doors=door_runs(facts, trace),
        painted=painted(floor_grid(scene, spec.robot.laser.z), trace),
        verdicts=oracles.judge(trace, spec.oracles),
    )


def _worlds(
    told: Sequence[_Told], near: float
) -> tuple[tuple[DoorCount, ...], tuple[FloorArea, ...]]:
    """Sum up doors and floor, scene by scene."""
    groups: dict[tuple[str, float], list[_Told]] = {}
    for one in told:
        groups.setdefault(one.world, []).append(one)
    doors: list[DoorCount] = []
    floor: list[FloorArea] = []
    for world, group in groups.items():
        scene = group[0].scene
        doors += door_counts(scene.name, [one.doors for one in group], near)
        floor.append(floor_area(scene, floor_grid(scene, world[1]), [one.painted for one in group]))
    return tuple(doors), tuple(floor)
