"""One child process for work that needs large libraries; they leave with the child.

To sample signals, the child loads numba, scipy and shapely. In the process of the dashboard they
would stay for as long as it is open: 245 MB with one run of the published building, 120 MB with
the child's answer alone. The languages of a campaign are another 100 MB. The child stays for a
minute after the last call: to read a trace takes 0.05 CPU s, to load the libraries 1.0 CPU s.
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
    """Runs functions in one child process, which starts at the first call; for any thread."""

    def __init__(self, idle: float = IDLE) -> None:
        self._idle = idle
        self._executor: ProcessPoolExecutor | None = None
        self._rest: threading.Timer | None = None
        self._closed = False
        self._turn = threading.Lock()

    def run(self, function: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Call a function of a module in the child; return or raise its result.

        A child that was killed, for example for lack of memory, is replaced once. Raises
        :class:`daemon.batch.errors.DaemonError` if the next one ends as well.
        """
        try:
            try:
                return self._submit(function, *arguments, **options).result()
            except BrokenProcessPool:
                return self._submit(function, *arguments, **options).result()
        except BrokenProcessPool as error:
            message = "the child process of the dashboard ended; is there enough memory?"
            raise DaemonError(message) from error

    def close(self) -> None:
        """End the child at once; its work is not needed any more."""
        self._closed = True
        if self._leave():
            for child in multiprocessing.active_children():
                child.kill()

    def _submit(
        self, function: Callable[P, T], *arguments: P.args, **options: P.kwargs
    ) -> Future[T]:
        with self._turn:
            if self._closed:
                raise DaemonError("the dashboard is closing")
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

                # A thread receives the child's answers, and its heap would keep freed memory: 442
                # instead of 208 MB after 16 recordings of 3200 s, of which four are kept.
                return_freed_memory(_LARGE)
                context = multiprocessing.get_context("spawn")
                self._executor = ProcessPoolExecutor(1, context, _begin)
                return self._executor.submit(function, *arguments, **options)

    def _leave(self) -> bool:
        """Let the child end once its work is done; return True if there was one."""
        with self._turn:
            executor, self._executor = self._executor, None
        if executor is not None:
            executor.shutdown(wait=False)
        return executor is not None


@contextlib.contextmanager
def _terminal_spared() -> Iterator[None]:
    """Let processes start as they do outside of a dashboard.

    Textual replaces standard error by a stream without a file. The child must not import modules
    from the working folder, nor run the script of its parent: an unguarded ``main()`` there would
    open a dashboard in the child.
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
    """Import modules in a child, before they are needed there."""
    for name in names:
        import_module(name)


def _begin() -> None:
    """Prepare the child: silent, detached from the terminal, and ending with its parent."""
    # In its own session it gets neither Ctrl-C nor the hang-up of the terminal.
    os.setsid()
    # Plug-ins may print, which would destroy the screen.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    # The child itself holds both ends of its queue and would wait for ever.
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
