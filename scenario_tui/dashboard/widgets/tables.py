"""Tables and lists with a cursor that stays on its row while they are refreshed in place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal, TypeVar

from rich.segment import Segment
from rich.style import Style
from rich.text import Text
from textual.binding import Binding, BindingType
from textual.coordinate import Coordinate
from textual.message import Message
from textual.widgets import DataTable, OptionList
from textual.widgets.data_table import ColumnKey, RowKey
from textual.widgets.option_list import Option

from daemon.model.assessments import NO_MARK, Mark
from daemon.model.verdicts import Outcome, Verdict
from scenario_tui.dashboard.widgets.static_text import same_text
from scenario_tui.text.run_text import NO_MARKS, by_severity, verdict_text

Row = tuple[str, tuple[Text, ...]]
"""The label or key of a row, and a cell for each column."""
R = TypeVar("R")

_ELSEWHERE: Final = Coordinate(-2, -2)
"""A cursor that is neither on a row nor on the titles."""
_LEAST: Final = 12
"""Least cells of the column of width 0; other columns give way to it."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of ``width`` cells, visible in tables of ``from_width`` cells or more.

    Exactly one column of a table has the width 0 and takes the rest. Columns with a ``from_width``
    give way to it, up to half of the table, because people type ids. A cell that is too long loses
    its middle, because names and ids often differ only at their end.
    """

    title: str
    width: int
    right: bool = False
    from_width: int = 0


@dataclass(frozen=True, slots=True)
class Arrangement:
    """Rows that mention ``text``, sorted by the column with the title ``sort``."""

    sort: str
    descending: bool = False
    text: str = ""

    def apply(
        self, rows: Iterable[tuple[R, Row]], keys: Mapping[str, Callable[[R], Any]]
    ) -> list[Row]:
        """Return the rows to show; equal ones keep their order.

        ``rows`` are values with their cells, ``keys`` give the value to sort by for each title.
        """
        text = self.text.casefold()
        matching = [
            (value, row)
            for value, row in rows
            if not text or text in " ".join(cell.plain for cell in row[1]).casefold()
        ]
        key = keys[self.sort]
        matching.sort(key=lambda pair: key(pair[0]), reverse=self.descending)
        return [row for _, row in matching]


def keep_ends(text: Text, width: int) -> Text:
    """Return a text of at most ``width`` cells, without its middle if it is longer."""
    if text.cell_len <= width:
        return text
    start, end = text.copy(), text[-max(width // 2, 1) :]
    while end.cell_len > max(width // 2, 1):
        end = end[1:]
    start.truncate(max(width - 1 - end.cell_len, 0), overflow="crop")
    return start.append("…").append_text(end)


class KeyedTable(DataTable[Text]):
    """A :class:`DataTable` for one page of rows."""

    # One page, because the first layout of a DataTable with 10,000 rows blocks the screen for 1.4 s
    # and a refill for 1.8 s; with 50,000 rows 6.6 and 7.9 s (measured, Textual 8.2). A changed cell
    # takes 12 to 17 us.

    BINDING_GROUP_TITLE = "in the list"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("j", "cursor_down", "Down", show=False, id="down", tooltip="Also the arrow"),
        Binding("k", "cursor_up", "Up", show=False, id="up", tooltip="Also the arrow"),
        Binding("g,home", "scroll_top", "First row", show=False, id="top", tooltip="To the top"),
        Binding("G,end", "scroll_bottom", "Last row", show=False, id="bottom", tooltip="The end"),
        Binding("enter", "select_cursor", "Open", id="open", tooltip="The row under the cursor"),
    ]

    class Beyond(Message):
        """A move beyond the last row (``step`` 1) or the first one (-1), or ``far`` beyond."""

        def __init__(self, step: int, *, far: bool = False) -> None:
            super().__init__()
            self.step, self.far = step, far

    def __init__(self, columns: Sequence[Column], *, id: str | None = None) -> None:
        super().__init__(cursor_type="row", id=id)
        self._all = tuple(columns)
        self._widths: dict[int, int] = {}
        self._flexible = [column.width for column in self._all].index(0)
        self._longest = _LEAST
        self._order = ("", False)
        self._rows: tuple[Row, ...] = ()
        self._begin: str | Literal[0, -1] = ""

    @property
    def key(self) -> str:
        """The key of the row under the cursor, empty without rows."""
        return self._rows[self.cursor_row][0] if 0 <= self.cursor_row < len(self._rows) else ""

    def begin_at(self, row: str | Literal[0, -1]) -> None:
        """Put the cursor on the row with this key, or on the first or last, at the next fill."""
        self._begin = row

    def show_order(self, title: str, *, descending: bool) -> None:
        """Mark the column by which the rows are sorted, none for an empty ``title``."""
        if (title, descending) == self._order:
            return
        self._order = (title, descending)
        for index in self._widths:
            self.columns[ColumnKey(str(index))].label = self._label(index)
        # Textual has no call to change a label, and new rows cost much more.
        self._clear_caches()
        self.refresh()

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
        """Show these rows; unchanged cells are not touched, and the cursor stays on its row."""
        rows, before, key = tuple(rows), self._rows, self.key
        # It only grows, so that a filter does not move the columns.
        if rows != before:
            names = (cells[self._flexible].cell_len for _, cells in rows)
            self._longest = max(self._longest, *names, 0)
        # New or hidden columns after a resize move all cells.
        if self._layout():
            self._refill(rows)
            return
        self._rows = rows
        if len(rows) < len(before):
            self.clear()
            before = ()
        changed = [
            place
            for place, (_, cells) in enumerate(rows[: len(before)])
            if self._change(place, before[place][1], cells)
        ]
        if changed:
            self._update_count += 1
        for place in changed:
            self.refresh_row(place)
        for place, (_, cells) in enumerate(rows[len(before) :], start=len(before)):
            self._append(place, cells)
        self._settle(key)

    def _change(self, place: int, before: tuple[Text, ...], cells: tuple[Text, ...]) -> bool:
        """Update the cells of a row; return True if any has changed."""
        if before is cells:
            return False
        changed = [i for i in self._widths if not same_text(before[i], cells[i])]
        # Not by update_cell(), which draws all rows anew: 20 CPU ms for a single changed age.
        row = self._data[RowKey(str(place))]
        for index in changed:
            row[ColumnKey(str(index))] = self._fitted(index, cells[index])
        return bool(changed)

    def _render_line_in_row(
        self,
        row_key: RowKey,
        line_no: int,
        base_style: Style,
        cursor_location: Coordinate,
        hover_location: Coordinate,
    ) -> tuple[list[list[Segment]], list[list[Segment]]]:
        """Draw only the rows that the cursor entered or left; Textual would draw all."""
        if self._row_locations.get(row_key) != cursor_location.row:
            cursor_location = _ELSEWHERE
        return super()._render_line_in_row(
            row_key, line_no, base_style, cursor_location, hover_location
        )

    def _append(self, place: int, cells: tuple[Text, ...]) -> None:
        # Keys are places, so that another page only changes cells, a tenth of the cost of new rows.
        self.add_row(*(self._fitted(i, cells[i]) for i in self._widths), key=str(place))

    def _settle(self, key: str) -> None:
        """Put the cursor on the row of a key, or on the first one."""
        if not self._rows:
            return  # begin_at() waits for the first rows
        begin, self._begin = self._begin, ""
        if isinstance(begin, int):
            place = begin % len(self._rows)
        else:
            names = [name for name, _ in self._rows]
            place = names.index(begin or key) if (begin or key) in names else 0
        if place != self.cursor_row:
            self.move_cursor(row=place, animate=False, scroll=False)
        if isinstance(begin, int):
            # The scroll offset of the page before would show the middle of this one.
            self.scroll_to(y=place, animate=False, immediate=True)

    def on_resize(self) -> None:
        """Choose the columns for the new size."""
        if self._layout():
            self._refill(self._rows)

    def _layout(self) -> bool:
        """Choose columns and widths; return True if they have changed."""
        flexible = self._flexible
        # One cell is left to the scroll bar.
        room = (self.size.width or self.app.size.width) - 1
        fitting = [i for i, column in enumerate(self._all) if column.from_width <= room + 1]
        least = max(_LEAST, min(self._longest, room // 2))
        while (rest := self._rest(fitting, room)) < least:
            others = [
                i for i in fitting if self._all[i].from_width or (i != flexible and rest < _LEAST)
            ]
            if not others:
                break
            fitting.remove(max(others, key=lambda i: (self._all[i].from_width, i)))
        rest = max(self._rest(fitting, room), 1)
        widths = {i: self._all[i].width or rest for i in fitting}
        changed, self._widths = widths != self._widths, widths
        return changed

    def _rest(self, columns: Sequence[int], room: int) -> int:
        """Return the cells of ``room`` that the columns of fixed width leave free."""
        return room - sum(self._all[i].width + 2 * self.cell_padding for i in columns)

    def _refill(self, rows: tuple[Row, ...]) -> None:
        key, scroll, anew = self.key, self.scroll_y, isinstance(self._begin, int)
        self.clear(columns=True)
        for index, width in self._widths.items():
            self.add_column(self._label(index), width=width, key=str(index))
        self._rows = rows
        for place, (_, cells) in enumerate(rows):
            self._append(place, cells)
        self._settle(key)
        if not anew:
            self.scroll_to(y=scroll, animate=False, immediate=True)

    def _label(self, index: int) -> Text:
        column, (sorted_by, descending) = self._all[index], self._order
        sign = ("▼" if descending else "▲") if column.title == sorted_by else ""
        return self._fitted(index, Text(sign + column.title))

    def _fitted(self, index: int, text: Text) -> Text:
        text = keep_ends(text, self._widths[index]).copy()
        text.no_wrap, text.overflow = True, "ellipsis"
        text.justify = "right" if self._all[index].right else "left"
        return text


class KeyedList(OptionList):
    """A list of texts with keys."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id, compact=True)
        self._texts: dict[str, Text] = {}

    def fill(self, texts: Mapping[str, Text]) -> None:
        """Show a text for each key; the cursor stays on its key, or goes to the first."""
        previous, self._texts = self._texts, dict(texts)
        keys = list(texts)
        if keys == list(previous):
            # In place, because a list that is filled anew every second would jump.
            for key, text in texts.items():
                if not same_text(text, previous[key]):
                    self.replace_option_prompt(key, text)
            return
        cursor, scroll = self.highlighted_option, self.scroll_y
        # New lines under the cursor are not a choice of the user.
        with self.prevent(*([OptionList.OptionHighlighted] if cursor else [])):
            self.set_options([Option(text, key) for key, text in texts.items()])
            row = keys.index(cursor.id) if cursor and cursor.id in keys else 0
            self.highlighted = row if keys else None
        if cursor is not None:
            self.scroll_to(y=scroll, animate=False)


class VerdictList(KeyedList, inherit_bindings=False):
    """Verdicts in a few lines each; the rest of the screen follows the highlighted one."""

    # Without the keys of option lists, because Home and End belong to the clock of the replay.

    BINDING_GROUP_TITLE = "in the list"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "cursor_down", "Next verdict", show=False, id="verdict-next",
                tooltip="Go to its decisive moment"),
        Binding("up,k", "cursor_up", "Verdict before", show=False, id="verdict-before",
                tooltip="Go to its decisive moment"),
        Binding("enter", "select", "To its moment", show=False, id="verdict-moment",
                tooltip="Back to its decisive moment"),
    ]  # fmt: skip

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._verdicts: dict[str, Verdict] = {}

    def show(
        self,
        verdicts: Sequence[Verdict],
        marks: Mapping[str, Mark] = NO_MARKS,
        *,
        so_far: bool = False,
    ) -> None:
        """Show verdicts with the marks of their oracles, ``so_far`` for a running run.

        The highlight stays on its oracle, or goes to the first verdict.
        """
        ordered = by_severity(verdicts, marks)
        if so_far:  # undecided oracles come last, because they have nothing to show yet
            ordered.sort(key=lambda verdict: verdict.outcome is Outcome.INCONCLUSIVE)
        self._verdicts = {verdict.oracle: verdict for verdict in ordered}
        self.fill(
            {
                oracle: verdict_text(verdict, marks.get(oracle, NO_MARK), so_far=so_far)
                for oracle, verdict in self._verdicts.items()
            }
        )

    def choose(self, oracle: str) -> None:
        """Highlight the verdict of an oracle."""
        self.highlighted = self.get_option_index(oracle)

    def chosen(self) -> Verdict | None:
        """Return the highlighted verdict."""
        option = self.highlighted_option
        return self._verdicts[option.id] if option is not None and option.id else None
