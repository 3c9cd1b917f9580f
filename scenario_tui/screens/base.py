"""What every screen has: two lines at the top, one at the bottom, keys that mean the same."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, cast

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import Screen
from textual.widget import Widget
from textual.widgets import Footer, Static

from scenario_tui.feed import Picture, Want
from scenario_tui.widgets.status_line import StatusLine

if TYPE_CHECKING:
    from scenario_tui.app import Dashboard


class BaseScreen(Screen[None]):
    """A screen that shows pictures of the daemon; subclasses say what they want to know."""

    AUTO_FOCUS = "KeyedTable"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "back", "Back", tooltip="To the screen before"),
    ]

    def compose(self) -> ComposeResult:
        """Lay out the frame and the screen's own widgets in it."""
        yield StatusLine(id="status")
        yield Static(id="trail")
        yield from self.body()
        yield Footer(compact=True, show_command_palette=False)

    def body(self) -> ComposeResult:
        """Yield the screen's own widgets."""
        raise NotImplementedError

    def want(self) -> Want:
        """Say what this screen shows."""
        return Want()

    def trail(self) -> str:
        """Say where we are: the second line."""
        raise NotImplementedError

    def show(self, picture: Picture) -> None:
        """Show what is known."""
        raise NotImplementedError

    @property
    def dashboard(self) -> Dashboard:
        """The app, as what it is."""
        return cast("Dashboard", self.app)

    _composed = False

    def on_mount(self) -> None:
        """Ask for what this screen shows, show what is known already."""
        self._composed = True
        self.wanted_changed()

    def on_screen_resume(self) -> None:
        """Ask for what this screen shows, when we come back to it."""
        if self._composed:
            self.wanted_changed()

    def present(self) -> None:
        """Bring everything up to date."""
        # A timer may still fire while the screens are being taken down.
        if not self._composed or not self.app.is_running:
            return
        picture, now = self.dashboard.picture, self.dashboard.clock()
        self.query_one(StatusLine).show(picture, now)
        self.query_one("#trail", Static).update(Text(self.trail(), no_wrap=True))
        self.set_class(not picture.connected and picture.at > 0, "-stale")
        self.show(picture)

    def wanted_changed(self) -> None:
        """Ask anew because what is wanted changed."""
        self.dashboard.feed.look(self.want())
        self.present()

    def action_back(self) -> None:
        """Leave this screen, unless it is the first."""
        if len(self.app.screen_stack) > 1:
            self.app.pop_screen()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Hide the way back where there is none."""
        return not (action == "back" and self.app.screen_stack[0] is self)


def empty(widget: Widget, table: Widget, message: str) -> None:
    """Show ``message`` instead of the table, or the table when there is no message."""
    widget.display = bool(message)
    table.display = not message
    if message and isinstance(widget, Static):
        widget.update(Text(message))
