"""The marker in the state directory: whoever reads it there shares the daemon's file system."""

from __future__ import annotations

import secrets
from dataclasses import dataclass

from daemon.places import Places, is_id, write_atomically
from grammars import codec


@dataclass(frozen=True, slots=True)
class Marker:
    """What stands in the marker: the directory's ``identity``, and the ``probe`` of one start."""

    identity: str
    probe: str


def leave_marker(places: Places) -> Marker:
    """Write a marker nobody can know from elsewhere, and return it.

    The directory keeps its identity for good. The probe is new each time: a copy of the directory
    on another machine, under the same path, is not mistaken for it. Raises ``OSError``.
    """
    known = read_marker(places)
    identity = known.identity if known is not None else secrets.token_hex(8)
    marker = Marker(identity, secrets.token_hex(16))
    write_atomically(places.marker, codec.to_json(marker))
    return marker


def read_marker(places: Places) -> Marker | None:
    """Return the marker in a directory, or ``None`` when there is none that can be read."""
    try:
        marker = codec.from_json(Marker, places.marker.read_bytes())
    except (OSError, ValueError):
        return None
    return marker if is_id(marker.identity) else None
