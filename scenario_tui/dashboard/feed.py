"""The thread that asks the daemon: for what every screen needs, and for the screen in front."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, TypeAlias, TypeVar

from daemon.batch.errors import DaemonError, Unreachable
from scenario_tui.dashboard.campaign_assessor import CampaignAssessor
from scenario_tui.dashboard.live_tracks import LiveNews
from scenario_tui.dashboard.run_watch import RunWatch
from scenario_tui.dashboard.searches import KnownSearches
from scenario_tui.dashboard.state import CAMPAIGNS_SHOWN, Known, Notice

if TYPE_CHECKING:
    from daemon.model.status import CampaignRow, ChangeEvent
    from daemon.model.verbs import ClientOpener, DaemonClient
    from scenario_tui.dashboard.screens.base import BaseScreen

T = TypeVar("T")

REFRESH: Final = 1.0
"""Seconds between two looks when nothing is known to have changed."""
_LOOK: Final = 10.0
"""Seconds between two looks at everything: events may be lost."""
_BREATH: Final = 0.2
"""Seconds between two looks at least: a campaign of short runs changes far more often than that."""
_GATHER: Final = 0.01
"""Seconds others are waited for when a key was pressed: they often come several at once."""
_RETRY: Final = 0.5
"""Seconds after which a daemon that was lost is tried again."""
_PATIENCE: Final = 1.0
"""Seconds the assessing thread gets to leave: it may wait for a daemon that is gone."""
_ASSESS_EVERY: Final = 0.1
"""Seconds between two looks for campaigns that should be assessed."""

Action: TypeAlias = "Callable[[DaemonClient], str]"


@dataclass(frozen=True, slots=True)
class News:
    """News since the last look: the state if it changed, telemetry and notices.

    ``fetched`` is the answer to the screen ``front``.
    """

    known: Known | None
    front: BaseScreen[Any] | None
    fetched: object
    lives: list[LiveNews]
    notices: list[Notice]


class Feed:
    """Asks the daemon for what is wanted, again and again, over its restarts.

    ``watch`` is for the screen in front, to ask for a run and to follow it.
    """

    def __init__(
        self,
        open_daemon: ClientOpener,
        *,
        clock: Callable[[], float] = time.time,
        assessor: CampaignAssessor | None = None,
    ) -> None:
        self.connect = open_daemon
        """Opens a connection of one's own, for questions that may take a while."""
        self._assessor = assessor or CampaignAssessor()
        # After a lost connection the old assessing thread may still be at work beside the new one.
        self._assessing = threading.Lock()
        self._clock = clock
        self._front: BaseScreen[Any] | None = None
        self._known = Known()
        self._fetched: tuple[BaseScreen[Any] | None, object] = (None, None)
        self._changed = False
        self._heard = self._assessed = False
        self._looked_at = 0.0
        # Appending to a deque needs no lock. Measured for one message: 0.6 us this way, 20 us by
        # Textual's post_message, 54 us by its call_from_thread.
        self._actions: deque[Action] = deque()
        self._lives: deque[LiveNews] = deque(maxlen=512)
        self._notices: deque[Notice] = deque(maxlen=16)
        self._wake = threading.Event()
        self._asked = threading.Event()
        self._told = threading.Event()
        self._searches = KnownSearches()
        self.watch = RunWatch(self._lives, self._note_problem)
        self._closing = False
        self.on_news: Callable[[], object] = bool
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="feed", daemon=True)

    def start(self) -> None:
        """Begin to ask."""
        self._thread.start()

    def close(self) -> None:
        """Stop asking; returns when the thread has left."""
        self._closing = True
        self._hurry()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def look_at(self, front: BaseScreen[Any]) -> None:
        """Fetch at once for the screen in front, or anew because it wants something else."""
        self._front = front
        if front.about and self._known.campaign(front.about) is None:
            self._heard = True  # one that is not listed is asked for with all others
        self._hurry()

    def enqueue_action(self, action: Action) -> None:
        """Have something done; what it returns, or why it was refused, becomes a notice."""
        self._actions.append(action)
        self._hurry()

    def _hurry(self) -> None:
        self._asked.set()
        self._wake.set()

    def take_news(self) -> News:
        """Return what is new; a bug in the asking thread is raised here, where it is seen."""
        if self._failure is not None:
            raise self._failure
        # First the flag, then the state: what is left behind in between is taken the next time.
        # The other way round it would never be.
        changed, self._changed = self._changed, False
        known = self._known if changed else None
        return News(known, *self._fetched, _drain(self._lives), _drain(self._notices))

    def _run(self) -> None:
        while not self._closing:
            try:
                self._session()
            except DaemonError as error:
                self._lose(error)
                self._forget()
                self._wake.wait(_RETRY)
                self._wake.clear()
            except Exception as error:
                self._fail(error)
                return

    def _fail(self, bug: Exception) -> None:
        self._failure = bug
        self.on_news()

    def _lose(self, error: DaemonError) -> None:
        """Keep what is known, and why nothing more is."""
        refused = not isinstance(error, Unreachable)
        self._publish(replace(self._known, connected=False, problem=str(error), refused=refused))

    def _session(self) -> None:
        """Ask over one connection until it breaks or the feed is closed."""
        with self.connect() as daemon:
            # Before the first look: what changes in between is then heard of and not missed.
            subscription = daemon.events(self._on_event, self.watch.hear)
            leaving = threading.Event()
            assessing = threading.Thread(
                target=self._assess_changes, args=(daemon, leaving), name="judge", daemon=True
            )
            assessing.start()
            try:
                while not self._closing:
                    self._wake.clear()
                    if self._is_outdated(daemon):
                        self._heard = False
                        self.step(daemon)
                    elif self._assessed:
                        self._publish(self._known)
                    self._breathe(daemon)
                    self._wake.wait(REFRESH - _BREATH)
            except DaemonError as error:
                # At once: to close the connection to a daemon that hangs takes ten seconds.
                self._lose(error)
                raise
            finally:
                leaving.set()
                self._told.set()
                # A question about a large campaign may still wait for a daemon that is gone.
                assessing.join(_PATIENCE)
                self.watch.close()
                subscription.close()

    def _is_outdated(self, daemon: DaemonClient) -> bool:
        """Return whether there may be more to know than is known."""
        now, known, held = self._clock(), self._known, self._known.overview
        if self._heard or not known.connected or held is None or now >= self._looked_at + _LOOK:
            return True
        if (self._asked.is_set() or self._assessed) and now < known.at + REFRESH:
            return False  # a key, which is answered first, or what was judged
        # Rows of 300 campaigns each second would be 1 % of a core while nothing happens.
        overview = daemon.overview()
        if overview.running or replace(overview, now=held.now) != held:
            return True
        self._known = replace(known, at=now)
        return False

    def _breathe(self, daemon: DaemonClient) -> None:
        """Let some time pass between two looks; only what people wait for is answered at once."""
        start = now = time.monotonic()
        # A key that is held asks without a pause: all else must not wait for its end.
        while now < start + REFRESH and self._asked.wait(max(0.0, start + _BREATH - now)):
            if self._closing:
                return
            # The last of several keys says what is wanted.
            time.sleep(_GATHER)
            self._asked.clear()
            self.answer(daemon)
            now = time.monotonic()

    def _assess_changes(self, daemon: DaemonClient, leaving: threading.Event) -> None:
        """Assess what changed until the connection is left."""
        while not leaving.wait(_ASSESS_EVERY):
            try:
                campaign = self.assess(daemon)
                if not campaign:
                    # Some may wait for their turn: to look ten times a second is 0.3 % of a core.
                    self._told.wait(REFRESH)
                    self._told.clear()
                elif campaign == self._about():
                    self._wake.set()
            except DaemonError:
                continue  # the asking thread notices too, and says so
            except Exception as error:
                if not leaving.is_set():  # else the connection was closed while it was used
                    self._fail(error)
                return

    def assess(self, daemon: DaemonClient) -> str:
        """Assess one campaign if one changed; return its id, empty if there was none."""
        # The runs of a search are there to fail: nothing was expected of them.
        campaigns = tuple(row for row in self._known.campaigns if not row.search)
        with self._assessing:
            campaign = self._assessor.step(daemon, campaigns, self._about())
        if campaign:
            self._assessed = True
        return campaign

    def _on_event(self, event: ChangeEvent) -> None:
        # The bus calls this, and RunWatch.hear, on the thread of its link, which waits meanwhile: a
        # request beside a slow callback ran into its time-out. So nothing is asked from here.
        if event.campaign:
            self._assessor.touch(event.campaign)
        self._searches.touch(event)
        self._heard = True
        self._wake.set()

    def answer(self, daemon: DaemonClient) -> None:
        """Do what was asked for, and fetch what the screen in front wants now."""
        self._act(daemon)
        self._fetch(daemon, self._known)

    def step(self, daemon: DaemonClient) -> None:
        """Do what was asked for, then ask how everything stands, and for the screen in front."""
        # First what people wait for, which is not fetched a second time behind it.
        answered = self._asked.is_set() and self._known.connected
        if answered:
            self._asked.clear()
            self.answer(daemon)
        else:
            self._act(daemon)
        campaigns = _campaigns(daemon, self._about())
        self._searches.update_rows(daemon, campaigns)
        self._looked_at = self._clock()
        known = replace(
            self._known,
            connected=True,
            problem="",
            refused=False,
            overview=daemon.overview(),
            campaigns=campaigns,
            searches=self._searches.rows,
            at=self._clock(),
        )
        if answered:
            self._publish(known)
        else:
            self._fetch(daemon, known)

    def _about(self) -> str:
        front = self._front
        return front.about if front is not None else ""

    def _fetch(self, daemon: DaemonClient, known: Known) -> None:
        """Fetch for the screen in front, and show that with what is ``known``."""
        front = self._front
        if front is not None:
            with self.watch.looking(daemon):
                self._fetched = (front, front.fetch(daemon, known))
        self._publish(known)

    def _forget(self) -> None:
        """Forget what was asked for: nobody expects it to be done when the daemon is back."""
        if _drain(self._actions):
            self._note_problem("no daemon answers, so nothing was done")

    def _act(self, daemon: DaemonClient) -> None:
        """Do what was asked for, and note what came of it."""
        while self._actions:
            try:
                self._notices.append(Notice(self._actions.popleft()(daemon)))
            except DaemonError as error:
                self._note_problem(str(error))

    def _note_problem(self, text: str) -> None:
        self._notices.append(Notice(text, "error"))

    def _publish(self, known: Known) -> None:
        """Show what is known, with all that is judged by now."""
        self._assessed = False
        conclusions, results = self._assessor.conclusions, self._assessor.results
        # Without a lock: what is known is immutable, and the flag is set behind it.
        self._known = replace(known, conclusions=conclusions, results=results)
        self._changed = True
        self._told.set()
        self.on_news()


def _campaigns(daemon: DaemonClient, about: str) -> tuple[CampaignRow, ...]:
    """Return the newest campaigns, all that are unfinished, and the one that is looked at."""
    rows = daemon.campaign_page(limit=CAMPAIGNS_SHOWN)
    if len(rows) < CAMPAIGNS_SHOWN:
        return rows
    listed = {row.id: row for row in (*rows, *daemon.campaign_page(unfinished=True))}
    if about and about not in listed and (row := daemon.campaign(about)):
        listed[about] = row
    return tuple(listed.values())


def _drain(waiting: deque[T]) -> list[T]:
    # One by one: another thread may be appending, and an iteration would raise.
    drained = []
    while waiting:
        drained.append(waiting.popleft())
    return drained
