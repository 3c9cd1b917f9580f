"""The certificate authority: making, revoking and packing keys and certificates.

Elliptic curve P-256, SHA-256, X.509 v3. Certificates of the daemon are for servers only and all
others for clients only, so a worker cannot impersonate the daemon (RFC 5280, 4.2.1.12).
"""

from __future__ import annotations

import fcntl
import io
import ipaddress
import os
import re
import shutil
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from daemon.batch.errors import KeysUnusable
from daemon.batch.security._keys import (
    CA_FILE,
    CERTIFICATE_FILE,
    KEY_FILE,
    REGISTER_FILE,
    IssuedKey,
    KeyRegister,
    load_register,
    write_register,
)
from daemon.model.verbs import Role
from grammars.text.files import sync_directory

VALID_DAYS: Final = 730
_CA_DAYS: Final = 3650
"""Lifetime of the authority, long since a new authority needs new keys for everybody."""
_CA_KEY: Final = "ca.key"
_LEEWAY: Final = timedelta(minutes=10)
"""Validity of a certificate before its creation, for slow clocks."""
_NAME: Final = re.compile(r"[a-z0-9][a-z0-9-]{0,39}\Z")
_ARCHIVE_FOLDER: Final = "keys"
_HOST: Final = re.compile(r"[A-Za-z0-9_]([A-Za-z0-9_.-]{0,250}[A-Za-z0-9])?\Z")


@dataclass(frozen=True, slots=True)
class _Signer:
    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


def create_authority(
    folder: Path, hosts: Sequence[str], now: datetime, days: int = VALID_DAYS
) -> KeyRegister:
    """Make an authority in ``folder`` with keys ``daemon``, ``worker``, ``operator``, ``viewer``.

    The daemon's certificate is for ``hosts``, names and addresses. Raises :class:`KeysUnusable`
    if the folder has one already (files are never overwritten) or for an invalid host, and
    ``OSError``.
    """
    _checked_hosts(hosts)
    if (folder / _CA_KEY).exists() or (folder / REGISTER_FILE).exists():
        raise KeysUnusable(f"{folder} has keys already: `scenario keys issue` makes more")
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    _make_authority(folder, now)
    for role in Role:
        issue_key(folder, role, "", hosts if role is Role.DAEMON else (), now, days)
    return load_register(folder)


def issue_key(
    folder: Path, role: Role, name: str, hosts: Sequence[str], now: datetime, days: int = VALID_DAYS
) -> IssuedKey:
    """Make one more key; its common name is ``role`` or ``role.name``.

    Raises :class:`KeysUnusable` for a name issued before, revoked or not, and ``OSError``.
    """
    if name and not _NAME.match(name):
        raise KeysUnusable(f'"{name}" is not a valid name of a key: use up to 40 of a-z 0-9 -')
    if (role is Role.DAEMON) != bool(hosts):
        raise KeysUnusable("a key of a daemon needs its hosts, other keys have none")
    common = f"{role}.{name}" if name else str(role)
    with _locked(folder) as (signer, register):
        existing = register.find(common)
        if existing is not None:
            state = "was revoked" if existing.revoked_at is not None else "exists"
            raise KeysUnusable(f'the key "{common}" {state}: choose another name')
        key = ec.generate_private_key(ec.SECP256R1())
        certificate = _sign(signer, key, common, role, _checked_hosts(hosts), now, days)
        # First the key, then the register: a key outside of the register is never admitted.
        _store_key(folder, common, key, certificate)
        entry = IssuedKey(
            common,
            role,
            tuple(hosts),
            certificate.not_valid_before_utc.timestamp() + _LEEWAY.total_seconds(),
            certificate.not_valid_after_utc.timestamp(),
            certificate.fingerprint(hashes.SHA256()).hex(),
        )
        write_register(folder, KeyRegister((*register.issued, entry)))
    return entry


def revoke_key(folder: Path, name: str, now: datetime) -> None:
    """Revoke a key; a daemon that starts afterwards does not admit it.

    Raises :class:`KeysUnusable` for an unknown name, and ``OSError``.
    """
    with _locked(folder) as (_, register):
        issued = register.find(name)
        if issued is None:
            names = ", ".join(one.name for one in register.issued)
            raise KeysUnusable(f'there is no key "{name}"; there are {names}')
        if issued.revoked_at is None:
            write_register(folder, register.revoke(name, now.timestamp()))


def utc_now() -> datetime:
    """Return the current time in whole seconds, as in certificates."""
    return datetime.now(UTC).replace(microsecond=0)


@contextmanager
def _locked(folder: Path) -> Iterator[tuple[_Signer, KeyRegister]]:
    """Lock the authority, so that concurrent changes of the register are not lost."""
    try:
        with (folder / _CA_KEY).open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            key = serialization.load_pem_private_key(file.read(), None)
            certificate = x509.load_pem_x509_certificate((folder / CA_FILE).read_bytes())
            if not isinstance(key, ec.EllipticCurvePrivateKey):
                raise ValueError(f"{_CA_KEY} is not a key of an elliptic curve")
            yield _Signer(certificate, key), load_register(folder)
    except FileNotFoundError as error:
        words = f"{folder} has no authority, {error.filename} is missing"
        raise KeysUnusable(f"{words}: `scenario keys init` makes one") from error
    except ValueError as error:
        raise KeysUnusable(f"the authority in {folder} is damaged: {error}") from error


def _make_authority(folder: Path, now: datetime) -> None:
    key = ec.generate_private_key(ec.SECP256R1())
    # A unique name: of two authorities with one name TLS libraries may try the wrong one.
    name = _x509_name(f"scenario authority {os.urandom(4).hex()}")
    builder = _builder(name, name, key, now, _CA_DAYS)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(_usage(signs=True), critical=True)
    identifier = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
    builder = builder.add_extension(identifier, critical=False)
    certificate = builder.sign(key, hashes.SHA256())
    _write_key(folder / _CA_KEY, key)
    _write(folder / CA_FILE, certificate.public_bytes(serialization.Encoding.PEM))
    write_register(folder, KeyRegister())


def _sign(
    signer: _Signer,
    key: ec.EllipticCurvePrivateKey,
    common: str,
    role: Role,
    hosts: Sequence[x509.GeneralName],
    now: datetime,
    days: int,
) -> x509.Certificate:
    serves = role is Role.DAEMON
    purpose = ExtendedKeyUsageOID.SERVER_AUTH if serves else ExtendedKeyUsageOID.CLIENT_AUTH
    builder = _builder(_x509_name(common), signer.certificate.subject, key, now, days)
    builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), True)
    builder = builder.add_extension(_usage(signs=False), critical=True)
    issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.key.public_key())
    builder = builder.add_extension(issuer, critical=False)
    builder = builder.add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
    if hosts:
        builder = builder.add_extension(x509.SubjectAlternativeName(hosts), critical=False)
    return builder.sign(signer.key, hashes.SHA256())


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, now: datetime, days: int
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _LEEWAY)
        .not_valid_after(now + timedelta(days=days))
    )


def _x509_name(common: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common)])


def _usage(*, signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs,
        crl_sign=signs,
        encipher_only=False,
        decipher_only=False,
    )


def _checked_hosts(hosts: Sequence[str]) -> tuple[x509.GeneralName, ...]:
    return tuple(_checked_host(host) for host in hosts)


def _checked_host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        if not _HOST.match(host):
            raise KeysUnusable(f'"{host}" is neither the name of a host nor an address') from None
    return x509.DNSName(host)


def _store_key(
    folder: Path, common: str, key: ec.EllipticCurvePrivateKey, certificate: x509.Certificate
) -> None:
    """Store a key with its certificates in a folder of its own, completely or not at all."""
    temporary = Path(tempfile.mkdtemp(prefix=".new-", dir=folder))  # of mode 0700
    try:
        _write_key(temporary / KEY_FILE, key)
        _write(temporary / CERTIFICATE_FILE, certificate.public_bytes(serialization.Encoding.PEM))
        _write(temporary / CA_FILE, (folder / CA_FILE).read_bytes())
        temporary.rename(folder / common)
    except OSError as error:
        shutil.rmtree(temporary)
        raise KeysUnusable(f"cannot keep the key in {folder / common}: {error.strerror}") from error
    sync_directory(folder)


def _write_key(path: Path, key: ec.EllipticCurvePrivateKey) -> None:
    data = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    _write(path, data)


def _write(path: Path, data: bytes) -> None:
    """Write a new file for its owner only; raises ``FileExistsError`` for an existing one."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def pack_key(folder: Path, name: str, output: Path) -> None:
    """Write the key ``name`` with its certificates to ``output``, a new tar archive.

    The archive has the folder ``keys``, the default name in a user's settings. A daemon's archive
    includes the register. Readable by its owner only. Raises :class:`KeysUnusable` for an unknown
    key or if ``output`` exists, and ``OSError``.
    """
    valid = {one.name: one for one in load_register(folder).issued if one.revoked_at is None}
    issued = valid.get(name)
    if issued is None:
        names = ", ".join(valid)
        raise KeysUnusable(f'there is no key "{name}" to pack; there are {names}')
    files = {
        file: (folder / name / file).read_bytes() for file in (CA_FILE, CERTIFICATE_FILE, KEY_FILE)
    }
    if issued.role is Role.DAEMON:
        files[REGISTER_FILE] = (folder / REGISTER_FILE).read_bytes()
    try:
        _write(output, _archive(files, issued.issued_at))
    except FileExistsError as error:
        raise KeysUnusable(f"{output} exists already: name another file") from error


def _archive(files: dict[str, bytes], at: float) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.PAX_FORMAT) as archive:
        inside = tarfile.TarInfo(_ARCHIVE_FOLDER)
        inside.type, inside.mode, inside.mtime = tarfile.DIRTYPE, 0o700, int(at)
        archive.addfile(inside)
        for file, data in files.items():
            entry = tarfile.TarInfo(f"{_ARCHIVE_FOLDER}/{file}")
            entry.size, entry.mode, entry.mtime = len(data), 0o600, int(at)
            archive.addfile(entry, io.BytesIO(data))
    return buffer.getvalue()
