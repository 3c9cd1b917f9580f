"""Files that are there as a whole or not at all, also after a power cut.

Every part of the product that keeps something for others to read writes it this way. Folders
that other processes clear meanwhile are listed without surprise.
"""

from __future__ import annotations

import errno
import glob
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def write_atomically(
    path: Path, data: bytes, *, durable: bool = True, mode: int | None = None
) -> None:
    """Write ``data`` so that ``path`` holds either all of it or what it held before.

    Also after a power cut, unless ``durable`` is off: that saves waiting for the disk where
    what is written can be made again. ``mode`` are the permissions of the file. Raises ``OSError``.
    """
    with replacing(path, mode=mode, durable=durable) as temporary:
        temporary.write_bytes(data)


@contextmanager
def replacing(path: Path, *, mode: int | None = None, durable: bool = True) -> Iterator[Path]:
    """Give the path of a file to be written, beside ``path``, that takes its place afterwards.

    When the block raises, ``path`` keeps what it held and nothing is left. ``mode`` are the
    permissions of the new file: with them it is there, empty, when the block begins.
    """
    # The name is random, not the process id: two threads may write the same file. The doctor
    # knows what a killed process left behind by the dot and the suffix.
    temporary = path.with_name(f".{path.name}.{os.urandom(4).hex()}.tmp")
    try:
        if mode is not None:
            # Created with them, not given them later: nobody else ever reads a byte of it.
            os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode | stat.S_IWUSR))
        yield temporary
        if mode is not None:
            temporary.chmod(mode)
        if durable:
            move_durably(temporary, path)
        else:
            temporary.replace(path)
    finally:
        # Also when all went well: of two hard links to one file, rename(2) removes neither.
        temporary.unlink(missing_ok=True)


def move_durably(source: Path, target: Path) -> None:
    """Give a complete file its name in the same file system, for good; raises ``OSError``."""
    # First the content: a rename may reach the disk before the data of the file does, and then a
    # power cut leaves an empty file under the good name. Then the folder, for the rename itself.
    with source.open("rb") as file:
        os.fsync(file.fileno())
    source.replace(target)
    sync_directory(target.parent)


def sync_directory(folder: Path) -> None:
    """Make renames and new names in ``folder`` durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def private_folder(folder: Path) -> Path:
    """Make ``folder`` unless it is there, ours alone; raises ``OSError`` where it cannot be."""
    folder.mkdir(mode=0o700, exist_ok=True)
    # Below /tmp somebody else may have been faster, with a folder or a link to one of ours.
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
        raise PermissionError(errno.EPERM, "belongs to somebody else", str(folder))
    if found.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        folder.chmod(0o700)
    return folder


def matching_paths(folder: Path, pattern: str) -> Iterator[Path]:
    """Yield the paths below ``folder`` that match, like ``Path.glob``; ``**`` follows links.

    Folders that others remove meanwhile, or that cannot be read, count as empty.
    """
    # ``Path.glob`` of Python before 3.13 raises ``FileNotFoundError`` for them.
    names = glob.iglob(pattern, root_dir=folder, recursive=True, include_hidden=True)  # noqa: PTH207
    for name in names:
        yield folder / name
