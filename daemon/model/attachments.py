"""Files that runs need: files of systems under test and maps.

They travel by digest, next to specifications. The submitter has them in a folder by digest
(:func:`user_files_folder`), as do the daemon and its workers. A system under test gets paths.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from grammars.text.files import replacing, user_folder
from grammars.text.sources import note_read

FILES_PARAMETER: Final = "files"
LARGEST_FILE: Final = 64 * 2**20
MOST_FILES: Final = 16
FILES_VARIABLE: Final = "SCENARIO_FILES"
"""Environment variable that names the folder of files to the process of a run."""
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}\Z")


class SutMissing(ValueError):  # noqa: N818  (reads as a sentence where it is raised)
    """A kind of system under test is not installed on this machine, or cannot be loaded.

    A ``ValueError``: the parameters that name the kind are wrong, not the daemon.
    """


def user_files_folder() -> Path:
    """Return the folder with the files of this user's runs, named by digest."""
    return user_folder("cache") / "files"


def attach_files(files: Mapping[str, Path]) -> dict[str, str]:
    """Store files, and return their digests by name.

    Raises ``ValueError`` for too many or too large files and for invalid names, ``OSError`` for
    unreadable ones.
    """
    if len(files) > MOST_FILES:
        raise ValueError(f"files: {len(files)} are too many, {MOST_FILES} may be attached")
    wrong = [name for name in files if not _NAME.match(name)]
    if wrong:
        raise ValueError(f"files: {wrong[0]!r} is not a valid name, use A-Z a-z 0-9 _ -")
    return {name: _store_file(name, path) for name, path in files.items()}


def _store_file(name: str, path: Path) -> str:
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError(f"files: {name} is not an ordinary file: {path}")
    size = status.st_size
    if size > LARGEST_FILE:
        limit = LARGEST_FILE // 2**20
        raise ValueError(f"files: {name} has {size / 2**20:.0f} MiB, the limit is {limit} MiB")
    note_read(path)
    return store_data(path.read_bytes())


def store_data(data: bytes) -> str:
    """Store data of a run in this user's folder; return its digest."""
    digest = hashlib.sha256(data).hexdigest()
    path = user_files_folder() / digest
    # Compare the size too: replace a copy that a full disk has cut.
    if not path.exists() or path.stat().st_size != len(data):
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with replacing(path, mode=0o400) as temporary:
            temporary.write_bytes(data)
    return digest


def stored_file(digest: str) -> Path:
    """Return the path of a file by digest in this process; the file may be missing."""
    return Path(os.environ.get(FILES_VARIABLE) or user_files_folder()) / digest
