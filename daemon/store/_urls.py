"""Where traces can be kept besides the state directory: names of stores and of what lies there."""

from __future__ import annotations

import re
from typing import Final
from urllib.parse import urlsplit

_URL: Final = re.compile(r"[a-z][a-z0-9+.-]*://")
_SHOWN_DIGEST: Final = 16


def is_url(location: str) -> bool:
    """Whether a trace lies at a URL rather than at a path."""
    return _URL.match(location) is not None


def checked_store(url: str) -> str:
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
    from fsspec import available_protocols

    from grammars.diagnostics import did_you_mean

    known = available_protocols()
    if name not in known:
        raise ValueError(f"{name}:// is no store: {did_you_mean(name, known)}")


def stored_url(store: str, trace: str, sha256: str) -> str:
    """Return the URL of a trace in a store, by its name and its digest.

    Traces that differ have different URLs: whoever writes one never harms another.
    """
    stem = trace.removesuffix(".mcap")
    return f"{store}/{stem}.{sha256[:_SHOWN_DIGEST]}.mcap"
