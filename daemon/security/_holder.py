"""Keys as somebody holds them: where they lie, whose they are, what Zenoh must be told.

A holder's folder has ``key.pem``, ``cert.pem`` and ``ca.pem``. The folder in which the authority
lies (:mod:`daemon.security.authority`) has one of them for each key that was issued.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import platformdirs

from daemon.errors import KeysUnusable
from daemon.security._register import FILE, Register, read_register
from daemon.security._rules import Role

CA: Final = "ca.pem"
CERTIFICATE: Final = "cert.pem"
KEY: Final = "key.pem"
VARIABLE: Final = "SCENARIO_KEYS"


@dataclass(frozen=True, slots=True)
class Holder:
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
            "connect_private_key": str(self.folder / KEY),
            "connect_certificate": str(self.folder / CERTIFICATE),
            "verify_name_on_connect": True,
        }

    @property
    def listening(self) -> dict[str, object]:
        """Zenoh's TLS settings for listening; only those with a certificate may connect."""
        return self._authority | {
            "listen_private_key": str(self.folder / KEY),
            "listen_certificate": str(self.folder / CERTIFICATE),
            "close_link_on_expiration": True,
        }

    @property
    def _authority(self) -> dict[str, object]:
        return {"root_ca_certificate": str(self.folder / CA), "enable_mtls": True}


@dataclass(frozen=True, slots=True)
class DaemonKeys:
    """What a daemon needs: its own key, and the names it admits."""

    holder: Holder
    register: Register


def keys_folder(keys: Path | None = None, environ: Mapping[str, str] = os.environ) -> Path:
    """Choose the folder: the argument, ``SCENARIO_KEYS``, else ``keys`` in the user's settings."""
    chosen = keys or environ.get(VARIABLE)
    path = Path(chosen) if chosen else platformdirs.user_config_path("scenario") / "keys"
    return path.expanduser().absolute()


def is_authority(folder: Path) -> bool:
    """Whether ``folder`` has the keys of everybody rather than one of them."""
    return (folder / FILE).exists() and not (folder / CERTIFICATE).exists()


def find_holder(role: Role, keys: Path | None = None) -> Holder:
    """Return whose key to use for connecting: the one in the folder, or the ``role``'s newest.

    Raises :class:`KeysUnusable` with the remedy.
    """
    folder = keys_folder(keys)
    if is_authority(folder):
        return _newest(folder, registered(folder), role)
    return read_holder(folder)


def find_daemon_keys(keys: Path | None = None) -> DaemonKeys:
    """Return what a daemon needs for listening; raises :class:`KeysUnusable` with the remedy."""
    folder = keys_folder(keys)
    register = registered(folder)
    alone = not is_authority(folder)
    holder = read_holder(folder) if alone else _newest(folder, register, Role.DAEMON)
    if holder.role is not Role.DAEMON:
        raise KeysUnusable(f'the key "{holder.name}" in {folder} is not one of a daemon')
    return DaemonKeys(holder, register)


def _newest(folder: Path, register: Register, role: Role) -> Holder:
    names = [one.name for one in register.valid(role)]
    if not names:
        raise KeysUnusable(f"{folder} has no key of a {role}: `scenario keys issue {role}`")
    return read_holder(folder / names[-1])


def registered(folder: Path) -> Register:
    """Read the register of a keys folder; raises :class:`KeysUnusable` with the remedy."""
    try:
        return read_register(folder)
    except OSError as error:
        raise KeysUnusable(
            f"there are no keys in {folder}: `scenario keys init` makes them, "
            f"--keys or {VARIABLE} names another folder"
        ) from error
    except ValueError as error:
        raise KeysUnusable(f"{folder / FILE} is damaged: {error}") from error


def read_holder(folder: Path) -> Holder:
    """Read whose key lies in ``folder``; raises :class:`KeysUnusable` with the remedy."""
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    try:
        mode = (folder / KEY).stat().st_mode
        certificate = x509.load_pem_x509_certificate((folder / CERTIFICATE).read_bytes())
        (folder / CA).stat()
        (common,) = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
        name = str(common.value)
        role = Role(name.partition(".")[0])
    except OSError as error:
        raise KeysUnusable(
            f"there is no key in {folder} ({error.filename}: {error.strerror}): get one with "
            f"`scenario keys bundle`, or name its folder with --keys or {VARIABLE}"
        ) from error
    except ValueError as error:
        raise KeysUnusable(f"{folder / CERTIFICATE} is none of ours: {error}") from error
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise KeysUnusable(f"others can read {folder / KEY}: chmod 600 it, or have a new one made")
    return Holder(folder, name, role, certificate.not_valid_after_utc.timestamp())
