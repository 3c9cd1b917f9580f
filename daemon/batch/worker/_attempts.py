"""Attempts: their folders in the spool, and what executes them.

    spool/<worker>/lock                      locked as long as that worker lives
    spool/<worker>/<run>/attempt-<k>/        grant.json, trace.mcap, result.json (last)

What a dead worker left is adopted by the next one: results are delivered, the rest is removed.
Attempts are executed by processes of this machine or by a cluster; the loop cannot tell which.
"""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from socket import socket
from typing import IO, Final, Protocol, TypeAlias

from daemon.batch.paths import StatePaths
from daemon.batch.run_process import GRANT, OUTPUT, RESULT, TRACE
from daemon.batch.stores import file_sha256, make_folder
from daemon.model.execution import RunLimits
from daemon.model.ids import is_id, is_run_id
from daemon.model.messages import Lease
from daemon.model.spec import RunResult
from grammars.text import codec
from grammars.text.files import replacing

_LOCK: Final = "lock"
_SHOWN_OUTPUT: Final = 2000


@dataclass(frozen=True, slots=True)
class Attempt:
    """One execution of a run, in its own folder."""

    grant: Lease
    folder: Path

    @property
    def finished(self) -> bool:
        """Whether there is a result, and so a complete trace."""
        return (self.folder / RESULT).exists()

    def result(self) -> RunResult:
        """The result; raises ``OSError`` or ``ValueError`` when it cannot be read."""
        return codec.from_json(RunResult, (self.folder / RESULT).read_bytes())

    def output(self) -> str:
        """The end of what the run printed, empty when it printed nothing."""
        try:
            with (self.folder / OUTPUT).open("rb") as file:
                file.seek(max(0, file.seek(0, os.SEEK_END) - _SHOWN_OUTPUT))
                return file.read().decode("utf-8", "replace").strip()
        except FileNotFoundError:
            return ""  # it ended before it had begun

    def discard(self) -> None:
        """Remove the folder, and the run's when this was its last attempt."""
        shutil.rmtree(self.folder)
        if not any(self.folder.parent.iterdir()):
            self.folder.parent.rmdir()


class Spool:
    """This worker's part of the spool."""

    def __init__(self, places: StatePaths, worker: str) -> None:
        self._places = places
        self._folder = places.spool / worker
        # Locked before it has its name: nobody adopts it in between.
        unborn = places.spool / f".{worker}"
        unborn.mkdir(mode=0o700)
        self._lock = _try_lock(unborn)
        unborn.rename(self._folder)

    def open(self, grant: Lease) -> Attempt:
        """Make the folder of a leased run; raises ``ValueError`` for a name that is none."""
        if not is_run_id(grant.run):
            raise ValueError(f"{grant.run!r} is not the id of a run")
        folder = self._folder / grant.run / f"attempt-{grant.attempt}"
        if folder.exists():
            shutil.rmtree(folder)
        folder.mkdir(parents=True)
        # Not synchronised: what a power cut takes from here runs again.
        (folder / GRANT).write_bytes(codec.to_json(grant))
        return Attempt(grant, folder)

    def adopt(self) -> tuple[Attempt, ...]:
        """Take over what dead workers left: their finished attempts become this worker's."""
        found = []
        for folder in sorted(self._places.spool.iterdir()):
            if folder == self._folder or not is_id(folder.name):
                continue
            lock = _try_lock(folder)
            if lock is None:
                continue
            with lock:
                if not folder.exists():
                    continue  # somebody else has just adopted it
                found += [self._move(attempt) for attempt in _finished_attempts(folder)]
                shutil.rmtree(folder)
        return tuple(found)

    def _move(self, attempt: Attempt) -> Attempt:
        target = self._folder / attempt.grant.run / attempt.folder.name
        if target.exists():
            shutil.rmtree(target)
        target.parent.mkdir(exist_ok=True)
        attempt.folder.rename(target)
        return Attempt(attempt.grant, target)

    def close(self) -> None:
        """Let go; the folder goes too when nothing waits in it."""
        if not any(path.is_dir() for path in self._folder.iterdir()):
            shutil.rmtree(self._folder)
        if self._lock is not None:
            self._lock.close()


def _try_lock(folder: Path) -> IO[str] | None:
    try:
        lock = (folder / _LOCK).open("a")
    except (FileNotFoundError, NotADirectoryError):
        return None  # removed by another worker that adopted it
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        return None
    return lock


def _finished_attempts(folder: Path) -> Iterator[Attempt]:
    for path in sorted(folder.glob("*/attempt-*")):
        try:
            attempt = Attempt(codec.from_json(Lease, (path / GRANT).read_bytes()), path)
        except (OSError, ValueError):
            continue  # the worker died before it had written the grant: nothing ran
        if attempt.finished and is_run_id(attempt.grant.run):
            yield attempt


@dataclass(frozen=True, slots=True)
class TracePlacement:
    """A trace on its way from the spool to where the grant says.

    The first trace to arrive stays; the one the ledger recorded may replace it.
    """

    source: Path
    target: Path
    sha256: str

    @classmethod
    def of(cls, attempt: Attempt, places: StatePaths, result: RunResult) -> TracePlacement:
        """Plan it; raises ``ValueError`` when the grant's trace name leaves the directory."""
        target = places.trace(attempt.grant.trace)
        return cls(attempt.folder / TRACE, target, result.trace.sha256)

    def put(self) -> bool:
        """Put the trace there unless there is one; returns whether it is this one now."""
        make_folder(self.target.parent)
        if self.target.exists():
            return file_sha256(self.target) == self.sha256
        self.replace()
        return True

    def replace(self) -> None:
        """Put the trace there whatever is there; the spool keeps its own."""
        with replacing(self.target) as temporary:
            try:
                os.link(self.source, temporary)
            except OSError:  # no hard links here, or another file system
                shutil.copyfile(self.source, temporary)

    def withdraw(self) -> None:
        """Remove the trace from there if it is this one."""
        if self.target.exists() and file_sha256(self.target) == self.sha256:
            self.target.unlink()


Waitable: TypeAlias = Connection | socket | int
"""What :func:`multiprocessing.connection.wait` waits for."""


class Execution(Protocol):
    """An attempt under way. It leaves its trace, then its result, in the attempt's folder."""

    attempt: Attempt
    live: bytes
    """What it last told about itself, a :class:`daemon.model.status.LiveSnapshot` in JSON; or nothing."""
    deadline: float
    """When it has to be listened to at the latest, by the monotonic clock [s]."""

    @property
    def lacks(self) -> bool:
        """Whether the system under test is not installed where it was executed."""

    @property
    def waitables(self) -> Sequence[Waitable]:
        """What becomes ready when there is something to listen to, or at the end."""

    @property
    def ended(self) -> bool:
        """Whether nothing of it runs any more, as far as can be known here."""

    @property
    def blame(self) -> bool:
        """Whether it counts against the run that it ended without a result."""

    def listen(self) -> None:
        """Take in what it has told."""

    def kill(self, why: str = "") -> None:
        """End it at once, for that reason; it has ended afterwards."""

    def why(self) -> str:
        """Why there is no result."""

    def close(self) -> None:
        """Free what belongs to it, once it has ended."""


class Backend(Protocol):
    """Starts executions."""

    @property
    def slots(self) -> int:
        """How many executions it takes at a time, right now."""

    @property
    def waitables(self) -> Sequence[Waitable]:
        """What becomes ready when an execution of it has something to tell, or ``slots`` change."""

    def listen(self) -> None:
        """Take in what made ``waitables`` ready."""

    def start(self, attempt: Attempt, scene: Path, limits: RunLimits) -> Execution:
        """Start an attempt on the scene in that file.

        Raises :class:`daemon.batch.errors.DaemonError`, ``OSError`` or ``EOFError`` when that is not
        possible now, which is nothing to blame the run for.
        """
