"""The map that a run gives to its system under test: drawn of its scene, or one of its own."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from daemon.model.attachments import stored_file
from daemon.model.spec import MapSettings
from grammars.model.grid import OccupancyGrid
from grammars.model.map_files import unpack_map
from grammars.model.scene import Scene
from templates.occupancy import occupancy_grid


class MapMissingError(ValueError):
    """A map of one's own is not on this machine, or not the one that was specified."""


def run_map(
    settings: MapSettings, scene: Scene, laser_height: float, joints: Mapping[str, float]
) -> OccupancyGrid:
    """Return the map of a run whose first laser is ``laser_height`` [m] above the floor.

    ``joints`` are where the doors start [rad or m], by scene-wide name.
    Raises :class:`MapMissingError`.
    """
    if settings.file:
        return stored_map(settings.file)
    return occupancy_grid(
        scene,
        resolution=settings.resolution,
        laser_height=laser_height,
        joints=joints if settings.doors == "initial" else None,
        rule=settings.rule,
    )


def stored_map(digest: str) -> OccupancyGrid:
    """Return a map of one's own by its digest; raises :class:`MapMissingError`."""
    path = stored_file(digest)
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise MapMissingError(
            f"the map {digest[:12]} of the run cannot be read: {path}: {reason}; "
            "loading its campaign again puts it there"
        ) from error
    if hashlib.sha256(data).hexdigest() != digest:
        raise MapMissingError(f"{path} is not the map {digest[:12]} any more: remove it")
    return unpack_map(data)
