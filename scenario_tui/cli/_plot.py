"""The command that draws signals of a recorded run in the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._options import AsJson, Connect, RunOrTrace, State

if TYPE_CHECKING:
    from scenario_tui.plotting import Curve, Curves


def plot(
    run: RunOrTrace,
    signals: Annotated[
        list[str],
        typer.Argument(
            metavar="SIGNAL",
            help="Signals as oracles name them: clearance speed loc.error door-17.angle "
            "'clearance(0.35 m, 0.2 m)'.",
            autocompletion=_completion.signals,
        ),
    ],
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Draw signals of a recorded run over time, with the moments that decided against it."""
    from scenario_tui.cli._chosen import one_trace
    from scenario_tui.cli._session import Target
    from scenario_tui.plotting import read_curves

    trace = one_trace(run, Target(connect, state), "RUN")
    try:
        found = read_curves(trace, signals)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="SIGNAL") from error
    if as_json:
        _emit(found)
    else:
        _print(found)


def _emit(found: Curves) -> None:
    from scenario_tui.cli._output import emit

    emit(
        "plot",
        run=found.trace.spec.label,
        trace=str(found.trace.path),
        signals=[_plain(curve) for curve in found.curves],
        verdicts=list(found.verdicts),
    )


def _plain(curve: Curve) -> dict[str, object]:
    """Return a curve as JSON can hold it: null where the signal is not known or not finite."""
    import math

    values = [value if math.isfinite(value) else None for value in curve.values.tolist()]
    return {"name": curve.name, "unit": curve.unit, "time": curve.time.tolist(), "values": values}


def _print(found: Curves) -> None:
    import shutil

    import numpy as np
    from rich.text import Text

    from daemon.verdict import Outcome
    from scenario_tui.cli._output import out
    from scenario_tui.wording import glyph_word, moment, quantity

    console = out()
    size = shutil.get_terminal_size((80, 24))
    against = [v for v in found.verdicts if v.outcome is Outcome.FAIL]
    marks = tuple(v.evidence.time for v in against if v.evidence.time is not None)
    colour = console.is_terminal and console.color_system is not None
    # A graph has five lines besides its rows: what it is, the unit, the top and the axis of time.
    rows = (size.lines - 1 - len(against)) // len(found.curves) - 5
    for curve in found.curves:
        known = curve.values[np.isfinite(curve.values)]
        said = "never known in this run"
        if len(known):
            unit = "" if curve.unit == "bool" else curve.unit
            low, high = quantity(float(known.min()), ""), quantity(float(known.max()), unit)
            said = f"{low} to {high}, at the end {quantity(float(known[-1]), unit)}"
        console.print(Text.assemble((curve.name, "bold"), f"  {said}"), soft_wrap=True)
        if len(known):
            console.print(Text.from_ansi(_drawn(curve, size.columns, rows, colour, marks)))
    for verdict in against:
        line = f"{glyph_word(verdict.outcome)}  {verdict.oracle}"
        when = f" at {moment(verdict.evidence.time)}" if verdict.evidence.time is not None else ""
        console.print(line + when, markup=False, soft_wrap=True)


def _drawn(curve: Curve, width: int, rows: int, colour: bool, marks: tuple[float, ...]) -> str:
    from scenario_tui.plotting import draw

    return draw(curve, width, rows, colour=colour, marks=marks)
