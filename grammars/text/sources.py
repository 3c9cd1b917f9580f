"""Files that people name: whether they are there, and their text, within bounds.

What a file names may be a folder, a pipe that never ends, a name too long for any file system or a
circle of links: none of that is an error of the machine, and all of it is said to people.
"""

from __future__ import annotations

import errno
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import islice
from pathlib import Path
from typing import Final

from grammars.text.diagnostics import InputError, Where, did_you_mean

MAX_BYTES: Final = 8 * 1024 * 1024
"""A file written by a person is never larger than this; a larger one is refused."""
_JSONLD: Final = (".jsonld", ".json")
_MOST_NEIGHBOURS: Final = 2_000
_REASONS: Final = {
    errno.ENAMETOOLONG: "its name is too long",
    errno.ELOOP: "its links lead in a circle",
    errno.EACCES: "permission denied",
}


_read: ContextVar[dict[Path, None] | None] = ContextVar("read", default=None)
"""The files that are read, where somebody wants to know."""


@contextmanager
def recording_reads() -> Iterator[dict[Path, None]]:
    """Give the files that people named and that are read meanwhile by this thread, in order."""
    found: dict[Path, None] = {}
    token = _read.set(found)
    try:
        yield found
    finally:
        _read.reset(token)


@contextmanager
def not_recording() -> Iterator[None]:
    """Read files meanwhile that say nothing about what is made: they are not recorded."""
    token = _read.set(None)
    try:
        yield
    finally:
        _read.reset(token)


def note_read(path: Path) -> None:
    """Say that a file is going to be read."""
    read = _read.get()
    if read is not None:
        read[path] = None


def is_file(path: Path) -> bool:
    """Return whether there is an ordinary file of a name, however that name looks."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        # Longer than the file system takes, or with a zero byte: no file has such a name.
        return False


def is_folder(path: Path) -> bool:
    """Return whether there is a folder of a name, however that name looks."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def is_jsonld(path: Path) -> bool:
    """Return whether a path is a JSON-LD file by its ending, or a folder that holds some."""
    return bool(model_files(path)) if is_folder(path) else path.suffix in _JSONLD


def model_files(path: Path) -> tuple[Path, ...]:
    """Return the file that a path names, or the files of a folder in order.

    Of a folder these are the ``.json`` files, otherwise the ``.jsonld`` files: an export of ours
    has the same plan both ways.
    """
    if not is_folder(path):
        return (path,)
    for ending in reversed(_JSONLD):
        found = sorted(file for file in path.iterdir() if file.suffix == ending)
        if found:
            return tuple(found)
    return ()


def names_in(folder: Path, wanted: Callable[[Path], bool] = is_file) -> list[str]:
    """Return names in a folder, those of files; none when it cannot be read."""
    try:
        return [path.name for path in islice(folder.iterdir(), _MOST_NEIGHBOURS) if wanted(path)]
    except (OSError, ValueError):
        return []


def _inside(folder: Path) -> str:
    """Suggest the campaign that lies in a folder, which is what people mean by it."""
    campaign = folder / "campaign.yaml"
    return f'did you mean "{campaign}"?' if is_file(campaign) else ""


def refuse_unreadable(path: str | Path, what: str = "the file", most: int = MAX_BYTES) -> None:
    """Raise :class:`InputError` for what is no ordinary file of at most ``most`` bytes.

    A pipe or a device may have no end. ``what`` the file is, such as ``the plan``, is said.
    """
    file, where = Path(path), Where(str(path))
    note_read(file)
    try:
        status = file.stat()
    except FileNotFoundError:
        raise InputError.at(where, "no such file", _neighbours(file)) from None
    except (OSError, ValueError) as error:
        raise InputError.at(where, f"{what} cannot be read: {reason_of(error)}") from error
    if stat.S_ISDIR(status.st_mode):
        raise InputError.at(where, "is a folder, expected a file", _inside(file))
    if not stat.S_ISREG(status.st_mode):
        raise InputError.at(where, "is no ordinary file", "copy what it holds into one")
    if status.st_size > most:
        size = f"{most >> 20} MiB" if most >= 1 << 20 else f"{most} bytes"
        raise InputError.at(where, f"is larger than {size}")


def read_text(path: str | Path, what: str = "the file", *, keep_line_ends: bool = False) -> str:
    """Return the text (UTF-8) of a file that a person wrote, its lines ended by ``\\n``.

    ``keep_line_ends`` leaves them as they are. Raises :class:`InputError` when it cannot be read.
    """
    refuse_unreadable(path, what)
    try:
        # Editors on Windows begin a file with a byte order mark.
        newline = "" if keep_line_ends else None
        with Path(path).open(encoding="utf-8-sig", newline=newline) as file:
            return file.read()
    except UnicodeDecodeError as error:
        raise InputError.at(
            Where(str(path)), f"{what} is not UTF-8 text (byte {error.start})", "save it as UTF-8"
        ) from None
    except OSError as error:
        raise InputError.at(
            Where(str(path)), f"{what} cannot be read: {reason_of(error)}"
        ) from error


def reason_of(error: OSError | ValueError) -> str:
    """Return in a few words why a file cannot be reached."""
    number = getattr(error, "errno", None)
    return _REASONS.get(number or 0) or getattr(error, "strerror", None) or str(error)


def _neighbours(file: Path) -> str:
    folder = file.parent
    if not is_folder(folder):
        return f"there is no folder {folder}"
    return did_you_mean(file.name, names_in(folder))


def shipped_folder() -> Path:
    """Return the folder of the campaigns, robots and systems that ship with the project."""
    # The packages of the project lie beside each other, in a checkout and installed.
    return Path(__file__).resolve().parents[2] / "campaigns"
