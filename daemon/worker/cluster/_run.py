"""One attempt in the cluster, as the agent sees it."""

from __future__ import annotations

import hashlib
import math
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from distributed import Future, KilledWorker
from distributed.client import FutureCancelledError

from daemon.attachments import attached
from daemon.child import FILES, RESULT, TRACE
from daemon.messages import LARGEST_REQUEST
from daemon.places import write_atomically
from daemon.spec import RunResult
from daemon.worker._backend import Waitable
from daemon.worker._spool import Attempt
from daemon.worker.cluster._job import LARGEST_GIFT, LARGEST_TRACE, Fate, Report
from grammars import codec

if TYPE_CHECKING:
    from daemon.worker.cluster._link import Link

_LAST_WORDS: Final = 6000


class Home(Protocol):
    """Who looks after the attempts of the cluster."""

    def submitted(self, key: str, run: RemoteRun) -> None:
        """The attempt is known to Dask as ``key``."""

    def leave(self, run: RemoteRun, key: str) -> None:
        """An attempt has ended and been taken in."""

    def suspect(self, run: str) -> bool:
        """Dask gave up on a run since its workers died; returns whether that is nothing new."""

    def ring(self) -> None:
        """Something is to be listened to. Callable from any thread."""


class RemoteRun:
    """Ends when Dask says so: in Dask's thread for callbacks, or in the agent's when killed."""

    waitables: tuple[Waitable, ...] = ()
    deadline = math.inf
    """The limit on wall clock time is kept where it executes: it may wait for a worker first."""

    def __init__(self, attempt: Attempt, scene: Path, job: bytes, link: Link, home: Home) -> None:
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
        return self._words[-_LAST_WORDS:]

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
            report = codec.from_json(Report, report_json)
            if report.fate is Fate.DONE:
                self._keep(result, trace)
                self._end()
            elif report.fate is Fate.MISSING and not self._gave:
                self._gave = True
                self.submit(self._gifts(report.missing))
            else:
                self._fail(report)
        except (OSError, ValueError) as error:
            self._end(f"what came from the cluster was not taken: {error}")

    def _gifts(self, missing: Sequence[str]) -> list[bytes]:
        """What the Dask worker lacks; raises ``ValueError`` for more than it may."""
        spec = self.attempt.grant.spec
        files = set(attached(spec.sut.parameters).values())
        paths = {digest: self.attempt.folder / FILES / digest for digest in files}
        paths[spec.scene] = self._scene
        if not paths.keys() >= set(missing):
            raise ValueError("it asked for what the run does not need")
        found = [paths[digest] for digest in missing]
        size = sum(path.stat().st_size for path in found)
        if size > LARGEST_GIFT:
            raise ValueError(f"scene and files have {size} bytes, more than travel to a cluster")
        return [path.read_bytes() for path in found]

    def _fail(self, report: Report) -> None:
        if report.fate is Fate.UNFIT:
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
