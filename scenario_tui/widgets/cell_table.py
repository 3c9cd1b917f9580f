"""A table of cells, each to be opened: refreshed in place, the cursor stays on its cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from rich.text import Text
from textual.binding import Binding, BindingType
from textual.coordinate import Coordinate
from textual.widgets import DataTable

Line = tuple[str, tuple[Text, ...]]
"""The label of a row, and a cell for each column."""


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
        self._lines: tuple[Line, ...] = ()

    @property
    def cell(self) -> tuple[str, str] | None:
        """Row and column under the cursor, ``None`` in an empty table."""
        row, column = self.cursor_coordinate
        if row < len(self._lines) and column < len(self._titles):
            return self._lines[row][0], self._titles[column]
        return None

    @property
    def places(self) -> tuple[tuple[str, str], ...]:
        """Row and column of every cell, row by row."""
        return tuple((label, title) for label, _ in self._lines for title in self._titles)

    def go_to(self, row: str, column: str) -> None:
        """Move the cursor to a cell, to the first one when it is not there."""
        labels = [label for label, _ in self._lines]
        found = row in labels and column in self._titles
        place = (labels.index(row), self._titles.index(column)) if found else (0, 0)
        self.move_cursor(row=place[0], column=place[1], animate=False)

    def fill(self, titles: Sequence[str], lines: Sequence[Line]) -> None:
        """Show these rows; unchanged cells are not touched."""
        labels = [label for label, _ in lines]
        if (tuple(titles), labels) != (self._titles, [label for label, _ in self._lines]):
            self._refill(tuple(titles), tuple(lines))
            return
        for row, ((_, before), (_, after)) in enumerate(zip(self._lines, lines, strict=True)):
            for column, (old, new) in enumerate(zip(before, after, strict=True)):
                if old != new:
                    self.update_cell_at(Coordinate(row, column), new, update_width=True)
        self._lines = tuple(lines)

    def _refill(self, titles: tuple[str, ...], lines: tuple[Line, ...]) -> None:
        before = self.cell
        self.clear(columns=True)
        self._titles, self._lines = titles, lines
        for title in titles:
            self.add_column(title, key=title)
        height = max(
            (cell.plain.count("\n") + 1 for _, cells in lines for cell in cells), default=1
        )
        for label, cells in lines:
            self.add_row(*cells, key=label, label=label, height=height)
        if before is not None:
            self.go_to(*before)
