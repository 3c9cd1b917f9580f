"""Attempts: their folders in the spool, and what executes them.

    spool/<worker>/lock                          locked as long as that worker lives; whose it is
    spool/<worker>/<run>/attempt-<k>.<token>/    grant.json, trace.mcap, result.json (last)

What a dead worker left is adopted by the next one with the same key: results are delivered, and the
runs that had none yet are given back at once, since their processes died with it.
Each attempt has a folder of its own, so two executions of a run never share a file.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from socket import socket
from typing import IO, Final, TypeAlias

from daemon.batch.paths import StatePaths
from daemon.batch.run_process import FILES, LEASE, RESULT, read_output
from daemon.model.ids import is_id, is_run_id
from daemon.model.messages import LARGEST_REQUEST, Lease
from daemon.model.spec import RunResult
from grammars.text import codec

_LOCK: Final = "lock"
"""Stands in the lock of a worker without a key: the daemon's owner started it."""
_SHOWN_OUTPUT: Final = 2000
_FIRST_PAUSE: Final = 2.0
_LONGEST_PAUSE: Final = 120.0
"""Seconds until something that could not be removed or taken over is tried again."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """One execution of a run, in its own folder."""

    lease: Lease
    folder: Path

    @classmethod
    def prepare(cls, folder: Path, lease: Lease) -> Attempt:
        """Make the folder of a leased run; raises ``OSError``."""
        folder.mkdir(parents=True)
        # Not synchronised: what a power cut takes from here runs again.
        try:
            (folder / LEASE).write_bytes(codec.to_json(lease))
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)  # no room: nobody would come back for it
            raise
        return cls(lease, folder)

    @classmethod
    def read(cls, folder: Path) -> Attempt:
        """Return the attempt in a folder; raises ``OSError`` or ``ValueError`` if there is none."""
        return cls(codec.from_json(Lease, (folder / LEASE).read_bytes()), folder)

    def link_files(self, folder: Path) -> None:
        """Put the files of systems under test in ``folder`` within reach of the run."""
        (self.folder / FILES).symlink_to(folder)

    @property
    def finished(self) -> bool:
        """Whether there is a result, and so a complete trace."""
        return (self.folder / RESULT).is_file()

    def result(self) -> RunResult:
        """The result; raises ``OSError`` or ``ValueError`` when it cannot be read."""
        with (self.folder / RESULT).open("rb") as file:
            data = file.read(LARGEST_REQUEST + 1)
        if len(data) > LARGEST_REQUEST:
            raise ValueError(f"its result has more than {LARGEST_REQUEST} bytes")
        return codec.from_json(RunResult, data)

    def output(self) -> str:
        """The end of what the run printed, empty when it printed nothing."""
        # Nothing of one that ended before it had begun.
        return read_output(self.folder)[-_SHOWN_OUTPUT:].decode("utf-8", "replace").strip()


@dataclass(frozen=True, slots=True)
class AdoptedWork:
    """What dead workers left: attempts with results, and leases of which nothing else is left."""

    finished: tuple[Attempt, ...] = ()
    unfinished: tuple[Lease, ...] = ()


class Spool:
    """This worker's part of the spool.

    Its disk may become unusable while the worker works. Then nothing of it is lost, ``log`` gets
    the reason once, and what could not be removed or taken over is tried again, less and less
    often. A folder that is in the way for good is put aside.
    """

    def __init__(self, paths: StatePaths, worker: str, log: Callable[[str], None]) -> None:
        self._paths = paths
        self._log = log
        self._remains: list[Path] = []
        self._adopt_at = self._pause = 0.0
        self._problems: set[str] = set()
        self._folder = paths.spool / worker
        # Locked before it has its name: nobody adopts it in between.
        unborn = paths.spool / f".{worker}"
        unborn.mkdir(mode=0o700)
        self._lock = _lock(unborn)
        unborn.rename(self._folder)

    def open(self, lease: Lease) -> Attempt:
        """Make the folder of a leased run; raises ``ValueError`` for a name that is none."""
        if not is_run_id(lease.run):
            raise ValueError(f"{lease.run!r} is not the id of a run")
        # With its token: a run that was deleted and submitted again begins with attempt 1 again,
        # while the one of before may still be ending here.
        folder = self._folder / lease.run / f"attempt-{lease.attempt}.{lease.token}"
        self._remove(folder)
        return Attempt.prepare(folder, lease)

    def discard(self, attempt: Attempt) -> None:
        """Remove the folder of an attempt, and the run's with its last one.

        One that cannot be removed is put aside, or tried again later.
        """
        if not self._remove(attempt.folder):
            self._remains.append(attempt.folder)
        with suppress(OSError):  # there are other attempts
            attempt.folder.parent.rmdir()

    def _remove(self, folder: Path) -> bool:
        """Remove a folder or put it aside; return whether it has gone."""
        if not os.path.lexists(folder):
            return True
        try:
            shutil.rmtree(folder)
        except OSError as error:
            try:
                aside = self._paths.put_aside(folder)
            except OSError:
                self._tell(f"{folder} cannot be removed: {error}")
                return False
            self._tell(f"{folder} cannot be removed, it lies in {aside} now: {error}")
        return True

    def _tell(self, problem: str) -> None:
        if problem not in self._problems:
            self._problems.add(problem)
            self._log(problem)

    def adopt(self) -> AdoptedWork:
        """Take over what dead workers left: their finished attempts become this worker's.

        The folders of the others go; their leases are to be given back. Leases are used under the
        name they were granted to: what workers with other keys left waits for such a one.
        """
        if time.monotonic() < self._adopt_at:
            return AdoptedWork()
        self._remains = [folder for folder in self._remains if not self._remove(folder)]
        failed = bool(self._remains)
        finished: list[Attempt] = []
        unfinished: list[Lease] = []
        for folder in self._others():
            try:
                failed |= not self._adopt_folder(folder, finished, unfinished)
            except OSError as error:
                self._tell(f"{folder} cannot be taken over: {error}")
                failed = True
        self._pause = min(2.0 * self._pause or _FIRST_PAUSE, _LONGEST_PAUSE) if failed else 0.0
        self._adopt_at = time.monotonic() + self._pause
        return AdoptedWork(tuple(finished), tuple(unfinished))

    def _others(self) -> list[Path]:
        try:
            folders = sorted(self._paths.spool.iterdir())
        except OSError as error:
            self._tell(f"the spool cannot be read: {error}")
            return []
        return [folder for folder in folders if folder != self._folder and is_id(folder.name)]

    def _adopt_folder(self, folder: Path, finished: list[Attempt], unfinished: list[Lease]) -> bool:
        """Add what the owner of ``folder`` left, unless he lives; return whether it has gone then.

        Raises ``OSError``.
        """
        lock = _try_lock(folder)
        if lock is None:
            return True
        with lock:
            # A removed folder can still be locked by who had its lock open: the first to
            # come has adopted it, name and all.
            if not folder.exists():
                return True
            for attempt in _attempts(folder):
                if attempt.finished:
                    finished.append(self._move(attempt))
                else:
                    unfinished.append(attempt.lease)
            # A run's process may be dying and still write: what is left goes later.
            return self._remove(folder)

    def _move(self, attempt: Attempt) -> Attempt:
        target = self._folder / attempt.lease.run / attempt.folder.name
        self._remove(target)
        target.parent.mkdir(exist_ok=True)
        attempt.folder.rename(target)
        return Attempt(attempt.lease, target)

    def close(self) -> None:
        """Let go; the folder goes too when nothing waits in it."""
        with self._lock:
            try:
                if not any(path.is_dir() for path in self._folder.iterdir()):
                    shutil.rmtree(self._folder)
            except OSError as error:
                self._tell(f"{self._folder} stays: {error}")


def _try_lock(folder: Path) -> IO[str] | None:
    try:
        return _lock(folder)
    except (BlockingIOError, FileNotFoundError, NotADirectoryError):
        return None  # its worker lives, or another worker has adopted it


def _lock(folder: Path) -> IO[str]:
    """Lock a worker's folder; raises ``BlockingIOError`` when its worker lives, and ``OSError``."""
    lock = (folder / _LOCK).open("a")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        raise
    return lock


def _attempts(folder: Path) -> Iterator[Attempt]:
    for path in sorted(folder.glob("*/attempt-*")):
        if not (path / LEASE).is_file():
            continue  # a pipe, say, that would keep who reads it
        try:
            attempt = Attempt.read(path)
        except (OSError, ValueError):
            continue  # the worker died before it had written the lease: nothing ran
        if is_run_id(attempt.lease.run):
            yield attempt


@dataclass(frozen=True, slots=True)
class AttemptEnd:
    """How an attempt ended; where it left no result, ``why``, and whether it ``counts`` against it.

    A run has only so many attempts that count. It is not its doing that a disk is full, a worker
    was stopped, or the system under test is not installed where it was tried (``sut_missing``).
    """

    why: str = ""
    counts: bool = False
    sut_missing: bool = False


Waitable: TypeAlias = Connection | socket | int
"""What :func:`multiprocessing.connection.wait` waits for."""
