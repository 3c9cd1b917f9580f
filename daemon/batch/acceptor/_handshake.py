"""TLS handshakes as they look from outside: records and their types (RFC 8446, 5.1)."""

from __future__ import annotations

import socket
import sys
from dataclasses import dataclass, field
from typing import Final

HANDSHAKE_TIME: Final = 3.0
"""Seconds until a handshake that has begun must be done."""
_GRACE: Final = 0.2
_GRACE_TRIPS: Final = 4
"""A handshake goes on although others wait for so long [s], or for so many round trips."""
_RTT_AT: Final = 68
"""Where the kernel's ``struct tcp_info`` has the smoothed round trip time [us]: linux/tcp.h."""
LARGEST_RECORD: Final = 5 + 2**14 + 256
_HANDSHAKE, _APPLICATION_DATA, _CLIENT_HELLO = 22, 23, 1


@dataclass(slots=True)
class Records:
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


def grace_of(client: socket.socket) -> float:
    """Return how long a handshake may take while others wait [s]: who is far away needs longer."""
    try:
        found = client.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _RTT_AT + 4)
    except OSError:
        return _GRACE
    trip = int.from_bytes(found[_RTT_AT : _RTT_AT + 4], sys.byteorder) / 1e6
    return min(max(_GRACE, _GRACE_TRIPS * trip), HANDSHAKE_TIME)


def may_be_hello(data: bytearray) -> bool:
    """Whether this begins a record with a ClientHello."""
    if data[0] != _HANDSHAKE or (len(data) > 1 and data[1] != 3):
        return False
    if len(data) >= 5 and not 4 < int.from_bytes(data[3:5], "big") <= LARGEST_RECORD - 5:
        return False
    return len(data) < 6 or data[5] == _CLIENT_HELLO
