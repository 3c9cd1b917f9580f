"""The process above that of a run: whatever the run starts ends with it, however it ends.

    holder (a worker, say) ── … ── guardian ── the run ── what it starts, forks, leaves behind

The guardian is the subreaper (prctl(2)) of all that: whose parent ends becomes its child, in
whatever session and process group. It ends everything when the run has ended, when its own parent
is gone, when its holder hangs up, and when it is told to by SIGTERM; then it ends as the run did,
with the same code or by the same signal. A guardian that is killed takes the run with it, and
leaves what the run has left behind to the next subreaper.

What the run prints goes through the guardian into a file that is bounded, and nobody waits for it.
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

_TOLD_TO_END: Final = (signal.SIGTERM, signal.SIGQUIT)
_NOT_ITS_BUSINESS: Final = (signal.SIGINT, signal.SIGHUP)
"""Of terminals: what becomes of a run then, its holder decides."""
_HANDLED: Final = (*_TOLD_TO_END, *_NOT_ITS_BUSINESS, signal.SIGCHLD)


def guard(output: Path | None = None, *, lifeline: socket.socket | None = None) -> None:
    """Put a guardian above this process; returns in the run's process, below it.

    To be called by a forked process before it has started anything. The run ends with the parent
    of that, and when the other end of ``lifeline`` is shut down or gone. What is printed from then
    on, by descriptors, goes to ``output``.

    Raises ``OSError`` when there is no process, pipe or file to be had.
    """
    parent = os.pidfd_open(os.getppid())
    pipe = None if output is None else (*os.pipe(), OutputFile(output))
    # No signal to the group of the parent is for the guardian.
    with suppress(PermissionError):  # it leads a session
        os.setpgid(0, 0)
    adopt_orphans()
    # None is lost before there is somebody to handle it.
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
    """End a run by its guardian, which is ``process``, and wait until nothing of it is left."""
    process.terminate()
    # One that was stopped, say, does not hear it; then the run dies with it.
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
        for number in _TOLD_TO_END:
            signal.signal(number, self.end)
        for number in _NOT_ITS_BUSINESS:
            signal.signal(number, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _HANDLED)

    def live(self) -> NoReturn:
        """Watch until the run has ended or is to end; end what is left, and leave as it did."""
        try:
            # It ends as the run did, but with neither core nor traceback of its own.
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            faulthandler.disable()
            while self._code is None and not self.ending:
                self.turn()
            end_children(os.getpid(), reap=self.reap)
            self.drain()
        finally:
            # Whatever went wrong here: the run has this process as its parent, and dies with it.
            self._leave()

    def child_ended(self, process: int, code: int) -> None:
        """Take note of the end of the run."""
        if process == self._run:
            self._code = code

    def _leave(self) -> NoReturn:
        code = 1 if self._code is None or self.ending else self._code
        if code < 0:
            # So that whoever waits learns by what the run was killed.
            signal.set_wakeup_fd(-1)
            with suppress(OSError):  # SIGKILL is as it is
                signal.signal(-code, signal.SIG_DFL)
            os.kill(os.getpid(), -code)
        os._exit(code if code >= 0 else 1)
