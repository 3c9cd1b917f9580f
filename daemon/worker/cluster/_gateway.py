"""The backend that has a Dask cluster execute attempts."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Final

from daemon.executor import Limits, Scheduler
from daemon.protocol import Live
from daemon.worker._backend import Waitable
from daemon.worker._bell import Bell
from daemon.worker._spool import Attempt
from daemon.worker.cluster._job import Job, News
from daemon.worker.cluster._link import Link
from daemon.worker.cluster._run import RemoteRun
from grammars import codec

_MOST_SLOTS: Final = 1024
_MOST_SUSPECTS: Final = 4096


class Gateway:
    """Gives attempts to a cluster: as many as it has threads, or ``slots``.

    Dask cannot say whose fault it is that a worker of its died. So a run that was there each time
    Dask gave up is a suspect: not blamed the first time, and from then on executed only when no
    other suspect is. Who is innocent finishes then; who is not is blamed.
    """

    def __init__(
        self,
        scheduler: Scheduler,
        executor: str,
        *,
        slots: int | None,
        log: Callable[[str], None],
    ) -> None:
        self._bell = Bell()
        self._executor = executor
        self._wished = slots
        self._link = Link(scheduler, executor, changed=self._bell.ring, told=self._hear, log=log)
        self._runs: dict[str, RemoteRun] = {}
        self._suspects: dict[str, None] = {}
        self._alone: RemoteRun | None = None
        self._waiting: deque[RemoteRun] = deque()
        self.waitables: tuple[Waitable, ...] = (self._bell.ear,)

    def open(self) -> None:
        """Connect; raises :class:`daemon.errors.WorkerBroken` when that is impossible."""
        self._link.open()

    def close(self) -> None:
        """Leave the cluster; what it still executes for us is stopped there."""
        self._link.close()
        self._bell.close()

    @property
    def slots(self) -> int:
        """How many attempts the cluster takes at a time, right now."""
        if not self._link.connected or self._link.useless:
            return 0
        wished = self._link.threads if self._wished is None else self._wished
        return min(wished, _MOST_SLOTS)

    def listen(self) -> None:
        """Let the bell ring again."""
        self._bell.take()

    def start(self, attempt: Attempt, scene: Path, limits: Limits) -> RemoteRun:
        """Give an attempt to the cluster; raises ``OSError`` when that is not possible now."""
        job = Job(self._executor, attempt.grant, limits, self._link.topic)
        run = RemoteRun(attempt, scene, codec.to_json(job), self._link, self)
        if attempt.grant.run not in self._suspects:
            run.submit()
        elif self._alone is None:
            run.submit()
            self._alone = run
        else:
            self._waiting.append(run)
        return run

    def submitted(self, key: str, run: RemoteRun) -> None:
        """The attempt is known to Dask as ``key``."""
        self._runs[key] = run

    def ring(self) -> None:
        """Something is to be listened to. Callable from any thread."""
        self._bell.ring()

    def suspect(self, run: str) -> bool:
        """Dask gave up on a run since its workers died; returns whether that is nothing new."""
        known = run in self._suspects
        self._suspects[run] = None
        while len(self._suspects) > _MOST_SUSPECTS:
            del self._suspects[next(iter(self._suspects))]
        return known

    def leave(self, run: RemoteRun, key: str) -> None:
        """An attempt has ended and been taken in."""
        self._runs.pop(key, None)
        if run.attempt.finished:
            self._suspects.pop(run.attempt.grant.run, None)
        if run in self._waiting:
            self._waiting.remove(run)
        if run is self._alone:
            self._alone = self._waiting.popleft() if self._waiting else None
            if self._alone is not None:
                self._alone.submit_or_end()

    def _hear(self, message: object) -> None:
        """Anybody in the cluster may publish anything: what is not news is ignored."""
        if not isinstance(message, str):
            return
        try:
            news = codec.from_json(News, message)
            live = codec.from_json(Live, news.live)
        except ValueError:
            return
        run = self._runs.get(news.key)
        if run is not None and run.attempt.grant.run == live.run:
            run.live = codec.to_json(live)
            self._bell.ring()
