"""A widget of characters and styles in arrays; only cells that changed go to the terminal."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
from rich.segment import Segment
from rich.style import Style
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from scenario_tui.widgets.braille import Codes

_GAP: Final = 16
"""Unchanged cells between two changed ones that are drawn along: the app sends changed ones only,
and every part takes some work.
"""


def segments(codes: Codes, owners: Codes, styles: Sequence[Style], base: Style) -> list[Segment]:
    """Return one row of cells (columns,) as text with styles over ``base``, one per run.

    ``owners`` index into ``styles``; negative ones have no style of their own.
    """
    text = "".join(map(chr, codes.tolist()))
    cuts = [0, *(np.flatnonzero(owners[1:] != owners[:-1]) + 1).tolist(), len(text)]
    over = _over(tuple(styles), base)
    return [Segment(text[a:b], over[owners[a]]) for a, b in itertools.pairwise(cuts)]


@lru_cache(maxsize=64)
def _over(styles: tuple[Style, ...], base: Style) -> tuple[Style, ...]:
    """Return styles over ``base``, and last, where index -1 points to, that alone."""
    return (*(base + style for style in styles), base)


def changed_spans(before: Codes, after: Codes, gap: int = _GAP) -> list[Region]:
    """Return the parts of rows in which two arrays of cells (k, rows, columns) differ."""
    changed = (before != after).any(axis=0)
    found = []
    for row in np.flatnonzero(changed.any(axis=1)).tolist():
        at = np.flatnonzero(changed[row])
        cuts = np.flatnonzero(np.diff(at) > gap)
        starts, ends = at[np.append(0, cuts + 1)], at[np.append(cuts, len(at) - 1)]
        for a, b in zip(starts.tolist(), ends.tolist(), strict=True):
            found.append(Region(a, row, b - a + 1, 1))
    return found


class CellView(Widget):
    """Shows what :meth:`cells` returns; call :meth:`redraw` when that changed."""

    STYLES: ClassVar[Sequence[Style]] = ()

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._cells: Codes | None = None
        self._base: Style | None = None

    def cells(self, columns: int, rows: int) -> tuple[Codes, Codes] | None:
        """Return code points and styles, shape (rows, columns) each, or nothing to show."""
        raise NotImplementedError

    def redraw(self) -> None:
        """Draw anew and have the terminal told of what changed."""
        self._base = None
        before, size = self._cells, self.size
        drawn = self.cells(size.width, size.height) if size.width and size.height else None
        self._cells = None if drawn is None else np.stack(drawn)
        if before is None or self._cells is None or before.shape != self._cells.shape:
            if before is not None or self._cells is not None:
                self.refresh()
            return
        spans = changed_spans(before, self._cells)
        if spans:
            self.refresh(*spans)

    def on_resize(self) -> None:
        """Draw for the new size."""
        self._cells = None
        self.redraw()

    def notify_style_update(self) -> None:
        """Take over another style of the background."""
        super().notify_style_update()
        self._base = None

    def render_line(self, y: int) -> Strip:
        """Return one row of cells, runs of one style joined."""
        if self._cells is None or y >= self._cells.shape[1]:
            return Strip.blank(self.size.width, self.rich_style)
        if self._base is None:
            self._base = self.rich_style
        codes, owners = self._cells[:, y]
        row = segments(codes, owners, self.STYLES, self._base)
        return Strip(row, self._cells.shape[2])
