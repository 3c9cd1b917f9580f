"""Copies on this machine of traces that lie elsewhere, by digest.

A trace on this machine is read where it lies. One of a remote daemon comes over the bus in
verified parts, one in a store through fsspec; both into a cache.
"""

from __future__ import annotations

import fcntl
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import platformdirs

from daemon.batch.errors import TraceUnavailable
from daemon.batch.stores._locations import is_url
from daemon.batch.stores._store import get_from_store
from daemon.batch.stores._transfer import (
    ByteProgress,
    download,
    file_sha256,
    matches_digest,
    trim_cache,
)
from daemon.model.messages import DownloadChunk
from daemon.model.status import RunDetail
from grammars.text.files import move_durably

LARGEST_CACHE: Final = 4 * 2**30
_IN_USE: Final = 3600.0
"""Seconds after its last use during which a trace stays in the cache: somebody may read it."""


@dataclass(frozen=True, slots=True)
class TraceReference:
    """The trace of a run: where it lies (a path there, or a URL), and what it must be."""

    run: str
    location: str
    sha256: str
    size: int


class TraceSource(Protocol):
    """Who has traces: a client of the daemon that keeps them."""

    def piece(self, run: str, offset: int) -> DownloadChunk:
        """A part of the trace of a run, from ``offset`` on."""


def trace_reference(detail: RunDetail) -> TraceReference:
    """Return the trace of a run; raises :class:`TraceUnavailable` when there is none (any more)."""
    row, result = detail.row, detail.result
    if result is None:
        raise TraceUnavailable(f"{row.id} has no trace: it is {row.state}")
    if not row.trace:
        raise TraceUnavailable(f"{row.id} has no trace: {row.reason or 'it is gone'}")
    return TraceReference(row.id, row.trace, result.trace.sha256, result.trace.size)


def local_copy(
    trace: TraceReference,
    source: TraceSource | None = None,
    *,
    cache: Path | None = None,
    largest: int = LARGEST_CACHE,
    progress: ByteProgress | None = None,
) -> Path:
    """Return a path on this machine where a trace can be read, bringing it here if need be.

    ``source`` is asked for what lies at a path of another machine; ``cache`` is a folder of at
    most ``largest`` bytes, that of the user if not given. Raises :class:`TraceUnavailable` with
    the reason and what to do, and whatever ``source`` raises.
    """
    there = Path(trace.location)
    # By digest also on this machine: another machine may have another file under the same path.
    if not is_url(trace.location) and matches_digest(there, trace.size, trace.sha256):
        return there
    kept = (cache or user_trace_cache()) / f"{trace.sha256}.mcap"
    if matches_digest(kept, trace.size, trace.sha256):
        os.utime(kept)
        return kept
    copy_trace(trace, source, kept, progress=progress)
    trim_cache(kept.parent.glob("*.mcap"), largest, lambda found: found.st_size, _IN_USE)
    return kept


def user_trace_cache() -> Path:
    """The folder of traces that were brought here for this user."""
    return platformdirs.user_cache_path("scenario") / "traces"


def copy_trace(
    trace: TraceReference,
    source: TraceSource | None,
    target: Path,
    *,
    progress: ByteProgress | None = None,
) -> None:
    """Make ``target`` a copy of a trace, whole and verified.

    What was interrupted goes on where it was. Raises like :func:`local_copy`.
    """
    try:
        target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        part = target.with_name(f".{trace.sha256}.part")
        with part.open("ab") as lock:
            # Two commands may want the same trace: the second one waits and finds it there.
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not matches_digest(target, trace.size, trace.sha256):
                _fill_part(trace, source, part, progress or (lambda _: None))
                move_durably(part, target)
            part.unlink(missing_ok=True)
    except OSError as error:
        raise TraceUnavailable(
            f"the trace of {trace.run} cannot be brought here: {error}"
        ) from error


def _fill_part(
    trace: TraceReference, source: TraceSource | None, part: Path, progress: ByteProgress
) -> None:
    """Make ``part`` all of the trace."""
    if is_url(trace.location):
        get_from_store(trace.location, part)
        progress(trace.size)
    elif source is None:
        raise TraceUnavailable(
            f"the trace of {trace.run} lies on another machine or is gone ({trace.location}): "
            "name its daemon with --connect"
        )
    else:
        _download(trace, source, part, progress)
    if part.stat().st_size != trace.size or file_sha256(part) != trace.sha256:
        os.truncate(part, 0)
        raise TraceUnavailable(
            f"the trace of {trace.run} is damaged where it is kept: {trace.location}"
        )


def _download(
    trace: TraceReference, source: TraceSource, part: Path, progress: ByteProgress
) -> None:
    def ask(offset: int) -> DownloadChunk:
        chunk = source.piece(trace.run, offset)
        if (chunk.sha256, chunk.size) != (trace.sha256, trace.size):
            raise TraceUnavailable(f"the daemon has another trace of {trace.run} now: ask again")
        return chunk

    if part.stat().st_size > trace.size:
        os.truncate(part, 0)
    try:
        download(part, ask, size=trace.size, progress=progress)
    except ValueError as error:
        raise TraceUnavailable(f"the trace of {trace.run} {error}") from error
