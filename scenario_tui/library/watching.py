"""Watching a campaign until its last run: over daemon restarts, with progress on terminals."""

from __future__ import annotations

import logging
import math
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Final, Protocol, TypeVar

from rich.console import Group, RenderableType
from rich.live import Live as Screen
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from daemon.batch.errors import DaemonError, Refused, Unavailable, Unreachable
from daemon.model.status import (
    CampaignRow,
    ChangeEvent,
    LiveSnapshot,
    PreparationPhase,
    RunRow,
)
from daemon.model.verbs import ClientOpener, DaemonClient
from daemon.search.answers.sentences import margin_words, phase_words
from grammars.text.terminal_text import printable_streams
from grammars.text.words import command_line, count_noun, duration_text
from scenario_tui.interrupts import stop_if_interrupted
from scenario_tui.terminal.printable_console import open_console
from scenario_tui.text.formatting import glyph_word, rate_text, run_counts
from scenario_tui.text.run_text import reached_text
from scenario_tui.text.search_text import search_state
from scenario_tui.text.styles import GLYPHS

if TYPE_CHECKING:
    from daemon.model.search_answer import SearchRow
    from daemon.model.spec import Snapshot
    from daemon.search.client import SearchClient
    from scenario_tui.source import DaemonTarget

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

LOG: Final = logging.getLogger("scenario_tui")
"""Messages without a progress bar; the command line prints them."""
INTERVAL: Final = 0.25
"""Seconds between two looks at a campaign that changes."""
_POLL: Final = 2.0
"""Seconds between two looks without an event: events may get lost."""
PATIENCE: Final = 120.0
"""Seconds a watcher waits for a daemon that went away."""
ENDURANCE: Final = 20.0
"""Seconds that a private daemon may lack a worker or space on its disk before the run fails."""
SUBMIT_PATIENCE: Final = 10.0
"""Seconds that a submission waits for a daemon: one that restarts needs a few."""
_LOOK: Final = 2.0
"""Seconds between two looks for problems of the daemon."""
_SHOWN_RUNS: Final = 8
_BAR: Final = 16
_WAITING: Final = "waiting for a free slot"
_SAY_AGAIN: Final = 5.0
"""Seconds between two lines about the preparation of a worker, without a terminal."""
_LIVE_PATIENCE: Final = 0.5
"""Seconds to wait for news of a run: a watched run sends several a second."""
_NO_WORKER: Final = "waiting for a worker: none is connected"
_AWAY: Final = "the daemon does not answer, waiting for it (Ctrl-C to leave)"


class ProgressDisplay:
    """Display of a watcher: a line for the campaign, one for each running run.

    Without a ``screen`` standard error is no terminal, and a log file is no place for progress.
    """

    def __init__(self, screen: Screen | None) -> None:
        self._screen = screen

    @property
    def on_screen(self) -> bool:
        """True if anything is drawn at all."""
        return self._screen is not None

    def show(self, draw: Callable[[], RenderableType]) -> None:
        """Draw the current state, if anything is drawn at all."""
        if self._screen is not None:
            self._screen.update(draw(), refresh=True)

    def note(self, message: str) -> None:
        """Print a message that stays: on a terminal it stands above the bar."""
        if self._screen is None:
            LOG.info("%s", message)
        else:
            self._screen.console.print(message, style="yellow")


@contextmanager
def open_display() -> Iterator[ProgressDisplay]:
    """Choose the display that fits standard error, or the notebook."""
    console = open_console(stderr=True)
    # rich draws in notebooks by ipywidgets, and warns where they are missing.
    in_notebook = console.is_jupyter and find_spec("ipywidgets") is not None
    if not (console.is_terminal or in_notebook):
        yield ProgressDisplay(None)
        return
    # The watcher draws four times a second, so rich needs no thread. Other output passes through
    # rich, which would interpret its colours.
    with Screen(console=console, auto_refresh=False, transient=True) as screen, printable_streams():
        yield ProgressDisplay(screen)


def _run_line(row: RunRow, live: LiveSnapshot | None) -> Text:
    text = Text.assemble((f"  {glyph_word('running')}  ", "running"), row.label)
    snapshot = None if live is None else live.snapshot
    return _fitting(text.append(f"  {reached_text(snapshot)}", style="dim"))


def _fitting(text: Text) -> Text:
    """Return a text that is cut where its line ends."""
    text.no_wrap, text.overflow = True, "ellipsis"
    return text


@dataclass(slots=True)
class _TroubleReporter:
    """Reports once why no run can be executed, and when they can again."""

    display: ProgressDisplay
    endurance: float
    words: str = ""
    since: float = 0.0
    look_at: float = 0.0
    preparing: str = ""
    phase: PreparationPhase | None = None
    say_at: float = 0.0

    def look(self, daemon: DaemonClient, now: float) -> None:
        """Ask every :data:`_LOOK` seconds; raises :class:`DaemonError` after the endurance."""
        if now < self.look_at:
            return
        self.look_at = now + _LOOK
        overview = daemon.overview()
        words = overview.trouble.strip()
        phase = overview.preparation.phase if overview.preparation else None
        is_news = overview.preparing != self.preparing and now >= self.say_at
        if phase is not None and (is_news or phase != self.phase) and not self.display.on_screen:
            self.display.note(overview.preparing)  # a screen shows it continuously
            self.say_at = now + _SAY_AGAIN
        self.phase = phase
        waits = overview.queued and not overview.workers and not overview.trouble
        self.preparing = overview.preparing or (_NO_WORKER if waits else "")
        if words and not self.words:
            self.since = now
        if words != self.words:
            last = words.splitlines()[-1] if words else ""
            self.display.note(f"no run can start: {last}" if words else "runs can start again")
        self.words = words
        if words and now - self.since > self.endurance:
            raise DaemonError(words)


class WatchedWork(Protocol[T_co]):
    """Part of a campaign that a watcher fetches and draws again and again, until its end."""

    campaign: str

    def look(self, daemon: DaemonClient, display: ProgressDisplay) -> T_co:
        """Ask for its current state and return that."""

    @property
    def finished(self) -> bool:
        """True if its state is final."""

    def draw(self, live: Mapping[str, LiveSnapshot], preparing: str) -> RenderableType:
        """Return its state; ``preparing`` tells why no run starts."""


@dataclass(slots=True)
class WatchedRuns:
    """The runs of a campaign, as far as they are drawn.

    ``command`` quotes a command about their daemon.
    """

    campaign: str
    command: Callable[..., str] = command_line
    row: CampaignRow | None = None
    running: tuple[RunRow, ...] = ()
    began: tuple[float, int] | None = None

    def look(self, daemon: DaemonClient, display: ProgressDisplay) -> CampaignRow:
        """Return the row of the campaign."""
        row = self.row = daemon.campaign(self.campaign)
        if row is None:
            raise Refused(f"the daemon does not know the campaign {self.campaign} (any more)")
        # One more than is drawn shows that there are more.
        most = _SHOWN_RUNS + 1
        if display.on_screen:
            self.running = daemon.runs(row.id, state="running", limit=most).rows
        # Runs that had ended before the first look do not count for the rate: they may be cached.
        self.began = self.began or (time.monotonic(), row.ended)
        return row

    @property
    def finished(self) -> bool:
        """True if no run waits or runs."""
        return self.row is not None and self.row.finished

    def draw(
        self, live: Mapping[str, LiveSnapshot], preparing: str, search: str = ""
    ) -> RenderableType:
        """Return the line of the campaign, that of its ``search``, one for each running run.

        A narrow terminal cuts the end of a line: the rate, then counts.
        """
        row, running = self.row, self.running
        if row is None or self.began is None:
            return Text(preparing)
        began, ended_then = self.began
        tail = Text(f"{row.ended}/{count_noun(row.total, 'run')}")
        if row.seconds_left is not None:
            tail.append(f"  {duration_text(row.seconds_left)} left", style="default")
        for word, count in run_counts(row).items():
            if word not in ("queued", "running"):
                tail.append(f"  {GLYPHS[word]} {count} {word}", style=word)
        minutes = (time.monotonic() - began) / 60.0
        if row.ended > ended_then and minutes > 0.0:
            tail.append(f"  {rate_text((row.ended - ended_then) / minutes)}", style="default")
        line = Table.grid(padding=(0, 2), expand=True)
        line.add_column(no_wrap=True)
        line.add_column(width=_BAR)
        line.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
        bar = ProgressBar(total=max(1, row.total), completed=row.ended, width=_BAR)
        line.add_row(Text(row.name, style="bold"), bar, tail)
        waiting = preparing
        if row.paused:
            waiting = f"paused: `{self.command('pause', row.id, '--off')}` continues it"
        elif not (running or waiting or row.finished):
            waiting = _WAITING
        hidden = len(running) - _SHOWN_RUNS
        words = (search, waiting, f"and {hidden} more" if hidden > 0 else "")
        about, *rest = (
            _fitting(Text(f"  {text}", style="dim")) if text else None for text in words
        )
        runs = [_run_line(run, live.get(run.id)) for run in running[:_SHOWN_RUNS]]
        return Group(line, *filter(None, (about, *runs, *rest)))


@dataclass  # slots would replace the class, and super() would miss it
class CollectedRuns(WatchedRuns):
    """The runs of a campaign with their results: ``rows`` are all of them, in order."""

    rows: tuple[RunRow, ...] = ()

    def look(self, daemon: DaemonClient, display: ProgressDisplay) -> CampaignRow:
        """Return the row of the campaign, after fetching the runs that may have changed."""
        row = super().look(daemon, display)
        settled = next((i for i, run in enumerate(self.rows) if not run.settled), len(self.rows))
        newer = daemon.all_runs(self.campaign, offset=settled, results=True)
        self.rows = (*self.rows[:settled], *newer)
        return row


@dataclass(slots=True)
class WatchedSearch:
    """A search as its last row describes it; ``client`` runs it in this process."""

    campaign: str
    client: SearchClient | None = None
    command: Callable[..., str] = command_line
    row: SearchRow | None = None
    runs: WatchedRuns = field(init=False)

    def __post_init__(self) -> None:
        self.runs = WatchedRuns(self.campaign, self.command)

    def look(self, daemon: DaemonClient, display: ProgressDisplay) -> SearchRow:
        """Return its row; report the first failure and every new phase."""
        row, previous = daemon.search_row(self.campaign), self.row
        if row is None:
            raise Refused(f"the daemon does not know the search {self.campaign} (any more)")
        if display.on_screen:
            self.runs.look(daemon, display)
        first = row.answer.first if row.answer is not None else None
        is_old = previous is not None and previous.answer is not None and previous.answer.first
        # If the search had ended before the first look, its answer reports the failure.
        if first is not None and not is_old and not (previous is None and row.ended):
            oracle = first.verdict.oracle if first.verdict else row.task.minimise
            margin = margin_words(first)
            by = f" by {margin}" if margin else ""
            display.note(f"run {first.number} fails: {oracle}{by} ({first.run})")
        phase = previous.phase if previous is not None else "explore"
        if row.phase != phase and row.state == "running":
            display.note(phase_words(row))
        self.row = row
        return row

    @property
    def finished(self) -> bool:
        """True once the search has ended, or waits for a client and has none here."""
        if self.row is None or self.row.state == "running":
            return False
        return self.row.ended or self.client is None or not self.client.is_alive()

    def draw(self, live: Mapping[str, LiveSnapshot], preparing: str) -> RenderableType:
        """Return the lines of its campaign and one about the search."""
        about = search_state(self.row) if self.row is not None else ""
        return self.runs.draw(live, preparing, about)


def watch(open_daemon: ClientOpener, work: WatchedWork[T], **limits: float) -> T:
    """Show the state of ``work`` until it is finished, and return its last state.

    ``limits`` are those of :func:`follow`.
    """
    with open_display() as display:
        return deque(follow(open_daemon, work, display, **limits), maxlen=1).pop()


def follow(
    open_daemon: ClientOpener,
    work: WatchedWork[T],
    display: ProgressDisplay,
    *,
    patience: float = PATIENCE,
    endurance: float = math.inf,
    limit: float = math.inf,
) -> Iterator[T]:
    """Yield the state of ``work`` after every change, until its end or for ``limit`` seconds.

    The loop waits for a daemon that does not answer. Raises :class:`Unreachable` after ``patience``
    seconds without an answer, or at the limit. Raises :class:`DaemonError` if the daemon cannot
    execute runs for ``endurance`` seconds.
    """
    start = time.monotonic()
    live: dict[str, LiveSnapshot] = {}
    away_since: float | None = None
    trouble = _TroubleReporter(display, endurance)
    while True:
        try:
            with open_daemon() as daemon, _listen(daemon, work.campaign, live) as changed:
                look_at = 0.0
                while True:
                    stop_if_interrupted()
                    now = time.monotonic()
                    if changed.is_set() or now >= look_at:
                        changed.clear()
                        yield work.look(daemon, display)
                        now = time.monotonic()
                        look_at = now + _POLL
                    if away_since is not None:
                        display.note("the daemon is back, watching again")
                        away_since = None
                    if work.finished or now - start >= limit:
                        return
                    trouble.look(daemon, now)
                    display.show(partial(work.draw, live, trouble.preparing))
                    time.sleep(INTERVAL)
        except Unreachable:
            now = time.monotonic()
            if away_since is None:
                display.note(_AWAY)
                away_since = now
            if now - away_since > patience or now - start >= limit:
                raise
            time.sleep(INTERVAL)


def ask_patiently(target: DaemonTarget, ask: Callable[[DaemonClient], T], patience: float) -> T:
    """Ask a daemon, repeatedly for ``patience`` seconds if it does not answer.

    Raises :class:`Unreachable` afterwards, at once if there never was a daemon, and all errors of
    ``ask``.
    """
    deadline = time.monotonic() + patience
    message = ""
    while True:
        try:
            with target.open() as daemon:
                return ask(daemon)
        except Unreachable as error:
            if not target.may_come_back or time.monotonic() >= deadline:
                raise
            previous, message = message, _AWAY
            if isinstance(error, Unavailable):
                message = f"{error}; trying again (Ctrl-C to leave)"
            if message != previous:
                LOG.info("%s", message)
            time.sleep(INTERVAL)


@contextmanager
def _listen(
    daemon: DaemonClient, campaign: str, live: dict[str, LiveSnapshot]
) -> Iterator[threading.Event]:
    """Collect telemetry, and yield an event that every change of the campaign sets."""
    changed = threading.Event()

    def on_event(event: ChangeEvent) -> None:
        if event.campaign == campaign:
            changed.set()

    def on_live(message: LiveSnapshot) -> None:
        live[message.run] = message

    subscription = daemon.events(on_event, on_live)
    try:
        yield changed
    finally:
        subscription.close()


def latest_snapshot(daemon: DaemonClient, run: str) -> Snapshot | None:
    """Return the next snapshot of a run, ``None`` if it takes too long."""
    snapshots: queue.SimpleQueue[Snapshot] = queue.SimpleQueue()
    watch = daemon.watch(run, lambda message: snapshots.put(message.snapshot))
    try:
        return snapshots.get(timeout=_LIVE_PATIENCE)
    except queue.Empty:
        return None
    finally:
        watch.close()
