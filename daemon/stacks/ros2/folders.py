"""Folders of running stacks, with the locks of their holders, and remains of earlier stacks.

    scenario-<uid>/stacks/lock              held while a folder is made or all are searched
    scenario-<uid>/stacks/<token>/lock      held as long as the stack's supervisor or holder lives
    scenario-<uid>/stacks/<token>/stack.json

A folder with a free lock belongs to a killed supervisor. The next stack that starts on this machine
ends it.
"""

from __future__ import annotations

import fcntl
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

from daemon.supervision.remains import end_container, end_marked
from daemon.supervision.shared_memory import remove_shared_memory
from grammars.text import codec
from grammars.text.files import write_atomically

_LOCK: Final = "lock"
_RECORD: Final = "stack.json"


@dataclass(frozen=True, slots=True)
class StackRecord:
    """Data for ending a stack from outside; ``engine`` and ``name`` are those of a container."""

    domain: int
    engine: str = ""
    name: str = ""

    def write(self, folder: Path) -> None:
        """Write it into the stack's folder; raises ``OSError``."""
        write_atomically(folder / _RECORD, codec.to_json(self), durable=False)

    @classmethod
    def read(cls, folder: Path) -> StackRecord | None:
        """Return the record in a folder, ``None`` before the stack's start."""
        try:
            return codec.from_json(cls, (folder / _RECORD).read_bytes())
        except (OSError, ValueError):
            return None


def make_folder(root: Path) -> tuple[Path, IO[str]]:
    """Make the folder of a new stack, named by its token; return it with its held lock.

    Raises ``OSError``.
    """
    with _alone(root):
        folder = root / secrets.token_hex(8)
        folder.mkdir(mode=0o700)
        lock = (folder / _LOCK).open("w")
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return folder, lock


def end_remains(root: Path) -> None:
    """End the stacks of killed supervisors on this machine; raises ``OSError``."""
    with _alone(root):
        remains = [(folder, _try_lock(folder)) for folder in root.iterdir() if folder.is_dir()]
    for folder, lock in remains:
        if lock is not None:
            with lock:
                end_stack(folder)


def end_stack(folder: Path) -> None:
    """End a stack without a supervisor, and remove its folder."""
    end_marked(folder.name)
    record = StackRecord.read(folder)
    if record is not None and record.engine:
        end_container(record.engine, record.name)
    elif record is not None:
        remove_shared_memory(record.domain)
    # Files that a container made as root stay, without harm.
    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _alone(root: Path) -> Iterator[None]:
    with (root / _LOCK).open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _try_lock(folder: Path) -> IO[str] | None:
    try:
        # It may be missing if a supervisor was killed while it removed its folder.
        lock = (folder / _LOCK).open("a")
    except FileNotFoundError:
        return None  # the folder is gone by now
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        return None
    return lock
