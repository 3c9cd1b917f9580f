"""The process above that of a run: everything the run starts ends with it, however it ends.

    holder (such as a worker) ── … ── guardian ── the run ── its children and their orphans

The guardian is the subreaper (prctl(2)) of the run: orphans become its children, in any session
and process group. It ends everything when the run has ended, when its own parent is gone, when its
holder hangs up, or on SIGTERM. It then exits as the run did, with the same code or by the same
signal. A guardian that is killed takes the run with it; the next subreaper gets the orphans.

The guardian copies the run's output into a bounded file; the run never waits for that.
"""

from __future__ import annotations

import faulthandler
import os
import resource
import signal
import socket
from contextlib import suppress
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Final, NoReturn

from .child import adopt_orphans, die_with_parent
from .event_loop import HUNG_UP, EventLoop
from .output_file import OutputFile
from .remains import KILL_LIMIT, end_children

_ENDING_SIGNALS: Final = (signal.SIGTERM, signal.SIGQUIT)
_IGNORED_SIGNALS: Final = (signal.SIGINT, signal.SIGHUP)
"""Signals of terminals: the holder decides whether the run ends."""
_HANDLED: Final = (*_ENDING_SIGNALS, *_IGNORED_SIGNALS, signal.SIGCHLD)


def guard(output: Path | None = None, *, lifeline: socket.socket | None = None) -> None:
    """Put a guardian above this process; return in the run's process, below it.

    Call this in a forked process that has started nothing. The run ends with that process's
    parent, and when the other end of ``lifeline`` is shut down or gone. Descriptors 1 and 2 then
    print to ``output``.

    Raises ``OSError`` when the system gives no process, pipe or file.
    """
    parent = os.pidfd_open(os.getppid())
    pipe = None if output is None else (*os.pipe(), OutputFile(output))
    # Keep signals to the parent's group away from the guardian.
    with suppress(PermissionError):  # it leads a session
        os.setpgid(0, 0)
    adopt_orphans()
    # Block signals until their handlers exist, so that none is lost.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, _HANDLED)
    guardian = os.getpid()
    try:
        run = os.fork()
    except OSError:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        raise
    if run:
        watch = _Guardian(run)
        watch.watch(parent, watch.end)
        if lifeline is not None:
            watch.watch(lifeline.fileno(), watch.end, HUNG_UP)
        if pipe is not None:
            reading, writing, printed = pipe
            os.close(writing)
            watch.take_output(reading, printed)
        watch.live()
    die_with_parent(guardian)
    os.setpgid(0, 0)
    os.close(parent)
    if pipe is not None:
        reading, writing, printed = pipe
        os.dup2(writing, 1)
        os.dup2(writing, 2)
        os.close(writing)
        os.close(reading)
        printed.close()
    signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def end_guarded(process: BaseProcess) -> None:
    """End a run through its guardian ``process``, and wait until all of it has ended."""
    process.terminate()
    # A stopped guardian does not react; the run dies with it.
    process.join(2 * KILL_LIMIT)
    if process.is_alive():
        process.kill()
        process.join()


class _Guardian(EventLoop):
    """The life of the guardian of ``run``."""

    def __init__(self, run: int) -> None:
        super().__init__()
        self._run = run
        self._code: int | None = None
        for number in _ENDING_SIGNALS:
            signal.signal(number, self.end)
        for number in _IGNORED_SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _HANDLED)

    def live(self) -> NoReturn:
        """Watch until the run has ended or is to end; end its remains, and exit as it did."""
        try:
            # Exit as the run did, but without a core or traceback of our own.
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            faulthandler.disable()
            while self._code is None and not self.ending:
                self.turn()
            end_children(os.getpid(), reap=self.reap)
            self.drain()
        finally:
            # After any error too: the run dies with this process, its parent.
            self._leave()

    def child_ended(self, process: int, code: int) -> None:
        """Note the end of the run."""
        if process == self._run:
            self._code = code

    def _leave(self) -> NoReturn:
        code = 1 if self._code is None or self.ending else self._code
        if code < 0:
            # The parent then sees the signal that killed the run.
            signal.set_wakeup_fd(-1)
            with suppress(OSError):  # SIGKILL has no handler
                signal.signal(-code, signal.SIG_DFL)
            os.kill(os.getpid(), -code)
        os._exit(code if code >= 0 else 1)
