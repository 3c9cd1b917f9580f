"""Names of keys in questions, and which of them are known and not revoked.

A question comes at ``ASK/<name>/<verb>``, and Zenoh lets each certificate ask below its own name
only (:mod:`daemon.batch.security`). Who comes through the socket, or over plain TCP, is the owner.
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
    """Return name and verb of a question's key."""
    name, _, verb = key.removeprefix(f"{ASK}/").partition("/")
    return name, verb


@dataclass(slots=True)
class RevokedKeys:
    """Keys that were revoked, also since the start; without ``keys`` only the owner is known.

    Zenoh's callbacks ask, the daemon's own thread looks at the register.
    """

    log: EventLog
    keys: DaemonCredentials | None = None
    clock: Callable[[], float] = time.monotonic
    _known: frozenset[str] = field(init=False, default=frozenset())
    _revoked: frozenset[str] = field(init=False, default=frozenset())
    _stamp: tuple[int, int, int] | None = field(init=False, default=None)
    _look_at: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        if self.keys is not None:
            self._take(self.keys.register)
            self._known = frozenset(one.name for one in self.keys.register.issued)

    def problem(self, name: str) -> Refused | None:
        """Return the objection to a question under this name, if any."""
        if name == OWNER:
            return None
        if name not in self._known:
            return Refused(f'this daemon knows no key "{name[:100]}"')
        if name in self._revoked:
            return Refused(
                f'the key "{name}" was revoked: ask whoever keeps the daemon for another'
            )
        return None

    def look(self) -> None:
        """See who was revoked; call it often, it looks once a second."""
        now = self.clock()
        if self.keys is None or now < self._look_at:
            return
        self._look_at = now + _LOOK_EVERY
        self._reread(self.keys)

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
