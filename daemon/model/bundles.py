"""Files that are sent as one value: which are taken, and how they come to lie in a folder.

Their paths come from anybody: what is written here leads nowhere else.
"""

from __future__ import annotations

import base64
import binascii
import os
import re
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Final

from daemon.model.search import LARGEST_BUNDLE, LONGEST_PATH, BundledFile

MOST_FILES: Final = 2_000
_LONGEST_PART: Final = 200
_DEEPEST: Final = 40
_WRONG: Final = re.compile(r"[\x00-\x1f\x7f\\]")


def unpack_bundle(files: Sequence[BundledFile], folder: Path) -> None:
    """Write the files of a bundle into ``folder``, which is made, readable by its owner alone.

    Raises ``ValueError`` for what no bundle is: paths that lead elsewhere or twice to one place,
    too much of it, text that is no base64; then nothing is written. Raises ``OSError``, also when
    the folder is there already.
    """
    contents = checked_bundle(files)
    folder.mkdir(mode=0o700, parents=True)
    for path, data in contents.items():
        target = folder.joinpath(*PurePosixPath(path).parts)
        target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        descriptor = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as opened:
            opened.write(data)


def checked_bundle(files: Sequence[BundledFile]) -> dict[str, bytes]:
    """Return the content of each file by its path; raises ``ValueError`` for what no bundle is."""
    if not 1 <= len(files) <= MOST_FILES:
        raise ValueError(f"a bundle has 1 to {MOST_FILES} files, not {len(files)}")
    # Before anything is decoded: four characters are three bytes.
    if sum(len(file.data) for file in files) * 3 // 4 > LARGEST_BUNDLE + 3 * len(files):
        raise ValueError(f"a bundle has at most {LARGEST_BUNDLE >> 20} MiB")
    found: dict[str, bytes] = {}
    for file in files:
        _check_path(file.path)
        try:
            data = base64.b64decode(file.data, validate=True)
        except (binascii.Error, ValueError) as error:
            raise ValueError(f"{file.path} in the bundle is no base64") from error
        if file.path in found:
            raise ValueError(f"{file.path} is twice in the bundle")
        found[file.path] = data
    folders = {str(parent) for path in found for parent in PurePosixPath(path).parents}
    both = sorted(folders & found.keys())
    if both:
        raise ValueError(f"{both[0]} is a file and a folder in the bundle")
    return found


def _check_path(path: str) -> None:
    parts = path.split("/")
    sound = (
        0 < len(path) <= LONGEST_PATH
        and len(parts) <= _DEEPEST
        and not _WRONG.search(path)
        and all(part not in ("", ".", "..") for part in parts)
        and all(len(part.encode()) <= _LONGEST_PART for part in parts)
    )
    if not sound:
        raise ValueError(f"{path[:80]!r} is no path of a file in a bundle")


def read_bundle(folder: Path) -> tuple[BundledFile, ...]:
    """Return the files below a folder, in the order of their names; raises ``OSError``."""
    return tuple(
        BundledFile(
            path.relative_to(folder).as_posix(), base64.b64encode(path.read_bytes()).decode()
        )
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.is_symlink()
    )
