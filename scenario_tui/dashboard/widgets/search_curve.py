"""The margins of a search over its runs: failures, and the best margin so far."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Final

import numpy as np
import numpy.typing as npt
from rich.style import Style

from daemon.model.search import SearchTask
from daemon.model.trials import Trial, smallest_so_far
from daemon.model.verdicts import Outcome
from grammars.model.geometry import Floats
from grammars.text.words import format_quantity
from scenario_tui.dashboard.searches import SearchTrials
from scenario_tui.dashboard.widgets.cell_view import Canvas, CellView, Codes, write_text
from scenario_tui.text.styles import BAD, BROKEN, BUSY, COLOURS, GLYPHS, QUIET, UNSURE

_LIMIT, _RUN, _BEST, _FAIL, _WORDS, _LOST = range(6)
_GUTTER: Final = 11
"""Columns for the margins beside the graph."""
_FIRST_RUNS: Final = 60
"""Runs for which the graph has room at first; the room doubles up to the budget."""
LEGEND: Final = "• run  ✗ fails  ━ best so far  ┈ limit"


def _room(task: SearchTask, count: int, running: bool) -> int:
    # In steps, because a graph that grows with every run would be drawn anew every time.
    room = _FIRST_RUNS
    while room < count:
        room *= 2
    return max(count, min(room, task.runs) if running else 0, 2)


def value_limits(value: Floats) -> tuple[float, float]:
    """Return the least and greatest value of the graph; 0, the limit, is always in view.

    A few runs far above the others are cut, because all others would be one line.
    """
    if not len(value):
        return -1.0, 1.0
    low, high = min(float(value.min()), 0.0), max(float(value.max()), 0.0)
    usual = max(float(np.quantile(value, 0.9)), 0.0)
    if high - low > 2.0 * (usual - low) > 0.0:
        high = usual
    room = 0.06 * (high - low) or 0.5
    return low - room, high + room


class SearchGraph:
    """The cells of a graph of a search: its margins at the left, its runs below.

    ``codes`` are code points and ``owners`` styles (rows, columns). ``value`` (n,) are the margins
    of the runs at the positions ``at`` (n,) in ``unit``, or without a unit their ratios to the
    scales of the oracles. ``best`` (m,) is the smallest value so far at each of ``m`` runs, NaN
    before the first. ``room`` is the width of the graph in runs.
    """

    def __init__(self, search: SearchTrials, columns: int, rows: int) -> None:
        trials, task = search.trials, search.row.task
        value = np.array([one.compared for one in trials], dtype=np.float64)
        finite = np.isfinite(value)
        explored = (one.compared if one.explores else math.nan for one in trials)
        self.unit = task.scales[0].unit if len(task.scales) == 1 else ""
        self.room = _room(task, len(trials), not search.row.ended)
        self.at, self.value = np.flatnonzero(finite), value[finite]
        self.best = np.array(smallest_so_far(explored))
        self.codes: Codes = np.full((rows, columns), ord(" "), dtype=np.int32)
        self.owners: Codes = np.full((rows, columns), -1, dtype=np.int32)
        self._gutter = min(_GUTTER, columns // 3)
        self._canvas = Canvas(columns - self._gutter, rows - 1, 5)
        self._low, self._high = value_limits(self.value)
        self._draw_best()
        self._draw_runs(np.array([one.fails for one in trials], dtype=np.bool_)[finite])
        self._write_margins()
        self._write_axis(trials)

    def _across(self, positions: npt.ArrayLike) -> Floats:
        last = self._canvas.width - 1
        dots: Floats = np.asarray(positions, dtype=np.float64) * last / (self.room - 1)
        return np.minimum(dots, last)

    def _down(self, values: npt.ArrayLike) -> Floats:
        share = (self._high - np.asarray(values, dtype=np.float64)) / (self._high - self._low)
        dots: Floats = np.clip(share, 0.0, 1.0) * (self._canvas.height - 1)
        return dots

    def _draw_best(self) -> None:
        """Draw the limit, and the best value so far, a column of dots after the other."""
        best, canvas = self.best, self._canvas
        canvas.dotted_line(float(self._down(0.0)), _LIMIT)
        if len(best):
            # The last run in a column has the smallest value so far.
            edges = (np.arange(canvas.width) + 0.5) * (self.room - 1) / max(canvas.width - 1, 1)
            at = np.minimum(np.floor(edges).astype(np.int64), len(best) - 1)
            y = self._down(best[at])
            reached = np.arange(canvas.width) <= self._across(len(best) - 1) + 1
            x = np.flatnonzero(np.isfinite(y) & reached)
            # Down from the column before, whose value is not below this one.
            canvas.bars(x.astype(np.int32), np.fmin(y[np.maximum(x - 1, 0)], y[x]), y[x], _BEST)

    def _draw_runs(self, fails: npt.NDArray[np.bool_]) -> None:
        """Draw every run as a dot, larger if there is room, and the worst failures as signs."""
        canvas, cells = self._canvas, slice(self._gutter, None)
        x, y = self._across(self.at), self._down(self.value)
        for layer, those in ((_RUN, ~fails), (_FAIL, fails)):
            canvas.points(np.column_stack([x[those], y[those]]), layer)
        self.codes[:-1, cells], self.owners[:-1, cells] = canvas.cells()
        failed = np.flatnonzero(fails)
        passed = np.flatnonzero(~fails) if self.room <= canvas.width else ()
        signs = dict.fromkeys(passed, ("•", _RUN))
        worst = {int(x[at] // 2): at for at in failed[np.argsort(-self.value[failed])]}
        signs |= dict.fromkeys(worst.values(), (GLYPHS["fail"], _FAIL))
        for at, (sign, owner) in signs.items():
            self._write(int(y[at] // 4), self._gutter + int(x[at] // 2), sign, owner)

    def _write_margins(self) -> None:
        """Write the margins of the edges and of the limit beside the graph."""
        rows = self._canvas.rows
        limit = int(self._down(0.0) // 4)
        self._write(limit, 0, "0".rjust(self._gutter - 2) + " ┈", _LIMIT)
        for row, value in ((0, self._high), (rows - 1, self._low)):
            if row != limit:
                text = format_quantity(value, self.unit)
                self._write(row, 0, text[: self._gutter - 1].rjust(self._gutter - 2), _WORDS)

    def _write_axis(self, trials: Sequence[Trial]) -> None:
        """Write the axis of runs below the graph, with phases and runs without a margin."""
        row, at, width = self._canvas.rows, self._gutter, self._canvas.columns
        last = str(self.room - 1)
        self._write(row, 0, "run".rjust(at - 2), _WORDS)
        self._write(row, at, "0", _WORDS)
        self._write(row, at + width - len(last), last, _WORDS)
        phases: dict[str, int] = {}
        for position, one in enumerate(trials):
            phases.setdefault(one.proposal.phase, position)
        free = at + 2
        for phase, position in phases.items():
            column = max(at + int(self._across(position) // 2), free)
            text = f"│{phase}"
            if position and column + len(text) <= at + width - len(last) - 1:
                self._write(row, column, text, _WORDS)
                free = column + len(text) + 1
        # Beside the numbers at the ends, not over them.
        first, end = at + 1, max(at + width - len(last) - 1, at + 1)
        for position, one in enumerate(trials):
            if one.outcome is not None and not math.isfinite(one.compared):
                column = min(max(at + int(self._across(position) // 2), first), end)
                is_unsure = one.outcome is Outcome.INCONCLUSIVE
                sign = GLYPHS["inconclusive" if is_unsure else "error"]
                self._write(row, column, sign, _LOST)

    def _write(self, row: int, column: int, text: str, owner: int) -> None:
        write_text(self.codes, self.owners, row, column, text, owner)


class SearchCurveView(CellView):
    """Draws the :class:`SearchGraph` of a search."""

    STYLES: ClassVar[tuple[Style, ...]] = (
        Style(color=COLOURS[UNSURE]),
        Style(color=COLOURS[QUIET]),
        Style(color=COLOURS[BUSY], bold=True),
        Style(color=COLOURS[BAD], bold=True),
        Style(color=COLOURS[QUIET]),
        Style(color=COLOURS[BROKEN], bold=True),
    )

    _search: SearchTrials | None = None

    def show(self, search: SearchTrials) -> None:
        """Show a search."""
        self._search = search
        self.redraw()

    def cells(self, columns: int, rows: int) -> tuple[Codes, Codes] | None:
        """Return the graph as cells, ``None`` without room for it."""
        if self._search is None or columns < 20 or rows < 3:
            return None
        graph = SearchGraph(self._search, columns, rows)
        return graph.codes, graph.owners
