"""Places of traces and their travels: a store by URL, parts of files, copies on this machine.

A store is an fsspec URL that finished traces are moved to, and fetched from. The marker of a state
directory tells one directory from another, and from a copy.
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

import platformdirs

from daemon.batch.errors import TraceUnavailable, Unavailable
from daemon.batch.paths import StatePaths
from daemon.model.ids import is_id
from daemon.model.messages import PART, FilePart
from daemon.model.status import RunRow
from daemon.model.verbs import DaemonClient
from grammars.text import codec
from grammars.text.files import move_durably, sync_directory, write_atomically

_FAULTS: Final = 5

ByteProgress: TypeAlias = Callable[[int], None]
"""Gets the number of bytes that arrived."""


def upload(
    path: Path, put: Callable[[int, bytes], int], progress: ByteProgress = lambda _: None
) -> None:
    """Send what the daemon lacks of a file.

    ``put`` gets offset and content of a part and returns how many bytes the daemon has. Raises
    :class:`Unavailable` when parts are not taken again and again, ``OSError``, and whatever ``put``
    raises.
    """
    size, faults = path.stat().st_size, 0
    arrived = put(0, b"")
    while arrived < size:
        before, arrived = arrived, put(arrived, read_part(path, arrived))
        progress(max(0, arrived - before))
        faults += arrived <= before
        if faults == _FAULTS:
            raise Unavailable(f"{path} does not arrive: {_FAULTS} parts of it were not taken")


def download(
    part: Path, get: Callable[[int], FilePart], progress: ByteProgress = lambda _: None
) -> None:
    """Bring what is missing of a file, from where ``part`` ends.

    ``get`` returns a part from an offset on. Whether the whole is the one meant is for the caller
    to verify. Raises ``ValueError`` when it ends too early, ``OSError``, and whatever ``get``
    raises.
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


def is_intact(path: Path) -> bool:
    """Whether a scene or file of runs is there that is what its name says: its digest.

    Raises ``OSError`` when it is there and cannot be read.
    """
    try:
        return file_sha256(path) == path.stem
    except FileNotFoundError:
        return False


def trim_cache(paths: Iterable[Path], most: int, in_use: float) -> None:
    """Remove the files that were not used for longest until the rest has at most ``most`` bytes.

    Those used within ``in_use`` seconds stay, however large: somebody may read them. Whoever uses a
    file of a cache touches it: few file systems keep the time of access.
    """
    files = sorted(((path.stat(), path) for path in paths), key=lambda file: file[0].st_mtime)
    total, now = sum(found.st_size for found, _ in files), time.time()
    for found, path in files:
        if total <= most or now - found.st_mtime < in_use:
            return
        path.unlink(missing_ok=True)
        total -= found.st_size


_LARGEST_CACHE: Final = 4 * 2**30
_IN_USE: Final = 3600.0
"""Seconds after its last use during which a trace stays in the cache: somebody may read it."""


@dataclass(frozen=True, slots=True)
class TraceReference:
    """The trace of a run: where it lies (a path there, or a URL), and what it must be."""

    run: str
    location: str
    sha256: str
    size: int


def trace_reference(row: RunRow) -> TraceReference:
    """Return the trace of a run; raises :class:`TraceUnavailable` when there is none (any more)."""
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
    """Return a path on this machine where a trace can be read, bringing it here if need be.

    ``source`` is asked for what lies at a path of another machine; ``cache`` is a folder, that of
    the user if not given. Raises :class:`TraceUnavailable` with the reason and what to do, and
    whatever ``source`` raises.
    """
    there = Path(trace.location)
    # By digest also on this machine: another machine may have another file under the same path.
    if not is_url(trace.location) and matches_digest(there, trace.size, trace.sha256):
        return there
    folder = cache or platformdirs.user_cache_path("scenario") / "traces"
    kept = folder / f"{trace.sha256}.mcap"
    if matches_digest(kept, trace.size, trace.sha256):
        os.utime(kept)
        return kept
    copy_trace(trace, source, kept, progress=progress)
    trim_cache(kept.parent.glob("*.mcap"), _LARGEST_CACHE, _IN_USE)
    return kept


def trace_file(
    row: RunRow, source: DaemonClient | None = None, *, progress: ByteProgress = lambda _: None
) -> Path:
    """Return the trace of a run as a file of this machine; otherwise as :func:`local_copy`.

    Without ``source`` a path is of this machine, and taken as it is.
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
                _bring(trace, source, part, progress)
                move_durably(part, target)
            part.unlink(missing_ok=True)
    except (OSError, ValueError) as error:
        raise TraceUnavailable(
            f"the trace of {trace.run} cannot be brought here: {error}"
        ) from error


def _bring(
    trace: TraceReference, source: DaemonClient | None, part: Path, progress: ByteProgress
) -> None:
    """Make ``part`` all of the trace."""
    if is_url(trace.location) or (source is None and Path(trace.location).is_file()):
        copy_between(trace.location, str(part))
        progress(trace.size)
    elif source is None:
        raise TraceUnavailable(
            f"the trace of {trace.run} lies on another machine or is gone ({trace.location}): "
            "name its daemon with --connect"
        )
    else:
        download(part, lambda offset: source.get(trace.sha256, offset, trace.run), progress)
    if not matches_digest(part, trace.size, trace.sha256):
        os.truncate(part, 0)
        raise ValueError(f"what comes from {trace.location} is not what was recorded")


def is_url(location: str) -> bool:
    """Whether a trace lies at a URL rather than at a path."""
    return "://" in location


def check_store_url(url: str) -> str:
    """Return the URL of a store without a slash at its end; raises ``ValueError`` for none."""
    from fsspec import available_protocols

    parts = urlsplit(url)
    if not is_url(url) or parts.scheme not in available_protocols():
        raise ValueError(f"{url!r} is no store: write file:///mnt/traces or s3://bucket/folder")
    if parts.scheme == "file" and (parts.netloc or len(parts.path) < 2):
        raise ValueError(f"{url!r} has no absolute path: write file:///mnt/traces")
    if parts.password is not None or parts.query:
        raise ValueError("the URL has credentials in it: they belong into the environment")
    return url.rstrip("/")


def copy_between(source: str, target: str) -> None:
    """Copy a file from a path or URL to another, for good; raises ``OSError``."""
    import fsspec

    try:
        with fsspec.open(source) as taken, fsspec.open(target, "wb") as given:
            shutil.copyfileobj(taken, given)
        if target.startswith("file://"):
            _sync(Path(target.removeprefix("file://")))
    except Exception as error:  # the library behind a URL may raise anything
        url = source if is_url(source) else target
        why = getattr(error, "strerror", "") or repr(error)
        raise OSError(f"{url} cannot be used from here: {why}") from error


def _sync(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
    sync_directory(path.parent)


@dataclass(frozen=True, slots=True)
class Marker:
    """Contents of the marker: the ``identity`` of the directory, and the ``era`` of its ledger."""

    identity: str
    era: str


def write_marker(paths: StatePaths, era: str) -> Marker:
    """Write a marker nobody can know from elsewhere, and return it.

    The directory keeps its identity for good. The era is new with each start of a daemon: a copy of
    the directory on another machine, under the same path, is not mistaken for it. Raises
    ``OSError``.
    """
    known = read_marker(paths)
    identity = known.identity if known is not None else secrets.token_hex(8)
    marker = Marker(identity, era)
    write_atomically(paths.marker, codec.to_json(marker), mode=0o600)
    return marker


def read_marker(paths: StatePaths) -> Marker | None:
    """Return the marker in a directory, or ``None`` when there is none that can be read."""
    try:
        marker = codec.from_json(Marker, paths.marker.read_bytes())
    except (OSError, ValueError):
        return None
    return marker if is_id(marker.identity) else None
