"""One resumable transfer for files and traces, in verified parts, and copies kept here."""

from __future__ import annotations

import binascii
import fcntl
import hashlib
import os
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol, TypeAlias

import platformdirs

from daemon.batch.errors import TraceUnavailable
from daemon.batch.stores._store import copy_between, is_url
from daemon.model.messages import CHUNK, DownloadChunk, UploadProgress
from daemon.model.status import RunDetail
from grammars.text.files import move_durably, sync_directory

_TRIES: Final = 3

ByteProgress: TypeAlias = Callable[[int], None]
"""Gets the number of bytes that arrived."""


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


@dataclass(slots=True)
class FileUpload:
    """A file on its way to the daemon; ``offset`` is unknown until the daemon says it.

    ``faults`` counts the parts that were not taken, ``problem`` says what was wrong with the
    latest; when to give up is for the sender to decide.
    """

    path: Path
    offset: int | None = None
    complete: bool = False
    faults: int = 0
    problem: str = ""

    def send_next(self, ask: Callable[[int, str, str], UploadProgress]) -> int:
        """Send the next part, or ask where to go on; returns its size.

        ``ask`` gets offset, text and digest of a part and returns the daemon's answer. Raises
        ``OSError`` and whatever ``ask`` raises.
        """
        data = b"" if self.offset is None else read_part(self.path, self.offset)
        received = ask(self.offset or 0, *encode_chunk(data))
        self.offset, self.complete = received.offset, received.complete
        self.problem = received.problem
        self.faults += bool(received.problem)
        return len(data)


def download(
    part: Path,
    ask: Callable[[int], DownloadChunk],
    *,
    size: int | None = None,
    largest: int | None = None,
    progress: ByteProgress = lambda _: None,
) -> None:
    """Bring what is missing of a file, from where ``part`` ends.

    ``ask`` returns a part from an offset on. The size is what the sender says, ``largest`` at
    most, unless it is known. Whether the whole is the one meant is for the caller to verify.
    Raises ``ValueError`` for parts that come damaged again and again, ``OSError``, and whatever
    ``ask`` raises.
    """
    have = file_size(part)
    progress(have)
    while size is None or have < size:
        data, said = _request_chunk(ask, have, size)
        if size is None:
            size = said if largest is None else min(said, largest)
        append_part(part, have, data)
        have += len(data)
        progress(len(data))


def _request_chunk(
    ask: Callable[[int], DownloadChunk], offset: int, size: int | None
) -> tuple[bytes, int]:
    for _ in range(_TRIES):
        chunk = ask(offset)
        with suppress(ValueError):
            data = decode_chunk(chunk.data, chunk.digest)
            left = (chunk.size if size is None else size) - offset
            if chunk.offset == offset and min(1, left) <= len(data) <= left:
                return data, chunk.size
    raise ValueError(f"arrives damaged, {_TRIES} times in a row")


def read_part(path: Path, offset: int) -> bytes:
    """Return the part of a file that begins at ``offset``; raises ``OSError``."""
    with path.open("rb") as file:
        file.seek(offset)
        return file.read(CHUNK)


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


def accept_part(part: Path, whole: Path, sha256: str, *, mode: int | None = None) -> bool:
    """Give a file that is complete its name, for good, and tell whether it is the one meant.

    One of another digest is removed. Raises ``OSError``.
    """
    part.touch(mode=0o600)  # an empty file comes without a single part
    if file_sha256(part) != sha256:
        part.unlink()
        return False
    if mode is not None:
        part.chmod(mode)
    move_durably(part, whole)
    return True


def file_size(path: Path) -> int:
    """Return how many bytes of a file there are, 0 while there is none."""
    with suppress(FileNotFoundError):
        return path.stat().st_size
    return 0


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


def make_folder(folder: Path) -> None:
    """Make a folder for its owner in one that there is, for good; raises ``OSError``."""
    if not folder.is_dir():
        folder.mkdir(mode=0o700, exist_ok=True)
        sync_directory(folder.parent)


def trim_cache(
    paths: Iterable[Path], most: int, weight: Callable[[os.stat_result], int], in_use: float
) -> None:
    """Remove the files that were not used for longest until the rest weighs at most ``most``.

    Those used within ``in_use`` seconds stay, whatever they weigh: somebody may read them. Whoever
    uses a file of a cache touches it: few file systems keep the time of access.
    """
    files = sorted(((path.stat(), path) for path in paths), key=lambda file: file[0].st_mtime)
    total, now = sum(weight(found) for found, _ in files), time.time()
    for found, path in files:
        if total <= most or now - found.st_mtime < in_use:
            return
        path.unlink(missing_ok=True)
        total -= weight(found)


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
        copy_between(trace.location, str(part))
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
