"""The backend that has a Dask cluster execute attempts, and one such attempt for the loop."""

from __future__ import annotations

import base64
import hashlib
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from distributed import Future, KilledWorker
from distributed.client import FutureCancelledError

from daemon.batch.run_process import FILES, RESULT, TRACE, Wanted
from daemon.batch.worker._attempts import Attempt, AttemptEnd, Waitable
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
from daemon.model.execution import DaskScheduler, RunLimits
from daemon.model.live_checks import read_snapshot
from daemon.model.live_judgement import LiveJudgement, pack_judgement, unpack_judgement
from daemon.model.messages import LARGEST_REQUEST
from daemon.model.spec import RunResult, SutReference
from daemon.model.status import LiveSnapshot
from grammars.text import codec
from grammars.text.files import write_atomically
from grammars.text.terminal_text import printable

_LONGEST_REASON: Final = 6000
_LONGEST_WORDS: Final = 200
_TELL_AGAIN: Final = 2.0
"""Seconds until what is wanted of a run is told to it again, as long as it does not know that."""


class RemoteExecution:
    """Ends when Dask says so: in Dask's thread for callbacks, or in the worker's when killed."""

    waitables: tuple[Waitable, ...] = ()
    deadline = math.inf
    """The limit on wall clock time is kept where it executes: it may wait for a worker first."""

    def __init__(
        self,
        attempt: Attempt,
        scene: Path,
        job: bytes,
        cluster: ClusterConnection,
        gateway: Gateway,
    ) -> None:
        self.attempt = attempt
        self.live = b""
        self.judged = b""
        self.where = ""
        """The Dask worker that it last told of itself from."""
        self.end: AttemptEnd | None = None
        self._scene = scene
        self._job = job
        self._cluster = cluster
        self._gateway = gateway
        self._future: Future | None = None
        self._key = ""
        self._workers: frozenset[str] = frozenset()
        self._inputs_sent = False
        self._wanted: frozenset[Wanted] = frozenset()
        self._told_at = -math.inf
        self._lock = threading.RLock()

    def submit(self, given: Sequence[bytes] = ()) -> None:
        """Give it to the cluster; raises ``OSError`` when that is not possible now."""
        future, self._workers = self._cluster.submit(self._job, given)
        self._future = future
        self._key = future.key
        self._gateway.submitted(future.key, self)
        future.add_done_callback(self._take)

    def submit_or_end(self) -> None:
        """Give it to the cluster, or end when that is not possible now."""
        try:
            self.submit()
        except OSError as error:
            self._finish(str(error))

    def listen(self) -> None:
        """Give up when no worker that may execute it is left; all else comes by itself."""
        if self._cluster.has_no_worker(self._workers):
            self.kill("the Dask workers that could execute it are gone")

    def watch(self, wanted: frozenset[Wanted]) -> None:
        """Have the Dask worker leave word for it."""
        # What is published was told before, so it is known where it executes.
        self._wanted = wanted
        self._tell_wanted()

    def _tell_wanted(self) -> None:
        self._told_at = time.monotonic()
        self._cluster.watch(self.where, self._key, sorted(self._wanted))

    def take_progress(
        self, live: LiveSnapshot, judged: LiveJudgement | None, progress: JobProgress
    ) -> None:
        """Take in what it tells of itself, and tell it again what it does not know to be wanted."""
        self.live, self.where = codec.to_json(live), progress.worker
        if judged is not None and judged.run == live.run:
            self.judged = pack_judgement(judged)
        # Dask may have begun it anew, on another worker, and what is told to a worker may be lost.
        unknown = frozenset(progress.wanted) != self._wanted
        if unknown and time.monotonic() - self._told_at > _TELL_AGAIN:
            self._tell_wanted()

    def kill(self, why: str = "") -> None:
        """Give it up; the cluster stops it within a fraction of a second."""
        with self._lock:
            if self.end is None:
                self._finish(why)

    def close(self) -> None:
        """Let others go on."""
        self._gateway.forget(self, self._key)

    def _finish(self, why: str = "", *, counts: bool = False, sut_missing: bool = False) -> None:
        self.end = AttemptEnd(why[-_LONGEST_REASON:], counts, sut_missing)
        if self._future is not None:
            # Nobody wants it any more: Dask frees what it keeps, or cancels what executes.
            self._future.release()
        self._gateway.wake()

    def _take(self, future: Future) -> None:
        try:
            answer = future.result()
        except KilledWorker as error:
            with self._lock:
                if self.end is None:
                    again = self._gateway.mark_suspect(self.attempt.lease.run)
                    self._finish(str(error), counts=again)
        except FutureCancelledError as error:
            self.kill(f"the cluster dropped it: {error.reason}")
        except Exception as error:
            # Dask hands on whatever was raised anywhere on the way: never the run's own doing,
            # which is reported in words.
            self.kill(f"the cluster failed: {error!r}")
        else:
            with self._lock:
                # Not the answer that asked for scene and files, when they are on their way.
                if self.end is None and future is self._future:
                    self._take_answer(answer)

    def _take_answer(self, answer: tuple[bytes, bytes, bytes]) -> None:
        try:
            report_json, result, trace = answer
            report = codec.from_json(JobReport, report_json)
            if report.status is JobStatus.DONE:
                self._write_output(result, trace)
                self._finish()
            elif report.status is JobStatus.MISSING and not self._inputs_sent:
                self._inputs_sent = True
                self.submit(self._read_inputs(report.missing))
            else:
                self._fail(report)
        except Exception as error:
            # Whatever it is: Dask's thread has nobody to raise it to, and the attempt would never
            # end. Beside a full disk that is an answer of another form.
            self._finish(f"what came from the cluster was not taken: {error}")

    def _read_inputs(self, missing: Sequence[str]) -> list[bytes]:
        """What the Dask worker lacks; raises ``ValueError`` for more than it may."""
        spec = self.attempt.lease.spec
        files = set(spec.files)
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
        if report.status is JobStatus.UNFIT:
            self._cluster.exclude(report.worker, report.end.why)
        why = report.end.why or f"Dask worker {report.worker} ended it: {report.status}"
        self._finish(why, counts=report.end.counts, sut_missing=report.end.sut_missing)

    def _write_output(self, result: bytes, trace: bytes) -> None:
        """Put both where a run of this machine would; raises ``ValueError`` for damage."""
        if len(result) > LARGEST_REQUEST or len(trace) > LARGEST_TRACE:
            raise ValueError(f"{len(result)} + {len(trace)} bytes are too many")
        value = codec.from_json(RunResult, result)
        if value.spec != self.attempt.lease.spec.digest:
            raise ValueError("it is the result of another run")
        if hashlib.sha256(trace).hexdigest() != value.trace.sha256:
            raise ValueError("the trace was damaged on its way")
        # Before Dask may forget them: from here on the spool has both, whatever dies.
        write_atomically(self.attempt.folder / TRACE, trace)
        write_atomically(self.attempt.folder / RESULT, result)


_MOST_SLOTS: Final = 1024
"""Most attempts leased at a time: each is a folder and is renewed every few seconds."""
_PATIENCE: Final = 30.0
"""Seconds without a slot after which it is said: a scheduler that is started again needs some."""
_MOST_SUSPECTS: Final = 4096
"""So many are remembered; who was forgotten is suspected anew before it is blamed."""


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
        patience: float = _PATIENCE,
    ) -> None:
        self._log = log
        self._patience = patience
        self._slots_seen_at = time.monotonic()
        self._wakeup = WakeupSocket()
        self._executor = executor
        self._wished = slots
        self._cluster = ClusterConnection(
            scheduler, executor, changed=self.wake, on_event=self._on_progress, log=log
        )
        self._runs: dict[str, RemoteExecution] = {}
        self._suspects: dict[str, None] = {}
        self._alone: RemoteExecution | None = None
        self._waiting: deque[RemoteExecution] = deque()
        self.trouble = ""
        """Why the cluster has executed nothing for ``patience`` [s] now; empty otherwise."""
        self.waitables: tuple[Waitable, ...] = (self._wakeup.receiver,)
        self._preparing: dict[str, str] = {}

    def open(self) -> None:
        """Connect; raises :class:`daemon.batch.errors.WorkerBroken` when that is impossible."""
        self._cluster.open()

    def close(self) -> None:
        """Leave the cluster; what it still executes for us is stopped there."""
        self._cluster.close()
        self._wakeup.close()

    @property
    def slots(self) -> int:
        """How many attempts the cluster takes at a time, right now."""
        if not self._cluster.connected or self._cluster.has_only_unfit:
            return 0
        wished = self._cluster.threads if self._wished is None else self._wished
        return min(wished, _MOST_SLOTS)

    @property
    def preparing(self) -> str:
        """What a process of the cluster does before the first run it was given can start."""
        return next((f"cluster: {words}" for words in tuple(self._preparing.values())), "")

    def listen(self) -> None:
        """Take the wake-ups: executions say themselves what is new. Notice what lasts."""
        self._wakeup.take_wakeups()
        self._look_for_slots()

    def _look_for_slots(self) -> None:
        now = time.monotonic()
        if self.slots:
            self._slots_seen_at = now
            if self.trouble:
                self._log("the cluster executes runs again")
            self.trouble = ""
        elif now - self._slots_seen_at >= self._patience:
            words = self._cluster.shortage
            if words != self.trouble:
                self._log(f"no slots: {words}")
            self.trouble = words

    def prepare(self, sut: SutReference, limits: RunLimits) -> bool:
        """Every run can start: what it needs, the process beside the Dask worker sees to."""
        return True

    def start(self, attempt: Attempt, scene: Path, limits: RunLimits) -> RemoteExecution:
        """Give an attempt to the cluster; raises ``OSError`` when that is not possible now."""
        job = ClusterJob(self._executor, attempt.lease, limits, self._cluster.topic)
        run = RemoteExecution(attempt, scene, codec.to_json(job), self._cluster, self)
        # Dask kills a task's neighbours with their worker: two suspects at a time would let an
        # innocent one die of the other again, and be blamed.
        if attempt.lease.run not in self._suspects:
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

    def wake(self) -> None:
        """Something is to be listened to. Callable from any thread."""
        self._wakeup.wake()

    def mark_suspect(self, run: str) -> bool:
        """Dask gave up on a run since its workers died; returns whether that is nothing new."""
        # Dask says which task it gave up, not which of those on the dead workers was at fault.
        known = run in self._suspects
        self._suspects[run] = None
        while len(self._suspects) > _MOST_SUSPECTS:
            del self._suspects[next(iter(self._suspects))]
        return known

    def forget(self, run: RemoteExecution, key: str) -> None:
        """An attempt has ended and been taken in."""
        self._runs.pop(key, None)
        self._preparing.pop(key, None)
        if run.attempt.finished:
            self._suspects.pop(run.attempt.lease.run, None)
        if run in self._waiting:
            self._waiting.remove(run)
        if run is self._alone:
            self._alone = self._waiting.popleft() if self._waiting else None
            if self._alone is not None:
                self._alone.submit_or_end()

    def _on_progress(self, message: object) -> None:
        """Take in what a run says; anybody in the cluster may publish anything else."""
        if not isinstance(message, str):
            return
        try:
            progress = codec.from_json(JobProgress, message)
            run = self._runs.get(progress.key)
            if progress.preparing and run is not None:
                self._preparing[progress.key] = printable(progress.preparing)[:_LONGEST_WORDS]
                self.wake()
                return
            live = read_snapshot(progress.live)
        except ValueError:
            return
        self._preparing.pop(progress.key, None)
        if run is None or run.attempt.lease.run != live.run:
            return
        run.take_progress(live, _judgement(progress.judged), progress)
        self.wake()


def _judgement(text: str) -> LiveJudgement | None:
    """Read a judgement in base64; ``None`` for what is none."""
    try:
        return unpack_judgement(base64.b64decode(text, validate=True)) if text else None
    except ValueError:  # the snapshot beside it may be as good as ever
        return None
