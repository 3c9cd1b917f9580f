"""Walls of a scene as one watertight mesh, for simulators and viewers.

The solids of a scene are prisms, whose outlines divide the floor into cells. Between two successive
heights, the building consists of some extruded cells. Cells share their corners exactly, so the
layers meet exactly. Their boolean union (manifold3d) therefore has no cracks, slivers or inner
faces. A direct union of the prisms would leave faces 1e-9 m apart.
"""

from __future__ import annotations

import functools
import itertools
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from grammars.model.scene import Solid
from grammars.text.plugins import load_extra
from templates.world import ExportJob

_GRID: Final = 1e-6
"""Distance up to which two corners are one corner [m]."""
_TOLERANCE: Final = 1e-5
"""Height up to which triangles are merged with their neighbours [m]."""
_UPRIGHT: Final = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""Rotation from z up (REP 103) to y up (glTF 2.0, section 3.4)."""
_COLOUR: Final = (0.74, 0.73, 0.70, 1.0)


@functools.lru_cache(maxsize=2)
def wall_mesh(solids: tuple[Solid, ...]) -> Any:
    """Return the union of solids as a trimesh, a closed 2-manifold with outward faces, z up [m].

    Several kinds and worlds share it: copy it before a change. Raises
    :class:`grammars.text.plugins.MissingExtraError` without the extra ``cad``.
    """
    m3 = _library("manifold3d")
    layers = [_extruded(m3, *layer) for layer in _layers(solids)]
    # as_original() drops the origin of faces: only then are coplanar faces joined.
    body = m3.Manifold.batch_boolean(layers, m3.OpType.Add).as_original().simplify(_TOLERANCE)
    if body.status() != m3.Error.NoError:
        raise ValueError(f"the walls have no closed surface: {body.status()}")
    mesh = body.to_mesh64()
    # Copies, because arrays of manifold3d would outlive it in the cache.
    vertices = np.array(mesh.vert_properties[:, :3], np.float64)
    faces = np.array(mesh.tri_verts, np.int64)
    return _library("trimesh").Trimesh(vertices, faces, process=False)


def write_meshes(job: ExportJob) -> tuple[Path, ...]:
    """Write ``mesh/<building>.stl`` and ``.glb``, if the scene has solids."""
    if not job.world.scene.solids:
        job.notes.append("the scene has no walls: no mesh is written")
        return ()
    stl, glb = (job.path("mesh", f"{job.building}.{ending}") for ending in ("stl", "glb"))
    mesh = wall_mesh(job.world.scene.solids)
    stl.write_bytes(stl_bytes(mesh))
    glb.write_bytes(glb_bytes(mesh, name=job.building))
    return stl, glb


def stl_bytes(mesh: Any) -> bytes:
    """Return a trimesh as binary STL, z up."""
    return bytes(mesh.export(file_type="stl"))


def glb_bytes(mesh: Any, *, name: str) -> bytes:
    """Return a trimesh as binary glTF 2.0, turned to its y-up axes.

    ``name`` is the name of the only node.
    """
    trimesh = _library("trimesh")
    body = mesh.copy()
    material = trimesh.visual.material.PBRMaterial(
        name="wall", baseColorFactor=_COLOUR, metallicFactor=0.0, roughnessFactor=0.9
    )
    body.visual = trimesh.visual.TextureVisuals(material=material)
    scene = trimesh.Scene()
    scene.add_geometry(body, node_name=name, geom_name=name, transform=_UPRIGHT)
    return bytes(scene.export(file_type="glb"))


def _library(name: str) -> Any:
    return load_extra(name, "cad", "a mesh", "mesh")


def _layers(solids: tuple[Solid, ...]) -> list[tuple[float, float, Any]]:
    """Return bottom, top and area of the building between neighbouring heights."""
    outlines = shapely.polygons([shapely.linearrings(s.polygon) for s in solids])
    lines = shapely.union_all(shapely.boundary(outlines), grid_size=_GRID)
    cells = shapely.get_parts(shapely.polygonize(shapely.get_parts(lines)))
    inside = shapely.STRtree(shapely.point_on_surface(cells)).query(outlines, predicate="contains")
    extents = np.array([(s.z_min, s.z_max) for s in solids])
    heights = sorted({float(z) for z in extents.ravel()})
    layers = []
    for low, high in itertools.pairwise(heights):
        # Heights are those of the solids, so each one fills a layer completely or not at all.
        standing = (extents[:, 0] <= low) & (extents[:, 1] >= high)
        filled = np.unique(inside[1][standing[inside[0]]])
        if len(filled):
            layers.append((low, high, shapely.coverage_union_all(cells[filled])))
    return layers


def _extruded(m3: Any, low: float, high: float, area: Any) -> Any:
    polygons = [orient(part) for part in shapely.get_parts(area)]
    rings = [
        shapely.get_coordinates(ring)[:-1]
        for polygon in polygons
        for ring in (polygon.exterior, *polygon.interiors)
    ]
    section = m3.CrossSection(rings, m3.FillRule.EvenOdd)
    return section.extrude(high - low).translate((0.0, 0.0, low))
