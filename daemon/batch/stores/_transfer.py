"""Files on the move over the bus: in verified parts, going on where it was after every break.

Parts travel as base64 text with the digest of their bytes: what travels is JSON. Whoever receives
says how much is there, whoever sends goes on from that; nothing else is remembered on either side,
so that either may die at any time. A file gets its name when it is whole and has its digest.
Daemon, workers and clients share this: scenes come whole, in one answer.
"""

from __future__ import annotations

import binascii
import hashlib
import os
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeAlias

from daemon.model.messages import DownloadChunk, UploadProgress
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

    def send_next(self, ask: Callable[[int, str, str], UploadProgress], count: int) -> int:
        """Send the next part of up to ``count`` bytes, or ask where to go on; returns its size.

        ``ask`` gets offset, text and digest of a part and returns the daemon's answer. Raises
        ``OSError`` and whatever ``ask`` raises.
        """
        data = b"" if self.offset is None else read_part(self.path, self.offset, count)
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
