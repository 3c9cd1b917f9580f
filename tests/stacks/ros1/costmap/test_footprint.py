import math

import numpy as np
import pytest

from daemon.stacks.ros1.costmap import LayeredCostmap, radii
from tests.stacks.ros1.costmap.test_costmap import A2S, DIFF, OMNI


@pytest.mark.parametrize(
    ("points", "inscribed", "circumscribed"),
    [(A2S, 0.085, 0.143), (DIFF, 0.243, 0.434), (OMNI, 0.230, 0.427)],
)
def test_radii_of_the_padded_footprint(points, inscribed, circumscribed):
    padded = LayeredCostmap(footprint=points).padded_footprint()
    assert padded.max(axis=0) == pytest.approx(np.array(points).max(axis=0) + 0.01)
    assert padded.min(axis=0) == pytest.approx(np.array(points).min(axis=0) - 0.01)
    assert radii(padded) == pytest.approx((inscribed, circumscribed), abs=5e-4)


def test_a_coordinate_of_zero_is_not_padded():
    corners = ((0.0, 0.2), (-0.1, 0.0), (0.1, 0.0))
    padded = LayeredCostmap(footprint=corners).padded_footprint()
    assert padded.tolist() == [[0.0, 0.2 + 0.01], [-0.1 - 0.01, 0.0], [0.1 + 0.01, 0.0]]


def test_a_footprint_beside_the_origin_has_an_inscribed_radius_all_the_same():
    assert radii([(1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0)])[0] == 1.0


def test_a_radius_stands_for_sixteen_corners():
    corners = LayeredCostmap(robot_radius=0.3, footprint_padding=0.0).padded_footprint()
    assert corners.shape == (16, 2)
    assert radii(corners) == pytest.approx((0.3 * math.cos(math.pi / 16), 0.3))
