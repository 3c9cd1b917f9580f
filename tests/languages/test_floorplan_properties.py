"""Properties that hold for every plan: walls and placements."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grammars.floorplan import parse_floorplan
from grammars.model.geometry import Pose2
from grammars.text.diagnostics import InputError

LENGTHS = st.floats(0.5, 20.0).map(lambda v: round(v, 3))
OFFSETS = st.floats(-20.0, 20.0).map(lambda v: round(v, 3))
ANGLES = st.floats(-math.pi, math.pi).map(lambda v: round(v, 4))
THICKNESS = st.floats(0.05, 0.8).map(lambda v: round(v, 3))


def polygon(ring):
    return "Polygon points: [" + ", ".join(f"({x!r} m, {y!r} m)" for x, y in ring) + "]"


def one_room(ring, thickness, pose):
    return parse_floorplan(
        f"Floor plan: p Space s: shape: {polygon(ring)} location: wrt: world of: this "
        f"translation: x: {pose.x!r}, y: {pose.y!r} rotation: z: {pose.yaw!r} rad "
        f"walls: thickness: {thickness!r} m height: 2 m"
    )


@st.composite
def convex_rings(draw):
    """Corners on an ellipse, clockwise, none closer than half a metre to the next."""
    count = draw(st.integers(3, 9))
    shares = draw(st.lists(st.floats(0.4, 1.0), min_size=count, max_size=count))
    angles = -math.tau * np.cumsum(shares) / sum(shares)
    width, length = draw(st.floats(2.0, 9.0)), draw(st.floats(2.0, 9.0))
    return tuple((width * math.cos(a), length * math.sin(a)) for a in angles)


poses = st.builds(Pose2, OFFSETS, OFFSETS, ANGLES)


@given(convex_rings(), THICKNESS, poses)
def test_walls_of_a_convex_room_fill_the_mitred_offset(ring, thickness, pose):
    plan = one_room(ring, thickness, pose)
    walls = [shapely.Polygon(wall.footprint) for wall in plan.walls]
    floor = shapely.Polygon(plan.spaces[0].outline)
    offset = floor.buffer(thickness, join_style="mitre", mitre_limit=1e6)
    built = shapely.union_all([floor, *walls])
    # On a grid of a nanometre: without one GEOS once returned both triangles of a room, which are
    # equal to the last digit, as what differs between them.
    assert shapely.symmetric_difference(offset, built, grid_size=1e-9).area < 1e-6
    assert sum(wall.area for wall in walls) == pytest.approx(offset.area - floor.area)


@given(convex_rings(), THICKNESS, poses)
def test_a_wall_is_a_trapezoid_in_its_own_frame(ring, thickness, pose):
    for wall in one_room(ring, thickness, pose).walls:
        outer_start, outer_end, end, start = wall.frame.inverse().apply_ring(wall.footprint)
        assert start == pytest.approx((-wall.length / 2, 0.0), abs=1e-9)
        assert end == pytest.approx((wall.length / 2, 0.0), abs=1e-9)
        assert (outer_start[1], outer_end[1]) == pytest.approx((thickness, thickness))


def matrix(x, y, yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, x], [s, c, y], [0.0, 0.0, 1.0]])


def wall_matrix(width, length, wall):
    middles = [(0.0, length / 2), (width / 2, 0.0), (0.0, -length / 2), (-width / 2, 0.0)]
    return matrix(*middles[wall], [0.0, -math.pi / 2, math.pi, math.pi / 2][wall])


@given(
    st.tuples(LENGTHS, LENGTHS, THICKNESS, st.integers(0, 3)),
    st.tuples(LENGTHS, LENGTHS, THICKNESS, st.integers(0, 3)),
    poses,
    st.tuples(OFFSETS, OFFSETS, ANGLES),
    st.booleans(),
    st.booleans(),
)
def test_a_placement_is_the_product_of_its_transforms(first, second, pose, offset, spaced, aligned):
    x, y, yaw = offset[0], 0.0 if spaced else offset[1], offset[2]
    rooms = [
        f"Space {name}: shape: Rectangle width={w!r}, length={h!r} location: {{}} "
        f"walls: thickness: {t!r} height: 2 "
        for name, (w, h, t, _) in (("a", first), ("b", second))
    ]
    flags = ("spaced " if spaced else "") + ("" if aligned else "not aligned")
    text = "Floor plan: p " + rooms[0].format(
        f"wrt: world of: this translation: x: {pose.x!r}, y: {pose.y!r} "
        f"rotation: z: {pose.yaw!r} rad"
    )
    text += rooms[1].format(
        f"wrt: a.walls[{first[3]}] of: this.walls[{second[3]}] "
        f"translation: x: {x!r}, y: {y!r} rotation: z: {yaw!r} rad {flags}"
    )
    frame = parse_floorplan(text).spaces[1].frame
    gap = y + (first[2] + second[2] if spaced else 0.0)
    expected = (
        matrix(pose.x, pose.y, pose.yaw)
        @ wall_matrix(first[0], first[1], first[3])
        @ matrix(x, gap, yaw + (math.pi if aligned else 0.0))
        @ np.linalg.inv(wall_matrix(second[0], second[1], second[3]))
    )
    assert np.allclose(matrix(frame.x, frame.y, frame.yaw), expected, atol=1e-9)


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=8))
def test_any_polygon_is_a_room_or_refused(points):
    try:
        plan = one_room(points, 0.1, Pose2())
    except InputError as refused:
        assert all(finding.message and finding.where.line == 1 for finding in refused.findings)
        return
    assert shapely.Polygon(plan.spaces[0].outline).is_valid
    assert all(np.isfinite(wall.footprint).all() for wall in plan.walls)
