"""Putting traces into stores and getting them out: file systems and object stores by URL.

Credentials are found by the libraries behind fsspec in the environment; nothing of them is passed
on, and words of those libraries are not repeated.
"""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from grammars.text.files import replacing

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
