"""The daemon's door: accepts TLS connections and lets in those that get on with their handshake.

Zenoh 1.10.2 lets 64 handshakes wait for ten seconds each and accepts nobody else meanwhile: seven
silent connections a second close its port. After each handshake that failed it rests 0.1 s, so ten
failures a second close it too. Therefore the port is this process's, and Zenoh listens behind it,
on loopback: silence stays here, and few failures of one address are let through. A connection
goes through these states:

silent    accepted; its ClientHello has not come, and Zenoh does not know of it
waiting   its ClientHello has come, others are at their handshakes
greeted   its ClientHello was passed on; few at a time, fairly among addresses
open      the handshake is done, which takes a certificate of the authority: bytes pass both ways

Nothing is decrypted: certificates are shown to Zenoh, and it is Zenoh that trusts them. Whether a
handshake is done shows in the types of records (RFC 8446, 5.1): the daemon's side has said
something after the client's first encrypted record.

A process of its own, so that neither a busy daemon nor Python's lock delays a link; it imports the
standard library only. ``python -m daemon.batch.acceptor FD PORT`` serves the listening socket FD
until standard input ends.
"""

from __future__ import annotations

import ipaddress
import json
import resource
import selectors
import socket
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

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
HANDSHAKE_TIME: Final = 3.0
GRACE: Final = 0.2
_GRACE_TRIPS: Final = 4
"""A handshake goes on although others wait for so long [s], or for so many round trips."""
_RTT_AT: Final = 68
"""Where the kernel's ``struct tcp_info`` has the smoothed round trip time [us]: linux/tcp.h."""
_REPORT_EVERY: Final = 10.0
FAULTS_EACH: Final = 10.0
FAULTS: Final = 12.0
"""Handshakes that fail at once, of one address and of all whose handshakes never succeeded; each
second gives back so many. Zenoh stands ten a second, and a worker with a bad key tries twice."""
_FORGIVEN_EACH: Final = 3.0
_FORGIVEN: Final = 5.0
_MOST_KNOWN: Final = 4096
"""Addresses that are remembered, those with faults and those known for a handshake."""
_LARGEST_RECORD: Final = 5 + 2**14 + 256
_HANDSHAKE, _APPLICATION_DATA, _CLIENT_HELLO = 22, 23, 1
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
    records: _Records = field(default_factory=lambda: _Records())
    answered: bool = False


@dataclass(slots=True)
class _Records:
    """Finds the end of the first encrypted record in a stream of records."""

    head: bytearray = field(default_factory=bytearray)
    left: int = 0
    encrypted: bool = False

    def feed(self, data: memoryview) -> None:
        """Go on with what came."""
        at = 0
        while at < len(data) and not self.encrypted:
            if self.left:
                step = min(self.left, len(data) - at)
                self.left -= step
            else:
                step = min(5 - len(self.head), len(data) - at)
                self.head += data[at : at + step]
                if len(self.head) == 5:
                    self.left = int.from_bytes(self.head[3:5], "big")
            at += step
            if len(self.head) == 5 and not self.left:
                self.encrypted = self.head[0] == _APPLICATION_DATA
                self.head.clear()


@dataclass(slots=True)
class _Patience:
    """How many more failures are let through: up to ``most``, ``rate`` come back each second."""

    most: float
    rate: float
    at: float
    left: float = field(init=False)

    def __post_init__(self) -> None:
        self.left = self.most

    def remaining(self, now: float) -> float:
        """Return how many more are let through now."""
        self.left = min(self.most, self.left + (now - self.at) * self.rate)
        self.at = now
        return self.left


class Acceptor:
    """Serves one listening socket; behind it Zenoh listens on loopback at ``port``."""

    def __init__(
        self,
        listener: socket.socket,
        port: int,
        report: Callable[[dict[str, int]], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._listener = listener
        self._behind = ("127.0.0.1", port)
        self._report = report
        self._clock = clock
        self._selector = selectors.DefaultSelector()
        self._links: dict[_State, dict[_Link, None]] = {state: {} for state in _State}
        self._counts: dict[_State, Counter[str]] = {state: Counter() for state in _State}
        self._dropped: Counter[str] = Counter()
        self._patience: dict[str, _Patience] = {}
        self._common_patience = _Patience(FAULTS, _FORGIVEN, clock())
        # Addresses whose handshakes have succeeded: strangers who fail do not keep them out.
        self._known: dict[str, None] = {}
        self._report_at = clock() + _REPORT_EVERY
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
            link = _Link(client, _address_key(found[0]), self._clock())
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
            self._blame(link.address)
        for end in (link.client, link.server):
            if end is not None:
                with suppress(KeyError, ValueError):
                    self._selector.unregister(end)
                end.close()

    def _hear(self, link: _Link) -> None:
        """Take what a client says first, until it is a ClientHello or can be none."""
        try:
            data = link.client.recv(_LARGEST_RECORD - len(link.hello))
        except BlockingIOError:
            return
        except OSError:
            data = b""
        link.hello += data
        if not data or not _may_be_hello(link.hello):
            self._drop(link)
        elif len(link.hello) >= 5 + int.from_bytes(link.hello[3:5], "big"):
            self._selector.unregister(link.client)
            self._enter(link, _State.WAITING)
            self._promote()
            if len(self._links[_State.WAITING]) > MOST_WAITING:
                self._drop_oldest(_State.WAITING, self._most(_State.WAITING))

    def _bearable(self, address: str) -> int:
        """Return how many handshakes of an address may be under way: each of them may fail.

        None when it, or all strangers together, failed too often lately.
        """
        now, counts = self._clock(), self._counts[_State.GREETED]
        own = self._patience.get(address)
        most = int(FAULTS_EACH if own is None else own.remaining(now))
        if address in self._known:
            return most
        common = int(self._common_patience.remaining(now))
        others = sum(n for one, n in counts.items() if one not in self._known and one != address)
        return min(most, max(1, common - others) if common else 0)

    def _blame(self, address: str) -> None:
        now = self._clock()
        own = self._patience.pop(address, None) or _Patience(FAULTS_EACH, _FORGIVEN_EACH, now)
        concerned = (own,) if address in self._known else (own, self._common_patience)
        for patience in concerned:
            patience.left = max(0.0, patience.remaining(now) - 1.0)
        self._patience[address] = own  # at the end: the one that failed longest ago goes first
        if len(self._patience) > _MOST_KNOWN:
            del self._patience[next(iter(self._patience))]

    def _remember(self, address: str) -> None:
        self._known.pop(address, None)
        self._known[address] = None
        if len(self._known) > _MOST_KNOWN:
            del self._known[next(iter(self._known))]

    def _promote(self) -> None:
        """Let those begin their handshakes who have said hello, as far as there is room."""
        waiting = self._links[_State.WAITING]
        while waiting:
            greeted = self._counts[_State.GREETED]
            # The newest of the address with the fewest: who came long ago may have given up.
            link = min(reversed(waiting), key=lambda one: greeted[one.address])
            bearable = self._bearable(link.address)
            if not bearable:
                self._drop(link)
            elif greeted[link.address] < bearable and self._make_room(link.address):
                self._greet(link)
            else:
                return

    def _make_room(self, address: str) -> bool:
        counts = self._counts[_State.GREETED]
        if counts[address] >= MOST_GREETED_EACH:
            whose = address
        elif len(self._links[_State.GREETED]) >= MOST_GREETED:
            whose = self._most(_State.GREETED)
        else:
            return True
        oldest = next(one for one in self._links[_State.GREETED] if one.address == whose)
        if self._clock() - oldest.since < _grace(oldest.client):
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
        link.since = self._clock()
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
            self._remember(link.address)
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
        now = self._clock()
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


def _grace(client: socket.socket) -> float:
    """Return how long a handshake may take while others wait [s]: who is far away needs longer."""
    try:
        found = client.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _RTT_AT + 4)
    except OSError:
        return GRACE
    trip = int.from_bytes(found[_RTT_AT : _RTT_AT + 4], sys.byteorder) / 1e6
    return min(max(GRACE, _GRACE_TRIPS * trip), HANDSHAKE_TIME)


def _may_be_hello(data: bytearray) -> bool:
    """Whether this begins a record with a ClientHello."""
    if data[0] != _HANDSHAKE or (len(data) > 1 and data[1] != 3):
        return False
    if len(data) >= 5 and not 4 < int.from_bytes(data[3:5], "big") <= _LARGEST_RECORD - 5:
        return False
    return len(data) < 6 or data[5] == _CLIENT_HELLO


def _address_key(host: str) -> str:
    """Return what counts as one address: an IPv4 address, or the network of an IPv6 one."""
    found = ipaddress.ip_address(host.partition("%")[0])
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    if found.ipv4_mapped is not None:
        return str(found.ipv4_mapped)
    # Whoever has an address has its /64 (RFC 4291, 2.5.4).
    return str(ipaddress.ip_network((int(found), 64), strict=False))


def _raise_descriptor_limit() -> None:
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _report_line(dropped: dict[str, int]) -> None:
    with suppress(OSError):
        sys.stdout.write(json.dumps(dropped) + "\n")
        sys.stdout.flush()


def main(descriptor: int, port: int) -> None:
    """Serve until standard input ends: then the daemon is gone."""
    _raise_descriptor_limit()
    acceptor = Acceptor(socket.socket(fileno=descriptor), port, _report_line)
    ended: list[bool] = []
    acceptor.watch(sys.stdin.fileno(), lambda: ended.append(True))
    while not ended:
        acceptor.step(0.25)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
