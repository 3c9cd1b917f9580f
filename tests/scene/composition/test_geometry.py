"""Walls become convex solids; the laser sees their outline and nothing else."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon

from grammars.floorplan import load_floorplan, parse_floorplan
from grammars.model.geometry import signed_area
from grammars.scenery.composition import compile_scene, static_segments
from grammars.scenery.composition._rings import convex_rings, is_convex
from tests.languages.plans import two_rooms

HEIGHTS = (0.1, 0.7, 1.2, 1.9, 2.05, 2.3)


@pytest.fixture(scope="module")
def scene():
    return compile_scene(two_rooms())


def crossing(scene, z):
    return [Polygon(s.polygon) for s in scene.solids if s.z_min <= z < s.z_max]


def wall_area_left(plan, z):
    """Return the area of all walls at a height, each minus the openings that list it."""
    total = 0.0
    for wall in plan.walls:
        cuts = [
            Polygon(o.footprint).buffer(1e-6, join_style="mitre")
            for o in plan.openings
            if wall.id in o.walls and o.z_min <= z < o.z_max
        ]
        if z < wall.height:
            total += Polygon(wall.footprint).difference(shapely.union_all(cuts)).area
    return total


def area_of_walls(scene, z):
    walls = (s for s in scene.solids if s.kind == "wall" and s.z_min <= z < s.z_max)
    return sum(Polygon(s.polygon).area for s in walls)


def pieces(scene, owner):
    return sorted((s.z_min, s.z_max) for s in scene.solids if s.owner == owner)


def test_openings_cut_the_walls_that_they_list(scene):
    # A doorway leaves two pieces beside it and a lintel, a window a sill too.
    assert pieces(scene, "kitchen-wall-2") == [(0.0, 2.5), (0.0, 2.5), (2.0, 2.5)]
    assert pieces(scene, "hall-wall-3") == [(0.0, 1.0), (0.0, 2.5), (0.0, 2.5), (2.0, 2.5)]
    one_side = two_rooms(("in: hall.walls[0] and kitchen.walls[2]", "in: hall.walls[0]"))
    other = compile_scene(one_side)
    assert len(pieces(other, "hall-wall-0")) == 3
    assert pieces(other, "kitchen-wall-2") == [(0.0, 2.5)]
    for z in HEIGHTS:
        assert area_of_walls(scene, z) == pytest.approx(wall_area_left(two_rooms(), z), abs=1e-4)


def test_regions_doorways_and_features_come_along(scene):
    assert [r.name for r in scene.regions] == ["hall", "kitchen"]
    assert [(d.name, d.width, d.z_min, d.z_max) for d in scene.doorways] == [
        ("kitchen_doorway", 1.0, 0.0, 2.0),
        ("way_out", 1.2, 0.0, 2.1),
    ]
    column = next(s for s in scene.solids if s.kind == "column")
    assert (column.owner, column.z_max, len(column.polygon)) == ("pillar", 2.0, 4)


def test_equal_input_gives_equal_digests(scene):
    assert compile_scene(two_rooms()).digest == scene.digest
    assert compile_scene(two_rooms(("width=4 m", "width=4.1 m"))).digest != scene.digest


openings = st.lists(
    st.tuples(
        st.sampled_from(["Entryway", "Window"]),
        st.integers(0, 3),
        st.floats(-1.2, 1.2),
        st.floats(0.2, 1.5),
        st.floats(0.3, 2.0),
        st.floats(0.2, 2.0),
    ),
    max_size=5,
)


@given(openings, st.floats(-3.0, 3.0), st.sampled_from(HEIGHTS))
def test_areas_add_up_for_any_openings(drawn, turn, z):
    text = [
        "Floor plan: any Defaults: walls: thickness: 0.2 m height: 2.5 m Space room: shape: "
        f"Rectangle width=4 m, length=4 m location: wrt: world of: this rotation: z: {turn} rad"
    ]
    text.extend(
        f"{kind} o{i}: shape: Rectangle width={w} m, height={h} m "
        f"location: in: room.walls[{wall}] translation: x: {x} m, z: {up + h / 2} m"
        for i, (kind, wall, x, w, h, up) in enumerate(drawn)
    )
    plan = parse_floorplan("\n".join(text), "any.fpm")
    scene = compile_scene(plan)
    near_an_edge = any(min(abs(z - o.z_min), abs(z - o.z_max)) < 1e-6 for o in plan.openings)
    if not near_an_edge:
        assert area_of_walls(scene, z) == pytest.approx(wall_area_left(plan, z), abs=1e-4)
    for solid in scene.solids:
        assert is_convex(solid.polygon)
        assert signed_area(solid.polygon) > 0.0
        assert solid.z_min < solid.z_max


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=3, max_size=9, unique=True))
@example(points=[(0, 1), (1, -1), (-2, 0), (-5.6e-280, 0), (0, 0), (0, 8.4e-305)])
def test_any_outline_falls_into_convex_parts_of_the_same_area(points):
    centre = np.mean(np.array(points), axis=0)
    star = sorted(points, key=lambda p: math.atan2(p[1] - centre[1], p[0] - centre[0]))
    polygon = Polygon(star)
    if not polygon.is_valid or polygon.area < 0.01:
        return
    rings = convex_rings(polygon)
    assert all(is_convex(ring) for ring in rings)
    assert sum(Polygon(r).area for r in rings) == pytest.approx(polygon.area, abs=1e-6)


TRIANGLE = "Polygon points: [(-1 m, 0 m, -0.5 m), (1 m, 0 m, -0.5 m), (0 m, 0 m, 0.5 m)]"


@pytest.mark.parametrize(
    ("shape", "area", "exact"),
    [(TRIANGLE, 0.5 * 2.0 * 1.0, 1e-6), ("Circle radius=0.5 m", math.pi * 0.25, 0.01)],
)
def test_a_window_that_is_no_rectangle_is_cut_in_steps(shape, area, exact):
    place = "\n    location: in: hall.walls[3]"
    plan = two_rooms((f"Rectangle width=2 m, height=1 m{place}", f"{shape}{place}"))
    uncut = next(Polygon(w.footprint).area * w.height for w in plan.walls if w.id == "hall-wall-3")
    solids = [s for s in compile_scene(plan).solids if s.owner == "hall-wall-3"]
    solid = sum(Polygon(s.polygon).area * (s.z_max - s.z_min) for s in solids)
    assert uncut - solid == pytest.approx(area * 0.2, rel=exact)


@pytest.mark.parametrize("z", HEIGHTS)
def test_laser_segments_are_the_outline_of_the_union(scene, z):
    segments, owner, owners = static_segments(scene, z)
    lines = shapely.union_all([LineString([s[:2], s[2:]]) for s in segments.tolist()])
    outline = shapely.union_all(crossing(scene, z)).boundary
    assert lines.hausdorff_distance(outline) < 2e-4
    lengths = np.hypot(*(segments[:, 2:] - segments[:, :2]).T)
    assert lengths.sum() == pytest.approx(outline.length, abs=1e-3)
    assert owner.dtype == np.int32
    assert owners == tuple(dict.fromkeys(s.owner for s in scene.solids))


def test_laser_segments_lie_on_their_owners_and_have_the_solid_on_the_left(scene):
    segments, owner, owners = static_segments(scene, 0.3)
    union = shapely.union_all(crossing(scene, 0.3))
    for (x0, y0, x1, y1), index in zip(segments.tolist(), owner.tolist(), strict=True):
        shapes = [
            Polygon(s.polygon)
            for s in scene.solids
            if s.owner == owners[index] and s.z_min <= 0.3 < s.z_max
        ]
        middle = shapely.Point((x0 + x1) / 2, (y0 + y1) / 2)
        assert min(shape.boundary.distance(middle) for shape in shapes) < 1e-5
        step = 0.01 / math.hypot(x1 - x0, y1 - y0)
        assert union.covers(shapely.Point(middle.x - (y1 - y0) * step, middle.y + (x1 - x0) * step))
    # In line they are merged: the inner and the outer face of a wall are one each.
    assert [owners[index] for index in owner.tolist()].count("hall-wall-1") == 2
    above, owner, _ = static_segments(scene, 2.6)
    assert (above.shape, owner.shape) == ((0, 4), (0,))


def test_the_outline_of_building_c_is_that_of_its_solids(campaigns):
    scene = compile_scene(load_floorplan(campaigns / "ortega2024" / "building_c.fpm"))
    segments, _, _ = static_segments(scene, 0.3)
    cut = shapely.union_all(crossing(scene, 0.3), grid_size=1e-6)
    # Where two mitred corners meet, the grid leaves a hole without an area.
    rings = [r for part in shapely.get_parts(cut) for r in (part.exterior, *part.interiors)]
    outline = shapely.multilinestrings([r for r in rings if shapely.Polygon(r).area > 1e-6])
    lengths = np.hypot(*(segments[:, 2:] - segments[:, :2]).T)
    assert lengths.min() > 1e-3
    assert lengths.sum() == pytest.approx(outline.length, rel=1e-5)
    lines = shapely.multilinestrings(segments.reshape(-1, 2, 2))
    assert lines.hausdorff_distance(outline) < 2e-4
