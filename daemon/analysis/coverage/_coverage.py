"""Coverage of a campaign: of its specifications, and of its traces where there are any.

Margins are how far from their limits the runs were, oracle by oracle, as histograms.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

from daemon.analysis.coverage._building import (
    CoveredCells,
    DoorRun,
    covered_cells,
    door_counts,
    door_runs,
    floor_area,
    floor_grid,
)
from daemon.analysis.coverage._features import (
    MODEL,
    RecognisedFeatures,
    feature_counts,
    pair_counts,
    recognise_features,
)
from daemon.analysis.coverage._results import (
    Coverage,
    DoorCount,
    FloorArea,
    MarginHistogram,
    Unreadable,
)
from daemon.analysis.coverage._rules import run_facts
from daemon.analysis.parallel_map import parallel_map
from daemon.judging import oracles
from daemon.model.spec import RunSpec
from daemon.model.verdicts import Outcome, Verdict
from daemon.trace import Trace, TraceError, read_trace
from grammars.model.scene import Scene

MAX_BINS: Final = 12
"""At most so many bins: a line of text, a bar a bin."""
_BLOCKS: Final = "▁▂▃▄▅▆▇█"


def margin_histograms(verdicts: Iterable[Verdict]) -> tuple[MarginHistogram, ...]:
    """Return one histogram per oracle and unit, in the order they come; measures have none."""
    judged: dict[tuple[str, str], list[Verdict]] = {}
    for verdict in verdicts:
        if verdict.outcome is not Outcome.MEASURE:
            judged.setdefault((verdict.oracle, verdict.unit), []).append(verdict)
    # A verdict in error has no unit; it belongs to the oracle's other verdicts.
    units = {name: unit for name, unit in judged if unit}
    merged: dict[str, list[Verdict]] = {}
    for (name, _), found in judged.items():
        merged.setdefault(name, []).extend(found)
    return tuple(_histogram(name, units.get(name, ""), found) for name, found in merged.items())


def _histogram(name: str, unit: str, verdicts: Sequence[Verdict]) -> MarginHistogram:
    # A margin may be infinite, when nothing came near at all: it has no bin and is counted apart.
    decided = [v for v in verdicts if v.outcome in (Outcome.PASS, Outcome.FAIL)]
    margins = [v.margin for v in decided]
    known = [m for m in margins if m is not None and math.isfinite(m)]
    edges = bin_edges(known)
    passed = sum(v.outcome is Outcome.PASS for v in decided)
    return MarginHistogram(
        oracle=name,
        unit=unit,
        edges=edges,
        counts=_bin_counts(known, edges),
        passed=passed,
        failed=len(decided) - passed,
        undecided=len(verdicts) - len(decided),
        unbounded=len(decided) - len(known),
        least=min(known, default=None),
        greatest=max(known, default=None),
    )


def bin_edges(values: Sequence[float]) -> tuple[float, ...]:
    """Return edges of equal bins of a round width that hold all values; zero is one of them."""
    if not values:
        return ()
    low, high = min(0.0, *values), max(0.0, *values)
    width = _round_width((high - low) / (MAX_BINS - 2)) if high > low else 1.0
    first, last = math.floor(low / width), math.floor(high / width) + 1
    # Division rounds: a value may lie on the edge it is divided by, or just beyond it.
    first -= _edge(first, width) > low
    last += _edge(last, width) <= high
    return tuple(_edge(index, width) for index in range(first, last + 1))


def _edge(index: int, width: float) -> float:
    """Return an edge as people would write it: 0.3, not 0.30000000000000004."""
    return float(f"{index * width:.12g}")


def _round_width(least: float) -> float:
    """Return the smallest of 1, 2 and 5 times a power of ten that is not below ``least``."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= least)


def _bin_counts(values: Sequence[float], edges: Sequence[float]) -> tuple[int, ...]:
    return tuple(sum(low <= value < high for value in values) for low, high in pairwise(edges))


def histogram_bars(histogram: MarginHistogram) -> str:
    """Return a histogram as one line of text; a bar stands at zero, where fail and pass part."""
    bars = (*count_bars(histogram.counts), "")
    return "".join(
        ("|" if edge == 0.0 else "") + bar for edge, bar in zip(histogram.edges, bars, strict=False)
    )


def count_bars(counts: Sequence[int]) -> str:
    """Return a sign for each count: a dot for none, else the higher the more."""
    most = max(counts, default=0)
    top = len(_BLOCKS) - 1
    return "".join(_BLOCKS[top * count // most] if count else "·" for count in counts)


NEAR: Final = 1.5
"""A door is met when the robot's base comes this near [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class RunCoverage:
    """What one recorded run contributes; with equal ``world`` it is of the same building.

    It travels from the process that read the trace, so the cells of its floor are packed.
    """

    world: tuple[str, float]
    scene: Scene
    recognised: RecognisedFeatures
    doors: tuple[DoorRun, ...]
    painted: CoveredCells
    verdicts: tuple[Verdict, ...]


def planned_coverage(runs: Iterable[RunSpec], scenes: Iterable[Scene]) -> Coverage:
    """Return which features and pairs of features runs would exercise; nothing is executed.

    ``scenes`` are those the specifications name. Raises ``KeyError`` when one is missing.
    """
    known = {scene.digest: scene for scene in scenes}
    found = [recognise_features(MODEL, run_facts(spec, known[spec.scene])) for spec in runs]
    features = feature_counts(MODEL, found)
    return Coverage(len(found), 0, NEAR, features, pair_counts(MODEL, found))


def trace_coverage(
    traces: Sequence[Path], *, near: float = NEAR, processes: int | None = None
) -> Coverage:
    """Return what recorded runs have covered: features, doors, floor and margins.

    ``near`` [m] is how near the robot's base has to come to a door to have met it. Traces are
    read on ``processes`` (default: one per core) and judged by the oracles inside of them; one
    that cannot be read is among ``unreadable``. Raises :class:`daemon.batch.errors.DaemonError`
    when a reading process dies.
    """
    oracles.warm_up()  # once here, not once in every process
    read = tuple(parallel_map(_read_coverage, traces, doing="reading traces", processes=processes))
    runs = [one for one in read if isinstance(one, RunCoverage)]
    unreadable = tuple(one for one in read if isinstance(one, Unreadable))
    return dataclasses.replace(sum_coverage(runs, near=near), unreadable=unreadable)


def sum_coverage(runs: Sequence[RunCoverage], *, near: float = NEAR) -> Coverage:
    """Return what recorded runs have covered together; see :func:`trace_coverage`."""
    found = [run.recognised for run in runs]
    doors, floor = _sum_scenes(runs, near)
    return Coverage(
        runs=len(found),
        recorded=len(found),
        near=near,
        features=feature_counts(MODEL, found),
        pairs=pair_counts(MODEL, found),
        doors=doors,
        floor=floor,
        margins=margin_histograms(verdict for run in runs for verdict in run.verdicts),
    )


def _read_coverage(path: Path) -> RunCoverage | Unreadable:
    """Read one trace and return what it contributes, or what is wrong with it."""
    try:
        trace = read_trace(path, scans=True)
    except TraceError as error:
        return Unreadable(str(path), error.diagnostics[0].message)
    return run_coverage(trace, oracles.judge(trace, trace.spec.oracles))


def run_coverage(trace: Trace, verdicts: tuple[Verdict, ...]) -> RunCoverage:
    """Return what a trace, read with its scans, contributes to coverage."""
    spec, scene = trace.spec, trace.scene
    facts = run_facts(spec, scene, trace)
    return RunCoverage(
        world=(spec.scene, spec.robot.laser.z),
        scene=scene,
        recognised=recognise_features(MODEL, facts),
        doors=door_runs(facts, trace),
        painted=covered_cells(floor_grid(scene, spec.robot.laser.z), trace),
        verdicts=verdicts,
    )


def _sum_scenes(
    runs: Sequence[RunCoverage], near: float
) -> tuple[tuple[DoorCount, ...], tuple[FloorArea, ...]]:
    """Sum up doors and floor, scene by scene."""
    groups: dict[tuple[str, float], list[RunCoverage]] = {}
    for run in runs:
        # At another height the first laser, at which the map is drawn, meets other walls and
        # windows: another floor to be seen.
        groups.setdefault(run.world, []).append(run)
    doors: list[DoorCount] = []
    floor: list[FloorArea] = []
    for world, group in groups.items():
        scene = group[0].scene
        doors += door_counts(scene.name, [run.doors for run in group], near)
        floor.append(floor_area(scene, floor_grid(scene, world[1]), [run.painted for run in group]))
    return tuple(doors), tuple(floor)
