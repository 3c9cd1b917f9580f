import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from daemon.simulator._physics import (
    area_and_centroid,
    convex_distance,
    mass_properties,
    ring_array,
    transform_array,
)
from grammars.model.geometry import Pose2
from tests.engine.simulator.scenes import box

coordinates = st.floats(-5.0, 5.0).map(lambda v: round(v, 6))


@st.composite
def convex_rings(draw):
    """A polygon inscribed in an ellipse, in either direction of turning."""
    count = draw(st.integers(3, 8))
    x, y = draw(coordinates), draw(coordinates)
    a, b = draw(st.floats(0.1, 3.0)), draw(st.floats(0.1, 3.0))
    phase = draw(st.floats(0.0, 6.0))
    angles = [phase + math.tau * k / count for k in range(count)]
    ring = tuple((x + a * math.cos(t), y + b * math.sin(t)) for t in angles)
    return ring[::-1] if draw(st.booleans()) else ring


@given(a=convex_rings(), b=convex_rings())
def test_distance_of_convex_polygons(a, b):
    expected = shapely.distance(shapely.Polygon(a), shapely.Polygon(b))
    assert convex_distance(ring_array(a), ring_array(b)) == pytest.approx(expected, abs=1e-9)


@given(a=convex_rings(), x=coordinates, y=coordinates)
def test_distance_of_a_point(a, x, y):
    expected = shapely.distance(shapely.Polygon(a), shapely.Point(x, y))
    assert convex_distance(np.array([[x, y]]), ring_array(a)) == pytest.approx(expected, abs=1e-9)


def test_distance_of_two_points():
    assert convex_distance(np.array([[0.0, 0.0]]), np.array([[3.0, 4.0]])) == 5.0


@given(ring=convex_rings())
def test_area_and_centroid(ring):
    polygon = shapely.Polygon(ring)
    area, centroid = area_and_centroid(ring)
    assert area == pytest.approx(polygon.area, rel=1e-6)
    assert centroid == pytest.approx((polygon.centroid.x, polygon.centroid.y), abs=1e-6)


def test_mass_properties_of_a_beam_in_two_pieces_are_those_of_the_beam():
    mass, centre, moment = mass_properties(
        [(box(1.0, 0.0, 2.0, 0.2), 3.0), (box(2.0, 0.0, 3.0, 0.2), 3.0)]
    )
    assert mass == 6.0
    assert centre == pytest.approx((2.0, 0.1))
    assert moment == pytest.approx(6.0 * (2.0**2 + 0.2**2) / 12.0)


def test_arrays_transform_like_rings():
    pose, ring = Pose2(1.0, -2.0, 0.7), box(0.0, 0.0, 1.0, 2.0)
    np.testing.assert_allclose(transform_array(pose, ring_array(ring)), pose.apply_ring(ring))
