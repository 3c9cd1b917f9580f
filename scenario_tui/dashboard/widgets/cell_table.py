"""A table with labelled rows and a cursor on one cell: what does not fit is folded, never cut."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import ClassVar, Final

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text
from textual.binding import Binding, BindingType
from textual.coordinate import Coordinate
from textual.geometry import Size
from textual.widgets import DataTable

from scenario_tui.dashboard.widgets.static_text import same_text
from scenario_tui.dashboard.widgets.tables import Row

_NARROWEST: Final = 12
"""Cells of a column of a matrix at least; one with more of these than fit is scrolled."""
_JOIN: Final = "\ue000"
"""Stands for a space at which no line is broken: U+00A0 is one to who breaks lines."""
_UNIT: Final = re.compile(r"(?<=\d) (?=[^\W\d_]{1,3}\b)")
"""The space between a number and its unit, or its footnote."""


def widest_line(cell: Text) -> int:
    """Return the width of the widest line of a cell."""
    return max((cell_len(line) for line in cell.plain.split("\n")), default=0)


class CellTable(DataTable[Text]):
    """A :class:`DataTable` with labelled rows and a cursor on one cell."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("h", "cursor_left", "Left", show=False, id="left", tooltip="Also the arrow"),
        Binding("j", "cursor_down", "Down", show=False, id="down", tooltip="Also the arrow"),
        Binding("k", "cursor_up", "Up", show=False, id="up", tooltip="Also the arrow"),
        Binding("l", "cursor_right", "Right", show=False, id="right", tooltip="Also the arrow"),
        Binding("enter", "select_cursor", "Runs", id="open", tooltip="The runs of the cell"),
    ]

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(cursor_type="cell", id=id)
        self._titles: tuple[str, ...] = ()
        self._widths: tuple[int, ...] = ()
        self._all: tuple[Row, ...] = ()
        self._drawn: tuple[tuple[str, int], ...] = ()

    @property
    def cell(self) -> tuple[str, str] | None:
        """Row and column under the cursor, ``None`` in an empty table."""
        row, column = self.cursor_coordinate
        if row < len(self._drawn) and column < len(self._titles):
            return self._drawn[row][0], self._titles[column]
        return None

    @property
    def places(self) -> tuple[tuple[str, str], ...]:
        """Row and column of every cell, row by row."""
        return tuple((label, title) for label, _ in self._drawn for title in self._titles)

    def go_to(self, row: str, column: str) -> None:
        """Move the cursor to a cell, to the first one when it is not there."""
        labels = [label for label, _ in self._drawn]
        found = row in labels and column in self._titles
        place = (labels.index(row), self._titles.index(column)) if found else (0, 0)
        self.move_cursor(row=place[0], column=place[1], animate=False)

    def fill(self, titles: Sequence[str], lines: Sequence[Row]) -> None:
        """Show these rows; unchanged cells are not touched."""
        # Every cell that is set has its row drawn and its column measured again: over a slow line a
        # matrix in which nothing changes shall cost nothing.
        before, self._all = self._all, tuple(lines)
        widths = self._fitting(titles, lines)
        shown = tuple((label, self._folded(cells, widths)) for label, cells in lines)
        if (tuple(titles), widths, _shape(shown)) != (self._titles, self._widths, self._drawn):
            self._refill(tuple(titles), widths, shown)
            return
        for row, ((_, old), (_, new), (_, cells)) in enumerate(
            zip(before, lines, shown, strict=True)
        ):
            for column, cell in enumerate(cells):
                if not same_text(old[column], new[column]):
                    self.update_cell_at(Coordinate(row, column), cell)

    def on_resize(self) -> None:
        """Fold the cells to the new width."""
        if self._all and self._fitting(self._titles, self._all) != self._widths:
            self.fill(self._titles, self._all)

    def needed(self) -> int:
        """Return the cells it takes to show everything without folding anything."""
        return sum(_needs(self._titles, self._all)) + self._around(self._titles, self._all)

    def _around(self, titles: Sequence[str], lines: Sequence[Row]) -> int:
        """Return the cells that labels, gaps and scroll bar take."""
        labels = max((cell_len(label) for label, _ in lines), default=0)
        return labels + 2 * self.cell_padding * (len(titles) + 1) + 1

    def _fitting(self, titles: Sequence[str], lines: Sequence[Row]) -> tuple[int, ...]:
        """Return a width for each column: what it needs, or a fair share of what there is."""
        needs = _needs(titles, lines)
        left = (self.size.width or self.app.size.width) - self._around(titles, lines)
        widths = dict.fromkeys(range(len(needs)), 0)
        # The narrow ones first: what they do not take is for those that need more.
        for rank, index in enumerate(sorted(widths, key=needs.__getitem__)):
            share = max(left // (len(needs) - rank), min(_NARROWEST, needs[index]))
            widths[index] = min(needs[index], share)
            left -= widths[index]
        return self._steady(tuple(widths.values()), titles, left)

    def _steady(self, widths: tuple[int, ...], titles: Sequence[str], left: int) -> tuple[int, ...]:
        """Keep columns as wide as they were, where there is room: margins come and go."""
        if tuple(titles) != self._titles:
            return widths
        kept = tuple(map(max, widths, self._widths))
        return kept if sum(kept) - sum(widths) <= left else widths

    def get_content_height(self, container: Size, viewport: Size, width: int) -> int:
        """Return the height of titles and rows, also while rows that are new wait to be drawn."""
        return 1 + sum(lines + 1 for _, lines in self._drawn)

    def _folded(self, cells: Sequence[Text], widths: Sequence[int]) -> tuple[Text, ...]:
        """Return cells with lines that fit; a number is never cut or parted from its unit."""
        return tuple(_folded(c, w, self.app.console) for c, w in zip(cells, widths, strict=True))

    def _refill(
        self, titles: tuple[str, ...], widths: tuple[int, ...], lines: tuple[Row, ...]
    ) -> None:
        before = self.cell
        self.clear(columns=True)
        self._titles, self._widths, self._drawn = titles, widths, _shape(lines)
        for title, width in zip(titles, widths, strict=True):
            self.add_column(Text(title, no_wrap=True, overflow="ellipsis"), key=title, width=width)
        for label, cells in lines:
            height = max((cell.plain.count("\n") + 1 for cell in cells), default=1)
            self.add_row(*cells, key=label, label=Text(label, style="bold"), height=height)
        if before is not None:
            self.go_to(*before)


def _needs(titles: Sequence[str], lines: Sequence[Row]) -> tuple[int, ...]:
    """Return the widest line of each column, its title included."""
    return tuple(
        max((cell_len(title), *(widest_line(cells[index]) for _, cells in lines)))
        for index, title in enumerate(titles)
    )


def _folded(cell: Text, width: int, console: Console) -> Text:
    if widest_line(cell) <= width:
        return cell
    joined = Text(_UNIT.sub(_JOIN, cell.plain), spans=list(cell.spans), style=cell.style)
    lines = joined.wrap(console, width)
    for line in lines:
        line.rstrip()
    folded = Text("\n").join(lines)
    return Text(folded.plain.replace(_JOIN, " "), spans=list(folded.spans))


def _shape(lines: Sequence[Row]) -> tuple[tuple[str, int], ...]:
    """Return what a table has to be made anew for: other rows, or rows of other heights."""
    return tuple(
        (label, max((cell.plain.count("\n") for cell in cells), default=0))
        for label, cells in lines
    )
