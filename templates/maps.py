"""Maps as files: occupancy grids of the building and of its doors in each state, and GeoJSON.

GeoJSON (RFC 7946) is in metres of the plan's world frame, not in degrees: load it with a local
(engineering) reference system. Exterior rings run counter-clockwise, interior ones clockwise, and
all are closed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from grammars.floorplan import FloorPlan
from grammars.model.behaviour import start_positions
from grammars.model.geometry import Ring, signed_area
from grammars.model.map_files import write_map
from templates.naming import file_name, free_name
from templates.occupancy import building_grid, with_objects
from templates.world import BehaviourDraw, ExportJob

_START: Final = "start"
"""What is added to the name of the map with objects as they start."""


def map_file(job: ExportJob, draw: BehaviourDraw) -> str:
    """Return the map a navigation stack gets in a run of ``draw``, relative to the world's folder.

    It is the one the campaign declares, as a run gets it. Worlds with objects have several maps,
    which then have a folder of their own.
    """
    world = job.world
    initial = world.doors == "initial" and world.scene.objects and world.given_map is None
    ending = _start_ending(job, draw) if initial else ""
    return f"{_stem(job)}-{ending}.yaml" if ending else f"{_stem(job)}.yaml"


def _stem(job: ExportJob) -> str:
    return f"maps/{job.building}" if job.world.scene.objects else job.building


def _start_ending(job: ExportJob, draw: BehaviourDraw) -> str:
    """Return what is added to the name of the map of ``draw`` at its start: that of the first
    draw whose objects start alike."""
    scene, draws = job.world.scene, job.world.draws
    start = start_positions(scene, draw.behaviours)
    like = next(d for d in draws if start_positions(scene, d.behaviours) == start)
    return _START if like is draws[0] else f"{_START}-{like.name}"


def write_maps(job: ExportJob) -> tuple[Path, ...]:
    """Write the map without objects, with objects as they start, and in every named state.

    A state that an object does not have leaves it as it starts. Where the campaign wants maps with
    objects as they start, every draw in which they start elsewhere has a map of its own. A map that
    the campaign gives is written as it is, and is the only one: it says nothing about doors.
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
        for state, given in job.world.states:
            # A layer may call a state of its doors "start".
            variants[free_name(file_name(state), variants)] = start | dict(given)
    resolution, rule = job.resolution, job.world.rule
    building = job.cached(
        ("map", scene.regions, scene.solids, scene.doorways, resolution, height, rule),
        lambda: building_grid(scene, resolution=resolution, laser_height=height, rule=rule),
    )
    written: list[Path] = []
    for name, joints in variants.items():
        grid = building
        if joints is not None:
            grid = with_objects(building, scene, laser_height=height, joints=joints, rule=rule)
        path = stem.with_name(f"{stem.name}-{name}" if name else stem.name)
        written += write_map(grid, path, laser_height=height)
    return tuple(written)


def feature_collection(plan: FloorPlan) -> dict[str, Any]:
    """Return the plan as a FeatureCollection, one polygon per space, wall, feature and opening.

    A wall is its footprint before cutting, an opening its footprint through the wall(s); the holes
    of spaces and walls of a walls layer are interior rings. All
    features have the properties ``kind``, ``name``, ``space``, ``index``, ``height``,
    ``thickness``, ``z_min`` and ``z_max`` (metres; ``None`` where one does not apply); their
    ``id`` is the published identifier.
    """
    spaces = [
        _feature(s.name, s.outline, s.holes, kind="space", name=s.name, space=s.name)
        for s in plan.spaces
    ]
    walls = [
        _feature(
            wall.id,
            wall.footprint,
            (),
            kind="wall",
            name=wall.id,
            space=wall.space,
            index=wall.index,
            thickness=wall.thickness,
            **_extent(0.0, wall.height),
        )
        for wall in plan.walls
    ]
    standing = [
        _feature(
            item.id,
            item.footprint,
            item.holes,
            kind=item.kind,
            name=item.name,
            space=item.space or None,
            **_extent(0.0, item.height),
        )
        for item in plan.features
    ]
    openings = [
        _feature(
            opening.id,
            opening.footprint,
            (),
            kind=opening.kind,
            name=opening.name,
            thickness=opening.depth,
            **_extent(opening.z_min, opening.z_max),
        )
        for opening in plan.openings
    ]
    features = spaces + walls + standing + openings
    return {"type": "FeatureCollection", "name": plan.name, "features": features}


def export_geojson(job: ExportJob) -> tuple[Path, ...]:
    """Write ``<world>.geojson``."""
    plan = job.world.plan
    return (write_geojson(plan, job.path(f"{job.name}.geojson")),) if plan else ()


def write_geojson(plan: FloorPlan, path: Path) -> Path:
    """Write the plan as GeoJSON, one feature per line, and return the path."""
    collection = feature_collection(plan)
    lines = ",\n".join(_dump(feature) for feature in collection["features"])
    head = f'{{"type": "FeatureCollection", "name": {_dump(plan.name)}, "features": [\n'
    path.write_text(f"{head}{lines}\n]}}\n", encoding="utf-8")
    return path


def _dump(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _extent(low: float, high: float) -> dict[str, float]:
    return {"height": high - low, "z_min": low, "z_max": high}


def _feature(id: str, ring: Ring, holes: Sequence[Ring], **known: Any) -> dict[str, Any]:
    names = ("kind", "name", "space", "index", "height", "thickness", "z_min", "z_max")
    return {
        "type": "Feature",
        "id": id,
        "properties": {name: known.get(name) for name in names},
        "geometry": {
            "type": "Polygon",
            "coordinates": [_closed(ring, 1.0), *(_closed(hole, -1.0) for hole in holes)],
        },
    }


def _closed(ring: Ring, way: float) -> list[list[float]]:
    """Return a closed ring, counter-clockwise for a ``way`` of 1, clockwise for -1."""
    corners = ring if way * signed_area(ring) >= 0.0 else tuple(reversed(ring))
    return [[x, y] for x, y in (*corners, corners[0])]
