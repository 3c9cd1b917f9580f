"""The dashboard: only a client of the daemon, so leaving it never stops any work."""

from __future__ import annotations

import asyncio
import logging
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeVar

from textual import work
from textual.actions import parse
from textual.app import SystemCommand
from textual.binding import ActiveBinding, Binding, BindingType
from textual.events import Event, Key
from textual.message_pump import MessagePump
from textual.screen import ModalScreen, Screen

from daemon.batch.errors import DaemonError
from grammars.text.diagnostics import InputError
from grammars.text.terminal_text import printable
from grammars.text.words import count_noun
from scenario_tui.dashboard.children import Children, load_modules
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.feed import Action, Feed
from scenario_tui.dashboard.recordings import Recordings
from scenario_tui.dashboard.run_watch import Tracks
from scenario_tui.dashboard.screens.base import BaseScreen
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.dialogs import Help, Refusal, our_bindings
from scenario_tui.dashboard.screens.steering import run_command
from scenario_tui.dashboard.state import DashboardState
from scenario_tui.dashboard.themes import ThemedApp
from scenario_tui.source import DaemonTarget

if TYPE_CHECKING:
    from scenario_tui.dashboard.widgets.tables import Arrangement
    from scenario_tui.library.submission import CheckedFile

T = TypeVar("T")

HERE: Final = DaemonTarget()
"""The daemon of this machine."""
FRAMES: Final = 10
"""Updates of the screen per second by snapshots of runs, live maps included."""
_PATIENCE: Final = 1.0
"""Seconds between updates of the screen without news, while runs are running."""
_READY: Final = 0.5
"""Seconds between the first answer, which is shown first, and the load of other screens."""
_READING: Final = (
    "scenario_tui.dashboard.playback",
    "daemon.judging.oracles",
    "daemon.judging.live",
)
"""Modules that read traces and sample their signals."""
_CHANGES: Final = ("launch", "report", "steer", "submit")
"""Actions that change something on the machine of the daemon or of the dashboard."""
_UNREACHABLE: Final = "no daemon answers, so nothing was done"


class Dashboard(ThemedApp):
    """Campaigns, their runs, one run, the workers; fed by a :class:`Feed`."""

    TITLE = "scenario"
    CSS_PATH = ["dashboard.tcss", "playing.tcss", "search.tcss"]  # noqa: RUF012
    # Narrow screens show one part, and Enter and Escape lead in and out; the first screen also
    # shows details of the row with the cursor below. Wide ones show them beside the table, which
    # takes 110 columns.
    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (110, "-wide")]  # noqa: RUF012
    VERTICAL_BREAKPOINTS = [(0, "-short"), (16, "-tall")]  # noqa: RUF012
    COMMAND_PALETTE_BINDING = "colon"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("1", "go('campaigns')", "Campaigns", show=False, id="campaigns", tooltip="All"),
        Binding("2", "go('runs')", "Runs", show=False, id="runs", tooltip="Of every campaign"),
        Binding("3", "go('workers')", "Workers", show=False, id="workers",
                tooltip="Machines that execute runs"),
        Binding("d", "launch", "Start daemon", show=False, id="launch",
                tooltip="On this machine, if none answers"),
        Binding("s", "submit", "Submit", show=False, id="submit",
                tooltip="Choose, check, submit a campaign"),
        Binding("colon", "command_palette", "Go", id="palette",
                tooltip="Find an action or a place by typing"),
        Binding("question_mark,f1", "keys", "Help", id="help", tooltip="Keys and signs"),
        Binding("q", "quit", "Quit", id="quit", tooltip="Leave; all work goes on"),
        Binding(
            "ctrl+c", "quit", "Quit", show=False, priority=True, id="quit-at-once",
            tooltip="Leave from anywhere; all work goes on",
        ),
    ]  # fmt: skip

    def __init__(
        self,
        feed: Feed,
        *,
        clock: Callable[[], float] = time.time,
        config: Config | None = None,
        target: DaemonTarget = HERE,
        run_command: Callable[[tuple[str, ...]], Mapping[str, Any]] = run_command,
        launch_daemon: Callable[[], str] | None = None,
        child_processes: Children | None = None,
    ) -> None:
        super().__init__()
        self.feed = feed
        self.run_command = run_command
        self.child_processes = child_processes or Children()
        self.target = target
        self.config = config or Config()
        self.read_only = self.config.read_only
        self.submitted: tuple[Path, ...] = ()
        self.submitted_campaign = ""
        self.submitting = ""
        self.running_jobs: set[str] = set()
        self.run_views: dict[tuple[str, str, str], tuple[Arrangement, int, str]] = {}
        """Last arrangement, offset and run under the cursor of each table of runs."""
        self.launch_daemon = launch_daemon
        self.launching = self.launched = False
        self.marked_run = ""
        self.clock = clock
        self.state = DashboardState()
        self.tracks = Tracks()
        self.recordings = Recordings(feed.connect, self.child_processes)
        self._is_answered = False
        self._shown_at = 0.0

    def get_default_screen(self) -> Screen[None]:
        """Return the screen of campaigns, which comes first."""
        return CampaignsScreen()

    def on_mount(self) -> None:
        """Start the feed, and apply the user's settings."""
        if self.config.theme:
            self.theme = self.config.theme
        self.set_keymap(self.config.keys)
        self.feed.on_news = partial(self.call_later, self.update_state)
        self._frames = self.set_interval(1.0 / FRAMES, self.update_state)
        self.action_launch()
        self.recordings.on_read = partial(self.call_later, self._update_front_screen)
        # The client takes as long to load as the whole first screen, so show the screen first.
        self.call_after_refresh(self.feed.start)

    @work(thread=True)
    def _load_screens(self) -> None:
        """Load other screens, whose libraries take longer than the first screen."""
        import_module("scenario_tui.dashboard.screens.matrix")
        import_module("scenario_tui.dashboard.screens.runs")
        import_module("scenario_tui.dashboard.screens.search")

    def action_launch(self) -> None:
        """Start a daemon on this machine if none answers and this is allowed."""
        if self.launch_daemon is not None:
            self.launching = True
            self.start_task(self.launch_daemon, self._end_launch, self._fail_launch)

    def _end_launch(self, message: str) -> None:
        self.launching, self.launched = False, bool(message)
        if message:
            self.notify(message, markup=False)
        self._update_front_screen()

    def _fail_launch(self, why: str) -> None:
        self.problem(why)
        self._end_launch("")

    def on_unmount(self) -> None:
        """Stop the feed and the child process."""
        self.feed.close()
        self.child_processes.close()

    def update_state(self) -> None:
        """Take over news and bring the screen in front up to date."""
        news = self.feed.take_news()
        for live in news.lives:
            self.tracks.add(live)
        for text, severity in news.notices:
            self.notify(text, severity=severity, markup=False)
        if news.state is not None:
            if not self._is_answered:
                self._is_answered = True
                self.set_timer(_READY, self._load_screens)
            self.state = news.state
            if news.front is not None:
                news.front.news = news.fetched
        now, overview = self.clock(), self.state.overview
        # Ages grow even without news. Without running runs, the feed announces every change.
        if news.state is not None or news.lives or now - self._shown_at >= _PATIENCE:
            self._shown_at = now
            self._update_front_screen()
        resting = self.state.connected and overview is not None and not overview.running
        (self._frames.pause if resting else self._frames.resume)()

    def _update_front_screen(self) -> None:
        for screen in reversed(self.screen_stack):
            if isinstance(screen, BaseScreen):
                screen.update_from_state()
                return

    def action_submit(self) -> None:
        """Choose a campaign file and submit it."""
        self.open("submit")

    def action_go(self, place: str) -> None:
        """Go to one of the main screens from any screen."""
        if isinstance(self.screen, Help):
            self.pop_screen()
        while len(self.screen_stack) > 1:
            self.pop_screen()
        if place != "campaigns":
            self.open(place)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Refuse keys in replays, which have their own, and actions that are impossible now."""
        if action == "launch":
            state = self.state
            is_away = bool(state.problem) and not (state.connected or state.refused)
            can_launch = self.launch_daemon is not None or self.read_only
            if not is_away or self.launching or not can_launch:
                return False
        ours = isinstance(self.screen, BaseScreen | ModalScreen)
        if not ours and action in ("go", "keys", "command_palette", "submit"):
            return False
        return None if self.why_not(action) else True

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """Yield the actions of all keys; typing also finds those not in the line of keys."""
        # Of several keys for an action show the first, and one in the line of keys before others.
        bindings = our_bindings(screen)[::-1]
        bindings.sort(key=lambda one: one.binding.show)
        for action, active in {one.binding.action: one for one in bindings}.items():
            binding = active.binding
            if action != "command_palette":
                about = f"{self.get_key_display(binding)}  {binding.tooltip}"
                do = partial(self.run_action, action, active.node)
                yield SystemCommand(binding.description, about, do, binding.show)
        about = "Choose other colours for this session"
        yield SystemCommand("Theme", about, self.action_change_theme)
        for row in self.state.campaigns:
            show = partial(self.open_campaign, row.id)
            yield SystemCommand(f"go to campaign {row.id}", "", show, discover=False)

    async def on_event(self, event: Event) -> None:
        """Let each key do all its work before the next one.

        Textual passes keys on at once. Those typed behind a key that opens a screen would go to the
        screen below, or to one that cannot take them yet.
        """
        if not isinstance(event, Key) or event.is_forwarded:
            await super().on_event(event)
            return
        before = self.screen
        active = before.active_bindings.get(event.key)
        done = active is not None and await self._do(active)
        if not done:
            await super().on_event(event)
        if self._exit:
            return  # no message is handled any more
        # The effect of the key may be a message on its way from the focused widget to the screen.
        for node in (before.focused or before).ancestors_with_self:
            if node is not self:
                await _settle(node)
        if self.screen is not before:
            await _settle(self.screen)

    async def _do(self, active: ActiveBinding) -> bool:
        """Run the action of a key, or open a dialog with the reason why it is impossible."""
        front = self.screen
        if not active.enabled and isinstance(front, BaseScreen):
            _, action, parameters = parse(active.binding.action)
            if why := front.why_not(action, *parameters):
                self.push_screen(Refusal(why))
                return True
        return await self.run_action(active.binding.action, active.node)

    def action_keys(self) -> None:
        """Show the keys of the screen in front."""
        self.push_screen(Help(self.screen))

    def check_file(
        self, path: Path, *, submit: bool = False, fresh: bool = False, state: Path | None = None
    ) -> CheckedFile:
        """Examine a campaign file in the child process; not for the thread that draws."""
        # Imported here, because it loads longer than the first screen.
        from scenario_tui.library.submission import check_file

        return self.child_processes.run(check_file, path, submit=submit, fresh=fresh, state=state)

    def prepare_playback(self) -> None:
        """Load the readers of traces in the child process: a run is about to be opened."""
        load = partial(self.child_processes.run, load_modules, *_READING)
        self.start_task(load, _nothing, self.problem)

    def open(self, place: str, *about: str) -> None:
        """Show a screen by the name of its module, with the ids of its contents."""
        # By name, because screens open each other in circles and most load longer than the first.
        module = import_module(f"scenario_tui.dashboard.screens.{place}")
        self.push_screen(getattr(module, f"{place.capitalize()}Screen")(*about))

    def open_campaign(self, campaign: str) -> None:
        """Show the search or the runs of a campaign."""
        row = self.state.campaign(campaign)
        self.open("search" if row is not None and row.search else "runs", campaign)

    def why_not(self, action: str) -> str:
        """Return why an action is impossible now on every screen, empty if it is possible."""
        # This bars only the dashboard; the daemon decides by the user's key.
        if self.read_only and action in _CHANGES:
            return "read-only: this dashboard changes nothing"
        # Before the first answer, the connection may still come.
        if action in ("submit", "steer") and self.state.at and not self.state.connected:
            return _UNREACHABLE
        return ""

    def steer(self, action: Action, command: str) -> None:
        """Request an action of the daemon; show its outcome with the equivalent command."""
        if self.state.connected:
            self.feed.enqueue_action(lambda daemon: f"{action(daemon)}\nsame as: {command}")
        else:
            self.problem(_UNREACHABLE)

    def say(self, text: str, command: str) -> None:
        """Show a message with the equivalent command."""
        self.notify(f"{text}\nsame as: {command}", markup=False)

    def problem(self, text: str) -> None:
        """Show an error message."""
        self.notify(text, severity="error", markup=False)

    def copy(self, command: str) -> None:
        """Put a command line into the clipboard of the terminal, also over SSH (OSC 52)."""
        # A line end from a name would run the text before it when it is pasted.
        command = printable(" ".join(command.splitlines()))
        self.copy_to_clipboard(command)
        self.notify(f"copied: {command}", markup=False)

    def remember(self, file: Path, campaign: str) -> None:
        """Note that a file was submitted as ``campaign``.

        The file is offered first the next time, and the cursor goes to the campaign once it is
        listed.
        """
        self.submitted_campaign = campaign
        self.submitted = tuple(dict.fromkeys((file, *self.submitted)))

    def start_task(
        self, work: Callable[[], T], then: Callable[[T], object], otherwise: Callable[[str], object]
    ) -> None:
        """Do ``work`` in a thread; ``then`` takes its result, in Textual's thread.

        ``otherwise`` takes the reason if the work cannot be done. Any other error is a bug, and
        ends the dashboard.
        """
        # Not a worker of Textual: leaving would wait for it.
        task = partial(self._run_task, work, then, otherwise)
        threading.Thread(target=task, name="task", daemon=True).start()

    def _run_task(
        self, work: Callable[[], T], then: Callable[[T], object], otherwise: Callable[[str], object]
    ) -> None:
        try:
            result = work()
        except (InputError, DaemonError) as error:
            self.call_later(otherwise, str(error))
        except OSError as error:
            where = f": {error.filename}" if error.filename else ""
            self.call_later(otherwise, f"{error.strerror or error}{where}")
        except Exception as error:
            self.call_later(_raise, error)
        else:
            self.call_later(then, result)

    def farewell(self) -> str:
        """Return the parting words: work that goes on without the dashboard."""
        overview = self.state.overview
        parts = ["Left the dashboard"]
        if overview is not None and self.state.connected:
            waiting = overview.queued + overview.running
            runs = count_noun(waiting, "unfinished run")
            parts.append(f"the daemon continues with {runs}" if waiting else "no run is waiting")
        if self.submitting:
            parts.append(f"the submission of {self.submitting} was cut off")
        parts += [f"another process continues {doing}" for doing in sorted(self.running_jobs)]
        lines = [f"{'; '.join(parts)}. Back with: {self.target.command('tui')}"]
        if self.launched and self.state.connected:
            lines.append(f"Stop the daemon with: {self.target.command('daemon', '--stop')}")
        return "\n".join(lines)


def _nothing(_: object) -> None:
    """Ignore a result; Textual inspects the signature, which ``bool`` lacks."""


def _raise(error: Exception) -> None:
    raise error


async def _settle(node: MessagePump) -> None:
    """Wait until a node has handled its present messages."""
    done = asyncio.Event()
    if node.call_later(done.set):
        await done.wait()


def run_dashboard(
    target: DaemonTarget, config: Config, launch_daemon: Callable[[], str] | None
) -> tuple[int, str]:
    """Show the dashboard until the user leaves it; return exit code and parting words.

    ``launch_daemon`` starts a daemon if none answers, and returns a message if it did.
    """
    app = Dashboard(Feed(target.open), config=config, target=target, launch_daemon=launch_daemon)
    # If the parent ignored SIGHUP, the dashboard would go on drawing after its terminal is closed.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    # The screen is drawn on standard error, where a printed warning would destroy it.
    logging.getLogger().addHandler(logging.NullHandler())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        app.limit_to_terminal()
        app.run(mouse=app.config.mouse)
    return app.return_code or 0, app.farewell()
