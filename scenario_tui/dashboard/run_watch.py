"""The run that somebody looks at: its telemetry, its details, its trace when it is over."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeAlias

from daemon.batch.errors import DaemonError, Refused
from daemon.model.run_state import RunState
from scenario_tui.dashboard.live_tracks import LiveNews
from scenario_tui.dashboard.recorded_traces import (
    TraceSummary,
    UnavailableTrace,
    can_fetch_trace,
    read_trace_summary,
)

if TYPE_CHECKING:
    from daemon.model.status import LiveSnapshot, RunDetail
    from daemon.model.verbs import ClientOpener, Closeable, DaemonClient
    from grammars.model.scene import Scene

_RecordingKey: TypeAlias = tuple[str, str, str]
"""A run, and the place and the digest of its trace."""

_SCENES_KEPT: Final = 8
"""Who goes through the runs of a campaign comes back to the same few scenes."""


@dataclass(frozen=True, slots=True)
class RunNews:
    """A run with its scene, if that can be had, and what is known of its recording."""

    detail: RunDetail
    scene: Scene | None
    recording: TraceSummary | UnavailableTrace | None


class RunWatch:
    """Asks about one run at a time; telemetry goes to ``lives``, problems to ``on_problem``.

    ``on_fetched`` is called, by another thread, when the trace of a run has been brought here.
    """

    def __init__(
        self,
        open_daemon: ClientOpener,
        lives: deque[LiveNews],
        on_problem: Callable[[str], object],
        on_fetched: Callable[[], object],
    ) -> None:
        self._open = open_daemon
        self._lives = lives
        self._on_problem = on_problem
        self._on_fetched = on_fetched
        self._scenes: dict[str, Scene] = {}
        self._recording: tuple[_RecordingKey, TraceSummary | UnavailableTrace] | None = None
        self._fetching = False
        self._again = False
        self._subscription: Closeable | None = None
        self._looked_at = self._followed = ("", False)
        self._detailed = ""

    @contextmanager
    def looking(self, daemon: DaemonClient) -> Iterator[None]:
        """Follow the run that is looked at meanwhile, if any, and no other afterwards."""
        self._looked_at = ("", False)
        yield
        if self._looked_at != self._followed:
            run, judged = self._looked_at
            self.close()
            if run:
                hear = self._lives.append if judged else None
                self._subscription = daemon.watch(run, self._hear_detail, hear)
                self._followed = (run, judged)

    def look(self, daemon: DaemonClient, run: str, *, judged: bool = False) -> RunNews | None:
        """Return all there is to know about a run, ``None`` if there is none of that name.

        While it runs, details of it are sent; ``judged``: also what it would be judged by now.
        """
        try:
            detail = daemon.run(run)
        except Refused as error:
            self._on_problem(str(error))
            return None
        if detail.row.state is RunState.RUNNING:
            self._looked_at = (run, judged)
        return RunNews(
            detail, self._scene(daemon, detail.spec.scene), self._recorded(daemon, detail)
        )

    def look_again(self) -> None:
        """Try once more to read a trace that could not be read; any thread."""
        self._again = True

    def close(self) -> None:
        """Follow no run."""
        if self._subscription is not None:
            self._subscription.close()
        self._subscription, self._followed, self._detailed = None, ("", False), ""

    def hear(self, live: LiveSnapshot) -> None:
        """Take in a snapshot sent to everybody."""
        # Those of the run that is followed come earlier, and finer, by its own subscription. Two
        # streams of one run would make its clock jump back, which means that it began anew.
        if live.run != self._detailed:
            self._lives.append(live)

    def _hear_detail(self, live: LiveSnapshot) -> None:
        self._detailed = live.run
        self._lives.append(live)

    def _scene(self, daemon: DaemonClient, digest: str) -> Scene | None:
        if digest not in self._scenes:
            try:
                scene = daemon.scene(digest)
            except (Refused, ValueError):
                return None  # without the scene there is no map; everything else is shown
            while len(self._scenes) >= _SCENES_KEPT:
                self._scenes.pop(next(iter(self._scenes)))
            self._scenes[digest] = scene
        return self._scenes[digest]

    def _recorded(
        self, daemon: DaemonClient, detail: RunDetail
    ) -> TraceSummary | UnavailableTrace | None:
        """Return what the trace of a run says that is over, or why it says nothing."""
        if not detail.row.settled:
            return None
        # With the digest: a run that is executed again leaves another trace at the same path.
        digest = detail.row.result.trace.sha256 if detail.row.result is not None else ""
        key = (detail.row.id, detail.row.trace, digest)
        if self._recording is None or self._recording[0] != key or self._may_succeed_now():
            self._again = False
            if can_fetch_trace(detail, daemon):
                size = 0.0 if detail.row.result is None else detail.row.result.trace.size / 1e6
                seen = UnavailableTrace(detail.row.id, f"Bringing its trace here, {size:.1f} MB …")
                self._recording, self._fetching = (key, seen), True
                # A thread for each: a large trace over a slow line must not keep the next one, of
                # the run the cursor has moved on to, waiting.
                threading.Thread(target=self._fetch, args=(key, detail), daemon=True).start()
            else:
                self._recording, self._fetching = (key, read_trace_summary(detail)), False
        return self._recording[1]

    def _may_succeed_now(self) -> bool:
        """Whether somebody looks again at a trace that could not be read."""
        assert self._recording is not None
        failed = isinstance(self._recording[1], UnavailableTrace) and not self._fetching
        return self._again and failed

    def _fetch(self, key: _RecordingKey, detail: RunDetail) -> None:
        """Bring a trace here beside everything else that is asked."""
        seen: TraceSummary | UnavailableTrace
        try:
            with self._open() as daemon:
                seen = read_trace_summary(detail, daemon)
        except DaemonError as error:
            seen = UnavailableTrace(detail.row.id, f"Its trace cannot be brought here: {error}")
        # Another run may be shown by now; the trace lies in the cache for when this one is again.
        if self._recording is not None and self._recording[0] == key:
            self._recording, self._fetching = (key, seen), False
            self._on_fetched()
