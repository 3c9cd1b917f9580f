"""Bodies of a simulator: inertia, boxes, names, movers; exports/sdf.txt shows the rest."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2
from grammars.model.scene import Joint, Link, SceneObject
from templates.bodies import body_of
from tests.scene.templates.worlds import box

HERE = Pose2(3.0, -2.0, 0.4)


def single(*polygons, height=1.0):
    link = Link("part", polygons, 6.0, 0.2, 0.2 + height)
    return body_of(SceneObject("thing", "thing", HERE, (link,), (), ()))


@given(
    st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), min_size=3, max_size=8),
    st.floats(0.1, 3.0),
)
def test_inertia_is_that_of_the_solid(corners, height):
    # Here, for every process of a round reads this file: with scipy it takes 0.3 s.
    import trimesh.creation

    hull = shapely.MultiPoint(corners).convex_hull
    assume(hull.geom_type == "Polygon" and hull.area > 0.05)
    (link,) = single(tuple(hull.exterior.coords[:-1]), height=height).links
    solid = trimesh.creation.extrude_polygon(hull, height)
    solid.density = 6.0 / solid.volume
    expected = solid.moment_inertia
    ixx, iyy, izz, ixy = link.inertia
    scale = np.abs(expected).max()
    assert [ixx, iyy, izz, ixy] == pytest.approx(
        [expected[0, 0], expected[1, 1], expected[2, 2], expected[0, 1]], abs=1e-5 * scale
    )
    assert link.pose[:3] == pytest.approx((*solid.center_mass[:2], 0.2 + height / 2), abs=1e-5)


def test_a_link_of_several_polygons_is_one_body():
    (two,) = single(box(-2, -1, 0, 1), box(0, -1, 2, 1)).links
    (one,) = single(box(-2, -1, 2, 1)).links
    assert two.inertia == pytest.approx(one.inertia)
    assert (len(two.boxes), len(one.boxes)) == (2, 1)


@pytest.mark.parametrize("yaw", [0.0, 0.3, 1.2, -2.5, math.pi / 2])
def test_a_turned_rectangle_is_a_box(yaw):
    ring = Pose2(0.4, 0.1, yaw).apply_ring(box(-1.0, -0.25, 1.0, 0.25))
    (link,) = single(ring).links
    (shape,) = link.boxes
    c, s = math.cos(shape.pose[5]), math.sin(shape.pose[5])
    half = shape.size[0] / 2, shape.size[1] / 2
    corners = {
        (round(c * a - s * b, 9), round(s * a + c * b, 9))
        for a in (-half[0], half[0])
        for b in (-half[1], half[1])
    }
    assert corners == {(round(x - 0.4, 9), round(y - 0.1, 9)) for x, y in ring}
    assert abs(shape.pose[5]) <= math.pi / 4 + 1e-9


def test_a_link_and_a_joint_have_different_names():
    same = Link("part", (box(0, 0, 1, 1),), 1.0, 0.0, 1.0)
    turn = Joint("part", "revolute", "world", "part", (0.0, 0.0), (1.0, 0.0), 0.0, 1.0)
    body = body_of(SceneObject("x", "x", HERE, (same,), (turn,), (0.0,)))
    assert body.links[0].name != body.joints[0].name
    assert body.joints[0].of == "part"
