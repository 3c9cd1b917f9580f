"""Owner of the state directory, and access of others to it.

Anybody who can write there decides what runs and what results say; submissions and results are
private to the owner. So its folders have mode 0700, and others cannot reach any file in them.
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
    """Exposed paths: of another owner, writable by others, or only readable by them."""

    foreign: tuple[Path, ...] = ()
    writable: tuple[Path, ...] = ()
    readable: tuple[Path, ...] = ()


def find_exposure(paths: Iterable[Path]) -> Exposure:
    """Return the exposed ones of files and folders; missing ones are skipped."""
    foreign, writable, readable = [], [], []
    for path in paths:
        with suppress(FileNotFoundError):
            status = path.stat()
            if status.st_uid != os.geteuid():
                foreign.append(path)
            if status.st_mode & _WRITE:
                writable.append(path)
            elif status.st_mode & _ANY:
                readable.append(path)
    return Exposure(tuple(foreign), tuple(writable), tuple(readable))


def secure_state(paths: StatePaths) -> tuple[Path, ...]:
    """Make a state directory private; return the folders that others could read until now.

    Raises :class:`DaemonError` if it belongs to somebody else or others can write there: its
    content cannot be trusted.
    """
    exposure = find_exposure(paths.folders)
    if exposure.foreign:
        raise DaemonError(
            f"{exposure.foreign[0]} belongs to somebody else: run the daemon as its owner, "
            "or choose another directory with --state"
        )
    if exposure.writable:
        names = " ".join(map(str, exposure.writable))
        raise DaemonError(
            f"others can write in {names}, and so decide what runs and what results say: "
            f"chmod go-rwx {names}, or choose a directory of your own with --state"
        )
    for folder in exposure.readable:
        folder.chmod(0o700)
    return exposure.readable


def find_key_exposure(folder: Path) -> Exposure:
    """Return the exposed paths in a folder of keys; only secrets count as readable.

    Files of root and folders with the sticky bit are safe: a cluster mounts secrets like this.
    """
    inside = [folder, *(path for path in folder.rglob("*") if not path.is_symlink())]
    exposure = find_exposure(inside)
    secret = (path for path in exposure.readable if path.name in ("key.pem", "ca.key"))
    return Exposure(
        tuple(path for path in exposure.foreign if path.stat().st_uid),
        tuple(path for path in exposure.writable if not _is_sticky(path)),
        tuple(secret),
    )


def _is_sticky(path: Path) -> bool:
    return path.is_dir() and bool(path.stat().st_mode & stat.S_ISVTX)


def refuse_exposed_keys(folder: Path) -> None:
    """Raise :class:`KeysUnusable` for keys that others could replace."""
    exposure = find_key_exposure(folder)
    if exposure.foreign:
        raise KeysUnusable(
            f"{exposure.foreign[0]} belongs to somebody else: have keys of your own made"
        )
    if exposure.writable:
        raise KeysUnusable(
            f"others can write {exposure.writable[0]}, and so decide who is admitted: "
            f"chmod -R go-rwx {folder}, and have new keys made"
        )


def open_private(path: Path) -> int:
    """Open a private file to append to it; return its descriptor. Raises ``OSError``."""
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
    return os.open(path, flags, 0o600)


def open_private_log(path: Path) -> IO[bytes]:
    """Open a log to append to it, unbuffered; raises ``OSError``."""
    return os.fdopen(open_private(path), "ab", buffering=0)
