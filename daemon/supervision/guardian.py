"""The process above that of a run: whatever the run starts ends with it, however it ends.

    holder (a worker, say) ── … ── guardian ── the run ── what it starts, forks, leaves behind

The guardian is the subreaper (prctl(2)) of all that: whose parent ends becomes its child, in
whatever session and process group. It ends everything when the run has ended, when its holder or
its own parent is gone, and when it is told to by SIGTERM; then it ends as the run did, with the
same code or by the same signal. A guardian that is killed takes the run with it, and leaves what
the run has left behind to the next subreaper.

What the run prints goes through the guardian into a file that is bounded, and nobody waits for it.
"""

from __future__ import annotations

import faulthandler
import os
import resource
import selectors
import signal
import socket
from contextlib import suppress
from multiprocessing import parent_process
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Final, NoReturn

from .child import adopt_orphans, die_with_parent, lower_session, session_niceness
from .output_file import OutputFile
from .remains import KILL_LIMIT, end_children, reap_children

_TOLD_TO_END: Final = (signal.SIGTERM, signal.SIGQUIT)
_NOT_ITS_BUSINESS: Final = (signal.SIGINT, signal.SIGHUP)
"""Of terminals: what becomes of a run then, its holder decides."""
_HANDLED: Final = (*_TOLD_TO_END, *_NOT_ITS_BUSINESS, signal.SIGCHLD)
_AGAIN: Final = 0.1
_MOST_READS: Final = 64
"""Reads of 64 KiB when all that printed has ended: more than a pipe holds."""


def guard(output: Path | None = None, *, niceness: int = 0) -> None:
    """Put a guardian above this process; returns in the run's process, below it.

    To be called by a child of :mod:`multiprocessing`, before it has started anything; its holder is
    the process that made it. What is printed from then on, by descriptors, goes to ``output``. The
    session, a new one, steps back behind others as far as the one before, and at least by
    ``niceness``.

    Raises ``OSError`` when there is no process, pipe or file to be had.
    """
    holder = parent_process()
    if holder is None:
        raise RuntimeError("only a child of multiprocessing has a holder")
    parent = _open_parent()
    reading, writing = (-1, -1) if output is None else os.pipe()
    printed = None if output is None else OutputFile(output)
    niceness = max(niceness, session_niceness())
    # Neither a signal to the group of the holder nor a terminal that hangs up is for the guardian.
    with suppress(PermissionError):  # it leads a group already
        os.setsid()
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
        if writing >= 0:
            os.close(writing)
        _Guardian(run, holder.sentinel, parent, reading, printed, niceness).watch()
    die_with_parent(guardian)
    os.setpgid(0, 0)
    if parent is not None:
        os.close(parent)
    if printed is not None:
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


def _open_parent() -> int | None:
    """Return a descriptor that is ready when the parent ends, ``None`` before Linux 5.3."""
    try:
        return os.pidfd_open(os.getppid())
    except OSError:
        return None


class _Guardian:
    """What this process does from now on."""

    def __init__(
        self,
        run: int,
        holder: int,
        parent: int | None,
        reading: int,
        printed: OutputFile | None,
        niceness: int,
    ) -> None:
        self._run, self._reading, self._printed = run, reading, printed
        self._niceness = niceness
        self._code: int | None = None
        self._ending = False
        self._selector = selectors.DefaultSelector()
        self._watched = {holder} if parent is None else {holder, parent}
        for descriptor in self._watched:
            self._selector.register(descriptor, selectors.EVENT_READ)
        if printed is not None:
            os.set_blocking(reading, False)
            self._selector.register(reading, selectors.EVENT_READ)
        self._listen_for_signals()

    def _listen_for_signals(self) -> None:
        ours, theirs = socket.socketpair()
        for end in (ours, theirs):
            end.setblocking(False)
        signal.set_wakeup_fd(theirs.fileno(), warn_on_full_buffer=False)
        self._signals = (ours, theirs)
        self._selector.register(ours, selectors.EVENT_READ)
        for number in _TOLD_TO_END:
            signal.signal(number, self._told_to_end)
        for number in _NOT_ITS_BUSINESS:
            signal.signal(number, signal.SIG_IGN)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _HANDLED)

    def _told_to_end(self, *_: object) -> None:
        self._ending = True

    def watch(self) -> NoReturn:
        """Watch until the run has ended or is to end; end what is left, and leave as it did."""
        try:
            # It ends as the run did, but with neither core nor traceback of its own.
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            faulthandler.disable()
            again = self._niceness > 0 and lower_session(self._niceness)
            while self._code is None and not self._ending:
                self._turn(_AGAIN if again else None)
                again = again and lower_session(self._niceness)
                self._reap()
            self._end()
        finally:
            # Whatever went wrong here: the run has this process as its parent, and dies with it.
            self._leave()

    def _turn(self, seconds: float | None) -> None:
        for key, _ in self._selector.select(seconds):
            if key.fd in self._watched:
                self._ending = True  # the holder is gone, or the parent
            elif key.fd == self._reading:
                self._drain()
            else:
                with suppress(BlockingIOError):
                    self._signals[0].recv(4096)

    def _drain(self) -> bool:
        """Take in some of what was printed; returns whether there may be more."""
        assert self._printed is not None
        try:
            data = os.read(self._reading, 1 << 16)
        except BlockingIOError:
            return False
        if data:
            self._printed.write(data)
        elif self._reading in self._selector.get_map():
            self._selector.unregister(self._reading)  # nobody is left who could print
        return bool(data)

    def _reap(self) -> None:
        for process, code in reap_children():
            if process == self._run:
                self._code = code

    def _end(self) -> None:
        end_children(os.getpid(), reap=self._reap)
        if self._printed is not None:
            for _ in range(_MOST_READS):
                if not self._drain():
                    break

    def _leave(self) -> NoReturn:
        code = 1 if self._code is None or self._ending else self._code
        if code < 0:
            # So that whoever waits learns by what the run was killed.
            signal.set_wakeup_fd(-1)
            with suppress(OSError):  # SIGKILL is as it is
                signal.signal(-code, signal.SIG_DFL)
            os.kill(os.getpid(), -code)
        os._exit(code if code >= 0 else 1)
