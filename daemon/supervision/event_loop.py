"""Event loop of a process with one thread; descriptors, signals and ended children wake it."""

from __future__ import annotations

import os
import select
import signal
import socket
from collections.abc import Callable
from contextlib import suppress

from .output_file import OutputFile
from .remains import reap_children

HUNG_UP = select.EPOLLRDHUP
"""Event of a socket whose other end is shut down or gone, even with unread data."""
_MOST_READS = 64
"""Reads of 64 KiB from one process that keeps printing, before others have their turn."""


class EventLoop:
    """Calls a reaction for each event, until it is ``ending``.

    Create it in the main thread, which must be the only one.
    """

    def __init__(self) -> None:
        self.ending = False
        self._poller = select.epoll()
        self._reactions: dict[int, Callable[[], object]] = {}
        self._pipes: dict[int, OutputFile] = {}
        self._wakeups = socket.socketpair()
        for end in self._wakeups:
            end.setblocking(False)
        signal.set_wakeup_fd(self._wakeups[1].fileno(), warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        self.watch(self._wakeups[0].fileno(), self._take_wakeups)

    def _take_wakeups(self) -> None:
        with suppress(BlockingIOError):
            self._wakeups[0].recv(4096)

    def end(self, *_: object) -> None:
        """Begin to end; usable as a reaction and as a signal handler."""
        self.ending = True

    def watch(
        self, descriptor: int, react: Callable[[], object], event: int = select.EPOLLIN
    ) -> None:
        """React to each event of a descriptor, by default whenever it can be read."""
        self._reactions[descriptor] = react
        self._poller.register(descriptor, event)

    def forget(self, descriptor: int) -> None:
        """Stop watching a descriptor; call this before closing it."""
        # Epoll goes on reporting a closed descriptor that a child has inherited.
        self._poller.unregister(descriptor)
        del self._reactions[descriptor]

    def take_output(self, reading: int, output: OutputFile) -> None:
        """Copy a pipe into ``output`` until its writers have ended."""
        os.set_blocking(reading, False)
        self._pipes[reading] = output
        self.watch(reading, lambda: self._drain(reading))

    def _drain(self, source: int) -> bool:
        """Copy some output; return whether there may be more."""
        try:
            data = os.read(source, 1 << 16)
        except BlockingIOError:
            return False
        if data:
            self._pipes[source].write(data)
        else:
            self.forget(source)
            os.close(source)
            del self._pipes[source]
        return bool(data)

    def drain(self) -> None:
        """Copy all output so far."""
        for source in tuple(self._pipes):
            for _ in range(_MOST_READS):  # a remaining process may never stop printing
                if not self._drain(source):
                    break

    def turn(self, seconds: float | None = None) -> None:
        """Wait for events, ``seconds`` at most, and react to them."""
        events = [(one, self._reactions[one]) for one, _ in self._poller.poll(seconds)]
        for descriptor, react in events:
            # An earlier event may have removed this reaction.
            if self._reactions.get(descriptor) is react:
                react()
        self.reap()

    def reap(self) -> None:
        """React to the end of children."""
        for process, code in reap_children():
            self.child_ended(process, code)

    def child_ended(self, process: int, code: int) -> None:
        """Handle the end of a child with ``code``, below 0 for a signal."""
        raise NotImplementedError
