"""Parts of traces as they travel: base64 text with the digest of the bytes."""

from __future__ import annotations

import binascii
import hashlib
import os
from contextlib import suppress
from pathlib import Path

from daemon.places import sync_directory


def packed(data: bytes) -> tuple[str, str]:
    """Return bytes as text, and their SHA-256."""
    text = binascii.b2a_base64(data, newline=False).decode("ascii")
    return text, hashlib.sha256(data).hexdigest()


def unpacked(text: str, digest: str) -> bytes:
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


def add_part(path: Path, offset: int, data: bytes) -> None:
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


def size_of(path: Path) -> int:
    """Return how many bytes of a file there are, 0 while there is none."""
    with suppress(FileNotFoundError):
        return path.stat().st_size
    return 0


def accept_part(part: Path, whole: Path, sha256: str, *, mode: int | None = None) -> bool:
    """Give a file that is complete its name, for good, and tell whether it is the one meant.

    One of another digest is removed. Raises ``OSError``.
    """
    part.touch(mode=0o600)
    if sha256_of(part) != sha256:
        part.unlink()
        return False
    with part.open("rb") as file:
        os.fsync(file.fileno())
    if mode is not None:
        part.chmod(mode)
    part.replace(whole)
    sync_directory(whole.parent)
    return True


def make_folder(folder: Path) -> None:
    """Make a folder for its owner in one that there is, for good; raises ``OSError``."""
    if not folder.is_dir():
        folder.mkdir(mode=0o700, exist_ok=True)
        sync_directory(folder.parent)


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file; raises ``OSError``."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_file_of(path: Path, size: int, sha256: str) -> bool:
    """Whether there is a file of that size and digest."""
    try:
        return path.is_file() and path.stat().st_size == size and sha256_of(path) == sha256
    except OSError:
        return False
