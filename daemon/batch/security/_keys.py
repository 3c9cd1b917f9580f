"""Keys and certificates on disk: folders, holders and the register of trusted ones.

A folder of one key has ``key.pem``, ``cert.pem`` and ``ca.pem``. The folder of the authority
(:mod:`daemon.batch.security.authority`) has one such folder for each issued key, and the register.
Zenoh matches common names exactly, so the daemon must know every name: it admits those in the
register. A revoked name is never issued again.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from daemon.batch.errors import KeysUnusable
from daemon.model.verbs import Role
from grammars.text import codec
from grammars.text.files import user_folder, write_atomically, written_path

CA_FILE: Final = "ca.pem"
CERTIFICATE_FILE: Final = "cert.pem"
KEY_FILE: Final = "key.pem"
REGISTER_FILE: Final = "register.json"
KEYS_VARIABLE: Final = "SCENARIO_KEYS"
_PATIENCE: Final = 2.0
"""Limit of a TCP connection and a handshake, after the daemon has failed to answer [s]."""


@dataclass(frozen=True, slots=True)
class IssuedKey:
    """A certificate: ``name`` is its common name, times are seconds since the epoch.

    ``fingerprint`` is the SHA-256 of the certificate; ``hosts`` are the host names of a daemon.
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
        """Return the unrevoked certificates of a role, the oldest first."""
        return tuple(one for one in self.issued if one.role is role and one.revoked_at is None)

    def revoke(self, name: str, now: float) -> KeyRegister:
        """Return the register without trust in ``name``."""
        return KeyRegister(
            tuple(replace(one, revoked_at=now) if one.name == name else one for one in self.issued)
        )


def write_register(folder: Path, register: KeyRegister) -> None:
    """Write the register atomically; raises ``OSError``."""
    write_atomically(folder / REGISTER_FILE, codec.to_json(register))


@dataclass(frozen=True, slots=True)
class Credentials:
    """A key with its certificate: the identity of a client or daemon.

    ``name`` is the common name, ``expires_at`` [s since the epoch] the end of the certificate.
    """

    folder: Path
    name: str
    role: Role
    expires_at: float

    @property
    def connecting(self) -> dict[str, object]:
        """Zenoh's TLS settings for connecting, with verification of the daemon's address."""
        return self._authority | {
            "connect_private_key": str(self.folder / KEY_FILE),
            "connect_certificate": str(self.folder / CERTIFICATE_FILE),
            "verify_name_on_connect": True,
        }

    @property
    def listening(self) -> dict[str, object]:
        """Zenoh's TLS settings for listening; clients need a certificate."""
        return self._authority | {
            "listen_private_key": str(self.folder / KEY_FILE),
            "listen_certificate": str(self.folder / CERTIFICATE_FILE),
            # Otherwise a certificate is checked only once per link, and links live long.
            "close_link_on_expiration": True,
        }

    @property
    def _authority(self) -> dict[str, object]:
        return {"root_ca_certificate": str(self.folder / CA_FILE), "enable_mtls": True}


@dataclass(frozen=True, slots=True)
class DaemonCredentials:
    """The daemon's own key, and the names it admits.

    ``folder`` has the register, which is checked for revoked names later.
    """

    credentials: Credentials
    register: KeyRegister
    folder: Path


def keys_folder(keys: Path | None = None, environ: Mapping[str, str] = os.environ) -> Path:
    """Choose the folder: the argument, ``SCENARIO_KEYS``, else ``keys`` in the user's settings."""
    return written_path(keys or environ.get(KEYS_VARIABLE) or user_folder("config") / "keys")


def is_authority(folder: Path) -> bool:
    """Return whether ``folder`` has all keys rather than one of them.

    A daemon's own folder also has a register, next to its certificate.
    """
    return (folder / REGISTER_FILE).exists() and not (folder / CERTIFICATE_FILE).exists()


def find_credentials(role: Role, keys: Path | None = None) -> Credentials:
    """Return the key for connecting: the one in the folder, or the newest of ``role``.

    Raises :class:`KeysUnusable` with the remedy.
    """
    folder = keys_folder(keys)
    if is_authority(folder):
        return _newest_of_role(folder, load_register(folder), role)
    return read_credentials(folder)


def find_daemon_credentials(keys: Path | None = None) -> DaemonCredentials:
    """Return the keys of a daemon for listening; raises :class:`KeysUnusable` with the remedy."""
    folder = keys_folder(keys)
    register = load_register(folder)
    if is_authority(folder):
        own = _newest_of_role(folder, register, Role.DAEMON)
    else:
        own = read_credentials(folder)
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
    """Read the key in ``folder``; raises :class:`KeysUnusable` with the remedy."""
    # Imported here: most commands need no keys.
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
        words = f"{folder / CERTIFICATE_FILE} is not one of our certificates: {error}"
        raise KeysUnusable(words) from error
    # As OpenSSH does: others may have copied a readable key.
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise KeysUnusable(
            f"others can read {folder / KEY_FILE}: chmod 600 it, or have a new one made"
        )
    return Credentials(folder, name, role, certificate.not_valid_after_utc.timestamp())


def handshake_problem(endpoint: str, credentials: Credentials) -> str:
    """Try a TLS handshake at ``endpoint`` and return the reason of its failure.

    Zenoh does not report one. Empty if nobody listens there, or if the handshake succeeds.
    """
    # Imported here: most commands connect to a socket of this machine.
    import socket
    import ssl

    host, _, port = endpoint.removeprefix("tls/").rpartition(":")
    host = host.strip("[]")
    try:
        context = ssl.create_default_context(cafile=str(credentials.folder / CA_FILE))
        context.load_cert_chain(
            credentials.folder / CERTIFICATE_FILE, credentials.folder / KEY_FILE
        )
        with (
            socket.create_connection((host, int(port)), timeout=_PATIENCE) as plain,
            context.wrap_socket(plain, server_hostname=host) as wrapped,
        ):
            # TLS 1.3: an objection to our certificate arrives after the handshake.
            wrapped.settimeout(_PATIENCE / 10)
            wrapped.recv(1)
    except ssl.SSLCertVerificationError as error:
        return (
            f"the listener there does not prove to be the daemon of these keys: "
            f"{error.verify_message.rstrip('.')} (keys of {credentials.folder})"
        )
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).replace("_", " ").lower()
        key = f'the key "{credentials.name}" in {credentials.folder}'
        return f"the listener there does not accept {key}: {reason}"
    except OSError:
        return ""
    return ""
