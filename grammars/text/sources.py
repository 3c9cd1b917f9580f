"""Bounded reading of files that people name.

A path may lead to a folder, an endless pipe or a circle of links, or be too long for the file
system. All of these are reported as errors of the input.
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
from grammars.text.file_kinds import kind_of_content, refuse_kind

MAX_BYTES: Final = 8 * 1024 * 1024
"""Largest accepted file [bytes]; files written by people are smaller."""
_JSONLD: Final = (".jsonld", ".json")
_MOST_NEIGHBOURS: Final = 2_000
_REASONS: Final = {
    errno.ENAMETOOLONG: "its name is too long",
    errno.ELOOP: "its links lead in a circle",
    errno.EACCES: "permission denied",
}


_read: ContextVar[dict[Path, None] | None] = ContextVar("read", default=None)
"""The files read so far, while :func:`recording_reads` is active."""


@contextmanager
def recording_reads() -> Iterator[dict[Path, None]]:
    """Yield a record of the named files that this thread reads during the block, in order."""
    reads: dict[Path, None] = {}
    token = _read.set(reads)
    try:
        yield reads
    finally:
        _read.reset(token)


@contextmanager
def not_recording() -> Iterator[None]:
    """Pause :func:`recording_reads`: files read in the block do not affect the result."""
    token = _read.set(None)
    try:
        yield
    finally:
        _read.reset(token)


def note_read(path: Path) -> None:
    """Record that a file is going to be read."""
    reads = _read.get()
    if reads is not None:
        reads[path] = None


def is_file(path: Path) -> bool:
    """Return whether a path is a regular file; ``False`` for impossible names."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        # Too long for the file system, or with a zero byte.
        return False


def is_folder(path: Path) -> bool:
    """Return whether a path is a folder; ``False`` for impossible names."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def is_jsonld(path: Path) -> bool:
    """Return whether a path has a JSON-LD ending or is a folder of JSON-LD files."""
    return bool(model_files(path)) if is_folder(path) else path.suffix in _JSONLD


def model_files(path: Path) -> tuple[Path, ...]:
    """Return the file that a path names, or the JSON-LD files of a folder in order.

    A folder with ``.json`` files yields only these: our export writes each plan with both endings.
    """
    if not is_folder(path):
        return (path,)
    for ending in reversed(_JSONLD):
        files = sorted(file for file in path.iterdir() if file.suffix == ending)
        if files:
            return tuple(files)
    return ()


def names_in(folder: Path, accept: Callable[[Path], bool] = is_file) -> list[str]:
    """Return the names of files in a folder; an empty list if the folder cannot be read."""
    try:
        return [path.name for path in islice(folder.iterdir(), _MOST_NEIGHBOURS) if accept(path)]
    except (OSError, ValueError):
        return []


def _inside(folder: Path) -> str:
    """Suggest the campaign in a folder: people name the folder and mean the campaign."""
    campaign = folder / "campaign.yaml"
    return f'did you mean "{campaign}"?' if is_file(campaign) else ""


def refuse_unreadable(path: str | Path, label: str = "the file", most: int = MAX_BYTES) -> None:
    """Raise :class:`InputError` unless ``path`` is a regular file of at most ``most`` bytes.

    Pipes and devices may have no end. ``label`` names the file in messages: ``the plan``.
    """
    file, where = Path(path), Where(str(path))
    note_read(file)
    try:
        status = file.stat()
    except FileNotFoundError:
        raise InputError.at(where, "no such file", _neighbours(file)) from None
    except (OSError, ValueError) as error:
        raise InputError.at(where, f"{label} cannot be read: {reason_of(error)}") from error
    if stat.S_ISDIR(status.st_mode):
        raise InputError.at(where, "is a folder, expected a file", _inside(file))
    if not stat.S_ISREG(status.st_mode):
        raise InputError.at(where, "is not a regular file", "copy its content into a file")
    if status.st_size > most:
        size = f"{most >> 20} MiB" if most >= 1 << 20 else f"{most} bytes"
        raise InputError.at(where, f"is larger than {size}")


def read_text(path: str | Path, label: str = "the file", *, keep_line_ends: bool = False) -> str:
    """Return the UTF-8 text of a file that a person wrote, with ``\\n`` as line end.

    ``keep_line_ends`` keeps other line ends. Raises :class:`InputError` for unreadable files.
    """
    refuse_unreadable(path, label)
    try:
        # Editors on Windows begin a file with a byte order mark.
        newline = "" if keep_line_ends else None
        with Path(path).open(encoding="utf-8-sig", newline=newline) as file:
            return file.read()
    except UnicodeDecodeError as error:
        if not error.object.lstrip().startswith(b"<"):  # launch files are XML
            refuse_kind(kind_of_content(error.object), Where(str(path)))
        raise InputError.at(*_not_unicode(error, str(path), label), "save it as UTF-8") from None
    except OSError as error:
        raise InputError.at(
            Where(str(path)), f"{label} cannot be read: {reason_of(error)}"
        ) from error


def _not_unicode(error: UnicodeDecodeError, file: str, label: str) -> tuple[Where, str]:
    """Return the place of the first byte that is not UTF-8, and the message about it."""
    before, byte = error.object[: error.start], error.object[error.start : error.start + 1]
    if error.object[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return Where(file), f"{label} is not UTF-8 text but UTF-16"
    sign = byte.decode("cp1252", "replace")
    line = before[before.rfind(b"\n") + 1 :].decode("utf-8")
    where = Where(file, before.count(b"\n") + 1, len(line) + 1)
    message = f'{label} is not UTF-8 text: byte {error.start} is "{sign}" in Windows-1252'
    return where, message


def reason_of(error: OSError | ValueError) -> str:
    """Return a short reason why a file cannot be reached."""
    number = getattr(error, "errno", None)
    return _REASONS.get(number or 0) or getattr(error, "strerror", None) or str(error)


def _neighbours(file: Path) -> str:
    folder = file.parent
    if not is_folder(folder):
        return f"there is no folder {folder}"
    return did_you_mean(file.name, names_in(folder))


def shipped_folder() -> Path:
    """Return the folder of the campaigns, robots and systems that ship with the project."""
    # The packages of the project are siblings, both in a checkout and installed.
    return Path(__file__).resolve().parents[2] / "campaigns"
