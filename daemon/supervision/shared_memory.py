"""Shared memory that killed processes of Fast DDS leave behind, half a MiB each.

A participant has a segment ``fastdds_<id>``, or ``fastrtps_<id>`` in older releases, and ports
``fastdds_port<number>`` with a semaphore each. One in use has a file ``..._el`` or ``..._sl`` that
its user has locked with flock(2). Observed with the releases of Jazzy and Kilted.
"""

from __future__ import annotations

import fcntl
import os
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

_MEMORY: Final = Path("/dev/shm")
_FILE: Final = re.compile(
    r"(?P<name>fast(?:dds|rtps)_(?:port(?P<port>\d+)|[0-9a-f]{16}))(?:_[es]l)?"
)
_FIRST_PORT: Final = 7400
_PORTS: Final = 250
"""Ports of domain d begin at 7400 + 250 d (DDSI-RTPS 2.5, 9.6.2)."""
_AGE: Final = 2.0
"""Age after which an unlocked file counts as abandoned [s]: its user creates it before locking."""


def remove_shared_memory(domain: int) -> None:
    """Remove unused segments, and the ports of a domain without participants."""
    ports = range(_FIRST_PORT + _PORTS * domain, _FIRST_PORT + _PORTS * (domain + 1))
    names = set()
    for file in _MEMORY.glob("fast*"):
        match = _FILE.fullmatch(file.name)
        if match and (match["port"] is None or int(match["port"]) in ports):
            names.add(match["name"])
    for name in names:
        # Another process may remove them at the same time; other users' files stay.
        with suppress(OSError):
            if _is_abandoned(name):
                for part in (name, f"sem.{name}_mutex", f"{name}_sl", f"{name}_el"):
                    (_MEMORY / part).unlink(missing_ok=True)


def _is_abandoned(name: str) -> bool:
    files = [_MEMORY / part for part in (name, f"{name}_el", f"{name}_sl")]
    present = [file for file in files if file.exists()]
    states = [file.stat() for file in present]
    limit = time.time() - _AGE
    if any(state.st_uid != os.getuid() or state.st_mtime > limit for state in states):
        return False
    return all(map(_is_unlocked, present))


def _is_unlocked(file: Path) -> bool:
    with file.open("rb") as opened:
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
