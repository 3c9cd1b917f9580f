"""The marker of a state directory: it tells one directory from another, and from a copy."""

from __future__ import annotations

import secrets
from dataclasses import dataclass

from daemon.batch.paths import StatePaths
from daemon.model.ids import is_id
from grammars.text import codec
from grammars.text.files import write_atomically


@dataclass(frozen=True, slots=True)
class Marker:
    """Contents of the marker: the ``identity`` of the directory, and the ``era`` of its ledger."""

    identity: str
    era: str


def write_marker(paths: StatePaths, era: str) -> Marker:
    """Write a marker nobody can know from elsewhere, and return it.

    The directory keeps its identity for good. The era is new with each start of a daemon: a copy of
    the directory on another machine, under the same path, is not mistaken for it. Raises
    ``OSError``.
    """
    known = read_marker(paths)
    identity = known.identity if known is not None else secrets.token_hex(8)
    marker = Marker(identity, era)
    write_atomically(paths.marker, codec.to_json(marker), mode=0o600)
    return marker


def read_marker(paths: StatePaths) -> Marker | None:
    """Return the marker in a directory, or ``None`` when there is none that can be read."""
    try:
        marker = codec.from_json(Marker, paths.marker.read_bytes())
    except (OSError, ValueError):
        return None
    return marker if is_id(marker.identity) else None
