"""The run in front: its details, and its telemetry while it runs."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from daemon.batch.errors import Refused
from daemon.model.verdicts import RunState
from scenario_tui.dashboard.live_tracks import LiveNews

if TYPE_CHECKING:
    from daemon.model.status import LiveSnapshot, RunDetail
    from daemon.model.verbs import Closeable, DaemonClient
    from grammars.model.scene import Scene

_SCENES_KEPT: Final = 8
"""Most scenes to keep: the runs of a campaign share a few."""


@dataclass(frozen=True, slots=True)
class RunNews:
    """A run with its scene, if available."""

    detail: RunDetail
    scene: Scene | None


class RunWatch:
    """Follows one run at a time; telemetry goes to ``lives``, problems to ``on_problem``."""

    def __init__(self, lives: deque[LiveNews], on_problem: Callable[[str], object]) -> None:
        self._lives = lives
        self._on_problem = on_problem
        self._scenes: dict[str, Scene] = {}
        self._subscription: Closeable | None = None
        self._looked_at = self._followed = ("", False)
        self._detailed = ""

    @contextmanager
    def looking(self, daemon: DaemonClient) -> Iterator[None]:
        """Follow the run of :meth:`look` in this block, if any, and no other afterwards."""
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
        """Return a run with its scene, ``None`` if it does not exist.

        While it runs, its details arrive as telemetry; with ``judged`` also its judgement so far.
        """
        try:
            detail = daemon.run(run)
        except Refused as error:
            self._on_problem(str(error))
            return None
        if detail.row.state is RunState.RUNNING:
            self._looked_at = (run, judged)
        return RunNews(detail, self._scene(daemon, detail.spec.scene))

    def close(self) -> None:
        """Follow no run."""
        if self._subscription is not None:
            self._subscription.close()
        self._subscription, self._followed, self._detailed = None, ("", False), ""

    def hear(self, live: LiveSnapshot) -> None:
        """Take in a snapshot from the stream for all clients."""
        # The run that is followed has its own, finer stream. Two streams of one run would make its
        # clock jump back, which means a new attempt.
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
                return None  # without the scene there is no map, but everything else
            while len(self._scenes) >= _SCENES_KEPT:
                self._scenes.pop(next(iter(self._scenes)))
            self._scenes[digest] = scene
        return self._scenes[digest]
