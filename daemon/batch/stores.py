"""Storage and transfer of traces: a store by URL, parts of files, copies on this machine.

A store is an fsspec URL to which finished traces move. The marker of a state directory
distinguishes it from other directories and from copies.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import secrets
import shutil
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeAlias
from urllib.parse import urlsplit

from daemon.batch.errors import TraceUnavailable, Unavailable
from daemon.batch.paths import StatePaths
from daemon.model.ids import is_id
from daemon.model.messages import PART, FilePart
from daemon.model.status import RunRow
from daemon.model.verbs import DaemonClient
from grammars.text import codec
from grammars.text.files import move_durably, sync_directory, user_folder, write_atomically

_FAULTS: Final = 5

ByteProgress: TypeAlias = Callable[[int], None]
"""Receiver of the number of bytes that arrived."""


def upload(
    path: Path, put: Callable[[int, bytes], int], progress: ByteProgress = lambda _: None
) -> None:
    """Send the missing parts of a file to the daemon.

    ``put`` gets offset and content of a part and returns the number of bytes that the daemon has.
    Raises :class:`Unavailable` after repeated refusals, ``OSError``, and the errors of ``put``.
    """
    size, faults = path.stat().st_size, 0
    arrived = put(0, b"")
    while arrived < size:
        previous, arrived = arrived, put(arrived, read_part(path, arrived))
        progress(max(0, arrived - previous))
        faults += arrived <= previous
        if faults == _FAULTS:
            raise Unavailable(f"{path} does not arrive: {_FAULTS} parts of it were refused")


def download(
    part: Path, get: Callable[[int], FilePart], progress: ByteProgress = lambda _: None
) -> None:
    """Fetch the rest of a file, from the end of ``part`` on.

    ``get`` returns a part from an offset on. The caller must verify the whole. Raises
    ``ValueError`` when it ends too early, ``OSError``, and the errors of ``get``.
    """
    have = file_size(part)
    progress(have)
    while True:
        answer = get(have)
        append_part(part, have, answer.data)
        have += len(answer.data)
        progress(len(answer.data))
        if have >= answer.size:
            return
        if not answer.data:
            raise ValueError(f"only {have} of {answer.size} bytes arrive")


def read_part(path: Path, offset: int) -> bytes:
    """Return the part of a file that begins at ``offset``; raises ``OSError``."""
    with path.open("rb") as file:
        file.seek(offset)
        return file.read(PART)


def append_part(path: Path, offset: int, data: bytes) -> None:
    """Write ``data`` at ``offset``, the end of the file, or raise ``OSError`` and write nothing."""
    with path.open("r+b" if path.exists() else "xb") as file:
        file.seek(offset)
        try:
            file.write(data)
            file.flush()
        except OSError:
            # Remove the incomplete part, for example on a full disk.
            os.truncate(path, offset)
            raise


def file_size(path: Path) -> int:
    """Return the size of a file [B], 0 if it does not exist."""
    with suppress(FileNotFoundError):
        return path.stat().st_size
    return 0


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file; raises ``OSError``."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def matches_digest(path: Path, size: int, sha256: str) -> bool:
    """Return whether the file exists with this size and digest."""
    try:
        return path.is_file() and path.stat().st_size == size and file_sha256(path) == sha256
    except OSError:
        return False


def is_intact(path: Path) -> bool:
    """Return whether a file of runs exists with the content of its name, a digest.

    Raises ``OSError`` if it exists but cannot be read.
    """
    try:
        return file_sha256(path) == path.stem
    except FileNotFoundError:
        return False


def trim_cache(paths: Iterable[Path], most: int, in_use: float) -> None:
    """Remove the least recently used files until the rest has at most ``most`` bytes.

    Files used within ``in_use`` seconds stay, however large: somebody may read them. Users of a
    cached file touch it, since few file systems keep the time of access.
    """
    files = sorted(((path.stat(), path) for path in paths), key=lambda file: file[0].st_mtime)
    total, now = sum(status.st_size for status, _ in files), time.time()
    for status, path in files:
        if total <= most or now - status.st_mtime < in_use:
            return
        path.unlink(missing_ok=True)
        total -= status.st_size


_LARGEST_CACHE: Final = 4 * 2**30
_IN_USE: Final = 3600.0
"""Time for which a trace stays in the cache after its last use [s]: somebody may read it."""


@dataclass(frozen=True, slots=True)
class TraceReference:
    """The trace of a run: its location (a path or a URL), digest and size."""

    run: str
    location: str
    sha256: str
    size: int


def trace_reference(row: RunRow) -> TraceReference:
    """Return the trace of a run; raises :class:`TraceUnavailable` if it does not exist."""
    if row.result is None:
        raise TraceUnavailable(f"{row.id} has no trace: it is {row.state}")
    if not row.trace:
        raise TraceUnavailable(f"{row.id} has no trace: {row.reason or 'it is gone'}")
    return TraceReference(row.id, row.trace, row.result.trace.sha256, row.result.trace.size)


def local_copy(
    trace: TraceReference,
    source: DaemonClient | None = None,
    *,
    cache: Path | None = None,
    progress: ByteProgress = lambda _: None,
) -> Path:
    """Return a path on this machine where a trace can be read, fetching it if necessary.

    ``source`` provides traces at paths of another machine; ``cache`` is a folder, by default the
    user's. Raises :class:`TraceUnavailable` with the reason and the remedy, and the errors of
    ``source``.
    """
    original = Path(trace.location)
    # Check the digest: the path may be another file on this machine.
    if not is_url(trace.location) and matches_digest(original, trace.size, trace.sha256):
        return original
    folder = cache or user_folder("cache") / "traces"
    copy = folder / f"{trace.sha256}.mcap"
    if matches_digest(copy, trace.size, trace.sha256):
        os.utime(copy)
        return copy
    copy_trace(trace, source, copy, progress=progress)
    trim_cache(copy.parent.glob("*.mcap"), _LARGEST_CACHE, _IN_USE)
    return copy


def trace_file(
    row: RunRow, source: DaemonClient | None = None, *, progress: ByteProgress = lambda _: None
) -> Path:
    """Return the trace of a run as a file of this machine; otherwise as :func:`local_copy`.

    Without ``source`` a path belongs to this machine, and is returned unchecked.
    """
    if source is None and row.trace and not is_url(row.trace):
        return Path(row.trace)
    return local_copy(trace_reference(row), source, progress=progress)


def copy_trace(
    trace: TraceReference,
    source: DaemonClient | None,
    target: Path,
    *,
    progress: ByteProgress = lambda _: None,
) -> None:
    """Make ``target`` a complete, verified copy of a trace.

    An interrupted copy goes on where it stopped. Raises as :func:`local_copy`.
    """
    try:
        target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        part = target.with_name(f".{trace.sha256}.part")
        with part.open("ab") as lock:
            # Of two commands that fetch the same trace, the second waits and finds it there.
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not matches_digest(target, trace.size, trace.sha256):
                _bring(trace, source, part, progress)
                move_durably(part, target)
            part.unlink(missing_ok=True)
    except (OSError, ValueError) as error:
        raise TraceUnavailable(f"the trace of {trace.run} cannot be fetched: {error}") from error


def _bring(
    trace: TraceReference, source: DaemonClient | None, part: Path, progress: ByteProgress
) -> None:
    """Fetch the trace into ``part``."""
    if is_url(trace.location) or (source is None and Path(trace.location).is_file()):
        copy_between(trace.location, str(part))
        progress(trace.size)
    elif source is None:
        raise TraceUnavailable(
            f"the trace of {trace.run} is on another machine or is gone ({trace.location}): "
            "name its daemon with --connect"
        )
    else:
        download(part, lambda offset: source.get(trace.sha256, offset, trace.run), progress)
    if not matches_digest(part, trace.size, trace.sha256):
        os.truncate(part, 0)
        raise ValueError(f"the data from {trace.location} differs from the recorded trace")


def is_url(location: str) -> bool:
    """Return whether the location of a trace is a URL rather than a path."""
    return "://" in location


def check_store_url(url: str) -> str:
    """Return the URL of a store without a final slash; raises ``ValueError`` for a bad one."""
    from fsspec import available_protocols

    parts = urlsplit(url)
    if not is_url(url) or parts.scheme not in available_protocols():
        raise ValueError(f"{url!r} is not a store: write file:///mnt/traces or s3://bucket/folder")
    if parts.scheme == "file" and (parts.netloc or len(parts.path) < 2):
        raise ValueError(f"{url!r} has no absolute path: write file:///mnt/traces")
    if parts.password is not None or parts.query:
        raise ValueError("the URL contains credentials: set them in the environment")
    return url.rstrip("/")


def copy_between(source: str, target: str) -> None:
    """Copy a file from a path or URL to another, durably; raises ``OSError``."""
    import fsspec

    try:
        with fsspec.open(source) as reader, fsspec.open(target, "wb") as writer:
            shutil.copyfileobj(reader, writer)
        if target.startswith("file://"):
            path = Path(target.removeprefix("file://"))
            with path.open("rb") as file:
                os.fsync(file.fileno())
            sync_directory(path.parent)
    except Exception as error:  # the library behind a URL may raise anything
        url = source if is_url(source) else target
        why = getattr(error, "strerror", "") or repr(error)
        raise OSError(f"{url} cannot be used from here: {why}") from error


@dataclass(frozen=True, slots=True)
class Marker:
    """Contents of the marker: the ``identity`` of the directory, and the ``era`` of its ledger."""

    identity: str
    era: str


def write_marker(paths: StatePaths, era: str) -> Marker:
    """Write a secret marker, and return it.

    The directory keeps its identity for good. Each start of a daemon has a new era, which
    distinguishes the directory from a copy on another machine. Raises ``OSError``.
    """
    previous = read_marker(paths)
    identity = previous.identity if previous is not None else secrets.token_hex(8)
    marker = Marker(identity, era)
    write_atomically(paths.marker, codec.to_json(marker), mode=0o600)
    return marker


def read_marker(paths: StatePaths) -> Marker | None:
    """Return the marker in a directory, or ``None`` without a readable one."""
    try:
        marker = codec.from_json(Marker, paths.marker.read_bytes())
    except (OSError, ValueError):
        return None
    return marker if is_id(marker.identity) else None
