"""Maps as files: occupancy grids of the building and of its doors in each state, and GeoJSON.

GeoJSON (RFC 7946) is in metres of the plan's world frame, not in degrees: load it with a local
(engineering) reference system. Exterior rings run counter-clockwise, interior ones clockwise, and
all are closed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from grammars.floorplan import FloorPlan
from grammars.model.behaviour import start_positions
from grammars.model.geometry import Ring, signed_area
from grammars.model.map_files import write_map
from templates.naming import file_name
from templates.occupancy import occupancy_grid
from templates.world import ExportJob


def map_file(job: ExportJob) -> str:
    """Return the map a navigation stack gets, relative to the folder of the world.

    Worlds with objects have several maps, which then have a folder of their own.
    """
    return f"maps/{job.building}.yaml" if job.world.scene.objects else f"{job.building}.yaml"


def write_maps(job: ExportJob) -> tuple[Path, ...]:
    """Write the map without objects, with objects as they start, and in every named state.

    A state that an object does not have leaves it as it starts. A map that the campaign gives is
    written as it is, and is the only one: it says nothing about doors.
    """
    scene, height = job.world.scene, job.laser_height
    stem = job.path(*map_file(job).removesuffix(".yaml").split("/"))
    if job.world.given_map is not None:
        return write_map(job.world.given_map, stem, laser_height=height)
    variants: dict[str, dict[str, float] | None] = {"": None}
    if scene.objects:
        start = start_positions(scene, job.world.draws[0].behaviours)
        variants["start"] = start
        variants |= {file_name(name): start | dict(given) for name, given in job.world.states}
    written: list[Path] = []
    for name, joints in variants.items():
        grid = occupancy_grid(
            scene,
            resolution=job.resolution,
            laser_height=height,
            joints=joints,
            rule=job.world.rule,
        )
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
