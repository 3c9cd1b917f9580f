"""Traces on the move: verified parts, and copies on this machine of traces that lie elsewhere.

Parts travel as base64 text with the digest of their bytes. A trace on this machine is read where it lies. One of a remote daemon comes over the bus in verified parts, one in a store through fsspec; both into a cache, by digest.
"""

from __future__ import annotations

import binascii
import fcntl
import hashlib
import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol, TypeAlias

import platformdirs

from daemon.batch.errors import TraceUnavailable
from daemon.batch.stores import _store
from daemon.batch.stores._locations import is_url
from daemon.model.messages import DownloadChunk
from daemon.model.status import RunDetail
from grammars.text.files import move_durably, sync_directory


def encode_chunk(data: bytes) -> tuple[str, str]:
    """Return bytes as text, and their SHA-256."""
    text = binascii.b2a_base64(data, newline=False).decode("ascii")
    return text, hashlib.sha256(data).hexdigest()


def decode_chunk(text: str, digest: str) -> bytes:
    """Return the bytes in ``text``; raises ``ValueError`` when they were damaged on the way."""
    try:
        data = binascii.a2b_base64(text, strict_mode=True)
    except ValueError as error:  # also for what is not ASCII
        raise ValueError("the chunk is damaged: it is not base64") from error
    if hashlib.sha256(data).hexdigest() != digest:
        raise ValueError("the chunk is damaged: its digest differs")
    return data


def read_part(path: Path, offset: int, count: int) -> bytes:
    """Return up to ``count`` bytes of a file from ``offset`` on; raises ``OSError``."""
    with path.open("rb") as file:
        file.seek(offset)
        return file.read(count)


def append_part(path: Path, offset: int, data: bytes) -> None:
    """Write ``data`` at ``offset``, where the file ends; raises ``OSError``, then nothing was."""
    with path.open("r+b" if path.exists() else "xb") as file:
        file.seek(offset)
        try:
            file.write(data)
            file.flush()
        except OSError:
            # A part of a part, the disk is full say.
            os.truncate(path, offset)
            raise


def file_size(path: Path) -> int:
    """Return how many bytes of a file there are, 0 while there is none."""
    with suppress(FileNotFoundError):
        return path.stat().st_size
    return 0


def accept_part(part: Path, whole: Path, sha256: str, *, mode: int | None = None) -> bool:
    """Give a file that is complete its name, for good, and tell whether it is the one meant.

    One of another digest is removed. Raises ``OSError``.
    """
    part.touch(mode=0o600)
    if file_sha256(part) != sha256:
        part.unlink()
        return False
    if mode is not None:
        part.chmod(mode)
    move_durably(part, whole)
    return True


def make_folder(folder: Path) -> None:
    """Make a folder for its owner in one that there is, for good; raises ``OSError``."""
    if not folder.is_dir():
        folder.mkdir(mode=0o700, exist_ok=True)
        sync_directory(folder.parent)


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file; raises ``OSError``."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def matches_digest(path: Path, size: int, sha256: str) -> bool:
    """Whether there is a file of that size and digest."""
    try:
        return path.is_file() and path.stat().st_size == size and file_sha256(path) == sha256
    except OSError:
        return False


LARGEST_CACHE: Final = 4 * 2**30
_RECENT: Final = 3600.0
"""Seconds after its last use during which nothing goes from the cache: somebody may read it."""
_TRIES: Final = 3

ByteProgress: TypeAlias = Callable[[int], None]
"""Gets the number of bytes that arrived."""


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
    told: ByteProgress | None = None,
) -> Path:
    """Return a path on this machine where a trace can be read, bringing it here if need be.

    ``source`` is asked for what lies at a path of another machine; ``cache`` is a folder, that of
    the user if not given. Raises :class:`TraceUnavailable` with the reason and what to do, and whatever
    ``source`` raises.
    """
    there = Path(trace.location)
    if not is_url(trace.location) and matches_digest(there, trace.size, trace.sha256):
        return there
    kept = (cache or user_trace_cache()) / f"{trace.sha256}.mcap"
    if matches_digest(kept, trace.size, trace.sha256):
        os.utime(kept)
        return kept
    copy_trace(trace, source, kept, told=told)
    _shrink_cache(kept.parent)
    return kept


def user_trace_cache() -> Path:
    """The folder of traces that were brought here for this user."""
    return platformdirs.user_cache_path("scenario") / "traces"


def copy_trace(
    trace: TraceReference,
    source: TraceSource | None,
    target: Path,
    *,
    told: ByteProgress | None = None,
) -> None:
    """Make ``target`` a copy of a trace, whole and verified.

    What was interrupted goes on where it was. Raises like :func:`local_copy`.
    """
    try:
        target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        part = target.with_name(f".{trace.sha256}.part")
        with part.open("ab") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not matches_digest(target, trace.size, trace.sha256):
                _fill_part(trace, source, part, told or (lambda _: None))
                move_durably(part, target)
            part.unlink(missing_ok=True)
    except OSError as error:
        raise TraceUnavailable(
            f"the trace of {trace.run} cannot be brought here: {error}"
        ) from error


def _fill_part(
    trace: TraceReference, source: TraceSource | None, part: Path, told: ByteProgress
) -> None:
    """Make ``part`` all of the trace."""
    if is_url(trace.location):
        _store.get_from_store(trace.location, part)
        told(trace.size)
    elif source is None:
        raise TraceUnavailable(
            f"the trace of {trace.run} lies on another machine or is gone ({trace.location}): "
            "name its daemon with --connect"
        )
    else:
        _download(trace, source, part, told)
    if part.stat().st_size != trace.size or file_sha256(part) != trace.sha256:
        os.truncate(part, 0)
        raise TraceUnavailable(
            f"the trace of {trace.run} is damaged where it is kept: {trace.location}"
        )


def _download(trace: TraceReference, source: TraceSource, part: Path, told: ByteProgress) -> None:
    if part.stat().st_size > trace.size:
        os.truncate(part, 0)
    have = part.stat().st_size
    told(have)
    while have < trace.size:
        data = _request_piece(trace, source, have)
        append_part(part, have, data)
        have += len(data)
        told(len(data))


def _request_piece(trace: TraceReference, source: TraceSource, offset: int) -> bytes:
    for _ in range(_TRIES):
        piece = source.piece(trace.run, offset)
        if (piece.sha256, piece.size) != (trace.sha256, trace.size):
            raise TraceUnavailable(f"the daemon has another trace of {trace.run} now: ask again")
        with suppress(ValueError):
            data = decode_chunk(piece.data, piece.digest)
            if piece.offset == offset and 0 < len(data) <= trace.size - offset:
                return data
    raise TraceUnavailable(f"the trace of {trace.run} arrives damaged, {_TRIES} times in a row")


def _shrink_cache(folder: Path) -> None:
    """Remove what was not used for longest until the cache is as small as it should be."""
    files = [(path.stat(), path) for path in folder.glob("*.mcap")]
    size, now = sum(stat.st_size for stat, _ in files), time.time()
    for stat, path in sorted(files, key=lambda entry: entry[0].st_mtime):
        if size <= LARGEST_CACHE or now - stat.st_mtime < _RECENT:
            return
        path.unlink(missing_ok=True)
        size -= stat.st_size
