"""The parts of a screen, one at a time if there is no room for all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from rich.text import Text
from textual.binding import Binding, BindingType
from textual.screen import Screen

from scenario_tui.text.styles import QUIET


class Parts(Screen[None]):
    """A screen of parts; a widget with the class ``part`` belongs to the parts that it names.

    ``in-map``, for example, is the class of all widgets in the part ``map``. On narrow screens the
    style sheet hides parts that are not ``-shown``.
    """

    VIEWS: ClassVar[Sequence[str]] = ()
    """Names of the parts, in the order of the key for the next part."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("tab,v", "view(1)", "View", key_display="tab", id="view",
                tooltip="The next part of the screen, if there is room for one only"),
        Binding("shift+tab,V", "view(-1)", "View before", show=False, id="view-before",
                tooltip="The part before"),
    ]  # fmt: skip

    _part = 0

    @property
    def part(self) -> str:
        """The part in view if there is room for one only."""
        return self.VIEWS[self._part]

    def on_mount(self) -> None:
        """Show the first part."""
        self.show_view(self._part)

    def show_view(self, part: int) -> None:
        """Show one part of the screen if there is room for one only."""
        self._part = part % len(self.VIEWS)
        for widget in self.query(".part"):
            widget.set_class(widget.has_class(f"in-{self.part}"), "-shown")
        self.call_after_refresh(self.view_changed)

    def view_changed(self) -> None:
        """Give the focus to the new part, if it takes keys."""

    def with_tabs(self, line: Text) -> Text:
        """Return a line as wide as the screen, with the parts at its end, the present in brackets.

        A screen with room for all parts has no names in the line; a very narrow one has one.
        """
        names = () if self.has_class("-wide") else self.VIEWS
        tabs = "".join(f"[{name}]" if name == self.part else f" {name} " for name in names)
        if len(tabs) > self.size.width // 2:
            tabs = f"[{self.part}]"
        line.truncate(max(self.size.width - len(tabs) - 4, 0), overflow="ellipsis", pad=True)
        return line.append(f"  {tabs}", style=QUIET)

    def action_view(self, step: int) -> None:
        """Show the next part of the screen, or the one before."""
        self.show_view(self._part + step)
