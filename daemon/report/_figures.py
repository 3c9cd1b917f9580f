"""Which figures a report has, and drawing them in parallel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from daemon.assessment import OracleCell
from daemon.report import _campaign_figures, _cell_figures
from daemon.report._buffer import limit_of
from daemon.report._extra import needed
from daemon.report._gather import Material
from daemon.report._moment import moment
from daemon.report._types import Driven, Passing
from daemon.spread import spread
from daemon.trace import TraceError, read_scene
from daemon.verdict import Outcome
from grammars.scene import Scene

MOST_CELLS: Final = 60
"""Cells that get figures of their own; in larger campaigns the first ones, and it is said so."""


MOST_MOMENTS: Final = 24
"""Findings whose deciding moment is drawn."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawn figure: ``svg`` and what it shows of which cell."""

    kind: str
    scenario: str
    sut: str
    caption: str
    svg: str


@dataclass(frozen=True, slots=True)
class _Task:
    """A figure to draw: ``draw(name, label)`` gives its SVG."""

    kind: str
    scenario: str
    sut: str
    caption: str
    label: str
    draw: Callable[[str, str], str]


def draw_figures(material: Material, *, processes: int | None = None) -> tuple[Figure, ...]:
    """Draw every figure of a report; raises :class:`InputError` without the extra ``report``."""
    needed("matplotlib.figure", "a report with figures")
    needed("matplotlib.backends.backend_svg", "a report with figures")
    drawn = (*_moments(material), *_of_cells(material), *_of_campaign(material))
    tasks = tuple(enumerate(drawn))
    return tuple(spread(_draw, tasks, doing="that draws figures", processes=processes))


def _draw(numbered: tuple[int, _Task]) -> Figure:
    number, task = numbered
    svg = task.draw(f"f{number}", task.label)
    return Figure(task.kind, task.scenario, task.sut, task.caption, svg)


def findings(material: Material) -> tuple[OracleCell, ...]:
    """Return the verdicts to look at: what contradicts, is open or fails, unexpected ones first."""
    wanted = [
        oracle
        for cell in material.assessment.cells
        for oracle in cell.oracles
        if not oracle.met or oracle.verdict is not Outcome.PASS
    ]
    return tuple(sorted(wanted, key=lambda oracle: oracle.met))


def _moments(material: Material) -> Iterator[_Task]:
    """Draw the deciding moments of the first findings."""
    runs = {run.record.id: run for run in material.runs}
    for oracle in findings(material)[:MOST_MOMENTS]:
        worst = oracle.worst
        time = None if worst is None else worst.verdict.evidence.time
        if worst is None or time is None:
            continue
        run, involved = runs[worst.run], worst.verdict.evidence.object
        if run.record.trace is None or not len(run.driven.time):
            continue
        caption = f"repeat {worst.repeat} at {time:.1f} s"
        yield _Task(
            f"moment {oracle.oracle}", oracle.scenario, oracle.sut, caption,
            f"The moment that decides {oracle.oracle}, {oracle.scenario} with {oracle.sut}",
            partial(
                moment, trace=Path(run.record.trace), time=time, involved=involved,
                buffer=run.driven.buffer,
            ),
        )  # fmt: skip


def _cells(material: Material) -> dict[tuple[str, str], list[Driven]]:
    found: dict[tuple[str, str], list[Driven]] = {}
    for run in material.runs:
        if len(run.driven.time) > 1:
            found.setdefault((run.record.scenario, run.record.sut), []).append(run.driven)
    return dict(list(found.items())[:MOST_CELLS])


def _of_cells(material: Material) -> Iterator[_Task]:
    cells, scenes = _cells(material), _scenes(material)
    limit = limit_of(material.chosen.oracles, "loc.error")
    for scenario in dict.fromkeys(scenario for scenario, _ in cells):
        here = {sut: runs for (name, sut), runs in cells.items() if name == scenario}
        frame = _cell_figures.frame_of([run for runs in here.values() for run in runs])
        for sut, runs in here.items():
            of = f"{scenario} with {sut}"
            if any(not np.isnan(run.error).all() for run in runs):
                yield _Task(
                    "localisation", scenario, sut, sut,
                    f"Localisation error and spread over time, {of}",
                    partial(_cell_figures.localisation, runs=runs, frame=frame, limit=limit),
                )  # fmt: skip
            if any(np.isnan(run.clearance).all() for run in runs):
                continue
            yield _Task(
                "distance", scenario, sut, sut, f"Clearance over time, {of}",
                partial(_cell_figures.distance, runs=runs, frame=frame),
            )  # fmt: skip
            scene = scenes.get(runs[0].scene)
            if scene is not None:
                yield _Task(
                    "way", scenario, sut, sut, f"Clearance along the way on the map, {of}",
                    partial(_cell_figures.along_the_way, runs=runs, frame=frame, scene=scene),
                )  # fmt: skip
            if any(len(run.inside) for run in runs):
                yield _Task(
                    "inside", scenario, sut, f"{scenario}, {sut}",
                    f"Obstacles inside the safety buffer as seen from the robot, {of}",
                    partial(_cell_figures.inside_buffer, runs=runs),
                )  # fmt: skip


def _of_campaign(material: Material) -> Iterator[_Task]:
    yield from _worst_localisation(material)
    yield from _boxes(material, "time in buffer", "time in buffer [s]")
    yield from _boxes(material, "error p95", "95 % of the error [m]")
    yield from _boxes(material, "duration", "duration [s]")
    yield from _triggers(material)


def _worst_localisation(material: Material) -> Iterator[_Task]:
    known = [run for run in material.runs if "error max" in run.driven.measures]
    if not known:
        return
    worst = max(known, key=lambda run: run.driven.measures["error max"])
    scene = _scenes(material).get(worst.driven.scene)
    if scene is None:
        return
    of = f"{worst.record.scenario} with {worst.record.sut}, repeat {worst.record.repeat}"
    limit = limit_of(material.chosen.oracles, "loc.error")
    yield _Task(
        "worst-localisation", worst.record.scenario, of, "around the peak",
        f"The largest localisation error over time, {of}",
        partial(_campaign_figures.error_peak, run=worst.driven, limit=limit),
    )  # fmt: skip
    yield _Task(
        "worst-localisation", worst.record.scenario, of, "where it was",
        f"The largest localisation error on the map, {of}",
        partial(_campaign_figures.peak_on_map, run=worst.driven, scene=scene),
    )  # fmt: skip


def _boxes(material: Material, measure: str, axis: str) -> Iterator[_Task]:
    values: dict[str, dict[str, list[float]]] = {}
    for run in material.runs:
        if measure in run.driven.measures:
            of = values.setdefault(run.record.scenario, {}).setdefault(run.record.sut, [])
            of.append(run.driven.measures[measure])
    if not values or not any(v for cells in values.values() for vs in cells.values() for v in vs):
        return
    suts = tuple(dict.fromkeys(sut for cells in values.values() for sut in cells))
    table = tuple((scenario, tuple(cells.items())) for scenario, cells in values.items())
    yield _Task(
        f"boxes {measure}", "", "", measure, f"Boxplots of {measure} by scenario",
        partial(_campaign_figures.boxes, values=table, suts=suts, axis=axis),
    )  # fmt: skip


def scenarios_with_triggers(material: Material) -> tuple[str, ...]:
    """Return the scenarios in the figures around triggers, in the order of their colours."""
    names = (run.record.scenario for run in material.runs if run.driven.passings)
    return tuple(dict.fromkeys(names))


def _triggers(material: Material) -> Iterator[_Task]:
    colours = {name: number for number, name in enumerate(scenarios_with_triggers(material))}
    found: dict[tuple[str, str], dict[int, list[Passing]]] = {}
    for run in material.runs:
        for passing in run.driven.passings:
            if len(passing.since) > 1:
                by_scenario = found.setdefault((passing.joint, run.record.sut), {})
                by_scenario.setdefault(colours[run.record.scenario], []).append(passing)
    for (joint, sut), by_scenario in sorted(found.items()):
        door = joint.rpartition(".")[0] or joint
        yield _Task(
            "trigger", door, sut, sut,
            f"Speed and turning speed around the trigger of {door} with {sut}",
            partial(_campaign_figures.around_triggers, scenarios=tuple(by_scenario.items())),
        )  # fmt: skip


def _scenes(material: Material) -> dict[str, Scene]:
    """Return the scenes of the runs by digest, each read from one of the traces."""
    found: dict[str, Scene] = {}
    for run in material.runs:
        digest, trace = run.driven.scene, run.record.trace
        if digest and trace is not None and digest not in found:
            try:
                found[digest] = read_scene(Path(trace))
            except TraceError:
                # Read a moment ago and gone now: the figure has no walls then.
                continue
    return found
