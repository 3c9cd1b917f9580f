"""How many failed handshakes are let through, of one address and of all strangers together."""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

FAILURES_EACH: Final = 10.0
FAILURES: Final = 12.0
"""Handshakes that may fail at once, of one address and of all whose handshakes never succeeded.
Zenoh takes ten failures a second, and a worker with a bad key makes two."""
_RECOVERED_EACH: Final = 3.0
_RECOVERED: Final = 5.0
"""How many more may fail with each second that passes."""
_MOST_KNOWN: Final = 4096
"""Addresses that are remembered, those with failures and those known for a handshake."""


@dataclass(slots=True)
class _Allowance:
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


class FailureLimits:
    """Failures of each address, and of strangers: those whose handshakes never succeeded.

    Whatever strangers do, addresses that are known for a handshake are not kept out by it.
    """

    def __init__(self, now: float) -> None:
        self._each: dict[str, _Allowance] = {}
        self._common = _Allowance(FAILURES, _RECOVERED, now)
        self._known: dict[str, None] = {}

    def allowed(self, address: str, under_way: Mapping[str, int], now: float) -> int:
        """Return how many handshakes of an address may be under way: each of them may fail.

        It is 0 when the address, or all strangers together, failed too often lately.
        """
        own = self._each.get(address)
        most = int(FAILURES_EACH if own is None else own.remaining(now))
        if address in self._known:
            return most
        common = int(self._common.remaining(now))
        others = sum(n for one, n in under_way.items() if one not in self._known and one != address)
        return min(most, max(1, common - others) if common else 0)

    def record_failure(self, address: str, now: float) -> None:
        """A handshake of the address failed."""
        own = self._each.pop(address, None) or _Allowance(FAILURES_EACH, _RECOVERED_EACH, now)
        for one in (own,) if address in self._known else (own, self._common):
            one.left = max(0.0, one.remaining(now) - 1.0)
        self._each[address] = own  # at the end: the one that failed longest ago goes first
        if len(self._each) > _MOST_KNOWN:
            del self._each[next(iter(self._each))]

    def record_success(self, address: str) -> None:
        """A handshake of the address succeeded."""
        self._known.pop(address, None)
        self._known[address] = None
        if len(self._known) > _MOST_KNOWN:
            del self._known[next(iter(self._known))]


def address_key(host: str) -> str:
    """Return what counts as one address: an IPv4 address, or the network of an IPv6 one."""
    found = ipaddress.ip_address(host.partition("%")[0])
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    if found.ipv4_mapped is not None:
        return str(found.ipv4_mapped)
    # Whoever has an address has its /64 (RFC 4291, 2.5.4).
    return str(ipaddress.ip_network((int(found), 64), strict=False))
