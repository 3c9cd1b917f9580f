"""The register: which certificates the authority has issued, and which it no longer stands for.

Zenoh matches common names exactly, so the daemon must know every name: it admits those in the
register, and a name that was revoked is never issued again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from daemon.places import write_atomically
from daemon.security._rules import Role
from grammars import codec

FILE: Final = "register.json"


@dataclass(frozen=True, slots=True)
class Issued:
    """A certificate: ``name`` is its common name, times are seconds since the epoch.

    ``fingerprint`` is the SHA-256 of the certificate; ``hosts`` are the names a daemon answers to.
    """

    name: str
    role: Role
    hosts: tuple[str, ...]
    issued_at: float
    expires_at: float
    fingerprint: str
    revoked_at: float | None = None


@dataclass(frozen=True, slots=True)
class Register:
    """All certificates, the oldest first."""

    issued: tuple[Issued, ...] = ()

    def find(self, name: str) -> Issued | None:
        """Return the certificate of this common name."""
        return next((one for one in self.issued if one.name == name), None)

    def valid(self, role: Role) -> tuple[Issued, ...]:
        """Return the certificates of a role that were not revoked, the oldest first."""
        return tuple(one for one in self.issued if one.role is role and one.revoked_at is None)

    def revoke(self, name: str, now: float) -> Register:
        """Return the register without trust in ``name``."""
        return Register(
            tuple(replace(one, revoked_at=now) if one.name == name else one for one in self.issued)
        )


def read_register(folder: Path) -> Register:
    """Read the register of a keys folder; raises ``OSError`` and ``ValueError``."""
    return codec.from_json(Register, (folder / FILE).read_bytes())


def write_register(folder: Path, register: Register) -> None:
    """Write the register so that it is never half there; raises ``OSError``."""
    write_atomically(folder / FILE, codec.to_json(register))
