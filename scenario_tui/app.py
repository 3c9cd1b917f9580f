"""The dashboard: a client of the daemon and nothing else; leaving it never stops any work."""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable, Iterable
from typing import ClassVar, Final

from textual.app import App, SystemCommand
from textual.binding import Binding, BindingType
from textual.screen import Screen

from scenario_tui.asking import Opener
from scenario_tui.feed import Feed, Picture
from scenario_tui.screens.base import BaseScreen
from scenario_tui.screens.campaigns import CampaignsScreen
from scenario_tui.screens.dialogs import Help
from scenario_tui.screens.matrix import MatrixScreen
from scenario_tui.screens.run import RunScreen
from scenario_tui.screens.runs import RunsScreen
from scenario_tui.screens.workers import WorkersScreen
from scenario_tui.tracks import Tracks
from scenario_tui.wording import counted

FRAMES: Final = 8
"""How often a second the screen takes over what the feed has found."""


class Dashboard(App[None]):
    """Campaigns, their runs, one run, the workers; fed by a :class:`Feed`."""

    TITLE = "scenario"
    CSS_PATH = "dashboard.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (110, "-wide")]  # noqa: RUF012
    COMMAND_PALETTE_BINDING = "colon"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("1", "go('campaigns')", "Campaigns", show=False),
        Binding("2", "go('runs')", "All runs", show=False, tooltip="Runs of every campaign"),
        Binding("3", "go('workers')", "Workers", show=False),
        Binding("colon", "command_palette", "Go", show=False, tooltip="Type where to go"),
        Binding("question_mark", "keys", "Help", tooltip="This list"),
        Binding("q", "quit", "Quit", tooltip="Leave; all work goes on"),
        Binding("ctrl+c", "quit", "Quit", show=False, priority=True),
    ]

    def __init__(self, feed: Feed, *, clock: Callable[[], float] = time.time) -> None:
        super().__init__()
        self.feed = feed
        self.clock = clock
        self.picture = Picture()
        self.tracks = Tracks()
        self._said = 0.0

    def get_default_screen(self) -> Screen[None]:
        """Begin with the campaigns."""
        return CampaignsScreen()

    def on_mount(self) -> None:
        """Start asking and looking."""
        self.feed.start()
        self.set_interval(1.0 / FRAMES, self.look)

    def on_unmount(self) -> None:
        """Stop asking."""
        self.feed.close()

    def look(self) -> None:
        """Take over what is new and bring the screen in front up to date."""
        picture, lives, notices = self.feed.take()
        for live in lives:
            self.tracks.add(live)
        for notice in notices:
            self.notify(notice.text, severity=notice.severity)
        if picture is not None:
            self.picture = picture
        now = self.clock()
        # Ages grow even when nothing is new.
        if picture is not None or lives or now - self._said >= 1.0:
            self._said = now
            self._present()

    def _present(self) -> None:
        for screen in reversed(self.screen_stack):
            if isinstance(screen, BaseScreen):
                screen.present()
                return

    def open_matrix(self, campaign: str) -> None:
        """Show a campaign judged."""
        self.push_screen(MatrixScreen(campaign))

    def open_runs(self, campaign: str, scenario: str = "", sut: str = "") -> None:
        """Show the runs of a campaign, or of one of its cells."""
        self.push_screen(RunsScreen(campaign, scenario, sut))

    def open_run(self, run: str) -> None:
        """Show one run."""
        self.push_screen(RunScreen(run))

    def action_go(self, place: str) -> None:
        """Go to one of the main screens from wherever we are."""
        if isinstance(self.screen, Help):
            self.pop_screen()
        while len(self.screen_stack) > 1:
            self.pop_screen()
        if place == "runs":
            self.push_screen(RunsScreen())
        elif place == "workers":
            self.push_screen(WorkersScreen())

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Leave dialogs alone: only their own keys work there."""
        in_front = isinstance(self.screen, BaseScreen)
        return in_front or action not in ("go", "keys", "command_palette")

    def action_keys(self) -> None:
        """Show the keys of the screen in front."""
        self.push_screen(Help(self.screen))

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """Offer places and help behind the colon."""
        yield SystemCommand("campaigns", "All campaigns", lambda: self.action_go("campaigns"))
        yield SystemCommand("runs", "Runs of every campaign", lambda: self.action_go("runs"))
        yield SystemCommand("workers", "Who executes runs", lambda: self.action_go("workers"))
        yield SystemCommand("help", "The keys of this screen", self.action_keys)
        yield SystemCommand("quit", "Leave; all work goes on", self.exit)

    def farewell(self) -> str:
        """Say what goes on without the dashboard."""
        overview = self.picture.overview
        if overview is None or not self.picture.connected:
            return "Left the dashboard. Back with: scenario tui"
        waiting = overview.queued + overview.running
        if not waiting:
            return "Left the dashboard; no run is waiting. Back with: scenario tui"
        runs = counted(waiting, "unfinished run")
        return f"Left the dashboard; the daemon goes on with {runs}. Back with: scenario tui"


def run_dashboard(open_daemon: Opener) -> tuple[int, str]:
    """Show the dashboard until somebody leaves it; return exit code and parting words."""
    app = Dashboard(Feed(open_daemon))
    # The screen is drawn on standard error: a warning printed there would tear it.
    logging.getLogger().addHandler(logging.NullHandler())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        app.run()
    return app.return_code or 0, app.farewell()
