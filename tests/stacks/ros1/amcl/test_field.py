import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.amcl.distance_field import distance_field
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from tests.stacks.ros1.amcl.plain import brushfire, distances, single

_A_CELL_IS_SKIPPED = (
    ".......#..........",
    "....#....#........",
    "....#.....#.......",
    "....#......#......",
    "....#.......#.....",
    "....#........#....",
    "....#..........##.",
    "....#..........#.#",
    "....#..........#..",
)


def metres(field, cap):
    """Distances without the frame."""
    return field.distances(cap)[field.squared[1:-1, 1:-1]]


def scattered(rows, columns, share, seed, resolution=0.05):
    random = np.random.default_rng(seed)
    cells = random.choice(np.array([FREE, UNKNOWN], dtype=np.int8), (rows, columns))
    cells[random.random((rows, columns)) < share] = OCCUPIED
    return OccupancyGrid(resolution, 1.0, -2.0, cells)


@given(
    rows=st.integers(1, 30),
    columns=st.integers(1, 30),
    share=st.floats(0.0, 0.4),
    cap=st.sampled_from([0.05, 0.2, 0.52, 2.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_exact_distances_are_those_of_brute_force_up_to_the_cap(rows, columns, share, cap, seed):
    grid = scattered(rows, columns, share, seed)
    away = metres(distance_field(grid, cap, brushfire=False), cap)
    np.testing.assert_allclose(away, distances(grid, cap), atol=1e-12)


@given(
    rows=st.integers(1, 30),
    columns=st.integers(1, 30),
    share=st.sampled_from([0.0, 0.003, 0.01, 0.05, 0.3, 1.0]),
    resolution=st.sampled_from([0.05, 0.1, 0.03]),
    cap=st.sampled_from([0.04, 0.2, 0.52, 2.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_spread_distances_are_those_of_the_plain_queue(rows, columns, share, resolution, cap, seed):
    grid = scattered(rows, columns, share, seed, resolution)
    found = metres(distance_field(grid, cap, brushfire=True), cap)
    np.testing.assert_array_equal(found, brushfire(grid, cap)[0])


def test_a_cell_nearer_than_the_one_it_is_reached_from_leaves_the_queue_in_its_stead():
    """Rare: on a published map of building C it happens to 609 cells, here to one."""
    marks = np.array([list(row) for row in (*["." * 18] * 5, *_A_CELL_IS_SKIPPED)])
    cells = np.where(marks == "#", OCCUPIED, FREE).astype(np.int8)
    grid = OccupancyGrid(0.05, 0.0, 0.0, cells)
    expected, skipped = brushfire(grid, 2.0)
    assert skipped == 1
    found = metres(distance_field(grid, 2.0, brushfire=True), 2.0)
    np.testing.assert_array_equal(found, expected)


def test_distances_end_a_cell_short_where_the_resolution_is_rounded_up():
    """5 cm are a little more in single precision: 2 m / 0.05000000075 m are 39 cells."""
    cells = np.full((1, 60), FREE, dtype=np.int8)
    cells[0, 0] = OCCUPIED
    grid = OccupancyGrid(0.05, 0.0, 0.0, cells)
    spread, exact = (distance_field(grid, 2.0, brushfire=quirk) for quirk in (True, False))
    assert (spread.radius, exact.radius) == (39, 40)
    assert metres(spread, 2.0)[0, 38:42].tolist() == [
        38 * single(0.05), 39 * single(0.05), 2.0, 2.0,
    ]  # fmt: skip
    away = metres(exact, 5.0)[0, 38:42]
    assert away.tolist() == pytest.approx([1.9, 1.95, 2.0, 5.0])
    # Coarser or finer cells may be rounded down, and then nothing is lost.
    tenths = OccupancyGrid(0.3, 0.0, 0.0, cells)
    assert distance_field(tenths, 3.0, brushfire=True).radius == int(3.0 / single(0.3))


@pytest.mark.parametrize("brushfire", [True, False])
@pytest.mark.parametrize(("radius", "kind"), [(255, np.uint16), (256, np.int32)])
def test_a_field_is_as_small_as_its_largest_value_allows(brushfire, radius, kind):
    cells = np.full((1, 300), FREE, dtype=np.int8)
    cells[0, 0] = OCCUPIED
    grid = OccupancyGrid(0.125, 0.0, 0.0, cells)
    field = distance_field(grid, radius * 0.125, brushfire=brushfire)
    assert field.squared.dtype == kind
    within = [min(k * k, field.far) if k <= radius else field.far for k in range(300)]
    assert field.squared[1, 1:-1].tolist() == within


def test_equal_maps_share_a_field_that_nobody_can_change():
    cells = np.zeros((5, 5), dtype=np.int8)
    cells[2, 2] = OCCUPIED
    one = distance_field(OccupancyGrid(0.05, 0.0, 0.0, cells.copy()), 1.0, brushfire=True)
    two = distance_field(OccupancyGrid(0.05, 7.0, 3.0, cells.copy()), 1.0, brushfire=True)
    assert one is two
    exact = distance_field(OccupancyGrid(0.05, 7.0, 3.0, cells.copy()), 1.0, brushfire=False)
    assert exact is not one
    coarse = distance_field(OccupancyGrid(0.1, 0.0, 0.0, cells.copy()), 2.0, brushfire=True)
    assert coarse is not one
    cells[0, 0] = OCCUPIED
    other = distance_field(OccupancyGrid(0.05, 0.0, 0.0, cells), 1.0, brushfire=True)
    assert other is not one
    with pytest.raises(ValueError, match="read-only"):
        one.squared[0, 0] = 0
