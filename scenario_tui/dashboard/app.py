"""The dashboard: a client of the daemon and nothing else; leaving it never stops any work."""

from __future__ import annotations

import asyncio
import logging
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, ClassVar, Final

from textual import work
from textual.actions import parse
from textual.app import SystemCommand
from textual.binding import ActiveBinding, Binding, BindingType
from textual.events import Event, Key
from textual.message_pump import MessagePump
from textual.screen import ModalScreen, Screen

from grammars.text.words import count_noun
from scenario_tui.dashboard.background import CommandLines
from scenario_tui.dashboard.base_app import BaseDashboard
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.feed import Feed
from scenario_tui.dashboard.screens.base import BaseScreen
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.dialogs import Refusal
from scenario_tui.dashboard.screens.help import Help, our_bindings

if TYPE_CHECKING:
    from daemon.model.verbs import ClientOpener

FRAMES: Final = 10
"""How often a second the screen takes over what the feed has found, live maps included."""
_READY: Final = 0.5
"""Seconds after the first answer until other screens are loaded: it is shown before."""


class Dashboard(BaseDashboard):
    """Campaigns, their runs, one run, the workers; fed by a :class:`Feed`."""

    TITLE = "scenario"
    CSS_PATH = ["dashboard.tcss", "playing.tcss", "search.tcss"]  # noqa: RUF012
    # Narrow screens show one thing, Enter and Escape lead in and out; wide ones a table and beside
    # it what the cursor is on, which takes 110 columns.
    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (110, "-wide")]  # noqa: RUF012
    VERTICAL_BREAKPOINTS = [(0, "-short"), (16, "-tall")]  # noqa: RUF012
    COMMAND_PALETTE_BINDING = "colon"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("1", "go('campaigns')", "Campaigns", show=False, id="campaigns", tooltip="All"),
        Binding("2", "go('runs')", "Runs", show=False, id="runs", tooltip="Of every campaign"),
        Binding("3", "go('workers')", "Workers", show=False, id="workers", tooltip="Who executes"),
        Binding("d", "launch", "Start daemon", show=False, id="launch",
                tooltip="On this machine, when none answers"),
        Binding("s", "submit", "Submit", show=False, id="submit",
                tooltip="Choose, check, submit a campaign"),
        Binding("colon", "command_palette", "Go", show=False, id="palette",
                tooltip="Type what to do or where to go"),
        Binding("question_mark,f1", "keys", "Help", id="help", tooltip="This list"),
        Binding("q", "quit", "Quit", id="quit", tooltip="Leave; all work goes on"),
        Binding(
            "ctrl+c", "quit", "Quit", show=False, priority=True, id="quit-at-once",
            tooltip="Leave from anywhere; all work goes on",
        ),
    ]  # fmt: skip

    _answered = False

    def get_default_screen(self) -> Screen[None]:
        """Begin with the campaigns."""
        return CampaignsScreen()

    def chosen_theme(self) -> str:
        """Return the theme of the settings."""
        return self.config.theme

    def on_mount(self) -> None:
        """Start asking and looking, the way the user likes it."""
        if self.config.theme:
            self.theme = self.config.theme
        self.set_keymap(self.config.keys)
        self.feed.on_answer = partial(self.call_later, self.update_state)
        self.action_launch()
        self.recordings.on_read = partial(self.call_later, self._update_front_screen)
        # What asks the daemon takes as long to load as all that is shown first: that comes before.
        self.call_after_refresh(self.feed.start)
        self.set_interval(1.0 / FRAMES, self.update_state)

    @work(thread=True)
    def _load_screens(self) -> None:
        """Load the screens behind the first one, whose libraries take longer than it does."""
        import_module("scenario_tui.dashboard.screens.matrix")
        import_module("scenario_tui.dashboard.screens.runs")
        import_module("scenario_tui.dashboard.screens.search")

    def action_launch(self) -> None:
        """See to it that a daemon answers, where one may be started on this machine."""
        if self.launch_daemon is not None:
            self.launching = True
            self.background_tasks.start(self.launch_daemon, self._launched, self._not_launched)

    def _launched(self, said: str) -> None:
        self.launching, self.launched = False, bool(said)
        if said:
            self.notify(said, markup=False)
        self._update_front_screen()

    def _not_launched(self, why: str) -> None:
        self.launching = False
        self.problem(why)
        self._update_front_screen()

    def on_unmount(self) -> None:
        """Stop asking, and what is done for nobody any more."""
        self.feed.close()
        self.child_processes.close()

    def update_state(self) -> None:
        """Take over what is new and bring the screen in front up to date."""
        news = self.feed.take_news()
        self.background_tasks.deliver()
        for live in news.lives:
            self.tracks.add(live)
        for notice in news.notices:
            self.notify(notice.text, severity=notice.severity, markup=False)
        if news.known is not None:
            if not self._answered:
                self._answered = True
                self.set_timer(_READY, self._load_screens)
            self.known = news.known
            if isinstance(news.front, BaseScreen):
                news.front.news = news.fetched
        now = self.clock()
        # Ages grow even when nothing is new.
        if news.known is not None or news.lives or now - self._said >= 1.0:
            self._said = now
            self._update_front_screen()

    def _update_front_screen(self) -> None:
        for screen in reversed(self.screen_stack):
            if isinstance(screen, BaseScreen):
                screen.update_from_state()
                return

    def action_submit(self) -> None:
        """Choose a campaign file and submit it."""
        self.open("submit")

    def action_go(self, place: str) -> None:
        """Go to one of the main screens from wherever we are."""
        if isinstance(self.screen, Help):
            self.pop_screen()
        while len(self.screen_stack) > 1:
            self.pop_screen()
        if place != "campaigns":
            self.open(place)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Leave replays alone, which have keys of their own; keys never reach below dialogs."""
        if action == "launch":
            known = self.known
            gone = bool(known.problem) and not (known.connected or known.refused or self.launching)
            return gone and self.launch_daemon is not None
        ours = isinstance(self.screen, BaseScreen | ModalScreen)
        if not ours and action in ("go", "keys", "command_palette", "submit"):
            return False
        front = self.screen
        return None if isinstance(front, BaseScreen) and front.why_not(action) else True

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """Yield what has a key on a screen; what is not in its line of keys is found by typing."""
        for action, active in {one.binding.action: one for one in our_bindings(screen)}.items():
            binding = active.binding
            if action != "command_palette":
                about = f"{self.get_key_display(binding)}  {binding.tooltip}"
                do = partial(self.run_action, action, active.node)
                yield SystemCommand(binding.description, about, do, binding.show)
        about = "Choose other colours, until you leave"
        yield SystemCommand("Theme", about, self.action_change_theme)
        for row in self.known.campaigns:
            show = partial(self.open_campaign, row.id)
            yield SystemCommand(f"go to campaign {row.id}", "", show, discover=False)

    async def on_event(self, event: Event) -> None:
        """Let each key do all its work before the next one is looked at.

        Textual hands keys on at once. Those typed behind a key that opens a screen would go to the
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
        # What the key did may be a message on its way from what has the focus up to the screen.
        for node in (before.focused or before).ancestors_with_self:
            if node is not self:
                await _settle(node)
        if self.screen is not before:
            await _settle(self.screen)

    async def _do(self, active: ActiveBinding) -> bool:
        """Do what a key is for; say why it is impossible in place of what it would open."""
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

    def farewell(self) -> str:
        """Say what goes on without the dashboard."""
        overview = self.known.overview
        said = ["Left the dashboard"]
        if overview is not None and self.known.connected:
            waiting = overview.queued + overview.running
            runs = count_noun(waiting, "unfinished run")
            said.append(f"the daemon goes on with {runs}" if waiting else "no run is waiting")
        said += [f"a process of its own goes on {doing}" for doing in sorted(self.running_jobs)]
        said = [f"{'; '.join(said)}. Back with: {self.command_lines.daemon_line('tui')}"]
        if self.launched and self.known.connected:
            said.append(
                f"Stop the daemon with: {self.command_lines.daemon_line('daemon', '--stop')}"
            )
        return "\n".join(said)


async def _settle(node: MessagePump) -> None:
    """Wait until the messages that a node has by now are dealt with."""
    done = asyncio.Event()
    if node.call_later(done.set):
        await done.wait()


def run_dashboard(
    open_daemon: ClientOpener,
    config: Config,
    command_lines: CommandLines,
    launch_daemon: Callable[[], str] | None,
) -> tuple[int, str]:
    """Show the dashboard until somebody leaves it; return exit code and parting words.

    ``launch_daemon`` sees to it that a daemon answers, and returns what to say if it started one.
    """
    app = Dashboard(
        Feed(open_daemon), config=config, command_lines=command_lines, launch_daemon=launch_daemon
    )
    # The screen is drawn on standard error: a warning printed there would tear it.
    logging.getLogger().addHandler(logging.NullHandler())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        app.limit_to_terminal()
        app.run(mouse=app.config.mouse)
    return app.return_code or 0, app.farewell()
