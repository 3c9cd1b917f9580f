from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daemon.stacks.ros1.amcl.laser_model import distance_field
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from tests.daemon.stacks.ros1.amcl.plain import distances


@settings(deadline=None, max_examples=40)
@given(
    rows=st.integers(1, 30),
    columns=st.integers(1, 30),
    share=st.floats(0.0, 0.4),
    cap=st.sampled_from([0.05, 0.2, 0.52, 2.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_distances_are_those_of_brute_force_up_to_the_cap(
    rows: int, columns: int, share: float, cap: float, seed: int
) -> None:
    random = np.random.default_rng(seed)
    cells = random.choice(np.array([FREE, UNKNOWN], dtype=np.int8), (rows, columns))
    cells[random.random((rows, columns)) < share] = OCCUPIED
    grid = OccupancyGrid(0.05, 1.0, -2.0, cells)
    field = distance_field(grid, cap)
    away = field.distances(grid.resolution, cap)[field.squared[1:-1, 1:-1]]
    np.testing.assert_allclose(away, distances(grid, cap), atol=1e-12)


def test_the_map_is_framed_by_the_value_of_far() -> None:
    field = distance_field(OccupancyGrid(0.05, 0.0, 0.0, np.full((3, 4), OCCUPIED, np.int8)), 2.0)
    assert field.radius == 40
    assert field.squared.shape == (5, 6)
    ring = np.ones((5, 6), dtype=bool)
    ring[1:-1, 1:-1] = False
    assert (field.squared[ring] == field.far).all()
    assert field.distances(0.05, 2.0)[field.far] == 2.0


def test_equal_maps_share_a_field_that_nobody_can_change() -> None:
    cells = np.zeros((5, 5), dtype=np.int8)
    cells[2, 2] = OCCUPIED
    one = distance_field(OccupancyGrid(0.05, 0.0, 0.0, cells.copy()), 1.0)
    two = distance_field(OccupancyGrid(0.05, 7.0, 3.0, cells.copy()), 1.0)
    assert one is two
    cells[0, 0] = OCCUPIED
    assert distance_field(OccupancyGrid(0.05, 0.0, 0.0, cells), 1.0) is not one
    with pytest.raises(ValueError, match="read-only"):
        one.squared[0, 0] = 0
