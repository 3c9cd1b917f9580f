"""The connections at the port, from their first byte to their last."""

from __future__ import annotations

import selectors
import socket
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from daemon.batch.acceptor._failure_limits import FailureLimits, address_key
from daemon.batch.acceptor._handshake import (
    HANDSHAKE_TIME,
    LARGEST_RECORD,
    Records,
    grace_of,
    may_be_hello,
)

MOST_OPEN: Final = 960
"""Links that are open; Zenoh takes 1000 sessions, those through the owner's socket included."""
MOST_OPEN_EACH: Final = 512
MOST_GREETED: Final = 48
"""Handshakes under way, of the 64 at which Zenoh stops accepting."""
MOST_GREETED_EACH: Final = 16
MOST_WAITING: Final = 256
MOST_SILENT: Final = 512
MOST_SILENT_EACH: Final = 128
HELLO_TIME: Final = 5.0
"""Seconds until a ClientHello must have come, also over a line that loses packets."""
_REPORT_EVERY: Final = 10.0
_PROMOTE_EVERY: Final = 0.02
_CHUNK: Final = 2**18


class _State(Enum):
    SILENT = "silent"
    WAITING = "waiting"
    GREETED = "greeted"
    OPEN = "open"


@dataclass(slots=True)
class _Stream:
    """Bytes on their way from one socket to another; no more are read while some are pending."""

    source: socket.socket
    sink: socket.socket
    pending: memoryview = field(default_factory=lambda: memoryview(b""))
    ended: bool = False


@dataclass(slots=True, eq=False)
class _Link:
    client: socket.socket
    address: str
    since: float
    state: _State = _State.SILENT
    hello: bytearray = field(default_factory=bytearray)
    server: socket.socket | None = None
    streams: tuple[_Stream, ...] = ()
    records: Records = field(default_factory=Records)
    answered: bool = False


class Acceptor:
    """Serves one listening socket; behind it Zenoh listens on loopback at ``port``."""

    def __init__(
        self,
        listener: socket.socket,
        port: int,
        report: Callable[[dict[str, int]], None],
    ) -> None:
        self._listener = listener
        self._behind = ("127.0.0.1", port)
        self._report = report
        self._selector = selectors.DefaultSelector()
        self._links: dict[_State, dict[_Link, None]] = {state: {} for state in _State}
        self._counts: dict[_State, Counter[str]] = {state: Counter() for state in _State}
        self._dropped: Counter[str] = Counter()
        self._failures = FailureLimits(time.monotonic())
        self._report_at = time.monotonic() + _REPORT_EVERY
        self._buffer = bytearray(_CHUNK)
        listener.setblocking(False)
        self._selector.register(listener, selectors.EVENT_READ, self._accept)

    def watch(self, descriptor: int, call: Callable[[], None]) -> None:
        """Call back when a descriptor can be read."""
        self._selector.register(descriptor, selectors.EVENT_READ, call)

    def step(self, seconds: float) -> None:
        """Wait for something to do, do it, and look at the clock."""
        if self._links[_State.WAITING]:
            seconds = min(seconds, _PROMOTE_EVERY)
        for key, events in self._selector.select(seconds):
            if isinstance(key.fileobj, socket.socket) and key.fileobj.fileno() < 0:
                continue  # closed by what happened before in this round
            if isinstance(key.data, tuple):
                link, reading, writing = key.data
                self._move(link, reading, writing, events)
            else:
                key.data()
        self._tidy()

    def _accept(self) -> None:
        for _ in range(64):
            try:
                client, found = self._listener.accept()
            except BlockingIOError:
                return
            except OSError:
                # No descriptors: those who say nothing have some.
                self._drop_oldest(_State.SILENT)
                return
            client.setblocking(False)
            with suppress(OSError):
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            link = _Link(client, address_key(found[0]), time.monotonic())
            self._enter(link, _State.SILENT)
            self._selector.register(client, selectors.EVENT_READ, lambda one=link: self._hear(one))
            if self._counts[_State.SILENT][link.address] > MOST_SILENT_EACH:
                self._drop_oldest(_State.SILENT, link.address)
            elif len(self._links[_State.SILENT]) > MOST_SILENT:
                self._drop_oldest(_State.SILENT, self._most(_State.SILENT))

    def _enter(self, link: _Link, state: _State) -> None:
        self._leave(link)
        link.state = state
        self._links[state][link] = None
        self._counts[state][link.address] += 1

    def _leave(self, link: _Link) -> bool:
        if link not in self._links[link.state]:
            return False
        del self._links[link.state][link]
        counts = self._counts[link.state]
        counts[link.address] -= 1
        if not counts[link.address]:
            del counts[link.address]
        return True

    def _most(self, state: _State) -> str:
        return self._counts[state].most_common(1)[0][0]

    def _drop_oldest(self, state: _State, address: str = "") -> None:
        for link in self._links[state]:
            if address in ("", link.address):
                self._drop(link)
                return

    def _drop(self, link: _Link) -> None:
        self._dropped[link.address] += 1
        self._close(link)

    def _close(self, link: _Link) -> None:
        if not self._leave(link):
            return
        if link.state is _State.GREETED:
            self._failures.record_failure(link.address, time.monotonic())
        for end in (link.client, link.server):
            if end is not None:
                with suppress(KeyError, ValueError):
                    self._selector.unregister(end)
                end.close()

    def _hear(self, link: _Link) -> None:
        """Take what a client says first, until it is a ClientHello or can be none."""
        try:
            data = link.client.recv(LARGEST_RECORD - len(link.hello))
        except BlockingIOError:
            return
        except OSError:
            data = b""
        link.hello += data
        if not data or not may_be_hello(link.hello):
            self._drop(link)
        elif len(link.hello) >= 5 + int.from_bytes(link.hello[3:5], "big"):
            self._selector.unregister(link.client)
            self._enter(link, _State.WAITING)
            self._promote()
            if len(self._links[_State.WAITING]) > MOST_WAITING:
                self._drop_oldest(_State.WAITING, self._most(_State.WAITING))

    def _promote(self) -> None:
        """Let those begin their handshakes who have said hello, as far as there is room."""
        while (link := self._next_waiting()) is not None:
            self._greet(link)

    def _next_waiting(self) -> _Link | None:
        counts = self._counts[_State.GREETED]
        # The newest of each address, those with the fewest first: who came long ago may be gone.
        newest = {link.address: link for link in self._links[_State.WAITING]}
        for address in sorted(newest, key=lambda one: counts[one]):
            allowed = self._failures.allowed(address, counts, time.monotonic())
            if not allowed:
                self._drop(newest[address])
            elif counts[address] < allowed and self._make_room(address):
                return newest[address]
        return None

    def _make_room(self, address: str) -> bool:
        counts = self._counts[_State.GREETED]
        if counts[address] >= MOST_GREETED_EACH:
            whose = address
        elif len(self._links[_State.GREETED]) >= MOST_GREETED:
            whose = self._most(_State.GREETED)
        else:
            return True
        oldest = next(one for one in self._links[_State.GREETED] if one.address == whose)
        if time.monotonic() - oldest.since < grace_of(oldest.client):
            return False
        self._drop(oldest)
        return True

    def _greet(self, link: _Link) -> None:
        if (
            len(self._links[_State.OPEN]) >= MOST_OPEN
            or self._counts[_State.OPEN][link.address] >= MOST_OPEN_EACH
        ):
            self._drop(link)
            return
        try:
            # Loopback: it is connected or refused at once, and takes a first record whole.
            link.server = socket.create_connection(self._behind, timeout=0.2)
            link.server.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            link.server.sendall(link.hello)
            link.server.setblocking(False)
        except OSError:
            self._drop(link)
            return
        link.hello.clear()
        link.since = time.monotonic()
        to_server = _Stream(link.client, link.server)
        to_client = _Stream(link.server, link.client)
        link.streams = (to_server, to_client)
        self._enter(link, _State.GREETED)
        self._selector.register(link.client, selectors.EVENT_READ, (link, to_server, to_client))
        self._selector.register(link.server, selectors.EVENT_READ, (link, to_client, to_server))

    def _move(self, link: _Link, reading: _Stream, writing: _Stream, events: int) -> None:
        """One end of a link can be read, or written to again."""
        try:
            if events & selectors.EVENT_WRITE:
                self._send(writing)
            if events & selectors.EVENT_READ and not reading.pending:
                self._receive(link, reading)
        except BlockingIOError:
            pass
        except OSError:
            self._close(link)
            return
        self._rearm(link)

    def _receive(self, link: _Link, stream: _Stream) -> None:
        count = stream.source.recv_into(self._buffer)
        if not count:
            stream.ended = True
            return
        data = memoryview(self._buffer)[:count]
        if link.state is _State.GREETED:
            self._follow(link, stream, data)
        try:
            sent = stream.sink.send(data)
        except BlockingIOError:
            sent = 0
        if sent < count:
            stream.pending = memoryview(bytes(data[sent:]))

    def _follow(self, link: _Link, stream: _Stream, data: memoryview) -> None:
        if stream.source is link.client:
            # Before the daemon's side has answered, nothing encrypted can be meant for it.
            if link.answered:
                link.records.feed(data)
        elif link.records.encrypted:
            self._enter(link, _State.OPEN)
            self._failures.record_success(link.address)
            self._promote()
        else:
            link.answered = True

    def _send(self, stream: _Stream) -> None:
        if stream.pending:
            sent = stream.sink.send(stream.pending)
            stream.pending = stream.pending[sent:]

    def _rearm(self, link: _Link) -> None:
        """Wait for what can go on; close a link of which one end is closed and all passed on."""
        if any(stream.ended and not stream.pending for stream in link.streams):
            self._close(link)
            return
        one, other = link.streams
        for end, reading, writing in ((link.client, one, other), (link.server, other, one)):
            wanted = 0 if reading.pending or reading.ended else selectors.EVENT_READ
            wanted |= selectors.EVENT_WRITE if writing.pending else 0
            self._wait_for(end, wanted, (link, reading, writing))

    def _wait_for(self, end: socket.socket | None, wanted: int, data: object) -> None:
        assert end is not None
        known = self._selector.get_map().get(end)
        if known is None:
            if wanted:
                self._selector.register(end, wanted, data)
        elif not wanted:
            self._selector.unregister(end)
        elif known.events != wanted:
            self._selector.modify(end, wanted, data)

    def _tidy(self) -> None:
        now = time.monotonic()
        late = [*self._overdue(_State.SILENT, now - HELLO_TIME)]
        late += self._overdue(_State.WAITING, now - HELLO_TIME)
        late += self._overdue(_State.GREETED, now - HANDSHAKE_TIME)
        for link in late:
            self._drop(link)
        if self._links[_State.WAITING]:
            self._promote()
        if self._dropped and now >= self._report_at:
            self._report(dict(self._dropped.most_common(10)))
            self._dropped.clear()
            self._report_at = now + _REPORT_EVERY

    def _overdue(self, state: _State, before: float) -> Iterator[_Link]:
        for link in self._links[state]:
            if link.since > before:
                return  # they are in the order of their beginning
            yield link
