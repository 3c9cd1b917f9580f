"""Filter and order of a table screen: a filter line, and columns to sort by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Final

from textual.binding import Binding, BindingType
from textual.widgets import Input

from scenario_tui.dashboard.screens.base import BaseScreen, T
from scenario_tui.dashboard.widgets.tables import Arrangement, KeyedTable

_LONGEST: Final = 200
"""Most characters of a filter."""


class FilteredScreen(BaseScreen[T]):
    """A screen with a table that the user filters by typing and sorts by its columns.

    Subclasses yield :meth:`filter_line` above their table.
    """

    SORTS: ClassVar[Mapping[str, bool]]
    """Titles of the columns to sort by, the default first; True for a descending order."""
    BINDINGS: ClassVar[list[BindingType]] = [
        # With priority: otherwise the next characters would be keys of the table.
        Binding("slash", "filter", "Filter", id="filter", priority=True,
                tooltip="Only rows that mention a text"),
        Binding("greater_than_sign", "sort(1)", "Sort", show=False, id="sort-next",
                tooltip="By the next column"),
        Binding("less_than_sign", "sort(-1)", "Sort back", show=False, id="sort-previous",
                tooltip="By the column before"),
        Binding("i", "reverse", "Invert", show=False, id="sort-invert",
                tooltip="Sort the other way round"),
    ]  # fmt: skip

    def __init__(self) -> None:
        super().__init__()
        self.arrangement = Arrangement(*next(iter(self.SORTS.items())))

    def rearranged(self) -> None:
        """Show the rows in the new arrangement."""
        self.update_from_state()

    def filter_line(self) -> Input:
        """Return the filter line, hidden while it is empty."""
        # With its text from the start, because a later change would clear the arrangement.
        line = Input(self.arrangement.text, placeholder="text in a row", id="filter", compact=True)
        line.display = bool(line.value)
        return line

    def no_match(self) -> str:
        """Return the message for a filter that no row matches."""
        return f"No row matches.\n\n    {self.key('filter')}  change the text      esc  clear it"

    def on_mount(self) -> None:
        """Mark the column by which the rows are sorted."""
        self._mark_order()

    def _mark_order(self) -> None:
        order = self.arrangement
        # Without a table if the user leaves the screen before it is laid out.
        for table in self.query(KeyedTable):
            table.show_order(order.sort, descending=order.descending)

    def rearrange(self, **changes: Any) -> None:
        """Change the arrangement and begin at the first row."""
        self.arrangement = replace(self.arrangement, **changes)
        self.query_one(KeyedTable).begin_at(0)
        self._mark_order()
        self.rearranged()

    def action_filter(self) -> None:
        """Open the filter line."""
        line = self.query_one("#filter", Input)
        line.display = True
        self.set_focus(line)

    def action_sort(self, step: int) -> None:
        """Sort by the next column, or the one before."""
        titles = list(self.SORTS)
        title = titles[(titles.index(self.arrangement.sort) + step) % len(titles)]
        self.rearrange(sort=title, descending=self.SORTS[title])

    def action_reverse(self) -> None:
        """Sort the other way round."""
        self.rearrange(descending=not self.arrangement.descending)

    def action_back(self) -> None:
        """Clear the filter first, then leave the screen."""
        line = self.query_one("#filter", Input)
        if not line.display:
            super().action_back()
            return
        line.value = ""
        self._leave_line()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Let the filter line take slashes; allow the way back while it is open."""
        if action == "filter" and isinstance(self.focused, Input):
            return False
        if action == "back" and self._composed and self.query_one("#filter").display:
            return True
        return super().check_action(action, parameters)

    def on_input_changed(self, event: Input.Changed) -> None:
        """Filter by the typed text."""
        if event.value != self.arrangement.text:
            self.rearrange(text=event.value[:_LONGEST])

    def on_input_submitted(self) -> None:
        """Give the focus back to the table; the filter stays."""
        self._leave_line()

    def _leave_line(self) -> None:
        line = self.query_one("#filter", Input)
        line.display = bool(line.value)
        # At once, because the next key may wait already.
        self.set_focus(self.query_one(KeyedTable), scroll_visible=False)
