"""The backend that has a Dask cluster execute attempts, and one such attempt as the loop sees it."""

from __future__ import annotations

import hashlib
import math
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, Protocol

from distributed import Future, KilledWorker
from distributed.client import FutureCancelledError

from daemon.batch.run_process import FILES, RESULT, TRACE
from daemon.batch.worker._attempts import Attempt, Waitable
from daemon.batch.worker._signals import WakeupSocket
from daemon.batch.worker.cluster._connection import ClusterConnection
from daemon.batch.worker.cluster._remote import (
    LARGEST_INPUTS,
    LARGEST_TRACE,
    ClusterJob,
    JobProgress,
    JobReport,
    JobStatus,
)
from daemon.model.attachments import attached_digests
from daemon.model.execution import DaskScheduler, RunLimits
from daemon.model.messages import LARGEST_REQUEST
from daemon.model.spec import RunResult
from daemon.model.status import LiveSnapshot
from grammars.text import codec
from grammars.text.files import write_atomically

_LONGEST_REASON: Final = 6000


class ExecutionOwner(Protocol):
    """Who looks after the attempts of the cluster."""

    def submitted(self, key: str, run: RemoteExecution) -> None:
        """The attempt is known to Dask as ``key``."""

    def leave(self, run: RemoteExecution, key: str) -> None:
        """An attempt has ended and been taken in."""

    def suspect(self, run: str) -> bool:
        """Dask gave up on a run since its workers died; returns whether that is nothing new."""

    def ring(self) -> None:
        """Something is to be listened to. Callable from any thread."""


class RemoteExecution:
    """Ends when Dask says so: in Dask's thread for callbacks, or in the agent's when killed."""

    waitables: tuple[Waitable, ...] = ()
    deadline = math.inf
    """The limit on wall clock time is kept where it executes: it may wait for a worker first."""

    def __init__(
        self,
        attempt: Attempt,
        scene: Path,
        job: bytes,
        link: ClusterConnection,
        home: ExecutionOwner,
    ) -> None:
        self.attempt = attempt
        self.live = b""
        self.blame = False
        self.lacks = False
        self.ended = False
        self._scene = scene
        self._job = job
        self._link = link
        self._home = home
        self._words = ""
        self._future: Future | None = None
        self._key = ""
        self._workers: frozenset[str] = frozenset()
        self._gave = False
        self._lock = threading.RLock()

    def submit(self, given: Sequence[bytes] = ()) -> None:
        """Give it to the cluster; raises ``OSError`` when that is not possible now."""
        future, self._workers = self._link.submit(self._job, given)
        self._future = future
        self._key = future.key
        self._home.submitted(future.key, self)
        future.add_done_callback(self._take)

    def submit_or_end(self) -> None:
        """Give it to the cluster, or end when that is not possible now."""
        try:
            self.submit()
        except OSError as error:
            self._end(str(error))

    def listen(self) -> None:
        """Give up when no worker that may execute it is left; all else comes by itself."""
        if self._link.stranded(self._workers):
            self.kill("the Dask workers that could execute it are gone")

    def kill(self, why: str = "") -> None:
        """Give it up; the cluster stops it within a fraction of a second."""
        with self._lock:
            if not self.ended:
                self._end(why)

    def why(self) -> str:
        """Why there is no result."""
        return self._words[-_LONGEST_REASON:]

    def close(self) -> None:
        """Let others go on."""
        self._home.leave(self, self._key)

    def _end(self, words: str = "", *, blame: bool = False) -> None:
        self._words = words
        self.blame = blame
        self.ended = True
        if self._future is not None:
            # Nobody wants it any more: Dask frees what it keeps, or cancels what executes.
            self._future.release()
        self._home.ring()

    def _take(self, future: Future) -> None:
        try:
            answer = future.result()
        except KilledWorker as error:
            with self._lock:
                if not self.ended:
                    self._end(f"{error}", blame=self._home.suspect(self.attempt.grant.run))
        except FutureCancelledError as error:
            self.kill(f"the cluster dropped it: {error.reason}")
        except Exception as error:
            # Dask hands on whatever was raised anywhere on the way: never the run's own doing,
            # which is reported in words.
            self.kill(f"the cluster failed: {error!r}")
        else:
            with self._lock:
                if not self.ended and future is self._future:
                    self._judge(answer)

    def _judge(self, answer: tuple[bytes, bytes, bytes]) -> None:
        report_json, result, trace = answer
        try:
            report = codec.from_json(JobReport, report_json)
            if report.fate is JobStatus.DONE:
                self._keep(result, trace)
                self._end()
            elif report.fate is JobStatus.MISSING and not self._gave:
                self._gave = True
                self.submit(self._gifts(report.missing))
            else:
                self._fail(report)
        except (OSError, ValueError) as error:
            self._end(f"what came from the cluster was not taken: {error}")

    def _gifts(self, missing: Sequence[str]) -> list[bytes]:
        """What the Dask worker lacks; raises ``ValueError`` for more than it may."""
        spec = self.attempt.grant.spec
        files = set(attached_digests(spec.sut.parameters).values())
        paths = {digest: self.attempt.folder / FILES / digest for digest in files}
        paths[spec.scene] = self._scene
        if not paths.keys() >= set(missing):
            raise ValueError("it asked for what the run does not need")
        found = [paths[digest] for digest in missing]
        size = sum(path.stat().st_size for path in found)
        if size > LARGEST_INPUTS:
            raise ValueError(f"scene and files have {size} bytes, more than travel to a cluster")
        return [path.read_bytes() for path in found]

    def _fail(self, report: JobReport) -> None:
        if report.fate is JobStatus.UNFIT:
            self._link.distrust(report.worker, report.words)
        self.lacks = report.lacks
        words = report.words or f"Dask worker {report.worker} ended it: {report.fate}"
        self._end(words, blame=report.blame)

    def _keep(self, result: bytes, trace: bytes) -> None:
        """Put both where a run of this machine would; raises ``ValueError`` for damage."""
        if len(result) > LARGEST_REQUEST or len(trace) > LARGEST_TRACE:
            raise ValueError(f"{len(result)} + {len(trace)} bytes are too many")
        value = codec.from_json(RunResult, result)
        if value.spec != self.attempt.grant.spec.digest:
            raise ValueError("it is the result of another run")
        if hashlib.sha256(trace).hexdigest() != value.trace.sha256:
            raise ValueError("the trace was damaged on its way")
        write_atomically(self.attempt.folder / TRACE, trace)
        write_atomically(self.attempt.folder / RESULT, result)


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
        scheduler: DaskScheduler,
        executor: str,
        *,
        slots: int | None,
        log: Callable[[str], None],
    ) -> None:
        self._bell = WakeupSocket()
        self._executor = executor
        self._wished = slots
        self._link = ClusterConnection(
            scheduler, executor, changed=self._bell.ring, told=self._hear, log=log
        )
        self._runs: dict[str, RemoteExecution] = {}
        self._suspects: dict[str, None] = {}
        self._alone: RemoteExecution | None = None
        self._waiting: deque[RemoteExecution] = deque()
        self.waitables: tuple[Waitable, ...] = (self._bell.ear,)

    def open(self) -> None:
        """Connect; raises :class:`daemon.batch.errors.WorkerBroken` when that is impossible."""
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

    def start(self, attempt: Attempt, scene: Path, limits: RunLimits) -> RemoteExecution:
        """Give an attempt to the cluster; raises ``OSError`` when that is not possible now."""
        job = ClusterJob(self._executor, attempt.grant, limits, self._link.topic)
        run = RemoteExecution(attempt, scene, codec.to_json(job), self._link, self)
        if attempt.grant.run not in self._suspects:
            run.submit()
        elif self._alone is None:
            run.submit()
            self._alone = run
        else:
            self._waiting.append(run)
        return run

    def submitted(self, key: str, run: RemoteExecution) -> None:
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

    def leave(self, run: RemoteExecution, key: str) -> None:
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
            news = codec.from_json(JobProgress, message)
            live = codec.from_json(LiveSnapshot, news.live)
        except ValueError:
            return
        run = self._runs.get(news.key)
        if run is not None and run.attempt.grant.run == live.run:
            run.live = codec.to_json(live)
            self._bell.ring()
