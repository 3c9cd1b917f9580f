"""Keys and certificates on disk: where they lie, whose they are, which are trusted.

A folder of one key has ``key.pem``, ``cert.pem`` and ``ca.pem``. The folder of the authority
(:mod:`daemon.batch.security.authority`) has one of them for each key that was issued, and the
register. Zenoh matches common names exactly, so the daemon must know every name: it admits those in
the register, and a name that was revoked is never issued again.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import platformdirs

from daemon.batch.errors import KeysUnusable
from daemon.model.verbs import Role
from grammars.text import codec
from grammars.text.files import write_atomically

CA_FILE: Final = "ca.pem"
CERTIFICATE_FILE: Final = "cert.pem"
KEY_FILE: Final = "key.pem"
REGISTER_FILE: Final = "register.json"
KEYS_VARIABLE: Final = "SCENARIO_KEYS"


@dataclass(frozen=True, slots=True)
class IssuedKey:
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
class KeyList:
    """The keys of a folder, or some of them."""

    folder: Path
    keys: tuple[IssuedKey, ...]


@dataclass(frozen=True, slots=True)
class KeyRegister:
    """All certificates, the oldest first."""

    issued: tuple[IssuedKey, ...] = ()

    def find(self, name: str) -> IssuedKey | None:
        """Return the certificate of this common name."""
        return next((one for one in self.issued if one.name == name), None)

    def valid(self, role: Role) -> tuple[IssuedKey, ...]:
        """Return the certificates of a role that were not revoked, the oldest first."""
        return tuple(one for one in self.issued if one.role is role and one.revoked_at is None)

    def revoke(self, name: str, now: float) -> KeyRegister:
        """Return the register without trust in ``name``."""
        return KeyRegister(
            tuple(replace(one, revoked_at=now) if one.name == name else one for one in self.issued)
        )


def write_register(folder: Path, register: KeyRegister) -> None:
    """Write the register so that it is never half there; raises ``OSError``."""
    write_atomically(folder / REGISTER_FILE, codec.to_json(register))


@dataclass(frozen=True, slots=True)
class Credentials:
    """A key with its certificate: who somebody is for a daemon.

    ``name`` is the common name, ``expires_at`` [s since the epoch] what the certificate says.
    """

    folder: Path
    name: str
    role: Role
    expires_at: float

    @property
    def connecting(self) -> dict[str, object]:
        """Zenoh's TLS settings for connecting; the daemon must be who its address says."""
        return self._authority | {
            "connect_private_key": str(self.folder / KEY_FILE),
            "connect_certificate": str(self.folder / CERTIFICATE_FILE),
            "verify_name_on_connect": True,
        }

    @property
    def listening(self) -> dict[str, object]:
        """Zenoh's TLS settings for listening; only those with a certificate may connect."""
        return self._authority | {
            "listen_private_key": str(self.folder / KEY_FILE),
            "listen_certificate": str(self.folder / CERTIFICATE_FILE),
            # Otherwise a certificate is looked at once, when the link is made, and links live long.
            "close_link_on_expiration": True,
        }

    @property
    def _authority(self) -> dict[str, object]:
        return {"root_ca_certificate": str(self.folder / CA_FILE), "enable_mtls": True}


@dataclass(frozen=True, slots=True)
class DaemonCredentials:
    """What a daemon needs: its own key, and the names it admits.

    ``folder`` is where the register lies that says, later on, who was revoked.
    """

    credentials: Credentials
    register: KeyRegister
    folder: Path


def keys_folder(keys: Path | None = None, environ: Mapping[str, str] = os.environ) -> Path:
    """Choose the folder: the argument, ``SCENARIO_KEYS``, else ``keys`` in the user's settings."""
    chosen = keys or environ.get(KEYS_VARIABLE)
    path = Path(chosen) if chosen else platformdirs.user_config_path("scenario") / "keys"
    return path.expanduser().absolute()


def is_authority(folder: Path) -> bool:
    """Whether ``folder`` has the keys of everybody rather than one of them.

    A daemon's own folder has a register too, beside its certificate.
    """
    return (folder / REGISTER_FILE).exists() and not (folder / CERTIFICATE_FILE).exists()


def find_credentials(role: Role, keys: Path | None = None) -> Credentials:
    """Return whose key to use for connecting: the one in the folder, or the ``role``'s newest.

    Raises :class:`KeysUnusable` with the remedy.
    """
    folder = keys_folder(keys)
    if is_authority(folder):
        return _newest_of_role(folder, load_register(folder), role)
    return read_credentials(folder)


def find_daemon_credentials(keys: Path | None = None) -> DaemonCredentials:
    """Return what a daemon needs for listening; raises :class:`KeysUnusable` with the remedy."""
    folder = keys_folder(keys)
    register = load_register(folder)
    alone = not is_authority(folder)
    own = read_credentials(folder) if alone else _newest_of_role(folder, register, Role.DAEMON)
    if own.role is not Role.DAEMON:
        raise KeysUnusable(f'the key "{own.name}" in {folder} is not one of a daemon')
    return DaemonCredentials(own, register, folder)


def _newest_of_role(folder: Path, register: KeyRegister, role: Role) -> Credentials:
    names = [one.name for one in register.valid(role)]
    if not names:
        raise KeysUnusable(f"{folder} has no key of a {role}: `scenario keys issue {role}`")
    return read_credentials(folder / names[-1])


def load_register(folder: Path) -> KeyRegister:
    """Read the register of a keys folder; raises :class:`KeysUnusable` with the remedy."""
    try:
        return codec.from_json(KeyRegister, (folder / REGISTER_FILE).read_bytes())
    except OSError as error:
        raise KeysUnusable(
            f"there are no keys in {folder}: `scenario keys init` makes them, "
            f"--keys or {KEYS_VARIABLE} names another folder"
        ) from error
    except ValueError as error:
        raise KeysUnusable(
            f"{folder / REGISTER_FILE} is damaged: {codec.reading_error(error)}"
        ) from error


def read_credentials(folder: Path) -> Credentials:
    """Read whose key lies in ``folder``; raises :class:`KeysUnusable` with the remedy."""
    # Loaded when a key is read: on one machine nobody needs keys, and commands start often.
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    try:
        mode = (folder / KEY_FILE).stat().st_mode
        certificate = x509.load_pem_x509_certificate((folder / CERTIFICATE_FILE).read_bytes())
        (folder / CA_FILE).stat()
        (common,) = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
        name = str(common.value)
        role = Role(name.partition(".")[0])
    except OSError as error:
        raise KeysUnusable(
            f"there is no key in {folder} ({error.filename}: {error.strerror}): get one with "
            f"`scenario keys bundle`, or name its folder with --keys or {KEYS_VARIABLE}"
        ) from error
    except ValueError as error:
        raise KeysUnusable(f"{folder / CERTIFICATE_FILE} is none of ours: {error}") from error
    # As OpenSSH does: a key that others could read may be theirs by now.
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise KeysUnusable(
            f"others can read {folder / KEY_FILE}: chmod 600 it, or have a new one made"
        )
    return Credentials(folder, name, role, certificate.not_valid_after_utc.timestamp())
