"""Store of traces: an fsspec URL that finished traces are moved to, and fetched from."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from urllib.parse import urlsplit

from grammars.text.files import sync_directory


def is_url(location: str) -> bool:
    """Whether a trace lies at a URL rather than at a path."""
    return "://" in location


def check_store_url(url: str) -> str:
    """Return the URL of a store without a slash at its end; raises ``ValueError`` for none."""
    from fsspec import available_protocols

    parts = urlsplit(url)
    if not is_url(url) or parts.scheme not in available_protocols():
        raise ValueError(f"{url!r} is no store: write file:///mnt/traces or s3://bucket/folder")
    if parts.scheme == "file" and (parts.netloc or len(parts.path) < 2):
        raise ValueError(f"{url!r} has no absolute path: write file:///mnt/traces")
    if parts.password is not None or parts.query:
        raise ValueError("the URL has credentials in it: they belong into the environment")
    return url.rstrip("/")


def copy_between(source: str, target: str) -> None:
    """Copy a file from a path or URL to another, for good; raises ``OSError``."""
    import fsspec

    try:
        with fsspec.open(source) as taken, fsspec.open(target, "wb") as given:
            shutil.copyfileobj(taken, given)
        if target.startswith("file://"):
            _sync(Path(target.removeprefix("file://")))
    except Exception as error:  # the library behind a URL may raise anything
        url = source if is_url(source) else target
        why = getattr(error, "strerror", "") or repr(error)
        raise OSError(f"{url} cannot be used from here: {why}") from error


def _sync(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
    sync_directory(path.parent)
