"""What screens need of the app: what is known, what can be done about it, what is said.

Screens see this class; :class:`scenario_tui.dashboard.app.Dashboard` sees the screens.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

from grammars.text.terminal_text import printable
from scenario_tui.dashboard.background import (
    BackgroundTasks,
    CommandLines,
    CommandRunner,
    run_command,
)
from scenario_tui.dashboard.children import Children, load_modules
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.feed import Action, Feed
from scenario_tui.dashboard.live_tracks import Tracks
from scenario_tui.dashboard.recordings import Recordings
from scenario_tui.dashboard.state import Known, RunsView
from scenario_tui.dashboard.themes import ThemedApp
from scenario_tui.terminal.capabilities import copy_to_tmux

if TYPE_CHECKING:
    from scenario_tui.library.submission import CheckedFile

_READING: Final = (
    "scenario_tui.dashboard.playback",
    "daemon.judging.oracles",
    "daemon.judging.live",
)
"""What reads traces and samples their signals."""


_PLACES: Final = {
    "matrix": ("matrix", "MatrixScreen"),
    "runs": ("runs", "RunsScreen"),
    "search": ("search", "SearchScreen"),
    "run": ("run", "RunScreen"),
    "workers": ("workers", "WorkersScreen"),
    "submit": ("submit", "SubmitScreen"),
}
"""The module and the class of every screen but the first.

By name: screens open each other in circles, and what most of them need loads longer than the first
screen.
"""


class BaseDashboard(ThemedApp):
    """State and services of the dashboard."""

    def __init__(
        self,
        feed: Feed,
        *,
        clock: Callable[[], float] = time.time,
        config: Config | None = None,
        command_lines: CommandLines | None = None,
        run_command: CommandRunner = run_command,
        launch_daemon: Callable[[], str] | None = None,
        child_processes: Children | None = None,
    ) -> None:
        super().__init__()
        self.feed = feed
        self.background_tasks = BackgroundTasks()
        self.run_command = run_command
        self.child_processes = child_processes or Children()
        self.command_lines = command_lines or CommandLines()
        self.config = config or Config()
        self.read_only = self.config.read_only
        self.submitted: tuple[Path, ...] = ()
        self.submitted_campaign = ""
        self.running_jobs: set[str] = set()
        self.run_views: dict[tuple[str, str, str], RunsView] = {}
        self.launch_daemon = launch_daemon
        self.launching = self.launched = False
        self.marked_run = ""
        self.clock = clock
        self.known = Known()
        self.tracks = Tracks()
        self.recordings = Recordings(feed.connect, self.child_processes)
        self._said = 0.0

    def check_file(
        self, path: Path, *, submit: bool = False, fresh: bool = False, state: Path | None = None
    ) -> CheckedFile:
        """Examine a campaign file in the child process; not for the thread that draws."""
        # It knows the daemon's records, which load longer than the first screen.
        from scenario_tui.library.submission import check_file

        return self.child_processes.run(check_file, path, submit=submit, fresh=fresh, state=state)

    def prepare_playback(self) -> None:
        """Have what reads traces there: somebody is about to open a run."""
        load = partial(self.child_processes.run, load_modules, *_READING)
        self.background_tasks.start(load, _nothing, self.problem)

    def open(self, place: str, *about: str) -> None:
        """Show a screen: its name, and the ids of what it shows."""
        module, name = _PLACES[place]
        kind = getattr(import_module(f"scenario_tui.dashboard.screens.{module}"), name)
        self.push_screen(kind(*about))

    def open_campaign(self, campaign: str) -> None:
        """Show what a campaign is about: a search, or runs."""
        row = self.known.campaign(campaign)
        self.open("search" if row is not None and row.search else "runs", campaign)

    def why_not_steer(self) -> str:
        """Return why nothing can be changed from here, empty if it can."""
        # Only what people see here is barred: who may do what, the daemon decides by their key.
        if self.read_only:
            return "read-only: nothing is changed from this dashboard"
        return "" if self.known.connected else "no daemon answers: nothing was done"

    def steer(self, action: Action, command: str) -> None:
        """Have the daemon do something; its outcome is shown with the command for the same."""
        if why := self.why_not_steer():
            self.problem(why)
        else:
            self.feed.enqueue_action(lambda daemon: f"{action(daemon)}\nsame as: {command}")

    def say(self, text: str, command: str) -> None:
        """Say something, and what to type to do the same."""
        self.notify(f"{text}\nsame as: {command}", markup=False)

    def problem(self, text: str) -> None:
        """Say that something cannot be done, and why."""
        self.notify(text, severity="error", markup=False)

    def copy(self, command: str) -> None:
        """Put a command line into the clipboard of the terminal, also over SSH (OSC 52)."""
        # A line end in it, from a name, would run what stands before it where it is pasted.
        command = printable(" ".join(command.splitlines()))
        # tmux ignores OSC 52 of programs inside of it, and is told itself.
        self.copy_to_clipboard(command)
        self.background_tasks.start(partial(copy_to_tmux, command), _nothing, self.problem)
        self.notify(f"copied: {command}", markup=False)

    def remember(self, file: Path, campaign: str) -> None:
        """Note that a file was submitted as ``campaign``: it is offered first the next time, and
        the cursor goes to the campaign once that is on the list.
        """
        self.submitted_campaign = campaign
        self.submitted = tuple(dict.fromkeys((file, *self.submitted)))


def _nothing(_: object) -> None:
    """What is copied was said already."""
