"""The process that compiles what runs need and the disk does not have, once on a machine.

Not the fork server, in which nothing else could begin meanwhile, and whose memory is that of all
runs: it loads afterwards what this one has left on the disk. Not the runs, since two that begin at
the same time would each compile the same.
"""

from __future__ import annotations

import fcntl
import os
import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from daemon.supervision.guardian import guard

# The first byte of what it tells its worker.
WAITING: Final = b"W"
"""Another process compiles into the same cache just now."""
COUNT: Final = b"C"
"""Then two numbers: kernels that are there, and about how many there will be."""
READY: Final = b"R"
FAILED: Final = b"F"
_LONGEST_WORDS: Final = 16_000


def compile_kernels(niceness: int, wire: Connection) -> None:
    """Compile the kernels that the fork server has just not found, and tell how far that is."""
    # The fork server has loaded it, at a moment it chooses itself: nobody else may.
    from daemon.batch import forkserver_preload

    if not forkserver_preload.missing:
        wire.send_bytes(READY)
        return
    try:
        # It ends with its worker, as runs do.
        guard(niceness=niceness)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        os.setpriority(os.PRIO_PROCESS, 0, max(niceness, os.getpriority(os.PRIO_PROCESS, 0)))
        # Not loaded by the fork server, which has no need of it.
        from daemon.batch.numba_cache import numba_cache_folder

        with compiling_alone(numba_cache_folder(), wire):
            _compile(forkserver_preload.missing, wire)
    except Exception:
        # Nothing a run could help: the worker gives back what needs these kernels.
        words = traceback.format_exc()[-_LONGEST_WORDS:]
        wire.send_bytes(FAILED + words.encode("utf-8", "replace"))
        return
    wire.send_bytes(READY)


@contextmanager
def compiling_alone(folder: Path, wire: Connection) -> Iterator[None]:
    """Wait until no other process compiles into ``folder``, and say so.

    What it has left there is loaded afterwards, not compiled once more.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "kernels.lock").open("ab")
    except OSError:
        yield  # nobody can be waited for: a file system that cannot be written
        return
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            wire.send_bytes(WAITING)
            fcntl.flock(lock, fcntl.LOCK_EX)
        except OSError:
            pass  # a file system without locks
        yield


def _compile(rooms: list[str], wire: Connection) -> None:
    from daemon.model.kernels import count_kernels, count_ready_kernels, counting_compiled

    modules = [import_module(room) for room in rooms]
    expected = count_kernels(rooms)

    def report(compiled: int) -> None:
        # Those that were on the disk are there as well.
        there = max(compiled, count_ready_kernels(rooms))
        wire.send_bytes(COUNT + f"{there} {max(there, expected)}".encode())

    report(0)
    with counting_compiled(report):
        for module in modules:
            module.warm_up()
