"""Drawing in terminal cells: a canvas of braille dots, and the widget that shows cells.

Only changed cells go to the terminal.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
import numpy.typing as npt
from rich.segment import Segment
from rich.style import Style
from rich.text import Text
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from grammars.model.geometry import Floats

# Our own drawing, because libraries cost more. Measured for a map with laser and trail on 80x24,
# ten frames a second, CPU per frame and bytes to the terminal: this 3.3 ms and 29 kB/s (86 without
# changed_spans), textual-hires-canvas 5.2 ms and 106 kB/s, textual-plot 13.9 ms and 244 kB/s,
# textual-plotext 21.1 ms and 137 kB/s.

BLANK: Final = 0x2800
"""The braille cell without dots; the bits of a code behind it are its dots, by row and column."""
DOT_BITS: Final = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)

Cells = npt.NDArray[np.uint8]
Codes = npt.NDArray[np.int32]
_GAP: Final = 16
"""Most unchanged cells between two changed ones to draw in one part, because each part is work for
the compositor. :class:`~scenario_tui.terminal.limited_terminal.TerminalDiff` removes them again.
"""


def points_along(segments: Floats) -> Floats:
    """Return points (m, 2) along straight lines (n, 4) as x0, y0, x1, y1, at most 1 apart."""
    start, way = segments[:, :2], segments[:, 2:] - segments[:, :2]
    steps = np.ceil(np.max(np.abs(way), axis=1)).astype(np.int64) + 1
    line = np.repeat(np.arange(len(segments)), steps)
    first = np.repeat(np.cumsum(steps) - steps, steps)
    along = (np.arange(len(line)) - first) / np.maximum(steps[line] - 1, 1)
    points: Floats = start[line] + along[:, None] * way[line]
    return points


class Canvas:
    """Dots of several layers over ``columns`` x ``rows`` cells; dot (0, 0) is at the top left.

    ``dots`` (layers, rows, columns) are bits of braille cells; ``width`` and ``height`` count them.
    """

    def __init__(self, columns: int, rows: int, layers: int) -> None:
        self.columns, self.rows = columns, rows
        self.width, self.height = 2 * columns, 4 * rows
        self.dots: Cells = np.zeros((layers, rows, columns), dtype=np.uint8)

    def points(self, dots: Floats, layer: int, size: int = 1) -> None:
        """Set dots, shape (n, 2) as x, y, or squares of ``size`` dots; ignore those outside."""
        whole = np.rint(dots).astype(np.int64)
        whole = np.vstack([whole + square for square in np.ndindex(size, size)])
        inside = np.all((whole >= 0) & (whole < (self.width, self.height)), axis=1)
        x, y = whole[inside].T
        bits = DOT_BITS[y % 4, x % 2]
        # With .at, because plain indexing would keep only the last of several dots in a cell.
        np.bitwise_or.at(self.dots[layer], (y // 4, x // 2), bits)

    def lines(self, segments: Floats, layer: int, size: int = 1) -> None:
        """Draw straight lines, shape (n, 4) as x0, y0, x1, y1 in dots, ``size`` dots thick."""
        self.points(points_along(segments), layer, size)

    def dotted_line(self, down: float, layer: int) -> None:
        """Draw a limit across, ``down`` dots from the top, distinct from curves without colours."""
        self.points(np.array([(right, down) for right in range(0, self.width, 4)]), layer)

    def bars(self, columns: Codes, tops: Floats, bottoms: Floats, layer: int) -> None:
        """Fill columns of dots (n,) from ``tops`` to ``bottoms`` (n,), the rows of both included.

        Draws upright lines in a third of the time of :meth:`lines`.
        """
        rows = np.arange(self.height)[:, None]
        filled = np.zeros((self.height, self.width), dtype=np.uint8)
        filled[:, columns] = (rows >= np.rint(tops)) & (rows <= np.rint(bottoms))
        dots = self.dots[layer]
        for (row, column), bit in np.ndenumerate(DOT_BITS):
            dots |= filled[row::4, column::2] * bit

    def cells(self) -> tuple[Codes, Codes]:
        """Return code points and layers, shape (rows, columns) each; layer -1 is empty.

        A cell belongs to its highest layer with a dot, and shows the dots of all layers.
        """
        codes = np.bitwise_or.reduce(self.dots, axis=0).astype(np.int32) + BLANK
        owners = np.full((self.rows, self.columns), -1, dtype=np.int32)
        for layer, dots in enumerate(self.dots):
            owners[dots > 0] = layer
        codes[owners < 0] = ord(" ")
        return codes, owners


def segments(codes: Codes, owners: Codes, styles: Sequence[Style]) -> list[Segment]:
    """Return one row of cells (columns,) as text with styles, one per run.

    ``owners`` index into ``styles``; -1 is the last of these.
    """
    text = codes.astype("<i4").tobytes().decode("utf-32-le")
    cuts = [0, *(np.flatnonzero(owners[1:] != owners[:-1]) + 1).tolist(), len(text)]
    return [Segment(text[a:b], styles[owners[a]]) for a, b in itertools.pairwise(cuts)]


@lru_cache(maxsize=64)
def _over(styles: tuple[Style, ...], base: Style) -> tuple[Style, ...]:
    """Return styles over ``base``, and ``base`` alone at the last index, -1."""
    return (*(base + style for style in styles), base)


def text_lines(codes: Codes, owners: Codes, styles: Sequence[Style]) -> list[Text]:
    """Return cells (rows, columns) as lines of text; owners of -1 have no style."""
    every = (*styles, Style())
    rows = (segments(*row, every) for row in zip(codes, owners, strict=True))
    return [Text.assemble(*((part.text, part.style or "") for part in row)) for row in rows]


def write_text(codes: Codes, owners: Codes, row: int, column: int, text: str, owner: int) -> None:
    """Write a text over cells (rows, columns), cut to their rows."""
    room = text[: max(codes.shape[1] - column, 0)]
    if 0 <= row < len(codes):
        codes[row, column : column + len(room)] = [ord(sign) for sign in room]
        owners[row, column : column + len(room)] = owner


def changed_spans(before: Codes, after: Codes) -> list[Region]:
    """Return the parts of rows in which two arrays of cells (k, rows, columns) differ."""
    changed = (before != after).any(axis=0)
    spans = []
    for row in np.flatnonzero(changed.any(axis=1)).tolist():
        at = np.flatnonzero(changed[row])
        cuts = np.flatnonzero(np.diff(at) > _GAP)
        starts, ends = at[np.append(0, cuts + 1)], at[np.append(cuts, len(at) - 1)]
        for a, b in zip(starts.tolist(), ends.tolist(), strict=True):
            spans.append(Region(a, row, b - a + 1, 1))
    return spans


class CellView(Widget):
    """Shows the cells of :meth:`cells`; call :meth:`redraw` after a change."""

    STYLES: ClassVar[tuple[Style, ...]] = ()

    _cells: Codes | None = None

    def cells(self, columns: int, rows: int) -> tuple[Codes, Codes] | None:
        """Return code points and styles, shape (rows, columns) each, or nothing to show."""
        raise NotImplementedError

    def redraw(self) -> None:
        """Draw anew, and send the changed cells to the terminal."""
        before, size = self._cells, self.size
        cells = self.cells(*size) if size else None
        after = self._cells = None if cells is None else np.stack(cells)
        if before is None or after is None or before.shape != after.shape:
            if before is not after:
                self.refresh()
        elif spans := changed_spans(before, after):
            self.refresh(*spans)

    def on_resize(self) -> None:
        """Draw for the new size."""
        self._cells = None
        self.redraw()

    def render_line(self, y: int) -> Strip:
        """Return one row of cells, runs of one style joined."""
        base = self.visual_style.rich_style
        if self._cells is None or y >= self._cells.shape[1]:
            return Strip.blank(self.size.width, base)
        codes, owners = self._cells[:, y]
        row = segments(codes, owners, _over(self.STYLES, base))
        return Strip(row, self._cells.shape[2])
