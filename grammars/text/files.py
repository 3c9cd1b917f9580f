"""Atomic file writes, durable across a power cut, folders, and listings despite removal.

Every part of the product that stores data for other readers writes it through this module.
"""

from __future__ import annotations

import errno
import glob
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

import platformdirs


def write_atomically(
    path: Path, data: bytes, *, durable: bool = True, mode: int | None = None
) -> None:
    """Write ``data`` so that ``path`` holds either all of it or its previous content.

    This holds after a power cut too, unless ``durable`` is off: files that can be made again need
    not wait for the disk. ``mode`` sets the permissions. Raises ``OSError``.
    """
    with replacing(path, mode=mode, durable=durable) as temporary:
        temporary.write_bytes(data)


@contextmanager
def replacing(path: Path, *, mode: int | None = None, durable: bool = True) -> Iterator[Path]:
    """Yield the path of a temporary file beside ``path`` that replaces it after the block.

    If the block raises, ``path`` keeps its content and the temporary file is removed. With
    ``mode``, its permissions, the file exists (empty) when the block begins.
    """
    # A random name, because two threads may write the same file. The doctor recognises files of
    # killed processes by the dot and the suffix.
    temporary = path.with_name(f".{path.name}.{os.urandom(4).hex()}.tmp")
    try:
        if mode is not None:
            # Set at creation, not later, so that no other user ever reads a byte of it.
            os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode | stat.S_IWUSR))
        yield temporary
        if mode is not None:
            temporary.chmod(mode)
        if durable:
            move_durably(temporary, path)
        else:
            temporary.replace(path)
    finally:
        # Needed after success too: rename(2) between two hard links of one file removes neither.
        temporary.unlink(missing_ok=True)


def move_durably(source: Path, target: Path) -> None:
    """Rename a complete file durably within its file system; raises ``OSError``."""
    # Sync the content first: if the rename reaches the disk before the data, a power cut leaves an
    # empty file under the final name. Then sync the folder for the rename itself.
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
    """Create ``folder`` if needed and make it private to this user; raises ``OSError``."""
    folder.mkdir(mode=0o700, exist_ok=True)
    # Below /tmp another user may have created the folder first, or a link to one of ours.
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
        raise PermissionError(errno.EPERM, "belongs to somebody else", str(folder))
    if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        folder.chmod(0o700)
    return folder


def user_folder(kind: Literal["cache", "config", "state"]) -> Path:
    """Return the folder of a kind of files of this user.

    Without a home directory, caches go below the folder of temporary files, all else to the state
    directory. Raises ``OSError`` if that is unknown too.
    """
    with suppress(RuntimeError):
        folder = Path(getattr(platformdirs, f"user_{kind}_path")("scenario"))
        if folder.is_absolute():  # as in versions without this error
            return folder
    if kind == "cache":
        import tempfile

        return private_folder(Path(tempfile.gettempdir()) / f"scenario-{os.getuid()}") / kind
    if state := os.environ.get("SCENARIO_STATE"):
        return Path(state).absolute() / kind
    message = f"there is no home directory (HOME is not set, user {os.getuid()} is unknown): "
    message += "set HOME, or SCENARIO_STATE and XDG_CACHE_HOME"
    raise FileNotFoundError(errno.ENOENT, message)


def written_path(path: Path | str) -> Path:
    """Return the absolute path that a person wrote, perhaps with ``~``; raises ``OSError``."""
    try:
        return Path(path).expanduser().absolute()
    except RuntimeError:
        message = f"the home directory in {path} is unknown"
        raise FileNotFoundError(errno.ENOENT, message) from None


def matching_paths(folder: Path, pattern: str) -> Iterator[Path]:
    """Yield the paths below ``folder`` that match, like ``Path.glob``; ``**`` follows links.

    Unreadable folders and folders removed meanwhile count as empty.
    """
    # ``Path.glob`` of Python before 3.13 raises ``FileNotFoundError`` for them.
    names = glob.iglob(pattern, root_dir=folder, recursive=True, include_hidden=True)  # noqa: PTH207
    for name in names:
        yield folder / name
