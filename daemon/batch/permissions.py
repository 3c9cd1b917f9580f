"""Whose the state directory is, and who else may write or read in it.

Whoever writes there decides what runs and what results say; what was submitted and what came out is
for its owner to show. So its folders have mode 0700, and no file in them is in anybody's reach.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

from daemon.batch.errors import DaemonError, KeysUnusable
from daemon.batch.paths import StatePaths

_WRITE: Final = stat.S_IWGRP | stat.S_IWOTH
_ANY: Final = stat.S_IRWXG | stat.S_IRWXO


@dataclass(frozen=True, slots=True)
class Exposure:
    """What is not its owner's alone: of another owner, writable or only readable by others."""

    foreign: tuple[Path, ...] = ()
    writable: tuple[Path, ...] = ()
    readable: tuple[Path, ...] = ()


def find_exposure(paths: Iterable[Path]) -> Exposure:
    """Look at files and folders; those that are gone meanwhile count for nothing."""
    foreign, writable, readable = [], [], []
    for path in paths:
        with suppress(FileNotFoundError):
            found = path.stat()
            if found.st_uid != os.geteuid():
                foreign.append(path)
            if found.st_mode & _WRITE:
                writable.append(path)
            elif found.st_mode & _ANY:
                readable.append(path)
    return Exposure(tuple(foreign), tuple(writable), tuple(readable))


def secure_state(paths: StatePaths) -> tuple[Path, ...]:
    """See to it that a state directory is ours alone; returns what others could read until now.

    Raises :class:`DaemonError` when it belongs to somebody else or others can write there: nobody
    knows what they have put into it.
    """
    found = find_exposure(paths.folders)
    if found.foreign:
        raise DaemonError(
            f"{found.foreign[0]} belongs to somebody else: run the daemon as its owner, "
            "or choose another directory with --state"
        )
    if found.writable:
        names = " ".join(map(str, found.writable))
        raise DaemonError(
            f"others can write in {names}, and so decide what runs and what results say: "
            f"chmod go-rwx {names}, or choose a directory of your own with --state"
        )
    for folder in found.readable:
        folder.chmod(0o700)
    return found.readable


def find_key_exposure(folder: Path) -> Exposure:
    """Look at a folder of keys; secrets that others may read count as readable, nothing else does.

    What root has put there is nobody's forgery, and where the sticky bit is set nobody can take
    another's place: that is how a cluster mounts secrets.
    """
    inside = [folder, *(path for path in folder.rglob("*") if not path.is_symlink())]
    found = find_exposure(inside)
    secret = (path for path in found.readable if path.name in ("key.pem", "ca.key"))
    return Exposure(
        tuple(path for path in found.foreign if path.stat().st_uid),
        tuple(path for path in found.writable if not _is_sticky(path)),
        tuple(secret),
    )


def _is_sticky(path: Path) -> bool:
    return path.is_dir() and bool(path.stat().st_mode & stat.S_ISVTX)


def refuse_exposed_keys(folder: Path) -> None:
    """Raise :class:`KeysUnusable` for keys in whose place others could put theirs."""
    found = find_key_exposure(folder)
    if found.foreign:
        raise KeysUnusable(
            f"{found.foreign[0]} belongs to somebody else: have keys of your own made"
        )
    if found.writable:
        raise KeysUnusable(
            f"others can write {found.writable[0]}, and so decide who is admitted: "
            f"chmod -R go-rwx {folder}, and have new keys made"
        )


def open_private(path: Path) -> int:
    """Return a descriptor to add to a file that is made for its owner alone; raises ``OSError``."""
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
    return os.open(path, flags, 0o600)


def open_private_log(path: Path) -> IO[bytes]:
    """Open a log to add to it, unbuffered; raises ``OSError``."""
    return os.fdopen(open_private(path), "ab", buffering=0)
