"""A table whose rows have keys: refreshed in place, the cursor stays on its row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from rich.text import Text
from textual.binding import Binding, BindingType
from textual.widgets import DataTable

Row = tuple[str, tuple[Text, ...]]


@dataclass(frozen=True, slots=True)
class Column:
    """A column: ``width`` cells, 0 to take what is left; shown from ``from_width`` cells on."""

    title: str
    width: int
    from_width: int = 0
    right: bool = False


class KeyedTable(DataTable[Text]):
    """A :class:`DataTable` for one page of rows."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("j", "cursor_down", "Down", show=False, id="down", tooltip="Also the arrow"),
        Binding("k", "cursor_up", "Up", show=False, id="up", tooltip="Also the arrow"),
        Binding("g,home", "scroll_top", "First row", show=False, id="top", tooltip="To the top"),
        Binding("G,end", "scroll_bottom", "Last row", show=False, id="bottom", tooltip="The end"),
        Binding("enter", "select_cursor", "Open", id="open", tooltip="What the cursor is on"),
    ]

    def __init__(self, columns: Sequence[Column], *, id: str | None = None) -> None:
        super().__init__(cursor_type="row", id=id)
        self._all = tuple(columns)
        self._shown: tuple[int, ...] = ()
        self._widths: tuple[int, ...] = ()
        self._rows: tuple[Row, ...] = ()
        self._from_top = False

    @property
    def key(self) -> str:
        """The key of the row under the cursor, empty when there is none."""
        return self._rows[self.cursor_row][0] if self.cursor_row < len(self._rows) else ""

    def from_top(self) -> None:
        """Begin at the first row with what is filled in next: it is about something else."""
        self._from_top = True

    def fill(self, rows: Sequence[Row]) -> None:
        """Show these rows; unchanged cells are not touched, the cursor stays on its row."""
        rows, before, key = tuple(rows), self._rows, self.key
        if self._layout():
            self._refill(rows)
            return
        self._rows = rows
        if len(rows) < len(before):
            self.clear()
            before = ()
        for place, (_, cells) in enumerate(rows[: len(before)]):
            self._change(place, before[place][1], cells)
        for place, (_, cells) in enumerate(rows[len(before) :], start=len(before)):
            self._append(place, cells)
        self._settle(key if not self._from_top else "")

    def _change(self, place: int, before: tuple[Text, ...], cells: tuple[Text, ...]) -> None:
        for index in self._shown:
            if before[index] != cells[index]:
                self.update_cell(str(place), str(index), self._cell(index, cells))

    def _append(self, place: int, cells: tuple[Text, ...]) -> None:
        # Named by their place: another page is then other words in the same rows, and drawing it
        # costs a tenth of making rows anew.
        self.add_row(*(self._cell(i, cells) for i in self._shown), key=str(place))

    def _settle(self, key: str) -> None:
        """Put the cursor on the row of a key, on the first one if there is none."""
        found = next((i for i, (name, _) in enumerate(self._rows) if name == key), 0)
        if found != self.cursor_row:
            self.move_cursor(row=found, animate=False, scroll=False)
        if self._from_top:
            self._from_top = False
            self.scroll_to(y=0, animate=False, immediate=True)

    def on_resize(self) -> None:
        """Choose the columns that fit."""
        if self._layout():
            self._refill(self._rows)

    def _layout(self) -> bool:
        """Choose columns and widths; return whether they are others than before."""
        width = self.size.width or self.app.size.width
        shown = tuple(i for i, c in enumerate(self._all) if c.from_width <= width)
        used = sum(self._all[i].width + 2 * self.cell_padding for i in shown)
        left = max(10, width - used - 1)
        widths = tuple(self._all[i].width or left for i in shown)
        if (shown, widths) == (self._shown, self._widths):
            return False
        self._shown, self._widths = shown, widths
        return True

    def _refill(self, rows: tuple[Row, ...]) -> None:
        key, scroll = "" if self._from_top else self.key, self.scroll_y
        self.clear(columns=True)
        for index, width in zip(self._shown, self._widths, strict=True):
            column = self._all[index]
            title = Text(column.title, justify="right" if column.right else "left")
            self.add_column(title, width=width, key=str(index))
        self._rows = rows
        for place, (_, cells) in enumerate(rows):
            self._append(place, cells)
        self._settle(key)
        self.scroll_to(y=scroll if key else 0, animate=False, immediate=True)

    def _cell(self, index: int, cells: tuple[Text, ...]) -> Text:
        cell = cells[index].copy()
        cell.no_wrap, cell.overflow = True, "ellipsis"
        cell.justify = "right" if self._all[index].right else "left"
        return cell
