"""The base of every screen: two lines at the top, one at the bottom, common keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar, cast

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import ModalScreen, Screen
from textual.widgets import Static

from scenario_tui.dashboard.state import DashboardState
from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.status_line import StatusLine
from scenario_tui.text.styles import UNSURE

if TYPE_CHECKING:
    from daemon.model.verbs import DaemonClient
    from scenario_tui.dashboard.app import Dashboard

T = TypeVar("T")


class BaseScreen(Screen[None], Generic[T]):
    """A screen about the daemon's state; ``news`` is its last own answer."""

    AUTO_FOCUS = "KeyedTable"
    about = ""
    """The campaign of the screen, empty for none; it is judged before others."""
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "back", "Back", id="back", tooltip="To the screen before"),
        Binding(
            "y", "copy", "Copy", show=False, id="copy",
            tooltip="The command for the row under the cursor",
        ),
    ]  # fmt: skip

    def compose(self) -> ComposeResult:
        """Lay out the frame and the screen's own widgets in it."""
        # Textual would set these classes later, and style every widget a second time.
        self.update_classes(dict.fromkeys(self._room_classes(), True))
        yield StatusLine(id="status")
        yield StaticText(id="trail")
        yield from self.body()
        yield KeyFooter()

    def _room_classes(self) -> Iterator[str]:
        """Yield the classes of the last breakpoints that fit the terminal's size."""
        breakpoints = (self.app.HORIZONTAL_BREAKPOINTS, self.app.VERTICAL_BREAKPOINTS)
        for size, rising in zip(self.app.size, breakpoints, strict=True):
            yield from [name for least, name in rising or () if least <= size][-1:]

    def body(self) -> ComposeResult:
        """Yield the screen's own widgets."""
        raise NotImplementedError

    def fetch(self, daemon: DaemonClient, state: DashboardState) -> T | None:
        """Fetch data of this screen that is not in the state.

        Called in the feed's thread: it reads attributes of the screen and changes none.
        """
        return None

    def trail(self) -> str:
        """Return the second line: the place of the screen."""
        raise NotImplementedError

    def show(self, state: DashboardState, news: T | None) -> None:
        """Show the state and the last ``news``, ``None`` before the first."""
        raise NotImplementedError

    def command(self) -> str:
        """Return the command that prints the same as this screen."""
        return self.dashboard.target.command("status")

    def cursor_command(self) -> str:
        """Return the command about the row under the cursor."""
        return self.command()

    def key(self, id: str) -> str:
        """Return the user's key of a binding; empty if it is disabled now."""
        enabled = (active.binding for active in self.active_bindings.values() if active.enabled)
        return next((self.app.get_key_display(b) for b in enabled if b.id == id), "")

    @property
    def dashboard(self) -> Dashboard:
        """The app with its type."""
        return cast("Dashboard", self.app)

    news: T | None = None
    _composed = False
    _enabled: Mapping[Binding, bool] = {}
    """Enabled bindings as last displayed."""

    def on_mount(self) -> None:
        """Fetch data of this screen, and show the state so far."""
        self._composed = True
        self.ask()

    def on_screen_suspend(self) -> None:
        """Release the cached lines of all widgets, 5 MB for an opened run.

        Behind a dialog, which has the focus, the selection is drawn without focus.
        """
        self.set_class(isinstance(self.app.screen, ModalScreen), "-behind")
        for widget in self.walk_children(with_self=True):
            widget.refresh()

    def on_screen_resume(self) -> None:
        """Fetch data of this screen again when it comes to the front."""
        self.remove_class("-behind")
        # This is also called before the first mount, when there are no widgets.
        if self._composed:
            self.ask()

    def update_from_state(self) -> None:
        """Bring all widgets up to date."""
        # A timer may still fire while the screens close.
        if not self._composed or not self.app.is_running:
            return
        state, now = self.dashboard.state, self.dashboard.clock()
        self.query_one(StatusLine).show(state, now, launching=self.dashboard.launching)
        self.query_one("#trail", Static).update(self._trail())
        self.set_class(not state.connected and state.at > 0, "-stale")
        self.show(state, self.news)
        enabled = {one.binding: one.enabled for one in self.active_bindings.values()}
        if enabled != self._enabled:
            self._enabled = enabled
            self.refresh_bindings()

    def _trail(self) -> Text:
        text = Text(self.trail(), no_wrap=True)
        if self.dashboard.read_only:
            text.append("  read-only", style=UNSURE)
        overview = self.dashboard.state.overview
        if not self.dashboard.state.connected and (key := self.key("launch")):
            text.append(f"  {key} starts a daemon on this machine", style="bold")
        if overview is not None and overview.troubles:
            why = " ".join(overview.troubles[0].words.split())
            text.append(f"  ! {why}", style="lost")
        return text

    def ask(self) -> None:
        """Fetch data of this screen at once."""
        self.dashboard.feed.look_at(self)
        self.update_from_state()

    def action_back(self) -> None:
        """Leave this screen, unless it is the first."""
        if len(self.app.screen_stack) > 1:
            self.app.pop_screen()

    def action_copy(self) -> None:
        """Copy the command line about the row under the cursor."""
        self.dashboard.copy(self.cursor_command())

    def why_not(self, action: str, *parameters: object) -> str:
        """Return why an action is impossible now, empty if it is possible."""
        return self.dashboard.why_not(action)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Make the keys of impossible actions grey; hide the way back on the first screen."""
        if action == "back" and self.app.screen_stack[0] is self:
            return False
        return None if self.why_not(action, *parameters) else True
