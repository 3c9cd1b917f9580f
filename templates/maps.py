"""Maps as files: occupancy grids of the building, and of its doors in each state."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path
from typing import Final

from grammars.model.behaviour import start_positions
from grammars.model.grid import MapRule, OccupancyGrid
from grammars.model.map_files import write_map
from grammars.model.scene import Scene
from templates.naming import file_name, free_name
from templates.occupancy import occupancy_grid, with_objects
from templates.world import BehaviourDraw, ExportJob

_START: Final = "start"
"""Suffix of the name of the map with objects at their start."""


def map_file(job: ExportJob, draw: BehaviourDraw) -> str:
    """Return the map for a navigation stack in a run of ``draw``, relative to the world's folder.

    It is the map that the campaign declares. Worlds with objects have several maps, in their own
    folder.
    """
    world = job.world
    initial = world.doors == "initial" and world.scene.objects and world.given_map is None
    ending = _start_ending(job, draw) if initial else ""
    return f"{_stem(job)}-{ending}.yaml" if ending else f"{_stem(job)}.yaml"


def _stem(job: ExportJob) -> str:
    return f"maps/{job.building}" if job.world.scene.objects else job.building


def _start_ending(job: ExportJob, draw: BehaviourDraw) -> str:
    """Return the suffix of the map's name at the start of ``draw``.

    It names the first draw with the same start positions.
    """
    scene, draws = job.world.scene, job.world.draws
    start = start_positions(scene, draw.behaviours)
    like = next(d for d in draws if start_positions(scene, d.behaviours) == start)
    return _START if like is draws[0] else f"{_START}-{like.name}"


@functools.lru_cache(maxsize=2)
def _building_map(
    building: Scene, resolution: float, laser_height: float, rule: MapRule
) -> OccupancyGrid:
    """Return the map of a scene without objects, which worlds of one building share."""
    return occupancy_grid(building, resolution=resolution, laser_height=laser_height, rule=rule)


def write_maps(job: ExportJob) -> tuple[Path, ...]:
    """Write the map without objects, with objects at their start, and in every named state.

    An object without a state stays at its start. If the campaign's maps show objects at their
    start, every draw with other start positions gets its own map. A map from the campaign is
    written unchanged, as the only map: it does not depend on doors.
    """
    scene, height = job.world.scene, job.laser_height
    stem = job.path(*_stem(job).split("/"))
    if job.world.given_map is not None:
        return write_map(job.world.given_map, stem, laser_height=height)
    variants: dict[str, dict[str, float] | None] = {"": None}
    if scene.objects:
        draws = job.world.draws if job.world.doors == "initial" else job.world.draws[:1]
        for draw in draws:
            variants[_start_ending(job, draw)] = start_positions(scene, draw.behaviours)
        start = start_positions(scene, draws[0].behaviours)
        for state, positions in job.world.states:
            # A layer may call a state of its doors "start".
            variants[free_name(file_name(state), variants)] = start | dict(positions)
    rule = job.world.rule
    building = _building_map(replace(scene, name="", objects=()), job.resolution, height, rule)
    files: list[Path] = []
    for name, joints in variants.items():
        grid = building
        if joints is not None:
            grid = with_objects(building, scene, laser_height=height, joints=joints, rule=rule)
        path = stem.with_name(f"{stem.name}-{name}" if name else stem.name)
        files += write_map(grid, path, laser_height=height)
    return tuple(files)
