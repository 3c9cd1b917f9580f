"""Stores of traces: their URLs, the marker of a state directory, putting and getting."""

from __future__ import annotations

import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from daemon.batch.paths import StatePaths
from daemon.model.ids import is_id
from grammars.text import codec
from grammars.text.files import replacing, write_atomically

_URL: Final = re.compile(r"[a-z][a-z0-9+.-]*://")
# Of 64: enough to tell the few traces of one run apart, short enough to read in a listing.
_SHOWN_DIGEST: Final = 16


def is_url(location: str) -> bool:
    """Whether a trace lies at a URL rather than at a path."""
    return _URL.match(location) is not None


def check_store_url(url: str) -> str:
    """Return the URL of a store as it is recorded: without a slash at the end.

    Raises ``ValueError`` for what is no usable URL, and for one with credentials in it: those
    stay in the environment of the workers.
    """
    if not is_url(url):
        raise ValueError(f"{url!r} is no URL: write file:///mnt/traces or s3://bucket/folder")
    parts = urlsplit(url)
    if parts.password is not None or parts.query or parts.fragment:
        raise ValueError(
            "the URL of a store carries no password and no options: "
            "what workers need to open it belongs into their environment"
        )
    if "::" in url or any(ord(sign) < 33 for sign in url):
        raise ValueError(f"{url!r} is no plain URL")
    if ".." in parts.path.split("/"):
        raise ValueError(f"{url!r} leads out of itself")
    if parts.scheme == "file" and (parts.netloc or len(parts.path) < 2):
        raise ValueError(f"{url!r} has no absolute path: write file:///mnt/traces")
    _check_protocol(parts.scheme)
    return url.rstrip("/")


def _check_protocol(name: str) -> None:
    # Imported here: most daemons keep traces in their own directory.
    from fsspec import available_protocols

    from grammars.text.diagnostics import did_you_mean

    known = available_protocols()
    if name not in known:
        raise ValueError(f"{name}:// is no store: {did_you_mean(name, known)}")


def trace_url(store: str, trace: str, sha256: str) -> str:
    """Return the URL of a trace in a store, by its name and its digest.

    Traces that differ have different URLs: whoever writes one never harms another.
    """
    stem = trace.removesuffix(".mcap")
    return f"{store}/{stem}.{sha256[:_SHOWN_DIGEST]}.mcap"


@dataclass(frozen=True, slots=True)
class Marker:
    """What stands in the marker: the directory's ``identity``, and the ``probe`` of one start."""

    identity: str
    probe: str


def write_marker(paths: StatePaths) -> Marker:
    """Write a marker nobody can know from elsewhere, and return it.

    The directory keeps its identity for good. The probe is new each time: a copy of the directory
    on another machine, under the same path, is not mistaken for it. Raises ``OSError``.
    """
    known = read_marker(paths)
    identity = known.identity if known is not None else secrets.token_hex(8)
    marker = Marker(identity, secrets.token_hex(16))
    write_atomically(paths.marker, codec.to_json(marker), mode=0o600)
    return marker


def read_marker(paths: StatePaths) -> Marker | None:
    """Return the marker in a directory, or ``None`` when there is none that can be read."""
    try:
        marker = codec.from_json(Marker, paths.marker.read_bytes())
    except (OSError, ValueError):
        return None
    return marker if is_id(marker.identity) else None


_WHOLE_PUTS: Final = frozenset(
    (
        "s3",
        "s3a",
        "gs",
        "gcs",
        "abfs",
        "abfss",
        "az",
        "adl",
        "oci",
        "ocilake",
        "oss",
        "tos",
        "tosfs",
    )
)
"""Object stores: what is put there appears as a whole or not at all, and moving is copying."""


class StoreUnusable(OSError):  # noqa: N818  (reads as a sentence where it is raised)
    """A store cannot be reached, read or written just now, or from here."""


def probe_store(store: str) -> None:
    """Write something into a store and remove it; raises :class:`StoreUnusable` with a remedy."""
    with _explained(store):
        name = f"{store}/.scenario-{secrets.token_hex(8)}"
        if folder := _local_path(store):
            folder.mkdir(parents=True, exist_ok=True)
            probe = folder / name.rpartition("/")[2]
            probe.write_bytes(b"")
            probe.unlink()
            return
        files, path = _open(name)
        files.makedirs(path.rpartition("/")[0], exist_ok=True)
        files.pipe_file(path, b"scenario")
        files.rm_file(path)


def put_in_store(source: Path, url: str) -> None:
    """Put a file there unless it is there; afterwards it is, as a whole and for good.

    Raises :class:`StoreUnusable`.
    """
    with _explained(url):
        if target := _local_path(url):
            _put_here(source, target)
        else:
            _put_there(source, *_open(url), url=url)


def _put_here(source: Path, target: Path) -> None:
    # The name has the digest in it and a file gets its name when it is whole: the size is enough.
    if target.is_file() and target.stat().st_size == source.stat().st_size:
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with replacing(target) as temporary:
        shutil.copyfile(source, temporary)


def _put_there(source: Path, files: Any, path: str, *, url: str) -> None:
    if files.exists(path) and files.size(path) == source.stat().st_size:
        return
    folder, _, name = path.rpartition("/")
    files.makedirs(folder, exist_ok=True)
    if urlsplit(url).scheme in _WHOLE_PUTS:
        files.put_file(str(source), path)
        return
    temporary = f"{folder}/.{name}.{secrets.token_hex(4)}.tmp"
    files.put_file(str(source), temporary)
    files.mv(temporary, path)


def get_from_store(url: str, target: Path) -> None:
    """Copy what lies there to a file; raises :class:`StoreUnusable`."""
    with _explained(url):
        if source := _local_path(url):
            shutil.copyfile(source, target)
        else:
            files, path = _open(url)
            files.get_file(path, str(target))


def remove_from_store(url: str) -> None:
    """Remove what lies there, if anything does; raises :class:`StoreUnusable`."""
    with _explained(url):
        if target := _local_path(url):
            target.unlink(missing_ok=True)
            return
        files, path = _open(url)
        if files.exists(path):
            files.rm_file(path)


def _local_path(url: str) -> Path | None:
    """The path a URL means on this machine: those need no library."""
    parts = urlsplit(url)
    return Path(parts.path) if parts.scheme == "file" else None


def _open(url: str) -> tuple[Any, str]:
    from fsspec.core import url_to_fs

    found: tuple[Any, str] = url_to_fs(url)
    return found


@contextmanager
def _explained(url: str) -> Iterator[None]:
    """Say what went wrong: in the words of the system, never in those of a library."""
    try:
        yield
    except ImportError as error:
        raise StoreUnusable(f"{url} cannot be opened here: {error}") from error
    except OSError as error:
        why = error.strerror or type(error).__name__
        raise StoreUnusable(f"{url} cannot be used from here: {why}") from error
    except Exception as error:
        raise StoreUnusable(
            f"{url} cannot be used from here ({type(error).__name__}): "
            "see what its library needs in the environment, credentials say"
        ) from error
