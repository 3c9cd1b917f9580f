"""Watching a campaign until its last run: over daemon restarts, with progress on terminals."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final, Protocol

from rich.console import Console, Group, RenderableType
from rich.live import Live as Screen
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from daemon.errors import DaemonError, Refused, Unreachable
from daemon.protocol import CampaignRow, Event, Live, RunRow
from scenario_tui.asking import Daemon, Opener
from scenario_tui.cli._output import err, say
from scenario_tui.wording import (
    GLYPHS,
    STYLES,
    counted,
    duration,
    glyph_word,
    rate,
    run_label,
    tally,
)

INTERVAL: Final = 0.25
PATIENCE: Final = 120.0
"""Seconds a watcher waits for a daemon that went away."""
_LOOK: Final = 2.0
"""Seconds between two questions whether the daemon is in trouble."""
_SHOWN_RUNS: Final = 8
_BAR: Final = 16
_WAITING: Final = "waiting for a worker; the first one on a machine compiles for a while"


@dataclass(slots=True)
class Sight:
    """What a watcher has seen last."""

    row: CampaignRow
    running: tuple[RunRow, ...] = ()
    live: dict[str, Live] = field(default_factory=dict)
    per_minute: float = 0.0
    seconds_left: float | None = None


class Display(Protocol):
    """Where a watcher tells what it sees."""

    def show(self, sight: Sight) -> None:
        """Show the campaign as it stands."""

    def note(self, message: str) -> None:
        """Say something that must not be overwritten."""


class Quiet:
    """The display when standard error is no terminal: notes only."""

    def show(self, sight: Sight) -> None:
        """Show nothing: a log file is no place for progress."""

    def note(self, message: str) -> None:
        """Write the message to standard error."""
        say(message)


class Bar:
    """The display on a terminal: one line for the campaign, one for each running run."""

    def __init__(self, console: Console, screen: Screen) -> None:
        self._console, self._screen = console, screen

    def show(self, sight: Sight) -> None:
        """Draw the campaign as it stands."""
        self._screen.update(drawn(sight, self._console.width), refresh=True)

    def note(self, message: str) -> None:
        """Print the message above the bar."""
        self._console.print(message, style="yellow")


@contextmanager
def display() -> Iterator[Display]:
    """Choose the display that fits standard error."""
    console = err()
    if not console.is_terminal:
        yield Quiet()
        return
    with Screen(console=console, auto_refresh=False, transient=True) as screen:
        yield Bar(console, screen)


def drawn(sight: Sight, width: int) -> RenderableType:
    """Return the lines that show how far a campaign is, on a terminal ``width`` cells wide."""
    for words, pace in ((True, True), (True, False), (False, False)):
        head, tail = _campaign(sight, words=words, pace=pace)
        if head.cell_len + tail.cell_len + _BAR + 4 <= width:
            break
    row = sight.row
    line = Table.grid(padding=(0, 2))
    for _ in range(3):
        line.add_column(no_wrap=True)
    finished = row.total - row.queued - row.running
    bar = ProgressBar(total=max(1, row.total), completed=finished, width=_BAR)
    line.add_row(head, bar, tail)
    runs = [_running(run, sight.live.get(run.id)) for run in sight.running[:_SHOWN_RUNS]]
    if not finished and not sight.running:
        runs.append(Text(f"  {_WAITING}", style="dim"))
    hidden = len(sight.running) - len(runs)
    if hidden > 0:
        runs.append(Text(f"  and {hidden} more", style="dim"))
    return Group(line, *runs)


def _campaign(sight: Sight, *, words: bool, pace: bool) -> tuple[Text, Text]:
    """Return what stands before and after the bar, with or without words and rate."""
    row = sight.row
    finished = row.total - row.queued - row.running
    tail = Text(f"{finished}/{counted(row.total, 'run')}")
    for word, count in tally(row).items():
        if word not in ("queued", "running"):
            tail.append(
                f"  {GLYPHS[word]} {count}{' ' + word if words else ''}", style=STYLES[word]
            )
    if sight.seconds_left is not None:
        tail.append(f"  {duration(sight.seconds_left)} left", style="default")
    if pace and sight.per_minute:
        tail.append(f"  {rate(sight.per_minute)}", style="default")
    return Text(row.name, style="bold"), tail


def _running(row: RunRow, live: Live | None) -> Text:
    text = Text.assemble((f"  {glyph_word('running')}  ", STYLES["running"]), run_label(row))
    if live is not None:
        seen = live.snapshot
        text.append(f"  waypoint {min(seen.reached + 1, seen.waypoints)} of {seen.waypoints}")
        text.append(f"  {seen.time:.0f} s simulated, limit {seen.limit:.0f} s", style="dim")
    return text


@dataclass(slots=True)
class _Pace:
    """Measures how fast runs finish while somebody watches."""

    started: float
    before: int

    def look(self, row: CampaignRow, now: float) -> tuple[float, float | None]:
        """Return runs per minute and the seconds left at that pace."""
        left = row.queued + row.running
        since = row.total - left - self.before
        elapsed = now - self.started
        if since <= 0 or elapsed <= 0:
            return 0.0, None
        return 60.0 * since / elapsed, left * elapsed / since


@dataclass(slots=True)
class _Trouble:
    """Says once what keeps runs from being executed, and when it is over."""

    shown: Display
    endurance: float
    words: str = ""
    since: float = 0.0
    look_at: float = 0.0

    def look(self, daemon: Daemon, now: float) -> None:
        """Ask every now and then; raises :class:`DaemonError` when endurance is at its end."""
        if now < self.look_at:
            return
        self.look_at = now + _LOOK
        words = daemon.overview().trouble.strip()
        if words and not self.words:
            self.since = now
        if words != self.words:
            last = words.splitlines()[-1] if words else ""
            self.shown.note(f"no run can start: {last}" if words else "runs can start again")
        self.words = words
        if words and now - self.since > self.endurance:
            raise DaemonError(words)


def watch(
    open_daemon: Opener,
    campaign: str,
    *,
    patience: float = PATIENCE,
    endurance: float = math.inf,
    limit: float = math.inf,
) -> CampaignRow:
    """Show progress until no run of ``campaign`` waits or runs; return how it ended.

    After ``limit`` seconds it is returned as it stands then. A daemon that goes away is waited for
    and found again. Raises :class:`daemon.errors.Unreachable` when it stays away for ``patience``
    seconds, or at the limit, and :class:`daemon.errors.DaemonError` when it cannot execute runs
    for ``endurance`` seconds.
    """
    begun = time.monotonic()
    live: dict[str, Live] = {}
    gone: float | None = None
    pace: _Pace | None = None
    with display() as shown:
        trouble = _Trouble(shown, endurance)
        while True:
            try:
                with open_daemon() as daemon, _telemetry(daemon, live):
                    while True:
                        row = _row(daemon, campaign)
                        now = time.monotonic()
                        if gone is not None:
                            shown.note("the daemon is back, watching again")
                            gone = None
                        if row.finished or now - begun >= limit:
                            return row
                        pace = pace or _Pace(now, row.total - row.queued - row.running)
                        trouble.look(daemon, now)
                        shown.show(_sight(daemon, row, live, pace, now))
                        time.sleep(INTERVAL)
            except Unreachable:
                now = time.monotonic()
                if gone is None:
                    shown.note("the daemon does not answer, waiting for it (Ctrl-C to leave)")
                    gone = now
                if now - gone > patience or now - begun >= limit:
                    raise
                time.sleep(INTERVAL)


@contextmanager
def _telemetry(daemon: Daemon, live: dict[str, Live]) -> Iterator[None]:
    def on_live(message: Live) -> None:
        live[message.run] = message

    subscription = daemon.events(_ignore, on_live)
    try:
        yield
    finally:
        subscription.close()


def _ignore(event: Event) -> None:
    """The campaign is asked for anyway."""


def _row(daemon: Daemon, campaign: str) -> CampaignRow:
    for row in daemon.campaigns():
        if row.id == campaign:
            return row
    raise Refused(f"the daemon does not know the campaign {campaign} (any more)")


def _sight(
    daemon: Daemon, row: CampaignRow, live: dict[str, Live], pace: _Pace, now: float
) -> Sight:
    running = daemon.runs(row.id, state="running", limit=_SHOWN_RUNS + 1).rows
    per_minute, left = pace.look(row, now)
    return Sight(row, running, live, per_minute, left)
