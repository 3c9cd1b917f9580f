"""Store of traces: an fsspec URL that finished traces are moved to, and fetched from."""

from __future__ import annotations

import re
import shutil
from typing import Final
from urllib.parse import urlsplit

_URL: Final = re.compile(r"[a-z][a-z0-9+.-]*://")
_SHOWN_DIGEST: Final = 16


def is_url(location: str) -> bool:
    """Whether a trace lies at a URL rather than at a path."""
    return _URL.match(location) is not None


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


def trace_url(store: str, trace: str, sha256: str) -> str:
    """Return the URL of a trace in a store; traces that differ have different ones."""
    return f"{store}/{trace.removesuffix('.mcap')}.{sha256[:_SHOWN_DIGEST]}.mcap"


def copy_between(source: str, target: str) -> None:
    """Copy a file from a path or URL to another; raises ``OSError``."""
    import fsspec

    try:
        with fsspec.open(source) as taken, fsspec.open(target, "wb") as given:
            shutil.copyfileobj(taken, given)
    except Exception as error:  # the library behind a URL may raise anything
        url = source if is_url(source) else target
        why = getattr(error, "strerror", "") or repr(error)
        raise OSError(f"{url} cannot be used from here: {why}") from error
