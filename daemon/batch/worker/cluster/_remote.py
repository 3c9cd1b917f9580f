"""The cluster's side: jobs, what became of them, and the launcher beside each Dask worker.

The functions here are what Dask executes: imported there by name from the installed package.
"""

from __future__ import annotations

import hashlib
import shutil
import socket
import subprocess
import threading
import time
import uuid
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

from distributed import get_worker
from distributed.core import Status

from daemon.batch.errors import WorkerBroken
from daemon.batch.paths import StatePaths
from daemon.batch.run_process import RESULT, TRACE, Wanted
from daemon.batch.worker._attempts import Attempt, AttemptEnd
from daemon.batch.worker._launcher import READY, LaunchReport, LaunchRequest
from daemon.model.execution import RunLimits, python_command
from daemon.model.messages import Lease
from daemon.model.spec import LARGEST_RESULT, RunSpec, own_version
from grammars.text import codec
from grammars.text.files import write_atomically

LARGEST_TRACE: Final = 256 * 2**20
"""Bytes of a trace that travel as the result of a Dask task, through the memory of three
processes."""
LARGEST_INPUTS: Final = 256 * 2**20
"""Bytes of scene and files that travel with one task."""


@dataclass(frozen=True, slots=True)
class ClusterJob:
    """One attempt; what it tells meanwhile is published under ``topic``."""

    executor: str
    grant: Lease
    limits: RunLimits
    topic: str


class JobStatus(StrEnum):
    """What became of a job.

    ``done``: result and trace are here. ``failed``: it left none. ``missing``: ask again
    and give it what the report names. ``unfit``: this Dask worker executes no runs.
    ``stopped``: nobody wanted it.
    """

    DONE = "done"
    FAILED = "failed"
    MISSING = "missing"
    UNFIT = "unfit"
    STOPPED = "stopped"


_NOTHING_SAID: Final = AttemptEnd()


@dataclass(frozen=True, slots=True)
class JobReport:
    """What became of a job on Dask worker ``worker``; ``missing`` are digests of what it needs."""

    status: JobStatus
    worker: str
    end: AttemptEnd = _NOTHING_SAID
    missing: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class JobProgress:
    """What a job under way says: a :class:`daemon.model.status.LiveSnapshot` in JSON, or what is
    prepared before it can start.

    ``judged`` is a :class:`daemon.model.live_judgement.LiveJudgement`, packed and in base64, or
    nothing; ``worker`` the Dask worker; ``wanted`` what it was told that those who watch want.
    """

    key: str
    live: str = ""
    judged: str = ""
    worker: str = ""
    preparing: str = ""
    wanted: tuple[str, ...] = ()


_WARM_UP_LIMIT: Final = 330.0
"""Seconds: longer than the fork server of the launcher may take, which has a reason to give."""
_TICK: Final = 0.2
"""Seconds between two looks whether anybody still wants a run; one that nobody does is stopped."""


@dataclass(frozen=True, slots=True)
class AttemptOutput:
    """What an attempt left; without a result, why."""

    end: AttemptEnd
    result: bytes = b""
    trace: bytes = b""


_LAUNCHER_ENDED: Final = AttemptEnd("the process that starts runs ended")


class RemoteLauncher:
    """One launcher with its folder; any thread may have it run an attempt."""

    def __init__(self, executor: str, directory: str) -> None:
        # A program of its own: a Dask worker has threads and event loops, so nothing may be forked
        # from it, and what runs need takes seconds to import.
        ours, theirs = socket.socketpair()
        with theirs:
            command = python_command("-m", "daemon.batch.worker._launcher")
            command += [str(theirs.fileno()), executor, directory]
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, pass_fds=(theirs.fileno(),)
            )
        self._wire = Connection(ours.detach())
        self._paths = StatePaths(Path(self._read_greeting()))
        self._paths.make_folders()
        self._sending = threading.Lock()
        self._inboxes: dict[str, SimpleQueue[LaunchReport]] = {}
        self._names: dict[str, str] = {}
        self._wanted: dict[str, tuple[Wanted, ...]] = {}
        self.ended = False
        threading.Thread(target=self._read, name="launcher", daemon=True).start()

    def _read_greeting(self) -> str:
        hello = b""
        with suppress(EOFError, OSError):  # it died: there are no words
            hello = self._wire.recv_bytes() if self._wire.poll(_WARM_UP_LIMIT) else b""
        words = hello[1:].decode("utf-8", "replace")
        if hello[:1] != READY:
            self._wire.close()
            self._process.kill()
            self._process.wait()
            raise WorkerBroken(words or "the process that starts runs did not answer")
        return words

    def _read(self) -> None:
        # It ended, or says what nobody understands: whoever waits is told below.
        with suppress(EOFError, OSError, ValueError):
            while True:
                report = codec.from_json(LaunchReport, self._wire.recv_bytes())
                inbox = self._inboxes.get(report.key)
                if inbox is not None:
                    inbox.put(report)
        self.ended = True
        for key, inbox in tuple(self._inboxes.items()):
            inbox.put(LaunchReport(key, end=_LAUNCHER_ENDED))
        self._process.terminate()  # what it runs is nobody's any more
        self._process.wait()

    def missing(self, spec: RunSpec) -> tuple[str, ...]:
        """The digests of what that run needs and is not kept here: scene, files of its SUT.

        Raises ``ValueError`` for what is no digest.
        """
        return tuple(digest for digest, path in self._needed(spec).items() if not path.exists())

    def keep(self, spec: RunSpec, given: Iterable[bytes]) -> None:
        """Keep what that run needs; raises ``ValueError`` for anything else."""
        needed = self._needed(spec)
        for data in given:
            path = needed.get(hashlib.sha256(data).hexdigest())
            if path is None:
                raise ValueError("something was damaged on its way to the cluster")
            write_atomically(path, data, durable=False)

    def _needed(self, spec: RunSpec) -> dict[str, Path]:
        paths = {spec.scene: self._paths.scene(spec.scene)}
        for digest in spec.files:
            paths[digest] = self._paths.files / digest
        return paths

    def run(
        self,
        lease: Lease,
        limits: RunLimits,
        wanted: Callable[[], bool],
        tell: Callable[[LaunchReport], None],
        name: str,
    ) -> AttemptOutput:
        """Run an attempt to its end, or stop it as soon as it is not ``wanted`` any more.

        ``tell`` is given what it tells about itself; :meth:`watch` knows it by ``name``. Raises
        ``OSError`` when there is no room.
        """
        key = self._names[name] = uuid.uuid4().hex
        self._wanted[key] = ()
        folder = self._paths.spool / key / f"attempt-{lease.attempt}"
        inbox = self._inboxes[key] = SimpleQueue()
        try:
            attempt = Attempt.prepare(folder, lease)
            if lease.spec.files:
                attempt.link_files(self._paths.files)
            scene = self._paths.scene(lease.spec.scene)
            self._send(LaunchRequest(key, str(folder), str(scene), limits))
            return _read_output(self._await(key, inbox, wanted, tell), attempt)
        finally:
            del self._inboxes[key]
            # One that Dask began anew here meanwhile goes by the same name.
            if self._names.get(name) == key:
                del self._names[name]
            del self._wanted[key]
            shutil.rmtree(folder.parent, ignore_errors=True)

    def watch(self, name: str, wanted: tuple[Wanted, ...]) -> None:
        """Tell an attempt what those who watch it want, unless it is over."""
        key = self._names.get(name)
        if key is not None:
            self._wanted[key] = wanted
            self._send(LaunchRequest(key, wanted=wanted))

    def wanted(self, name: str) -> tuple[Wanted, ...]:
        """Return what an attempt was told to be wanted."""
        return self._wanted.get(self._names.get(name, ""), ())

    def _await(
        self,
        key: str,
        inbox: SimpleQueue[LaunchReport],
        wanted: Callable[[], bool],
        tell: Callable[[LaunchReport], None],
    ) -> AttemptEnd:
        looked_at = time.monotonic()
        while True:
            # A run that is watched tells of itself more often than every tick, so a tick is not the
            # time without a report.
            if time.monotonic() - looked_at >= _TICK:
                looked_at = time.monotonic()
                if not wanted():
                    with suppress(OSError):  # the launcher has just ended: its reader says so
                        self._send(LaunchRequest(key))
            try:
                report = inbox.get(timeout=_TICK)
            except Empty:
                # It may have ended before this inbox was there for its reader to find.
                if self.ended:
                    return _LAUNCHER_ENDED
                continue
            if report.end is not None:
                return report.end
            tell(report)

    def _send(self, request: LaunchRequest) -> None:
        with self._sending:
            self._wire.send_bytes(codec.to_json(request))


def _read_output(end: AttemptEnd, attempt: Attempt) -> AttemptOutput:
    if not attempt.finished:
        return AttemptOutput(end)
    result, trace = attempt.folder / RESULT, attempt.folder / TRACE
    for path, limit in ((result, LARGEST_RESULT), (trace, LARGEST_TRACE)):
        size = path.stat().st_size
        if size > limit:
            words = f"its {path.name} has {size} bytes; at most {limit} travel from a cluster"
            return AttemptOutput(AttemptEnd(words, counts=True))
    return AttemptOutput(end, result.read_bytes(), trace.read_bytes())


_launchers: dict[str, RemoteLauncher] = {}
_starting: Final = threading.Lock()


def remote_launcher(executor: str, directory: str) -> RemoteLauncher:
    """The launcher of this process for ``executor``, a new one when it has ended.

    Raises :class:`WorkerBroken` when runs cannot be executed here.
    """
    with _starting:
        found = _launchers.get(executor)
        if found is None or found.ended:
            found = _launchers[executor] = RemoteLauncher(executor, directory)
        return found


_LIVE_PERIOD: Final = 1.0
"""Seconds between two snapshots of a run: all of them pass through the one scheduler."""
_CLOSING: Final = (Status.closing, Status.closed, Status.failed)


# Reports travel as JSON of ours, not as objects: Dask would pickle those, and whoever unpickles
# runs what another version, or anybody in the cluster, has put there.
def start_launcher(executor: str) -> bytes:
    """Be warm here, or say what is wrong: a :class:`JobReport` of ``done`` or ``unfit`` in JSON."""
    worker = get_worker()
    words = ""
    try:
        remote_launcher(executor, worker.local_directory)
    except (WorkerBroken, OSError) as error:
        words = f"Dask worker {worker.address}: {error}"
    status = JobStatus.UNFIT if words else JobStatus.DONE
    return codec.to_json(JobReport(status, worker.address, AttemptEnd(words)))


def execute_job(version: str, job: bytes, *given: bytes) -> tuple[bytes, bytes, bytes]:
    """Execute a :class:`ClusterJob` of that version.

    Returns a :class:`JobReport`, the result (both in JSON) and the trace. Scene and files not
    ``given`` are those this Dask worker has kept, or the report asks for them.
    """
    worker = get_worker()
    result, trace = b"", b""
    try:
        # Compared before the job is read: what it is written in may have changed.
        if version != own_version():
            raise WorkerBroken(f"{worker.address} has {own_version()}")
        report, result, trace = _execute_here(worker, codec.from_json(ClusterJob, job), given)
    except WorkerBroken as error:
        report = JobReport(JobStatus.UNFIT, worker.address, AttemptEnd(str(error)))
    except (OSError, ValueError) as error:
        report = JobReport(JobStatus.FAILED, worker.address, AttemptEnd(str(error)))
    return codec.to_json(report), result, trace


def _execute_here(
    worker: Any, job: ClusterJob, given: tuple[bytes, ...]
) -> tuple[JobReport, bytes, bytes]:
    where = worker.address
    launcher = remote_launcher(job.executor, worker.local_directory)
    launcher.keep(job.grant.spec, given)
    missing = launcher.missing(job.grant.spec)
    if missing:
        return JobReport(JobStatus.MISSING, where, missing=missing), b"", b""
    key = worker.get_current_task()
    output = launcher.run(
        job.grant,
        job.limits,
        lambda: _is_wanted(worker, key),
        _progress_publisher(worker, job.topic, key, partial(launcher.wanted, key)),
        key,
    )
    if output.result:
        return JobReport(JobStatus.DONE, where), output.result, output.trace
    status = JobStatus.FAILED if _is_wanted(worker, key) else JobStatus.STOPPED
    return JobReport(status, where, output.end), b"", b""


def _is_wanted(worker: Any, key: str) -> bool:
    """Whether the scheduler still wants this task.

    A task whose future was cancelled, whose gateway died, or whose scheduler went, goes on
    executing in state ``cancelled``: a thread cannot be stopped, only its process.
    """
    if worker.status in _CLOSING:
        return False
    # By the worker's own table of tasks (distributed 2026.8).
    task = worker.state.tasks.get(key)
    return task is not None and task.state in ("executing", "long-running")


def _progress_publisher(
    worker: Any, topic: str, key: str, wanted: Callable[[], tuple[Wanted, ...]]
) -> Callable[[LaunchReport], None]:
    following = 0.0
    judged = ""

    def tell(report: LaunchReport) -> None:
        nonlocal following, judged
        now, judged = time.monotonic(), report.judged or judged
        if (report.live or report.preparing) and now >= following:
            following = now + _LIVE_PERIOD
            words = report.preparing
            progress = JobProgress(key, report.live, judged, worker.address, words, wanted())
            judged = ""
            worker.log_event(topic, codec.to_json(progress).decode())

    return tell


def watch_job(executor: str, key: str, wanted: tuple[str, ...]) -> None:
    """Tell the job that this Dask worker knows as ``key`` what those who watch it want."""
    launcher = _launchers.get(executor)
    if launcher is not None and not launcher.ended:
        launcher.watch(key, tuple(Wanted(word) for word in wanted))
