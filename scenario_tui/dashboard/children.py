"""One child process for work that needs large libraries, which takes along what it loaded.

Sampling signals loads what judges: numba, scipy and shapely, and what they keep. In the process of
the dashboard that would stay for as long as it is open: 245 MB with one run of the published
building, 120 with what the child hands over. To check a campaign loads its languages, another
100 MB. The child stays for a minute after the last call, because to read a trace takes 0.05 CPU s
and to load what reads it 1.0.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from multiprocessing.connection import wait
from types import ModuleType
from typing import Final, ParamSpec, TypeVar

from daemon.batch.errors import DaemonError

P = ParamSpec("P")
T = TypeVar("T")

IDLE: Final = 60.0
"""Seconds after the last call until the child leaves."""
_LARGE: Final = 1 << 17
"""Bytes of an array whose memory goes back to the system at once."""


class Children:
    """Runs functions in one child process, there when the first one is called; any thread."""

    def __init__(self, idle: float = IDLE) -> None:
        self._idle = idle
        self._executor: ProcessPoolExecutor | None = None
        self._rest: threading.Timer | None = None
        self._closed = False
        self._turn = threading.Lock()

    def run(self, function: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Return what a function of a module returns in the child; raises what it raises.

        A child that was killed, for its memory for example, is replaced once. Raises
        :class:`daemon.batch.errors.DaemonError` if the next one ends as well.
        """
        try:
            try:
                return self._submit(function, *arguments, **options).result()
            except BrokenProcessPool:
                return self._submit(function, *arguments, **options).result()
        except BrokenProcessPool as error:
            message = "the process that does this for the dashboard ended; is there enough memory?"
            raise DaemonError(message) from error

    def close(self) -> None:
        """End the child at once: nobody waits for its work any more."""
        self._closed = True
        if self._leave():
            for child in multiprocessing.active_children():
                child.kill()

    def _submit(
        self, function: Callable[P, T], *arguments: P.args, **options: P.kwargs
    ) -> Future[T]:
        with self._turn:
            if self._closed:
                raise DaemonError("the dashboard is being left")
            if self._rest is not None:
                self._rest.cancel()
            self._rest = threading.Timer(self._idle, self._leave)
            self._rest.daemon = True
            self._rest.start()
            with _terminal_spared():
                if self._executor is not None:
                    # Its child may have been killed.
                    with contextlib.suppress(BrokenProcessPool):
                        return self._executor.submit(function, *arguments, **options)
                from daemon.supervision.child import return_freed_memory

                # What a child sends is taken in by a thread, whose heap would keep what was freed:
                # 442 MB after 16 recordings of 3200 s, of which four are kept, instead of 208.
                return_freed_memory(_LARGE)
                context = multiprocessing.get_context("spawn")
                self._executor = ProcessPoolExecutor(1, context, _begin)
                return self._executor.submit(function, *arguments, **options)

    def _leave(self) -> bool:
        """Let the child end once its work is done; return whether there was one."""
        with self._turn:
            executor, self._executor = self._executor, None
        if executor is not None:
            executor.shutdown(wait=False)
        return executor is not None


@contextlib.contextmanager
def _terminal_spared() -> Iterator[None]:
    """Have processes start as they do outside of a dashboard.

    Textual puts a stream without a file in the place of standard error, and modules are not to be
    imported from the folder somebody works in. A child runs the script of its parent first, unless
    there is none: one that calls ``main()`` unguarded would open a dashboard in the child.
    """
    safe, main = os.environ.get("PYTHONSAFEPATH"), sys.modules["__main__"]
    os.environ["PYTHONSAFEPATH"] = "1"
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        with contextlib.redirect_stderr(sys.__stderr__):
            yield
    finally:
        sys.modules["__main__"] = main
        if safe is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = safe


def load_modules(*names: str) -> None:
    """Import modules, in a child before they are needed there."""
    for name in names:
        import_module(name)


def _begin() -> None:
    """Prepare the child: silent, deaf to the terminal, and never there without its parent."""
    # In a session of its own it does not hear Ctrl-C or that the terminal was closed.
    os.setsid()
    # Plug-ins may print, and the dashboard draws where that would go.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    # The child itself holds both ends of its queue and would wait there for ever.
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
