"""Fit of building C to the meshes of Ortega et al. 2024.

``python -m campaigns.studies.published_worlds``

The meshes are in ``worlds/`` of the folder ``SCENARIO_REFERENCE_DATA``. Both the mesh and the plan
are cut at the height of the laser. The program compares the edges that a robot can see from its
possible places, in both directions: the share of one that lies within 2 cm of the other.
"""

import gzip
import math
import os
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import shapely

from daemon.campaign import load_campaign
from grammars.model.kinematics import placed_links

Floats = npt.NDArray[np.float64]

LASER_HEIGHT = 0.3
HALL = (0.0, 0.0)
"""A place in the middle of the building with a view of all corridors."""
NEAR = 0.02
"""Largest distance of an edge from its counterpart [m]."""
_CRACK = 2e-3
"""Largest gap between two faces of a mesh that are one wall [m]."""
_SLIT = 0.15
"""Largest gap that a robot cannot leave the building through [m]; the published walls have some."""

MESHES = {"S1": "brsu_building_c_static", "S3.4": "brsu_building_c_door_events"}
"""A scenario in each published world, with its mesh."""

_MITRE = {"join_style": "mitre", "mitre_limit": 10.0}
_FACET = np.dtype(
    [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")],
)


@dataclass(frozen=True, slots=True)
class Fit:
    """Lengths of visible edges [m], and of their parts near the other edges."""

    published: float
    published_near: float
    ours: float
    ours_near: float

    @property
    def shares(self):
        """The share of published edges near ours, and of ours near the published ones."""
        return self.published_near / self.published, self.ours_near / self.ours


def read_mesh(path):
    """Return the facets of a gzipped binary STL file, shape (n, 3, 3)."""
    data = gzip.decompress(path.read_bytes())
    return np.frombuffer(data, _FACET, offset=84)["corners"].astype(np.float64)


def mesh_section(facets, height):
    """Return the section of a mesh at ``height`` [m].

    The published walls and pillars overlap and do not all face outwards, so each is cut alone.
    """
    pieces = [_filled(_cut(part, height)) for part in _bodies(facets)]
    return _closed(shapely.union_all(pieces))


def _bodies(facets):
    """Return the facets by body: facets that share corners, directly or through others."""
    corners = facets.reshape(-1, 3).round(4)
    _, ids = np.unique(corners, axis=0, return_inverse=True)
    triples = ids.reshape(-1, 3)
    root = np.arange(ids.max() + 1)
    while True:
        lowest = root[triples].min(axis=1)
        previous = root.copy()
        for column in triples.T:
            np.minimum.at(root, column, lowest)
        root = root[root]
        if np.array_equal(root, previous):
            break
    labels = root[triples[:, 0]]
    return [facets[labels == label] for label in np.unique(labels)]


def _cut(facets, height):
    """Return the segments in which facets meet the plane, shape (n, 2, 2), solid on one side."""
    segments = []
    for facet in facets:
        below = facet[:, 2] < height
        if below.all() or not below.any():
            continue
        ends = {}
        for i in range(3):
            first, second = facet[i], facet[(i + 1) % 3]
            if below[i] != below[(i + 1) % 3]:
                part = (height - first[2]) / (second[2] - first[2])
                ends[bool(below[i])] = (first + part * (second - first))[:2]
        segments.append((ends[True], ends[False]))
    return np.array(segments).reshape(-1, 2, 2)


def _filled(segments):
    """Return the area that directed segments enclose: its winding number is not 0."""
    lines = shapely.linestrings(segments.round(5))
    net = shapely.node(shapely.multilinestrings(lines[shapely.length(lines) > 1e-5]))
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(net)))
    start, end = segments[:, 0], segments[:, 1]
    inside = []
    for face in faces:
        x, y = shapely.point_on_surface(face).coords[0]
        is_crossed = (start[:, 1] <= y) != (end[:, 1] <= y)
        a, b = start[is_crossed], end[is_crossed]
        crossing = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
        if np.sign(b[:, 1] - a[:, 1])[crossing > x].sum() != 0:
            inside.append(face)
    return shapely.union_all(inside)


def scene_section(scene, height):
    """Return the section of a scene's walls and fixed objects at ``height`` [m]."""
    cut = [s.polygon for s in scene.solids if s.z_min <= height <= s.z_max]
    for thing in scene.objects:
        if not thing.joints:
            for link, rings in placed_links(thing, {}):
                cut += rings if link.z_min <= height <= link.z_max else []
    return _closed(shapely.union_all([shapely.Polygon(ring) for ring in cut]))


def _closed(area):
    return shapely.buffer(shapely.buffer(area, _CRACK, **_MITRE), -_CRACK, **_MITRE)


def compare(published, ours, leaves, places):
    """Compare the edges visible from ``places``, with all doors shut."""
    points = [shapely.Point(place) for place in places]

    def visible(area):
        around = shapely.box(*shapely.buffer(area, 5.0).bounds)
        floor = shapely.difference(around, shapely.union(area, leaves))
        halls = shapely.get_parts(shapely.buffer(floor, -_SLIT / 2, **_MITRE))
        rooms = shapely.union_all([h for h in halls if any(h.contains(p) for p in points)])
        reach = shapely.buffer(rooms, _SLIT / 2 + _CRACK, **_MITRE)
        return shapely.intersection(shapely.boundary(area), reach)

    def near(edges, other):
        return float(
            shapely.intersection(edges, shapely.buffer(shapely.boundary(other), NEAR)).length
        )

    theirs, own = visible(published), visible(ours)
    return Fit(theirs.length, near(theirs, ours), own.length, near(own, published))


def shut_leaves(scene, joints):
    """Return the shut leaves of all doors, a little widened."""
    rings = [
        ring
        for thing in scene.objects
        if thing.joints
        for _, placed in placed_links(thing, joints)
        for ring in placed
    ]
    return shapely.buffer(shapely.union_all([shapely.Polygon(ring) for ring in rings]), 0.04)


def fits(data, campaigns):
    """Return the fit of the campaign's worlds to the published meshes, by scenario."""
    campaign = load_campaign(campaigns / "ortega2024" / "campaign.yaml")
    by_scenario = {}
    for name, mesh in MESHES.items():
        cell = next(cell for cell in campaign.cells if cell.name == name)
        published = mesh_section(read_mesh(data / "worlds" / f"{mesh}.stl.gz"), LASER_HEIGHT)
        start = cell.mission.start
        places = [HALL, (start.x, start.y), *((w.x, w.y) for w in cell.mission.waypoints)]
        leaves = shut_leaves(cell.scene, dict.fromkeys(cell.scene.joint_names, 0.0))
        ours = scene_section(cell.scene, LASER_HEIGHT)
        by_scenario[name] = compare(published, ours, leaves, places)
    return by_scenario


def main():
    """Print the figures; the exit code is 2 without the published meshes."""
    folder = os.environ.get("SCENARIO_REFERENCE_DATA")
    if not folder or not (Path(folder) / "worlds").is_dir():
        print("SCENARIO_REFERENCE_DATA names no folder with worlds/", file=sys.stderr)
        return 2
    for name, fit in fits(Path(folder), Path(__file__).parents[2] / "campaigns").items():
        theirs, own = (math.floor(share * 1e4) / 100 for share in fit.shares)
        print(
            f"{name}: of {fit.published:.0f} m of published edges {theirs:.2f} % lie within "
            f"{NEAR * 100:.0f} cm of ours, of our {fit.ours:.0f} m {own:.2f} % of theirs"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
