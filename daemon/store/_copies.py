"""Traces at hand: wherever one lies, a path on this machine where it can be read.

A trace on this machine is read where it lies. One of a remote daemon comes over the bus in
verified parts, one in a store through fsspec; both into a cache, by digest.
"""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol, TypeAlias

import platformdirs

from daemon.errors import NotAtHand
from daemon.messages import Piece
from daemon.places import sync_directory
from daemon.protocol import RunDetail
from daemon.store import _shelf
from daemon.store._chunks import add_part, is_file_of, sha256_of, unpacked
from daemon.store._urls import is_url

LARGEST_CACHE: Final = 4 * 2**30
_RECENT: Final = 3600.0
"""Seconds after its last use during which nothing goes from the cache: somebody may read it."""
_TRIES: Final = 3

Told: TypeAlias = Callable[[int], None]
"""Gets the number of bytes that arrived."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """The trace of a run: where it lies (a path there, or a URL), and what it must be."""

    run: str
    location: str
    sha256: str
    size: int


class Source(Protocol):
    """Who has traces: a client of the daemon that keeps them."""

    def piece(self, run: str, offset: int) -> Piece:
        """A part of the trace of a run, from ``offset`` on."""


def recorded(detail: RunDetail) -> Recorded:
    """Return the trace of a run; raises :class:`NotAtHand` when there is none (any more)."""
    row, result = detail.row, detail.result
    if result is None:
        raise NotAtHand(f"{row.id} has no trace: it is {row.state}")
    if not row.trace:
        raise NotAtHand(f"{row.id} has no trace: {row.reason or 'it is gone'}")
    return Recorded(row.id, row.trace, result.trace.sha256, result.trace.size)


def local_copy(
    trace: Recorded,
    source: Source | None = None,
    *,
    cache: Path | None = None,
    told: Told | None = None,
) -> Path:
    """Return a path on this machine where a trace can be read, bringing it here if need be.

    ``source`` is asked for what lies at a path of another machine; ``cache`` is a folder, that of
    the user if not given. Raises :class:`NotAtHand` with the reason and what to do, and whatever
    ``source`` raises.
    """
    there = Path(trace.location)
    if not is_url(trace.location) and is_file_of(there, trace.size, trace.sha256):
        return there
    kept = (cache or user_cache()) / f"{trace.sha256}.mcap"
    if is_file_of(kept, trace.size, trace.sha256):
        os.utime(kept)
        return kept
    bring(trace, source, kept, told=told)
    _bound(kept.parent)
    return kept


def user_cache() -> Path:
    """The folder of traces that were brought here for this user."""
    return platformdirs.user_cache_path("scenario") / "traces"


def bring(
    trace: Recorded, source: Source | None, target: Path, *, told: Told | None = None
) -> None:
    """Make ``target`` a copy of a trace, whole and verified.

    What was interrupted goes on where it was. Raises like :func:`local_copy`.
    """
    try:
        target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        part = target.with_name(f".{trace.sha256}.part")
        with part.open("ab") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not is_file_of(target, trace.size, trace.sha256):
                _fill(trace, source, part, told or (lambda _: None))
                part.replace(target)
                sync_directory(target.parent)
            part.unlink(missing_ok=True)
    except OSError as error:
        raise NotAtHand(f"the trace of {trace.run} cannot be brought here: {error}") from error


def _fill(trace: Recorded, source: Source | None, part: Path, told: Told) -> None:
    """Make ``part`` all of the trace."""
    if is_url(trace.location):
        _shelf.get(trace.location, part)
        told(trace.size)
    elif source is None:
        raise NotAtHand(
            f"the trace of {trace.run} lies on another machine or is gone ({trace.location}): "
            "name its daemon with --connect"
        )
    else:
        _download(trace, source, part, told)
    if part.stat().st_size != trace.size or sha256_of(part) != trace.sha256:
        os.truncate(part, 0)
        raise NotAtHand(f"the trace of {trace.run} is damaged where it is kept: {trace.location}")
    with part.open("rb") as file:
        os.fsync(file.fileno())


def _download(trace: Recorded, source: Source, part: Path, told: Told) -> None:
    if part.stat().st_size > trace.size:
        os.truncate(part, 0)
    have = part.stat().st_size
    told(have)
    while have < trace.size:
        data = _piece(trace, source, have)
        add_part(part, have, data)
        have += len(data)
        told(len(data))


def _piece(trace: Recorded, source: Source, offset: int) -> bytes:
    for _ in range(_TRIES):
        piece = source.piece(trace.run, offset)
        if (piece.sha256, piece.size) != (trace.sha256, trace.size):
            raise NotAtHand(f"the daemon has another trace of {trace.run} now: ask again")
        with suppress(ValueError):
            data = unpacked(piece.data, piece.digest)
            if piece.offset == offset and 0 < len(data) <= trace.size - offset:
                return data
    raise NotAtHand(f"the trace of {trace.run} arrives damaged, {_TRIES} times in a row")


def _bound(folder: Path) -> None:
    """Remove what was not used for longest until the cache is as small as it should be."""
    files = [(path.stat(), path) for path in folder.glob("*.mcap")]
    size, now = sum(stat.st_size for stat, _ in files), time.time()
    for stat, path in sorted(files, key=lambda entry: entry[0].st_mtime):
        if size <= LARGEST_CACHE or now - stat.st_mtime < _RECENT:
            return
        path.unlink(missing_ok=True)
        size -= stat.st_size
