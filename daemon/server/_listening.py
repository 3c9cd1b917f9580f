"""Where a daemon listens: at the socket in its state directory, and at an address if told so."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from daemon.errors import DaemonError
from daemon.places import INSECURE, Places, is_encrypted, stays_here
from daemon.security import DaemonKeys, find_daemon_keys


@dataclass(frozen=True, slots=True)
class Listening:
    """``socket`` is for the daemon's owner on this machine; ``address`` for others, or empty.

    ``keys`` say whom an encrypted address admits.
    """

    socket: str
    address: str = ""
    keys: DaemonKeys | None = None

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All endpoints."""
        return (self.socket, self.address) if self.address else (self.socket,)


def arrange(
    places: Places, listen: str = "", keys: Path | None = None, *, insecure: bool = False
) -> Listening:
    """Return where to listen, ready to do so.

    Raises :class:`DaemonError` for plain TCP that other machines could reach, unless ``insecure``,
    and :class:`daemon.errors.KeysUnusable` when an encrypted address has no keys.
    """
    try:
        places.make_socket_folder()
    except OSError as error:
        words = f"cannot listen at {places.socket}: {error.filename}: {error.strerror}"
        raise DaemonError(words) from error
    if listen and is_encrypted(listen):
        return Listening(places.endpoint, listen, find_daemon_keys(keys))
    if listen and not (stays_here(listen) or insecure or os.environ.get(INSECURE)):
        raise DaemonError(
            f"{listen} would be open to every machine of the network: listen at tls/ with keys "
            "(`scenario keys init`), or say --insecure"
        )
    # Said again, the daemon's own socket is still one.
    return Listening(places.endpoint, "" if listen == places.endpoint else listen)


def exposure(listen: str) -> str:
    """Say who can reach a daemon that listens at ``listen`` without a key; empty for nobody."""
    if not listen or is_encrypted(listen):
        return ""
    who = "everybody with an account on this machine"
    if not stays_here(listen):
        who = "everybody in the network, unencrypted and unasked,"
    return f"INSECURE: {who} can look, submit, cancel and stop the daemon through {listen}"
