"""Names of keys in requests, and the revoked ones among them.

A request comes at ``ASK/<name>/<verb>``, and Zenoh lets each certificate use only its own name
(:mod:`daemon.batch.security`). Clients of the socket, or over plain TCP, are the owner.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from daemon.batch.errors import KeysUnusable, Refused
from daemon.batch.security import REGISTER_FILE, DaemonCredentials, KeyRegister, load_register
from daemon.batch.server._runtime import EventLog
from daemon.model.messages import ASK, OWNER

_LOOK_EVERY: Final = 1.0


def split_key(key: str) -> tuple[str, str]:
    """Return name and verb of a request's key."""
    name, _, verb = key.removeprefix(f"{ASK}/").partition("/")
    return name, verb


@dataclass(slots=True)
class RevokedKeys:
    """Revoked keys, including those since the start; without ``keys`` only the owner is admitted.

    Zenoh's callbacks read it; the daemon's own thread reads the register.
    """

    log: EventLog
    keys: DaemonCredentials | None = None
    clock: Callable[[], float] = time.monotonic
    _admitted: frozenset[str] = field(init=False, default=frozenset())
    _revoked: frozenset[str] = field(init=False, default=frozenset())
    _stamp: tuple[int, int, int] | None = field(init=False, default=None)
    _look_at: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        if self.keys is not None:
            self._take(self.keys.register)
            self._admitted = frozenset(one.name for one in self.keys.register.issued)

    def problem(self, name: str) -> Refused | None:
        """Return the objection to a request under this name, if any."""
        if name == OWNER:
            return None
        if name not in self._admitted:
            return Refused(f'this daemon does not know the key "{name[:100]}"')
        if name in self._revoked:
            return Refused(f'the key "{name}" was revoked: ask the owner of the daemon for another')
        return None

    def look(self) -> None:
        """Check for revoked keys; call it often, it reads the register once a second."""
        now = self.clock()
        if self.keys is None or now < self._look_at:
            return
        self._look_at = now + _LOOK_EVERY
        self._reread(self.keys)

    def _reread(self, keys: DaemonCredentials) -> None:
        try:
            status = (keys.folder / REGISTER_FILE).stat()
            stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
            if stamp == self._stamp:
                return
            register = load_register(keys.folder)
        except (OSError, KeysUnusable) as error:
            # Admitted keys stay admitted: the register may be in the middle of a copy.
            if self._stamp is not None:
                self.log.write("register not read", problem=str(error))
            self._stamp = None
            return
        self._stamp = stamp
        self._take(register)

    def _take(self, register: KeyRegister) -> None:
        revoked = frozenset(one.name for one in register.issued if one.revoked_at is not None)
        # Revocation is final: a copy of the register may be older than the one read before.
        for name in sorted(revoked - self._revoked):
            self.log.write("key revoked", key=name)
        self._revoked |= revoked
