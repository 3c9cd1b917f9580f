"""The thread that asks the daemon: for the state of all screens, and for the screen in front."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias, TypeVar

from daemon.batch.errors import DaemonError, Unreachable
from scenario_tui.dashboard.run_watch import LiveNews, RunWatch
from scenario_tui.dashboard.state import (
    CampaignAssessor,
    DashboardState,
    listed_campaigns,
    search_rows,
)

if TYPE_CHECKING:
    from daemon.model.status import ChangeEvent
    from daemon.model.verbs import ClientOpener, DaemonClient
    from scenario_tui.dashboard.screens.base import BaseScreen

T = TypeVar("T")

REFRESH: Final = 1.0
"""Seconds between two looks without a known change."""
_LOOK: Final = 10.0
"""Seconds between two complete looks, because events may be lost."""
_BREATH: Final = 0.2
"""Least seconds between two looks: a campaign of short runs changes far more often."""
_GATHER: Final = 0.01
"""Seconds to wait for further keys, which often come several at once."""
_RETRY: Final = 0.5
"""Seconds until the next attempt to reach a lost daemon."""
_PATIENCE: Final = 1.0
"""Seconds for the assessing thread to end: it may wait for a lost daemon."""
_ASSESS_EVERY: Final = 0.1
"""Seconds between two looks for campaigns to assess, while there are any."""
_ASSESS_IDLE: Final = 0.5
"""Seconds until the next look after one without any: ten a second take 0.3 % of a core."""

Action: TypeAlias = "Callable[[DaemonClient], str]"
Notice: TypeAlias = tuple[str, Literal["information", "error"]]
"""The outcome of an action, for people, and its severity."""


@dataclass(frozen=True, slots=True)
class News:
    """News since the last look: the state if it changed, telemetry and notices.

    ``fetched`` is the answer for the screen ``front``.
    """

    state: DashboardState | None
    front: BaseScreen[Any] | None
    fetched: object
    lives: list[LiveNews]
    notices: list[Notice]


class Feed:
    """Keeps the state of the dashboard up to date, over restarts of the daemon.

    The screen in front uses ``watch`` to ask for a run and to follow it.
    """

    def __init__(
        self,
        open_daemon: ClientOpener,
        *,
        clock: Callable[[], float] = time.time,
        assessor: CampaignAssessor | None = None,
    ) -> None:
        self.connect = open_daemon
        """Opens a separate connection, for requests that may take a while."""
        self._assessor = assessor or CampaignAssessor()
        # After a lost connection the old assessing thread may still be at work beside the new one.
        self._assessing = threading.Lock()
        self._clock = clock
        self._front: BaseScreen[Any] | None = None
        self._state = DashboardState()
        self._fetched: tuple[BaseScreen[Any] | None, object] = (None, None)
        self._changed = False
        self._outdated = self._assessed = False
        self._looked_at = 0.0
        # Appending to a deque needs no lock. A message takes 0.6 us this way, 20 us by Textual's
        # post_message, 54 us by its call_from_thread (measured).
        self._actions: deque[Action] = deque()
        self._lives: deque[LiveNews] = deque(maxlen=512)
        self._notices: deque[Notice] = deque(maxlen=16)
        self._wake = threading.Event()
        self._requested = threading.Event()
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
        """Fetch at once for the screen in front, also if it needs other data now."""
        self._front = front
        if front.about and self._state.campaign(front.about) is None:
            self._outdated = True  # fetches a campaign that is not listed with all others
        self._hurry()

    def enqueue_action(self, action: Action) -> None:
        """Request an action; its answer, or the reason of a refusal, becomes a notice."""
        self._actions.append(action)
        self._hurry()

    def _hurry(self) -> None:
        self._requested.set()
        self._wake.set()

    def take_news(self) -> News:
        """Return the news; raise a bug of the feed's thread here, where it is reported."""
        if self._failure is not None:
            raise self._failure
        # First the flag, then the state: a change in between is taken the next time. The other way
        # round it would be lost.
        changed, self._changed = self._changed, False
        state = self._state if changed else None
        return News(state, *self._fetched, _drain(self._lives), _drain(self._notices))

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
        """Keep the last state, with the reason why it is not up to date."""
        refused = not isinstance(error, Unreachable)
        self._publish(replace(self._state, connected=False, problem=str(error), refused=refused))

    def _session(self) -> None:
        """Ask over one connection until it breaks or the feed is closed."""
        with self.connect() as daemon:
            # Before the first look, so that no change in between is missed.
            subscription = daemon.events(self._on_event, self.watch.hear)
            leaving = threading.Event()
            assessing = threading.Thread(
                target=self._assess_changes, args=(daemon, leaving), name="judge", daemon=True
            )
            assessing.start()
            try:
                is_woken = False
                while not self._closing:
                    self._wake.clear()
                    if self._is_outdated(daemon, is_woken):
                        self._outdated = False
                        self.step(daemon)
                    elif self._assessed:
                        self._publish(self._state)
                    self._breathe(daemon)
                    is_woken = self._wake.wait(REFRESH - _BREATH)
            except DaemonError as error:
                # At once, because it takes ten seconds to close the connection to a hanging daemon.
                self._lose(error)
                raise
            finally:
                leaving.set()
                # A request about a large campaign may still wait for a lost daemon.
                assessing.join(_PATIENCE)
                self.watch.close()
                subscription.close()

    def _is_outdated(self, daemon: DaemonClient, is_woken: bool) -> bool:
        """Return True if the state may have changed; ``is_woken`` is False if a look is due."""
        now, state, last = self._clock(), self._state, self._state.overview
        if self._outdated or not state.connected or last is None or now >= self._looked_at + _LOOK:
            return True
        if is_woken and now < state.at + REFRESH:
            return False  # by a key, which is answered first, or by a new conclusion
        # Rows of 300 campaigns each second would take 1 % of an idle core.
        overview = daemon.overview()
        if overview.running or replace(overview, now=last.now) != last:
            return True
        self._state = replace(state, at=now)
        return False

    def _breathe(self, daemon: DaemonClient) -> None:
        """Pause between two looks, but answer requests of people at once."""
        start = now = time.monotonic()
        # A held key requests without a pause, and other updates must not wait for its end.
        while now < start + REFRESH and self._requested.wait(max(0.0, start + _BREATH - now)):
            if self._closing:
                return
            # The last of several keys decides.
            time.sleep(_GATHER)
            self._requested.clear()
            self.answer(daemon)
            now = time.monotonic()

    def _assess_changes(self, daemon: DaemonClient, leaving: threading.Event) -> None:
        """Assess changed campaigns until the connection is left."""
        pause = _ASSESS_EVERY
        while not leaving.wait(pause):
            try:
                campaign = self.assess(daemon)
                pause = _ASSESS_EVERY if campaign else _ASSESS_IDLE
                if campaign and campaign == self._about():
                    self._wake.set()
            except DaemonError:
                continue  # the feed's thread gets the same error and reports it
            except Exception as error:
                if not leaving.is_set():  # otherwise the connection was closed during its use
                    self._fail(error)
                return

    def assess(self, daemon: DaemonClient) -> str:
        """Assess one changed campaign; return its id, empty if none has changed."""
        # Searches have no expectations: their runs should fail.
        campaigns = tuple(row for row in self._state.campaigns if not row.search)
        with self._assessing:
            campaign = self._assessor.step(daemon, campaigns, self._about())
        if campaign:
            self._assessed = True
        return campaign

    def _on_event(self, event: ChangeEvent) -> None:
        # The bus calls this, and RunWatch.hear, on the thread of its link, which waits meanwhile. A
        # slow callback would let other requests time out, so this makes no request.
        if event.campaign:
            self._assessor.touch(event.campaign)
        self._outdated = True
        self._wake.set()

    def answer(self, daemon: DaemonClient) -> None:
        """Do the requested actions, then fetch for the screen in front."""
        self._act(daemon)
        self._fetch(daemon, self._state)

    def step(self, daemon: DaemonClient) -> None:
        """Do the requested actions, then fetch the state, and for the screen in front."""
        # First the screen that people wait for; it is not fetched a second time afterwards.
        is_answered = self._requested.is_set() and self._state.connected
        if is_answered:
            self._requested.clear()
            self.answer(daemon)
        else:
            self._act(daemon)
        campaigns = listed_campaigns(daemon, self._about())
        self._looked_at = self._clock()
        state = replace(
            self._state,
            connected=True,
            problem="",
            refused=False,
            overview=daemon.overview(),
            campaigns=campaigns,
            searches=search_rows(daemon, campaigns, self._state),
            at=self._clock(),
        )
        if is_answered:
            self._publish(state)
        else:
            self._fetch(daemon, state)

    def _about(self) -> str:
        front = self._front
        return front.about if front is not None else ""

    def _fetch(self, daemon: DaemonClient, state: DashboardState) -> None:
        """Fetch for the screen in front, and publish the answer with the state."""
        front = self._front
        if front is not None:
            with self.watch.looking(daemon):
                self._fetched = (front, front.fetch(daemon, state))
        self._publish(state)

    def _forget(self) -> None:
        """Drop requested actions: nobody expects them once the daemon is back."""
        if _drain(self._actions):
            self._note_problem("no daemon answers, so nothing was done")

    def _act(self, daemon: DaemonClient) -> None:
        """Do the requested actions, and note their outcomes."""
        while self._actions:
            try:
                self._notices.append((self._actions.popleft()(daemon), "information"))
            except DaemonError as error:
                self._note_problem(str(error))

    def _note_problem(self, text: str) -> None:
        self._notices.append((text, "error"))

    def _publish(self, state: DashboardState) -> None:
        """Publish the state, with all conclusions so far."""
        self._assessed = False
        conclusions, results = self._assessor.conclusions, self._assessor.results
        # Without a lock: the state is immutable, and the flag is set after it.
        self._state = replace(state, conclusions=conclusions, results=results)
        self._changed = True
        self.on_news()


def _drain(waiting: deque[T]) -> list[T]:
    # One by one, because an iteration would raise if another thread appends.
    drained = []
    while waiting:
        drained.append(waiting.popleft())
    return drained
