"""The command that draws signals of a recorded run."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.model.verdicts import Outcome, Verdict
from grammars.text.words import format_quantity
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.options import RunOrTrace
from scenario_tui.cli.output import print_line
from scenario_tui.library.trace import Trace
from scenario_tui.source import DaemonTarget, one_trace
from scenario_tui.text.formatting import glyph_word, moment_text

if TYPE_CHECKING:
    from rich.text import Text

    from scenario_tui.library.signal import Signal


@dataclass(frozen=True, slots=True)
class PlottedSignal:
    """A signal over ``time`` [s]; a value that is unknown or not finite is null."""

    name: str
    unit: str
    time: list[float]
    value: list[float]


@dataclass(frozen=True, slots=True)
class Plot:
    """Signals of a run, and its verdicts."""

    run: str
    trace: str
    signals: tuple[PlottedSignal, ...]
    verdicts: tuple[Verdict, ...]


def plot(
    run: RunOrTrace,
    signals: Annotated[
        list[str],
        typer.Argument(
            metavar="SIGNAL",
            help="Signals by their names in oracles: clearance speed loc.error door_17.angle "
            "'clearance(0.35 m, 0.2 m)'.",
            autocompletion=completion.offers(completion.signals),
        ),
    ],
    *,
    target: DaemonTarget,
) -> Answer[Plot]:
    """Draw signals of a recorded run over time, and mark the moments of failures."""
    trace = Trace(one_trace(run, target))
    sampled = [trace.signal(name) for name in signals]
    plotted = (PlottedSignal(s.name, s.unit, s.time.tolist(), s.value.tolist()) for s in sampled)
    value = Plot(trace.recorded.spec.label, str(trace.path), tuple(plotted), trace.verdicts)
    return Answer("plot", value, partial(_print, trace, sampled, value.verdicts))


def _print(trace: Trace, signals: list[Signal], verdicts: tuple[Verdict, ...]) -> None:
    from scenario_tui.dashboard.widgets.timeline import draw_signals

    size = shutil.get_terminal_size((80, 24))
    failures = [v for v in verdicts if v.outcome is Outcome.FAIL]
    marks = tuple(v.evidence.time for v in failures if v.evidence.time is not None)
    for signal in signals:
        print_line(_summary(signal))
    rows = size.lines - 1 - len(failures) - len(signals)
    for row in draw_signals(trace.recorded, signals, size.columns, rows, marks=marks):
        print_line(row)
    for one in failures:
        parts = (f"{glyph_word(one.outcome)}  {one.oracle}", moment_text(one.evidence.time))
        print_line(" ".join(filter(None, parts)))


def _summary(signal: Signal) -> Text:
    """Return a signal in a line: its range and its last value."""
    import numpy as np
    from rich.text import Text

    finite = signal.value[np.isfinite(signal.value)]
    words = "has no value in this run"
    if len(finite):
        unit = "" if signal.unit == "bool" else signal.unit
        low, high = format_quantity(float(finite.min())), format_quantity(float(finite.max()), unit)
        words = f"{low} to {high}, at the end {format_quantity(float(finite[-1]), unit)}"
    return Text.assemble((signal.name, "bold"), f"  {words}")
