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
from dataclasses import dataclass, replace
from enum import StrEnum
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

from distributed import get_worker
from distributed.core import Status

from daemon.batch.errors import WorkerBroken
from daemon.batch.paths import StatePaths
from daemon.batch.run_process import FILES, GRANT, RESULT, TRACE
from daemon.batch.worker._launcher import READY, LaunchReport, LaunchRequest
from daemon.model.attachments import attached_digests
from daemon.model.execution import RunLimits, python_command
from daemon.model.messages import LARGEST_REQUEST, Lease
from daemon.model.spec import RunSpec
from daemon.model.versions import own_version
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


@dataclass(frozen=True, slots=True)
class JobReport:
    """The end of a job on Dask worker ``worker``; ``blame`` is the run's for having failed.

    It ``lacks`` the system under test, or things ``missing``, by digest.
    """

    fate: JobStatus
    worker: str
    words: str = ""
    blame: bool = False
    lacks: bool = False
    missing: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class JobProgress:
    """What a job under way tells: a :class:`daemon.model.status.LiveSnapshot` in JSON."""

    key: str
    live: str


_WARM_UP_LIMIT: Final = 330.0
_TICK: Final = 0.2


@dataclass(frozen=True, slots=True)
class AttemptOutput:
    """What an attempt left; without a result, why."""

    told: LaunchReport
    result: bytes = b""
    trace: bytes = b""


class RemoteLauncher:
    """One sitter with its folder; any thread may have it run an attempt."""

    def __init__(self, executor: str, directory: str) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            command = python_command("-m", "daemon.batch.worker._launcher")
            command += [str(theirs.fileno()), executor, directory]
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, pass_fds=(theirs.fileno(),)
            )
        self._wire = Connection(ours.detach())
        self._places = StatePaths(Path(self._greet()))
        self._places.make_folders()
        self._sending = threading.Lock()
        self._inboxes: dict[str, SimpleQueue[LaunchReport]] = {}
        self.gone = False
        threading.Thread(target=self._read, name="sitter", daemon=True).start()

    def _greet(self) -> str:
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
        with suppress(EOFError, OSError):  # the sitter is gone: everybody waiting is told
            while True:
                told = codec.from_json(LaunchReport, self._wire.recv_bytes())
                inbox = self._inboxes.get(told.key)
                if inbox is not None:
                    inbox.put(told)
        self.gone = True
        for key, inbox in tuple(self._inboxes.items()):
            inbox.put(LaunchReport(key, ended=True, why="the process that starts runs ended"))
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
        paths = {spec.scene: self._places.scene(spec.scene)}
        for digest in attached_digests(spec.sut.parameters).values():
            paths[digest] = self._places.files / digest
        return paths

    def run(
        self,
        grant: Lease,
        limits: RunLimits,
        wanted: Callable[[], bool],
        tell: Callable[[str], None],
    ) -> AttemptOutput:
        """Run an attempt to its end, or stop it as soon as it is not ``wanted`` any more.

        ``tell`` is given what it tells about itself. Raises ``OSError`` when there is no room.
        """
        key = uuid.uuid4().hex
        folder = self._places.spool / key / f"attempt-{grant.attempt}"
        inbox = self._inboxes[key] = SimpleQueue()
        try:
            folder.mkdir(parents=True)
            (folder / GRANT).write_bytes(codec.to_json(grant))
            if attached_digests(grant.spec.sut.parameters):
                (folder / FILES).symlink_to(self._places.files)
            scene = self._places.scene(grant.spec.scene)
            self._send(LaunchRequest(key, str(folder), str(scene), limits))
            told = self._await(key, inbox, wanted, tell)
            return _read_output(told, folder)
        finally:
            del self._inboxes[key]
            shutil.rmtree(folder.parent, ignore_errors=True)

    def _await(
        self,
        key: str,
        inbox: SimpleQueue[LaunchReport],
        wanted: Callable[[], bool],
        tell: Callable[[str], None],
    ) -> LaunchReport:
        while True:
            try:
                told = inbox.get(timeout=_TICK)
            except Empty:
                if self.gone:
                    return LaunchReport(key, ended=True, why="the process that starts runs ended")
                if not wanted():
                    self._send(LaunchRequest(key))
                continue
            if told.ended:
                return told
            tell(told.live)

    def _send(self, order: LaunchRequest) -> None:
        with self._sending:
            self._wire.send_bytes(codec.to_json(order))


def _read_output(told: LaunchReport, folder: Path) -> AttemptOutput:
    result, trace = folder / RESULT, folder / TRACE
    if not result.exists():
        return AttemptOutput(told)
    for path, limit in ((result, LARGEST_REQUEST), (trace, LARGEST_TRACE)):
        size = path.stat().st_size
        if size > limit:
            words = f"its {path.name} has {size} bytes; at most {limit} travel from a cluster"
            return AttemptOutput(LaunchReport(told.key, ended=True, blame=True, why=words))
    return AttemptOutput(told, result.read_bytes(), trace.read_bytes())


_launchers: dict[str, RemoteLauncher] = {}
_starting: Final = threading.Lock()


def remote_launcher(executor: str, directory: str) -> RemoteLauncher:
    """The household of this process for ``executor``, a new one when it is gone.

    Raises :class:`WorkerBroken` when runs cannot be executed here.
    """
    with _starting:
        found = _launchers.get(executor)
        if found is None or found.gone:
            found = _launchers[executor] = RemoteLauncher(executor, directory)
        return found


_LIVE_PERIOD: Final = 1.0
_CLOSING: Final = (Status.closing, Status.closed, Status.failed)


def start_launcher(executor: str) -> bytes:
    """Be warm here, or say what is wrong: a :class:`JobReport` of ``done`` or ``unfit`` in JSON."""
    worker = get_worker()
    words = ""
    try:
        remote_launcher(executor, worker.local_directory)
    except (WorkerBroken, OSError) as error:
        words = f"Dask worker {worker.address}: {error}"
    return codec.to_json(
        JobReport(JobStatus.UNFIT if words else JobStatus.DONE, worker.address, words)
    )


def execute_job(version: str, job: bytes, *given: bytes) -> tuple[bytes, bytes, bytes]:
    """Execute a :class:`ClusterJob` of that version: a :class:`JobReport`, the result (both in JSON) and
    the trace.

    Scene and files not ``given`` are those this Dask worker has kept, or the report asks for them.
    """
    worker = get_worker()
    report, result, trace = JobReport(JobStatus.UNFIT, worker.address), b"", b""
    try:
        if version == own_version():
            report, result, trace = _execute_here(worker, codec.from_json(ClusterJob, job), given)
        else:
            report = replace(report, words=f"{worker.address} has {own_version()}")
    except WorkerBroken as error:
        report = replace(report, words=str(error))
    except (OSError, ValueError) as error:
        report = JobReport(JobStatus.FAILED, worker.address, str(error))
    return codec.to_json(report), result, trace


def _execute_here(
    worker: Any, job: ClusterJob, given: tuple[bytes, ...]
) -> tuple[JobReport, bytes, bytes]:
    where = worker.address
    house = remote_launcher(job.executor, worker.local_directory)
    house.keep(job.grant.spec, given)
    missing = house.missing(job.grant.spec)
    if missing:
        return JobReport(JobStatus.MISSING, where, missing=missing), b"", b""
    key = worker.get_current_task()
    left = house.run(
        job.grant,
        job.limits,
        lambda: _is_wanted(worker, key),
        _progress_publisher(worker, job.topic, key),
    )
    if left.result:
        return JobReport(JobStatus.DONE, where), left.result, left.trace
    fate = JobStatus.FAILED if _is_wanted(worker, key) else JobStatus.STOPPED
    return JobReport(fate, where, left.told.why, left.told.blame, left.told.lacks), b"", b""


def _is_wanted(worker: Any, key: str) -> bool:
    """Whether the scheduler still wants this task.

    A task whose future was cancelled, whose gateway died, or whose scheduler went, goes on
    executing in state ``cancelled``: a thread cannot be stopped, only its process.
    """
    if worker.status in _CLOSING:
        return False
    task = worker.state.tasks.get(key)
    return task is not None and task.state in ("executing", "long-running")


def _progress_publisher(worker: Any, topic: str, key: str) -> Callable[[str], None]:
    following = 0.0

    def tell(live: str) -> None:
        nonlocal following
        now = time.monotonic()
        if now >= following:
            following = now + _LIVE_PERIOD
            worker.log_event(topic, codec.to_json(JobProgress(key, live)).decode())

    return tell
