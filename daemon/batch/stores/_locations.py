"""Where traces are kept: in the state directory or in a store named by a URL.

Whoever reads the marker in the state directory shares the daemon's file system.
"""

from __future__ import annotations

import re
import secrets
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from daemon.batch.paths import StatePaths
from daemon.model.ids import is_id
from grammars.text import codec
from grammars.text.files import write_atomically

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
    write_atomically(paths.marker, codec.to_json(marker))
    return marker


def read_marker(paths: StatePaths) -> Marker | None:
    """Return the marker in a directory, or ``None`` when there is none that can be read."""
    try:
        marker = codec.from_json(Marker, paths.marker.read_bytes())
    except (OSError, ValueError):
        return None
    return marker if is_id(marker.identity) else None
