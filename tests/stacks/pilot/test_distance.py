import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.kernels import FAR, distance_transform
from daemon.stacks.pilot.maps import map_field
from grammars.model.grid import OCCUPIED, UNKNOWN, OccupancyGrid
from tests.stacks.pilot.world import draw


def brute_force(solid):
    found = np.argwhere(solid)
    rows, columns = np.indices(solid.shape)
    away = np.hypot(rows[..., None] - found[:, 0], columns[..., None] - found[:, 1])
    return away.min(axis=-1)


@given(
    rows=st.integers(1, 24),
    columns=st.integers(1, 24),
    share=st.floats(0.01, 0.9),
    seed=st.integers(0, 2**32 - 1),
)
def test_distances_are_those_of_brute_force(rows, columns, share, seed):
    solid = (np.random.default_rng(seed).random((rows, columns)) < share).astype(np.uint8)
    solid[0, 0] = 1
    np.testing.assert_allclose(distance_transform(solid), brute_force(solid), rtol=1e-6)


def test_without_solid_cells_everything_is_far():
    assert (distance_transform(np.zeros((3, 5), dtype=np.uint8)) == FAR).all()


def test_the_surface_lies_on_the_edge_of_the_painted_wall():
    field = map_field(draw([(1.0, 0.0, 1.2, 2.0)], (2.0, 2.0)))
    row, column = field.cell(0.975, 1.0)
    assert field.surface[row, column] == pytest.approx(0.025)
    assert field.surface[row, column + 1] == pytest.approx(-0.025)


def test_unknown_cells_leave_no_clearance_but_are_no_surface():
    grid = draw([(1.0, 0.0, 1.2, 2.0)], (2.0, 2.0))
    field = map_field(grid)
    row, column = field.cell(-0.025, 1.0)
    assert field.clearance[row, column] == 0.0
    assert field.surface[row, column] > 0.9


def test_a_map_without_free_cells_is_refused():
    cells = np.full((4, 4), UNKNOWN, dtype=np.int8)
    cells[1, 1] = OCCUPIED
    with pytest.raises(ValueError, match="no free cell"):
        map_field(OccupancyGrid(0.05, 0.0, 0.0, cells))
