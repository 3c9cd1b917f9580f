"""What a stack has said since the cycle before, put aside by threads of Zenoh's."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from threading import Condition
from time import perf_counter
from typing import Final

from daemon.stacks.ros2.link import COMMAND_KINDS, ReceivedMessage

_MOST_KEPT: Final = 1000
"""Messages of a topic that are kept between two cycles when all of them are asked for."""

_STAMPED: Final = COMMAND_KINDS[0]


@dataclass(frozen=True, slots=True)
class Taken:
    """What was in an inbox: messages oldest first, how many were commands, whether any at all."""

    messages: tuple[ReceivedMessage, ...]
    commands: int
    heard: bool


class Inbox:
    """Messages of a stack and whether its command has come; safe for threads."""

    def __init__(self) -> None:
        self._news = Condition()
        self._order = 0
        self._last: dict[str, tuple[int, ReceivedMessage]] = {}
        self._all: dict[str, deque[tuple[int, ReceivedMessage]]] = {}
        self._commands = 0
        self._heard = False
        self._oldest: int | None = None
        self._sent = 0.0
        self._answer: float | None = None
        self._woken = False

    def put(self, topic: str, kind: str, keep_all: bool, data: bytes) -> None:
        """Put a message aside."""
        with self._news:
            self._keep(ReceivedMessage(topic, kind, data), keep_all)

    def put_command(self, topic: str, kind: str, data: bytes) -> None:
        """Put a command aside, and say so when it is the answer that is waited for."""
        now = perf_counter()
        with self._news:
            self._keep(ReceivedMessage(topic, kind, data), keep_all=False)
            self._commands += 1
            if self._answer is None and self._answers(kind, data, now):
                self._answer = now
                self._news.notify_all()

    def wake(self, heard: bool) -> None:
        """Have whoever waits look after something else; ``heard``: it came from the stack."""
        with self._news:
            self._woken = True
            self._heard = self._heard or heard
            self._news.notify_all()

    def expect(self, oldest: int) -> float:
        """Await a command not older than ``oldest`` [ns], or after now; return now.

        Before the clock goes out: the answer may be quicker than this thread.
        """
        with self._news:
            self._oldest, self._sent, self._answer = oldest, perf_counter(), None
            return self._sent

    def wait(self, seconds: float, *, for_command: bool, attend: Callable[[], bool]) -> None:
        """Wait that long since :meth:`expect`, or for the command; ``attend`` when woken.

        Where that says that a goal has ended, no command is owed and waiting for one ends too.
        """
        deadline = self._sent + seconds
        while True:
            with self._news:
                while not (
                    self._woken
                    or (for_command and self._answer is not None)
                    or (left := deadline - perf_counter()) <= 0
                ):
                    self._news.wait(left)
                over = (for_command and self._answer is not None) or perf_counter() >= deadline
                woken, self._woken = self._woken, False
            if woken and attend() and for_command:
                return
            if over:
                return

    def latency(self) -> float | None:
        """Return the seconds from :meth:`expect` to the command that answered."""
        with self._news:
            return None if self._answer is None else max(self._answer - self._sent, 0.0)

    def take(self) -> Taken:
        """Return and forget everything."""
        with self._news:
            kept = [*self._last.values(), *(one for some in self._all.values() for one in some)]
            kept.sort(key=lambda one: one[0])
            taken = Taken(tuple(message for _, message in kept), self._commands, self._heard)
            self._last.clear()
            self._all.clear()
            self._commands = 0
            self._heard = False
            return taken

    def _keep(self, message: ReceivedMessage, keep_all: bool) -> None:
        self._heard = True
        self._order += 1
        if keep_all:
            queue = self._all.setdefault(message.topic, deque(maxlen=_MOST_KEPT))
            queue.append((self._order, message))
        else:
            self._last[message.topic] = (self._order, message)

    def _answers(self, kind: str, data: bytes, now: float) -> bool:
        if self._oldest is None:
            return False
        if kind != _STAMPED:
            return now > self._sent
        stamp = _stamp(data)
        return stamp is not None and stamp >= self._oldest


def _stamp(data: bytes) -> int | None:
    """Return the stamp [ns] of a message that begins with a header, ``None`` for no such thing."""
    if len(data) < 12:
        return None
    seconds, rest = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
    return int(seconds) * 1_000_000_000 + int(rest)
