"""Tables and lists with a cursor: refreshed in place, the cursor stays on its row or cell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final, Literal

from rich.text import Text
from textual.binding import Binding, BindingType
from textual.coordinate import Coordinate
from textual.message import Message
from textual.widgets import DataTable, OptionList
from textual.widgets.option_list import Option

from daemon.model.live_judgement import ProvisionalVerdict
from daemon.model.verdicts import Verdict
from scenario_tui.text.provisional_text import by_urgency, provisional_text
from scenario_tui.text.run_text import by_severity, verdict_text

Row = tuple[str, tuple[Text, ...]]
"""The label or key of a row, and a cell for each column."""
_LEAST: Final = 9
"""Cells of the column that takes what is left, at least: the last columns give way to it."""


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
        self._lines: tuple[Row, ...] = ()

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

    def fill(self, titles: Sequence[str], lines: Sequence[Row]) -> None:
        """Show these rows; unchanged cells are not touched."""
        # Every cell that is set has its row drawn and its column measured again: over a slow line a
        # matrix in which nothing changes shall cost nothing.
        labels = [label for label, _ in lines]
        if (tuple(titles), labels) != (self._titles, [label for label, _ in self._lines]):
            self._refill(tuple(titles), tuple(lines))
            return
        for row, ((_, before), (_, after)) in enumerate(zip(self._lines, lines, strict=True)):
            for column, (old, new) in enumerate(zip(before, after, strict=True)):
                if old != new:
                    self.update_cell_at(Coordinate(row, column), new, update_width=True)
        self._lines = tuple(lines)

    def _refill(self, titles: tuple[str, ...], lines: tuple[Row, ...]) -> None:
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


@dataclass(frozen=True, slots=True)
class Column:
    """A column: ``width`` cells, 0 to take what is left; shown from ``from_width`` cells on."""

    title: str
    width: int
    from_width: int = 0
    right: bool = False


class KeyedTable(DataTable[Text]):
    """A :class:`DataTable` for one page of rows."""

    # One page, for the first layout of a DataTable of 10,000 rows blocks the screen for 1.4 s and
    # filling it anew for 1.8 s, of 50,000 rows for 6.6 and 7.9 s (measured, Textual 8.2); other
    # words in a cell that is there take 12 to 17 us.

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("j", "cursor_down", "Down", show=False, id="down", tooltip="Also the arrow"),
        Binding("k", "cursor_up", "Up", show=False, id="up", tooltip="Also the arrow"),
        Binding("g,home", "scroll_top", "First row", show=False, id="top", tooltip="To the top"),
        Binding("G,end", "scroll_bottom", "Last row", show=False, id="bottom", tooltip="The end"),
        Binding("enter", "select_cursor", "Open", id="open", tooltip="What the cursor is on"),
    ]

    class Beyond(Message):
        """Somebody moves on from the last row (``step`` 1) or the first one (-1).

        ``far``: to the very end of what there may be behind it.
        """

        def __init__(self, step: int, *, far: bool = False) -> None:
            super().__init__()
            self.step, self.far = step, far

    def __init__(self, columns: Sequence[Column], *, id: str | None = None) -> None:
        super().__init__(cursor_type="row", id=id)
        self._all = tuple(columns)
        self._shown: tuple[int, ...] = ()
        self._widths: tuple[int, ...] = ()
        self._rows: tuple[Row, ...] = ()
        self._from: Literal["", "top", "bottom"] = ""

    @property
    def key(self) -> str:
        """The key of the row under the cursor, empty when there is none."""
        return self._rows[self.cursor_row][0] if 0 <= self.cursor_row < len(self._rows) else ""

    def from_top(self) -> None:
        """Begin at the first row with what is filled in next: it is about something else."""
        self._from = "top"

    def from_bottom(self) -> None:
        """Begin at the last row with what is filled in next."""
        self._from = "bottom"

    def action_cursor_down(self) -> None:
        """Go down, also beyond the last row."""
        self._go(1, super().action_cursor_down)

    def action_cursor_up(self) -> None:
        """Go up, also beyond the first row."""
        self._go(-1, super().action_cursor_up)

    def action_page_down(self) -> None:
        """Go down by a screen, also beyond the last row."""
        self._go(1, super().action_page_down)

    def action_page_up(self) -> None:
        """Go up by a screen, also beyond the first row."""
        self._go(-1, super().action_page_up)

    def action_scroll_bottom(self) -> None:
        """Go to the last row of all."""
        if self.row_count:
            super().action_scroll_bottom()
        self.post_message(self.Beyond(1, far=True))

    def action_scroll_top(self) -> None:
        """Go to the first row of all."""
        super().action_scroll_top()
        self.post_message(self.Beyond(-1, far=True))

    def _go(self, step: int, move: Callable[[], None]) -> None:
        edge = self.row_count - 1 if step > 0 else 0
        if self.cursor_row == edge:
            self.post_message(self.Beyond(step))
        else:
            move()

    def fill(self, rows: Sequence[Row]) -> None:
        """Show these rows; unchanged cells are not touched, the cursor stays on its row."""
        rows, before, key = tuple(rows), self._rows, self.key
        # Columns that come or go, after a resize, leave no cell where it was.
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
        self._settle(key)

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
        # The scroll of another page would show its middle; where the cursor begins, the view does.
        beginning, self._from = self._from, ""
        found = next((i for i, (name, _) in enumerate(self._rows) if name == key), 0)
        if beginning:
            found = 0 if beginning == "top" else max(0, len(self._rows) - 1)
        if found != self.cursor_row:
            self.move_cursor(row=found, animate=False, scroll=False)
        if beginning:
            self.scroll_to(y=found, animate=False, immediate=True)

    def on_resize(self) -> None:
        """Choose the columns that fit."""
        if self._layout():
            self._refill(self._rows)

    def _layout(self) -> bool:
        """Choose columns and widths; return whether they are others than before."""
        width = self.size.width or self.app.size.width
        shown = tuple(i for i, c in enumerate(self._all) if c.from_width <= width)
        while len(shown) > 1 and self._left(shown, width) < _LEAST:
            shown = shown[:-1]
        left = max(_LEAST, self._left(shown, width))
        widths = tuple(self._all[i].width or left for i in shown)
        if (shown, widths) == (self._shown, self._widths):
            return False
        self._shown, self._widths = shown, widths
        return True

    def _left(self, shown: tuple[int, ...], width: int) -> int:
        """Return the cells that columns of fixed width leave to the others."""
        return width - 1 - sum(self._all[i].width + 2 * self.cell_padding for i in shown)

    def _refill(self, rows: tuple[Row, ...]) -> None:
        key, scroll, anew = self.key, self.scroll_y, bool(self._from)
        self.clear(columns=True)
        for index, width in zip(self._shown, self._widths, strict=True):
            column = self._all[index]
            title = Text(column.title, justify="right" if column.right else "left")
            self.add_column(title, width=width, key=str(index))
        self._rows = rows
        for place, (_, cells) in enumerate(rows):
            self._append(place, cells)
        self._settle(key)
        if not anew:
            self.scroll_to(y=scroll, animate=False, immediate=True)

    def _cell(self, index: int, cells: tuple[Text, ...]) -> Text:
        cell = cells[index].copy()
        cell.no_wrap, cell.overflow = True, "ellipsis"
        cell.justify = "right" if self._all[index].right else "left"
        return cell


class VerdictList(OptionList, inherit_bindings=False):
    """Verdicts in some lines each; the highlighted one is what the rest of the screen is about."""

    # Without the keys of option lists: Home and End are for the clock of the replay.

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "cursor_down", "Next verdict", show=False, id="verdict-next",
                tooltip="Go to when it was decided"),
        Binding("up,k", "cursor_up", "Verdict before", show=False, id="verdict-before",
                tooltip="Go to when it was decided"),
        Binding("enter", "select", "To its moment", show=False, id="verdict-moment",
                tooltip="Back to when it was decided"),
    ]  # fmt: skip

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id, compact=True)
        self._verdicts: tuple[Verdict, ...] = ()
        self._texts: tuple[Text, ...] = ()

    def show(self, verdicts: Sequence[Verdict]) -> None:
        """Show other verdicts; the first of them is chosen, unless one of that oracle was."""
        ordered = by_severity(verdicts)
        self._fill(ordered, [verdict_text(verdict) for verdict in ordered])

    def show_so_far(self, provisional: Sequence[ProvisionalVerdict]) -> None:
        """Show what oracles say of a run that goes on."""
        ordered = by_urgency(provisional)
        self._fill([one.verdict for one in ordered], [provisional_text(one) for one in ordered])

    def _fill(self, verdicts: Sequence[Verdict], texts: Sequence[Text]) -> None:
        if (tuple(verdicts), tuple(texts)) == (self._verdicts, self._texts):
            return
        before, chosen = self._verdicts, self.chosen()
        self._verdicts, self._texts = tuple(verdicts), tuple(texts)
        names = [verdict.oracle for verdict in verdicts]
        if names == [verdict.oracle for verdict in before]:
            # In place: a list filled anew every second would jump under the cursor.
            for place, text in enumerate(texts):
                if text != self.get_option_at_index(place).prompt:
                    self.replace_option_prompt_at_index(place, text)
            return
        scrolled = self.scroll_y
        self.clear_options()
        self.add_options([Option(text) for text in texts])
        kept = names.index(chosen.oracle) if chosen and chosen.oracle in names else 0
        self.highlighted = kept if names else None
        if chosen is not None:
            self.scroll_to(y=scrolled, animate=False)

    def chosen(self) -> Verdict | None:
        """Return the highlighted verdict."""
        if self.highlighted is None or self.highlighted >= len(self._verdicts):
            return None
        return self._verdicts[self.highlighted]
