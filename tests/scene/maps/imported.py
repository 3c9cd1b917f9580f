"""Maps for the tests of imports, and how far a map is from that of the building made of it."""

from types import SimpleNamespace

import numpy as np

from grammars.maps import load_walls, walls_text
from grammars.maps.map_import import vectorise
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.scenery.composition import compile_scene
from templates.occupancy import occupancy_grid

CELL = 0.05


def compared(grid, folder, rule="centre"):
    """Import a map, write and read the layer, draw its map, and hold it beside the first.

    ``differing`` is the share of cells that differ, ``astray`` the number far from borders.
    """
    made = vectorise(grid)
    file = folder / "made.walls.yaml"
    file.write_text(walls_text(made.building), encoding="utf-8")
    plan = load_walls(file)
    drawn = occupancy_grid(
        compile_scene(plan), resolution=grid.resolution, laser_height=0.3, rule=rule
    )
    again = sampled(drawn, grid)
    other = again != grid.cells
    walls, free, unknown = (grid.cells == kind for kind in (OCCUPIED, FREE, UNKNOWN))
    # Where floor ends and no wall stands, the border is one of what was seen.
    frontier = free & within_a_cell(unknown)
    near = within_a_cell(walls | frontier)
    astray = int((other & ~near).sum())
    return SimpleNamespace(made=made, plan=plan, differing=float(other.mean()), astray=astray)


def sampled(drawn, like):
    """Return what a map says in the centres of the cells of another one."""
    rows, columns = like.cells.shape
    x = like.x + (np.arange(columns) + 0.5) * like.resolution
    y = like.y + (np.arange(rows) + 0.5) * like.resolution
    column = np.floor((x - drawn.x) / drawn.resolution + 1e-6).astype(int)
    row = np.floor((y - drawn.y) / drawn.resolution + 1e-6).astype(int)
    height, width = drawn.cells.shape
    inside = np.ix_((row >= 0) & (row < height), (column >= 0) & (column < width))
    found = np.full(like.cells.shape, UNKNOWN, dtype=np.int8)
    found[inside] = drawn.cells[
        np.ix_(row[(row >= 0) & (row < height)], column[(column >= 0) & (column < width)])
    ]
    return found


def within_a_cell(cells):
    """Return the cells and the eight around each."""
    wide = np.pad(cells, 1)
    upright = wide[:-2] | wide[1:-1] | wide[2:]
    return upright[:, :-2] | upright[:, 1:-1] | upright[:, 2:]


def painted(rows, columns, *rectangles):
    """Return an unknown map with (row, column, rows, columns, value) painted on it, in order."""
    cells = np.full((rows, columns), UNKNOWN, dtype=np.int8)
    for row, column, height, width, value in rectangles:
        cells[row : row + height, column : column + width] = value
    return OccupancyGrid(CELL, -1.0, -2.0, cells)


def hexagon_world():
    """Draw a hexagon with nine columns in it, as the world of TurtleBot3 has them."""
    row, column = np.mgrid[0:110, 0:110]
    x, y = (column - 54.5) * CELL, (row - 54.5) * CELL
    angles = np.arange(6) * np.pi / 3 + 0.2
    reach = np.max([x * np.cos(a) + y * np.sin(a) for a in angles], axis=0)
    cells = np.where(reach < 2.4, FREE, np.where(reach < 2.5, OCCUPIED, UNKNOWN)).astype(np.int8)
    for at in np.ndindex(3, 3):
        away = np.hypot(x - (at[0] - 1) * 1.1, y - (at[1] - 1) * 1.1)
        cells[away < 0.15] = OCCUPIED
        # A laser sees the outside of a column only.
        cells[away < 0.08] = UNKNOWN
    return OccupancyGrid(CELL, -2.75, -2.75, cells)


def house():
    """Draw three rooms and a corridor with walls of two cells and three doors of 0.9 m."""
    free, wall = FREE, OCCUPIED
    return painted(
        140,
        200,
        (8, 8, 124, 184, wall),
        (10, 10, 56, 70, free),
        (10, 82, 56, 108, free),
        (68, 10, 30, 180, free),
        (100, 10, 30, 180, free),
        (66, 40, 2, 18, free),
        (66, 120, 2, 18, free),
        (98, 90, 2, 18, free),
        (30, 20, 6, 10, wall),
    )


def measured(grid, seed=1):
    """Return a map as SLAM would have it: walls are ragged, and some cells were never seen."""
    drawn = np.random.default_rng(seed)
    cells = grid.cells.copy()
    wall = cells == OCCUPIED
    beside = within_a_cell(wall) & (cells == FREE)
    cells[beside & (drawn.random(cells.shape) < 0.12)] = OCCUPIED
    cells[(cells == FREE) & (drawn.random(cells.shape) < 0.001)] = UNKNOWN
    return OccupancyGrid(grid.resolution, grid.x, grid.y, cells)
