"""What every screen has: two lines at the top, one at the bottom, keys that mean the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar, cast

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import ModalScreen, Screen
from textual.widget import Widget
from textual.widgets import Static

from scenario_tui.dashboard.state import Known
from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.status_line import StatusLine
from scenario_tui.text.styles import UNSURE

if TYPE_CHECKING:
    from daemon.model.verbs import DaemonClient
    from scenario_tui.dashboard.app import Dashboard

T = TypeVar("T")


class BaseScreen(Screen[None], Generic[T]):
    """A screen that shows what the daemon knows; ``news`` is what it has fetched last."""

    AUTO_FOCUS = "KeyedTable"
    about = ""
    """The campaign that the screen is about, empty for none: it is judged before others."""
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "back", "Back", id="back", tooltip="To the screen before"),
        Binding(
            "y", "copy", "Copy", show=False, id="copy",
            tooltip="The command for what the cursor is on",
        ),
    ]  # fmt: skip

    def compose(self) -> ComposeResult:
        """Lay out the frame and the screen's own widgets in it."""
        # Textual tells the room after that, and would have every widget styled a second time.
        self.update_classes(dict.fromkeys(self._room_classes(), True))
        yield StatusLine(id="status")
        yield StaticText(id="trail")
        yield from self.body()
        yield KeyFooter()

    def _room_classes(self) -> Iterator[str]:
        """Yield the classes of the breakpoints that the terminal's size has passed last."""
        breakpoints = (self.app.HORIZONTAL_BREAKPOINTS, self.app.VERTICAL_BREAKPOINTS)
        for size, rising in zip(self.app.size, breakpoints, strict=True):
            yield from [name for least, name in rising or () if least <= size][-1:]

    def body(self) -> ComposeResult:
        """Yield the screen's own widgets."""
        raise NotImplementedError

    def fetch(self, daemon: DaemonClient, known: Known) -> T | None:
        """Ask the daemon for what is shown beyond what is ``known``.

        Called in the feed's thread: it reads attributes of the screen and changes none.
        """
        return None

    def trail(self) -> str:
        """Say where we are: the second line."""
        raise NotImplementedError

    def show(self, known: Known, news: T | None) -> None:
        """Show what is known and what was fetched last, ``None`` before the first time."""
        raise NotImplementedError

    def command(self) -> str:
        """Return what to type to be told the same."""
        return self.dashboard.target.command("status")

    def cursor_command(self) -> str:
        """Return what to type about what the cursor is on."""
        return self.command()

    def key(self, id: str) -> str:
        """Return the key of a binding, as the user has it; empty if it can do nothing now."""
        found = (active.binding for active in self.active_bindings.values() if active.enabled)
        return next((self.app.get_key_display(b) for b in found if b.id == id), "")

    @property
    def dashboard(self) -> Dashboard:
        """The app, as what it is."""
        return cast("Dashboard", self.app)

    news: T | None = None
    _composed = False
    _enabled: Mapping[Binding, bool] = {}
    """Which keys can do something, as they are shown."""

    def on_mount(self) -> None:
        """Ask for what this screen shows, show what is known already."""
        self._composed = True
        self.ask()

    def on_screen_suspend(self) -> None:
        """Let go of the lines drawn: every cut of each is kept, 5 MB for a run that is opened.

        Behind a dialog, which takes the keys, the selection is shown as one without them.
        """
        self.set_class(isinstance(self.app.screen, ModalScreen), "-behind")
        for widget in self.walk_children(with_self=True):
            widget.refresh()

    def on_screen_resume(self) -> None:
        """Ask for what this screen shows, when we come back to it."""
        self.remove_class("-behind")
        # Comes also before the first mount, when there are no widgets to ask.
        if self._composed:
            self.ask()

    def update_from_state(self) -> None:
        """Bring everything up to date."""
        # A timer may still fire while the screens are being taken down.
        if not self._composed or not self.app.is_running:
            return
        known, now = self.dashboard.known, self.dashboard.clock()
        self.query_one(StatusLine).show(known, now, launching=self.dashboard.launching)
        self.query_one("#trail", Static).update(self._trail())
        self.set_class(not known.connected and known.at > 0, "-stale")
        self.show(known, self.news)
        enabled = {one.binding: one.enabled for one in self.active_bindings.values()}
        if enabled != self._enabled:
            self._enabled = enabled
            self.refresh_bindings()

    def _trail(self) -> Text:
        text = Text(self.trail(), no_wrap=True)
        if self.dashboard.read_only:
            text.append("  read-only", style=UNSURE)
        overview = self.dashboard.known.overview
        if not self.dashboard.known.connected and (key := self.key("launch")):
            text.append(f"  {key} starts a daemon on this machine", style="bold")
        if overview is not None and overview.troubles:
            why = " ".join(overview.troubles[0].words.split())
            text.append(f"  ! {why}", style="lost")
        return text

    def ask(self) -> None:
        """Fetch at once, because something else is wanted."""
        self.dashboard.feed.look_at(self)
        self.update_from_state()

    def action_back(self) -> None:
        """Leave this screen, unless it is the first."""
        if len(self.app.screen_stack) > 1:
            self.app.pop_screen()

    def action_copy(self) -> None:
        """Copy the command line about what the cursor is on."""
        self.dashboard.copy(self.cursor_command())

    def why_not(self, action: str, *parameters: object) -> str:
        """Return why an action is impossible now, empty if it is possible."""
        return self.dashboard.why_not(action)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Make the keys of impossible actions grey; hide the way back where there is none."""
        if action == "back" and self.app.screen_stack[0] is self:
            return False
        return None if self.why_not(action, *parameters) else True


def show_message_or(widget: Widget, table: Widget, message: str) -> None:
    """Show ``message`` instead of the table, or the table when there is no message."""
    widget.display = bool(message)
    table.display = not message
    if message and isinstance(widget, Static):
        widget.update(Text(message))
