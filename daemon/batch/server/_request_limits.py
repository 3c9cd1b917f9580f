"""Who asks: names of keys, those revoked since the start, how much each may ask.

A question comes at ``ASK/<name>/<verb>``, and Zenoh lets each certificate ask below its own name
only (:mod:`daemon.batch.security`). Who comes through the socket, or over plain TCP, is the owner:
nothing of this limits him, for the file system (or he who opened the port) has let him in.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from daemon.batch.errors import DaemonError, KeysUnusable, Refused, Unavailable
from daemon.batch.security import REGISTER_FILE, DaemonCredentials, KeyRegister, load_register
from daemon.batch.server._runtime import EventLog
from daemon.model.messages import ASK, OWNER

RATE: Final = 1000.0
"""Questions a second under one name. A key that 200 workers share asks as many when runs are short:
they ask three to five times a second each."""
BURST: Final = 5000.0
"""Questions under one name at once, after a while of fewer."""
MOST_WAITING: Final = 1024
MOST_WAITING_BYTES: Final = 128 * 2**20
"""Questions under one name that wait for an answer: half of what waits for any thread."""
_LOOK_EVERY: Final = 1.0


def split_key(key: str) -> tuple[str, str]:
    """Return name and verb of a question's key; the name is empty when there is none in it."""
    name, _, verb = key.removeprefix(f"{ASK}/").rpartition("/")
    return name, verb


def holder_of(name: str) -> str:
    """Return whose a lease is that is given under ``name``: that name, empty for the owner."""
    return "" if name == OWNER else name


@dataclass(slots=True)
class _Account:
    """What one name has asked; ``tokens`` are the questions it may ask now, at ``at``."""

    tokens: float
    at: float
    waiting: int = 0
    size: int = 0
    turned_away: int = 0


@dataclass(slots=True)
class RequestLimits:
    """Admits questions by name; without ``keys`` there is nobody but the owner.

    Asked by Zenoh's callbacks and by the ledger's threads, looked after by the daemon's own.
    """

    log: EventLog
    keys: DaemonCredentials | None = None
    clock: Callable[[], float] = time.monotonic
    rate: float = RATE
    burst: float = BURST
    _accounts: dict[str, _Account] = field(init=False, default_factory=dict)
    _lock: threading.Lock = field(init=False, default_factory=threading.Lock)
    _known: frozenset[str] = field(init=False, default=frozenset())
    _revoked: frozenset[str] = field(init=False, default=frozenset())
    _stamp: tuple[int, int, int] | None = field(init=False, default=None)
    _look_at: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        if self.keys is not None:
            self._take(self.keys.register)
            self._known = frozenset(one.name for one in self.keys.register.issued)

    def admit(self, name: str, size: int) -> DaemonError | None:
        """Take a question of ``size`` bytes, or return what is to be said against it.

        What is taken is told to :meth:`answered` when it has its answer.
        """
        if name == OWNER:
            return None
        if name not in self._known:
            return Refused(f'this daemon knows no key "{name[:100]}"')
        if name in self._revoked:
            return Refused(
                f'the key "{name}" was revoked: ask whoever keeps the daemon for another'
            )
        with self._lock:
            return self._charge(name, size)

    def _charge(self, name: str, size: int) -> DaemonError | None:
        now = self.clock()
        account = self._accounts.setdefault(name, _Account(self.burst, now))
        account.tokens = min(self.burst, account.tokens + (now - account.at) * self.rate)
        account.at = now
        # One that is larger than all the room there is has its turn when nothing else waits.
        much = account.waiting and account.size + size > MOST_WAITING_BYTES
        if account.tokens < 1.0 or account.waiting >= MOST_WAITING or much:
            account.turned_away += 1
            wait = max((1.0 - account.tokens) / self.rate, 0.1)
            return Unavailable(
                f'too many requests under the key "{name}": ask again in {wait:.1f} s'
            )
        account.tokens -= 1.0
        account.waiting += 1
        account.size += size
        return None

    def answered(self, name: str, size: int) -> None:
        """A question that was admitted has its answer."""
        if name == OWNER:
            return
        with self._lock:
            account = self._accounts[name]
            account.waiting -= 1
            account.size -= size

    def look(self) -> None:
        """See who was revoked and who was turned away; call it often, it looks once a second."""
        now = self.clock()
        if self.keys is None or now < self._look_at:
            return
        self._look_at = now + _LOOK_EVERY
        self._reread(self.keys)
        # Once a second and name, whatever the flood: the log is where people look afterwards.
        with self._lock:
            counts = {n: a.turned_away for n, a in self._accounts.items() if a.turned_away}
            for name in counts:
                self._accounts[name].turned_away = 0
        for name, count in counts.items():
            self.log.write("too many requests", key=name, turned_away=count)

    def _reread(self, keys: DaemonCredentials) -> None:
        try:
            found = (keys.folder / REGISTER_FILE).stat()
            stamp = (found.st_mtime_ns, found.st_size, found.st_ino)
            if stamp == self._stamp:
                return
            register = load_register(keys.folder)
        except (OSError, KeysUnusable) as error:
            # Who was admitted stays so: a register that is being copied is no reason to stop work.
            if self._stamp is not None:
                self.log.write("register not read", problem=str(error))
            self._stamp = None
            return
        self._stamp = stamp
        self._take(register)

    def _take(self, register: KeyRegister) -> None:
        revoked = frozenset(one.name for one in register.issued if one.revoked_at is not None)
        # Nobody comes back: another copy of the register may be older than what was read before.
        for name in sorted(revoked - self._revoked):
            self.log.write("key revoked", key=name)
        self._revoked |= revoked
