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
"""Most items that a child takes at a time; fewer if a child would have no work at the end."""
_FEW: Final = 8
"""Number of items up to which the start of other processes takes longer than the work."""


def parallel_map(
    task: Callable[[T], R],
    items: Sequence[T],
    *,
    doing: str,
    processes: int | None = None,
    always_forked: bool = False,
) -> Iterator[R]:
    """Return ``task`` of each item, in order; forked children work on many items.

    ``processes`` defaults to one per core. With ``always_forked`` no task runs in this process, not
    even a single one: a task that starts threads would leave it unable to fork. Load and compile
    everything before the call, so that children share it. Raises
    :class:`daemon.batch.errors.DaemonError`, with the words of ``doing``, if a child dies.
    """
    count = min(processes or available_cores(), len(items))
    if not items or (not always_forked and (count < 2 or len(items) <= _FEW)):
        yield from map(task, items)
        return
    # Forked children inherit loaded oracles and compiled kernels.
    context = multiprocessing.get_context("fork")
    executor = ProcessPoolExecutor(
        count, mp_context=context, initializer=_prepare_child, initargs=(os.getpid(),)
    )
    try:
        yield from executor.map(task, items, chunksize=min(_CHUNK, 1 + len(items) // (4 * count)))
    except BrokenProcessPool as error:
        raise DaemonError(
            f"a process {doing} died, by lack of memory or by a plug-in oracle"
        ) from error
    finally:
        executor.shutdown(cancel_futures=True)


def _prepare_child(parent: int) -> None:
    """Leave Ctrl-C to the parent, and end with it in any case."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent(parent)
