"""The map that a run gives to its system under test: drawn from its scene, or from a file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from daemon.model.attachments import stored_file
from daemon.model.spec import MapSettings
from grammars.model.grid import OccupancyGrid
from grammars.model.map_files import unpack_map
from grammars.model.scene import Scene
from templates.occupancy import occupancy_grid, with_objects

_MOST_BUILDINGS: Final = 4
_buildings: Final[dict[tuple[object, ...], OccupancyGrid]] = {}
"""The last maps of buildings, for the runs of a process and its children: drawing the published
building takes a tenth of the time of its shortest runs."""


class MapMissingError(ValueError):
    """A map file is missing on this machine, or differs from the specified one."""


def run_map(
    settings: MapSettings, scene: Scene, laser_height: float, joints: Mapping[str, float]
) -> OccupancyGrid:
    """Return the map of a run whose first laser is ``laser_height`` [m] above the floor.

    ``joints`` are the initial positions of the doors [rad or m], by scene-wide name.
    Raises :class:`MapMissingError`.
    """
    if settings.file:
        return stored_map(settings.file)
    key = (scene.digest, settings.resolution, settings.rule, laser_height)
    if key not in _buildings:
        if len(_buildings) == _MOST_BUILDINGS:
            del _buildings[next(iter(_buildings))]
        _buildings[key] = occupancy_grid(
            scene, resolution=settings.resolution, laser_height=laser_height, rule=settings.rule
        )
    building = _buildings[key]
    if settings.doors == "initial":
        return with_objects(
            building, scene, laser_height=laser_height, joints=joints, rule=settings.rule
        )
    # A copy for every run: a system under test may write into its map.
    return replace(building, cells=building.cells.copy())


def stored_map(digest: str) -> OccupancyGrid:
    """Return the map of a file by its digest; raises :class:`MapMissingError`."""
    path = stored_file(digest)
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise MapMissingError(
            f"the map {digest[:12]} of the run cannot be read: {path}: {reason}; "
            "load its campaign again to restore it"
        ) from error
    if hashlib.sha256(data).hexdigest() != digest:
        raise MapMissingError(f"{path} is not the map {digest[:12]} any more: remove it")
    return unpack_map(data)
