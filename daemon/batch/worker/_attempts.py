"""Attempts and their folders in the spool.

    spool/<worker>/lock                          locked as long as that worker lives
    spool/<worker>/<run>/attempt-<k>.<token>/    grant.json, trace.mcap, result.json (last)

The next worker adopts the spool of a dead one: it delivers the results, and returns runs without a
result at once, since their processes died with the worker. Each attempt has a folder of its own, so
two executions of a run never share a file.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
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
from grammars.text.terminal_text import printable

_LOCK: Final = "lock"
_SHOWN_OUTPUT: Final = 2000
_FIRST_PAUSE: Final = 2.0
_LONGEST_PAUSE: Final = 120.0
"""Pauses before a failed removal or adoption is tried again [s]."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """One execution of a run, in its own folder."""

    lease: Lease
    folder: Path

    @classmethod
    def prepare(cls, folder: Path, lease: Lease) -> Attempt:
        """Make the folder of a leased run; raises ``OSError``."""
        folder.mkdir(parents=True)
        # Not synchronised: a run that a power cut removes from here runs again.
        try:
            (folder / LEASE).write_bytes(codec.to_json(lease))
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)  # no space: nobody would remove it later
            raise
        return cls(lease, folder)

    @classmethod
    def read(cls, folder: Path) -> Attempt:
        """Return the attempt in a folder; raises ``OSError`` or ``ValueError`` without one."""
        return cls(codec.from_json(Lease, (folder / LEASE).read_bytes()), folder)

    def link_files(self, folder: Path) -> None:
        """Link ``folder`` with the files of systems under test for the run."""
        (self.folder / FILES).symlink_to(folder)

    @property
    def finished(self) -> bool:
        """True if there is a result, and so a complete trace."""
        return (self.folder / RESULT).is_file()

    def result(self) -> RunResult:
        """Return the result; raises ``OSError`` or ``ValueError`` if it cannot be read."""
        with (self.folder / RESULT).open("rb") as file:
            data = file.read(LARGEST_REQUEST + 1)
        if len(data) > LARGEST_REQUEST:
            raise ValueError(f"its result has more than {LARGEST_REQUEST} bytes")
        return codec.from_json(RunResult, data)

    def output(self) -> str:
        """Return the end of the run's output, which may be empty."""
        return read_output(self.folder)[-_SHOWN_OUTPUT:].decode("utf-8", "replace").strip()


class Spool:
    """This worker's part of the spool.

    Its disk may become unusable while the worker works. Then no result is lost, the log has the
    reason once, and failed removals and adoptions are tried again, less and less often. A folder
    that cannot be removed is put aside.
    """

    def __init__(self, paths: StatePaths, worker: str) -> None:
        self._paths = paths
        self._remains: list[Path] = []
        self._adopt_at = self._pause = 0.0
        self._problems: set[str] = set()
        self._folder = paths.spool / worker
        # Locked before it has its name, so that no other worker adopts it in between.
        unnamed = paths.spool / f".{worker}"
        unnamed.mkdir(mode=0o700)
        self._lock = _lock(unnamed)
        unnamed.rename(self._folder)

    def open(self, lease: Lease) -> Attempt:
        """Make the folder of a leased run; raises ``ValueError`` for an invalid name."""
        if not is_run_id(lease.run):
            raise ValueError(f"{lease.run!r} is not the id of a run")
        # With its token: a run that was deleted and submitted again restarts with attempt 1, while
        # the old one may still be ending here.
        folder = self._folder / lease.run / f"attempt-{lease.attempt}.{lease.token}"
        self._remove(folder)
        return Attempt.prepare(folder, lease)

    def discard(self, attempt: Attempt) -> None:
        """Remove the folder of an attempt, and that of the run with its last one.

        A folder that cannot be removed is put aside, or tried again later.
        """
        if not self._remove(attempt.folder):
            self._remains.append(attempt.folder)
        with suppress(OSError):  # there are other attempts
            attempt.folder.parent.rmdir()

    def _remove(self, folder: Path) -> bool:
        """Remove a folder or put it aside; return whether it is gone."""
        if not os.path.lexists(folder):
            return True
        try:
            shutil.rmtree(folder)
        except OSError as error:
            try:
                aside = self._paths.put_aside(folder)
            except OSError:
                self._report(f"{folder} cannot be removed: {error}")
                return False
            self._report(f"{folder} cannot be removed, it is in {aside} now: {error}")
        return True

    def _report(self, problem: str) -> None:
        if problem not in self._problems:
            self._problems.add(problem)
            log(problem)

    def adopt(self) -> tuple[list[Attempt], list[Lease]]:
        """Take over the work of dead workers: attempts with results, and leases without one.

        The attempts become this worker's. The folders of the others are removed; the caller must
        return their leases.
        """
        finished: list[Attempt] = []
        unfinished: list[Lease] = []
        if time.monotonic() < self._adopt_at:
            return finished, unfinished
        self._remains = [folder for folder in self._remains if not self._remove(folder)]
        failed = bool(self._remains)
        for folder in self._others():
            try:
                failed |= not self._adopt_folder(folder, finished, unfinished)
            except OSError as error:
                self._report(f"{folder} cannot be taken over: {error}")
                failed = True
        self._pause = min(2.0 * self._pause or _FIRST_PAUSE, _LONGEST_PAUSE) if failed else 0.0
        self._adopt_at = time.monotonic() + self._pause
        return finished, unfinished

    def _others(self) -> list[Path]:
        try:
            folders = sorted(self._paths.spool.iterdir())
        except OSError as error:
            self._report(f"the spool cannot be read: {error}")
            return []
        return [folder for folder in folders if folder != self._folder and is_id(folder.name)]

    def _adopt_folder(self, folder: Path, finished: list[Attempt], unfinished: list[Lease]) -> bool:
        """Add the work of a dead owner of ``folder``; return false if the folder had to stay.

        Raises ``OSError``.
        """
        lock = _try_lock(folder)
        if lock is None:
            return True
        with lock:
            # A removed folder can still be locked through an open lock file: another worker has
            # adopted it.
            if not folder.exists():
                return True
            for attempt in _attempts(folder):
                if attempt.finished:
                    finished.append(self._move(attempt))
                else:
                    unfinished.append(attempt.lease)
            # A dying process of a run may still write: a remaining folder is removed later.
            return self._remove(folder)

    def _move(self, attempt: Attempt) -> Attempt:
        target = self._folder / attempt.lease.run / attempt.folder.name
        self._remove(target)
        target.parent.mkdir(exist_ok=True)
        attempt.folder.rename(target)
        return Attempt(attempt.lease, target)

    def close(self) -> None:
        """Release the spool; remove its folder if it has no attempts."""
        with self._lock:
            try:
                if not any(path.is_dir() for path in self._folder.iterdir()):
                    shutil.rmtree(self._folder)
            except OSError as error:
                self._report(f"{self._folder} stays: {error}")


def _try_lock(folder: Path) -> IO[str] | None:
    try:
        return _lock(folder)
    except (BlockingIOError, FileNotFoundError, NotADirectoryError):
        return None  # its worker lives, or another worker has adopted it


def _lock(folder: Path) -> IO[str]:
    """Lock a worker's folder; raises ``BlockingIOError`` if its worker lives, and ``OSError``."""
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
            continue  # for example a pipe, which would block the reader
        try:
            attempt = Attempt.read(path)
        except (OSError, ValueError):
            continue  # the worker died before it had written the lease: no run had started
        if is_run_id(attempt.lease.run):
            yield attempt


@dataclass(frozen=True, slots=True)
class AttemptEnd:
    """End of an attempt; without a result the reason, and whether it ``counts`` against the run.

    The number of attempts that count is limited. A full disk, a stopped worker, or a system under
    test that is not installed (``sut_missing``) does not count.
    """

    why: str = ""
    counts: bool = False
    sut_missing: bool = False


Waitable: TypeAlias = Connection | socket | int
"""An argument of :func:`multiprocessing.connection.wait`."""


def log(message: str) -> None:
    """Print a message of this worker with the time."""
    now = datetime.now().astimezone().isoformat(timespec="milliseconds")
    # A full disk must not end a worker whose log is on it.
    with suppress(OSError):
        print(now, printable(message), file=sys.stderr, flush=True)
