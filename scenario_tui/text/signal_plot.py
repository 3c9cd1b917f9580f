"""Signals of a recorded run, drawn with characters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from daemon.judging.oracles import SignalSampler, judge, trace_problems
from daemon.model.verdicts import Verdict
from daemon.trace import Trace, TraceError, read_trace
from grammars.model.geometry import Floats
from grammars.oracle import (
    Oracle,
    Signal,
    Statistic,
    Temporal,
    check_references,
    kind_of,
    parse_oracle,
)
from grammars.text.diagnostics import InputError, Where

LEAST_ROWS: Final = 5
"""Rows of cells a graph takes at least."""
_LABELS: Final = 20
"""Columns plotille takes besides the graph: numbers before it, the unit of time after it."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A signal over time: ``time`` and ``values`` (n,), NaN where it is not known."""

    name: str
    unit: str
    time: Floats
    values: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """The signals asked for of one run, and what its oracles say."""

    trace: Trace
    curves: tuple[Curve, ...]
    verdicts: tuple[Verdict, ...]


def read_curves(path: Path, signals: list[str]) -> Curves:
    """Sample signals, written as in oracles, of the run in a trace.

    Raises :class:`daemon.trace.TraceError` for a trace that cannot be used or trusted and
    :class:`InputError` for what is no signal, or none of this run's scene.
    """
    trace = read_trace(path)
    parsed = [_parsed(text, trace) for text in signals]
    problems = trace_problems(trace)
    if problems:
        raise TraceError(path, f"not to be trusted: {'; '.join(problems)}", "run it again")
    sampler = SignalSampler(trace)
    curves = tuple(
        Curve(text, unit, sampler.time_base.time, sampler.sample(signal).values)
        for text, (signal, unit) in zip(signals, parsed, strict=True)
    )
    return Curves(trace, curves, judge(trace, trace.spec.oracles, sampler=sampler))


def _parsed(text: str, trace: Trace) -> tuple[Signal, str]:
    oracle = _oracle_about(text)
    found = check_references(oracle, trace.scene, trace.spec.mission)
    if found:
        raise InputError(found)
    match oracle.judgement:
        case Statistic(signal=Signal() as signal) | Temporal(predicate=Signal() as signal):
            kind = kind_of(signal)
            return signal, "bool" if kind is None else kind.unit
    raise ValueError(f'"{text}" is no signal: name one, such as clearance or loc.error')


def _oracle_about(text: str) -> Oracle:
    """Return an oracle about the signal, which is a quantity, else true or false."""
    # Signals have no grammar of their own. What is wrong is said of the first try: most signals
    # are quantities.
    where = Where(f"signal {text}")
    try:
        return parse_oracle(text, f"max({text})", where)
    except InputError:
        try:
            return parse_oracle(text, f"never({text})", where)
        except InputError:
            pass
        raise


def envelope(curve: Curve, columns: int) -> tuple[Floats, Floats]:
    """Return a curve of at most two points a column, the least and the greatest in it, in order.

    A spike of one sample stays to be seen however long the run. Unknown samples are left out.
    """
    known = np.isfinite(curve.values)
    time, values = curve.time[known], curve.values[known]
    if len(time) <= 2 * columns:
        return time, values
    edges = np.linspace(time[0], time[-1], columns + 1)[1:-1]
    cells = np.split(np.arange(len(time)), np.searchsorted(time, edges))
    kept = [
        index
        for cell in cells
        if len(cell)
        for index in sorted({cell[np.argmin(values[cell])], cell[np.argmax(values[cell])]})
    ]
    return time[kept], values[kept]


def draw_curve(
    curve: Curve, width: int, rows: int, *, colour: bool, marks: tuple[float, ...]
) -> str:
    """Return a graph of at most ``width`` columns, with upright lines at ``marks`` [s]."""
    import plotille

    figure = plotille.Figure()
    columns = max(width - _LABELS, 10)
    figure.width, figure.height = columns, max(rows, LEAST_ROWS)
    figure.color_mode, figure.with_colors = "names", colour
    figure.register_label_formatter(float, _number)
    figure.x_label = "s"
    figure.y_label = curve.unit
    time, values = envelope(curve, 2 * columns)  # a braille cell is two dots wide
    start, end = _span(curve.time)
    figure.set_x_limits(min_=start, max_=end)
    low, high = _span(values, 0.05)
    figure.set_y_limits(min_=low, max_=high)
    figure.plot(time.tolist(), values.tolist(), lc="cyan")
    for mark in marks:
        figure.axvline((mark - start) / (end - start), lc="red")
    return "\n".join(line.rstrip() for line in str(figure.show()).splitlines())


def _span(values: Floats, room: float = 0.0) -> tuple[float, float]:
    """Return limits around values, never empty, with ``room`` as a share of their range."""
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    more = room * (high - low) if high > low else max(abs(low), 1.0) * 0.5
    return (low, high) if not room and high > low else (low - more, high + more)


def _number(value: float, chars: int, delta: float, left: bool = False) -> str:
    """Return a label of ``chars`` characters for plotille."""
    text = f"{value:.3g}" if delta < 1000 else f"{value:.0f}"
    text = "0" if float(text) == 0 else text
    return text.ljust(chars) if left else text.rjust(chars)
