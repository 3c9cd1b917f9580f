"""Packing a key for the machine where it is used."""

from __future__ import annotations

import io
import os
import tarfile
from pathlib import Path
from typing import Final

from daemon.errors import KeysUnusable
from daemon.security._holder import CA, CERTIFICATE, KEY, registered
from daemon.security._register import FILE
from daemon.security._rules import Role

_INSIDE: Final = "keys"


def pack(folder: Path, name: str, output: Path) -> None:
    """Write the key ``name`` with what goes with it to ``output``: a new ``.tar``, or a new folder.

    In the archive everything lies below ``keys``, the default place of keys among a user's
    settings. A daemon gets the register too. Readable by its owner only. Raises
    :class:`KeysUnusable` when there is no such key or ``output`` exists, and ``OSError``.
    """
    issued = registered(folder).find(name)
    if issued is None or issued.revoked_at is not None:
        names = ", ".join(one.name for one in registered(folder).issued if one.revoked_at is None)
        raise KeysUnusable(f'there is no key "{name}" to pack; there are {names}')
    files = {file: (folder / name / file).read_bytes() for file in (CA, CERTIFICATE, KEY)}
    if issued.role is Role.DAEMON:
        files[FILE] = (folder / FILE).read_bytes()
    try:
        if output.suffix == ".tar":
            _write(output, _archive(files, issued.issued_at))
        else:
            output.mkdir(mode=0o700)
            for file, data in files.items():
                _write(output / file, data)
    except FileExistsError as error:
        raise KeysUnusable(f"{output} is there already: name another file") from error


def _archive(files: dict[str, bytes], at: float) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.PAX_FORMAT) as archive:
        inside = tarfile.TarInfo(_INSIDE)
        inside.type, inside.mode, inside.mtime = tarfile.DIRTYPE, 0o700, int(at)
        archive.addfile(inside)
        for file, data in files.items():
            entry = tarfile.TarInfo(f"{_INSIDE}/{file}")
            entry.size, entry.mode, entry.mtime = len(data), 0o600, int(at)
            archive.addfile(entry, io.BytesIO(data))
    return buffer.getvalue()


def _write(path: Path, data: bytes) -> None:
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)
