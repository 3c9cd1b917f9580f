"""Folders of running stacks, with the locks of their holders, and the remains of earlier ones.

    scenario-<uid>/stacks/lock              held while a folder is made or all are looked at
    scenario-<uid>/stacks/<token>/lock      held as long as the stack's supervisor or holder lives
    scenario-<uid>/stacks/<token>/stack.json

A folder whose lock is free belongs to a supervisor that was killed. The next stack that starts on
this machine ends it.
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
    """Facts by which others can end a stack; ``engine`` and ``name`` are those of a container."""

    domain: int
    engine: str = ""
    name: str = ""

    def write(self, folder: Path) -> None:
        """Leave it in the stack's folder; raises ``OSError``."""
        write_atomically(folder / _RECORD, codec.to_json(self), durable=False)

    @classmethod
    def read(cls, folder: Path) -> StackRecord | None:
        """Return the record in a folder, ``None`` while the stack has not been started."""
        try:
            return codec.from_json(cls, (folder / _RECORD).read_bytes())
        except (OSError, ValueError):
            return None


def make_folder(root: Path) -> tuple[Path, IO[str]]:
    """Make the folder of a new stack; its name is the token, the file its lock, held.

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
    """End a stack that has no supervisor any more, and remove its folder."""
    end_marked(folder.name)
    record = StackRecord.read(folder)
    if record is not None and record.engine:
        end_container(record.engine, record.name)
    elif record is not None:
        remove_shared_memory(record.domain)
    # Files that a container made as root stay; they do no harm.
    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _alone(root: Path) -> Iterator[None]:
    with (root / _LOCK).open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _try_lock(folder: Path) -> IO[str] | None:
    try:
        # It may be missing: a supervisor was killed while it removed its folder.
        lock = (folder / _LOCK).open("a")
    except FileNotFoundError:
        return None  # the folder is gone by now
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        return None
    return lock
