"""A map over many items by forked processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Final, TypeVar

from daemon.batch.errors import DaemonError
from daemon.model.execution import available_cores
from daemon.supervision.child import die_with_parent

T = TypeVar("T")
R = TypeVar("R")

_CHUNK: Final = 8
"""Items a child takes at a time: fewer where that leaves one without work at the end."""
_FEW: Final = 8
"""This many traces are read sooner than other processes are started."""


def parallel_map(
    task: Callable[[T], R],
    items: Sequence[T],
    *,
    doing: str,
    processes: int | None = None,
    always_forked: bool = False,
) -> Iterator[R]:
    """Return ``task`` of each item, in order, by forked children where there are many items.

    ``processes`` defaults to one per core. With ``always_forked`` no task runs in this process,
    however few there are: one that starts threads would leave it unable to fork. What must be
    loaded or compiled should be before: children have it in memory then. Raises
    :class:`daemon.batch.errors.DaemonError`, saying what it was ``doing``, when a child dies.
    """
    count = min(processes or available_cores(), len(items))
    if not items or (not always_forked and (count < 2 or len(items) <= _FEW)):
        yield from map(task, items)
        return
    # Forked: children start with oracles loaded and kernels compiled, not each by itself.
    context = multiprocessing.get_context("fork")
    executor = ProcessPoolExecutor(
        count, mp_context=context, initializer=_prepare_child, initargs=(os.getpid(),)
    )
    try:
        yield from executor.map(task, items, chunksize=min(_CHUNK, 1 + len(items) // (4 * count)))
    except BrokenProcessPool as error:
        raise DaemonError(
            f"a process {doing} died, by lack of memory or by an oracle that plugs in"
        ) from error
    finally:
        executor.shutdown(cancel_futures=True)


def _prepare_child(parent: int) -> None:
    """Leave Ctrl-C to the process that people see, and end with it however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent(parent)
