"""The still parts of a map: walls as blocks, names, the bar of the scale, the axes.

They are made once for a scene, a mission and a size, which is most of the work for a map.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from grammars.model.geometry import Floats, Point2
from grammars.model.mission import Mission
from grammars.model.scene import Scene
from scenario_tui.dashboard.widgets.block_cells import (
    Mask,
    area_dots,
    draw_strokes,
    fill_areas,
    mask_blocks,
    mask_dots,
    middle_line,
    ring_edges,
)
from scenario_tui.dashboard.widgets.cell_view import Canvas, Cells, Codes
from scenario_tui.dashboard.widgets.map_names import (
    Box,
    MapLabel,
    Place,
    place_beside,
    place_inside,
)
from scenario_tui.dashboard.widgets.map_projection import (
    MapProjection,
    cell_of,
    fit,
    main_axis,
    map_turn,
)
from scenario_tui.dashboard.widgets.map_style import ARROWS, Layer
from scenario_tui.text.formatting import keep_start
from scenario_tui.text.scale import round_step
from templates import plan_shapes
from templates.plan_shapes import PlanShape, ShapeRole

EYE_HEIGHT: Final = 0.3
"""Height of the section [m], about that of laser scanners."""
_LEAST_NAMED: Final = (30, 8)
"""Least columns and rows of a map with names and a scale."""
_LEAST_DOOR: Final = 1.5
"""Least length [dots] of a door with a name."""
_BAR_SHARE: Final = 0.08
"""Least share of the bar of the scale in the width."""
_MOST_NUMBERS: Final = 7
"""Most characters beside a waypoint; several may lie in one cell."""
_CELL: Final = np.array([2.0, 4.0])
"""Dots across and down a cell."""


@dataclass(frozen=True, slots=True, eq=False)
class _SceneLines:
    """A scene in metres, as arrays: edges and middle lines (n, 4), corners (n, 2).

    ``turn`` [rad] is its turn to the left on every screen.
    """

    walls: Floats
    middles: Floats
    low: Floats
    sweeps: Floats
    corners: Floats
    turn: float
    spaces: tuple[PlanShape, ...]
    doors: tuple[PlanShape, ...]


@dataclass(frozen=True, slots=True, eq=False)
class StillMap:
    """The still parts in cells (rows, columns), ``walls`` and ``low`` as dots of braille.

    ``blocks`` are the characters of walls, ``numbers`` those of waypoints by the cell of their
    sign.
    """

    projection: MapProjection
    blocks: Codes
    walls: Cells
    low: Cells
    numbers: Mapping[Place, MapLabel]
    names: tuple[MapLabel, ...]
    edge: tuple[MapLabel, ...]


@lru_cache(maxsize=16)
def still_map(
    scene: Scene, mission: Mission, columns: int, rows: int, zoom: int, middle: Point2 | None
) -> StillMap:
    """Return the still parts, or those around ``middle`` [m], ``zoom`` times larger."""
    lines = _scene_lines(scene)
    stops = np.array([(waypoint.x, waypoint.y) for waypoint in mission.waypoints])
    # The last row is left to the scale.
    size = (2 * columns, 4 * max(rows - 1, 1))
    start = (mission.start.x, mission.start.y)
    projection = fit(np.vstack([lines.corners, start, stops]), lines.turn, *size)
    if middle is not None:
        projection = replace(projection, scale=projection.scale * zoom, middle=middle)
    mask = _wall_mask(lines, projection, columns, rows)
    walls = mask_dots(mask.repeat(2, axis=0))
    low, sweeps = Canvas(columns, rows, 1), Canvas(columns, rows, 1)
    low.lines(_in_dots(lines.low, projection), 0)
    has_names = columns >= _LEAST_NAMED[0] and rows >= _LEAST_NAMED[1]
    edge = tuple(_scale_and_axes(projection, columns, rows)) if has_names else ()
    free = np.ones((rows, columns), dtype=np.bool_)
    for text in edge:
        text.take_place(free)
    numbers = _numbers(projection.dots(stops), free, walls > 0)
    names: tuple[MapLabel, ...] = ()
    if has_names:
        swept = _in_dots(lines.sweeps, projection)
        sweeps.lines(swept, 0)
        free &= (walls | sweeps.dots[0] | area_dots(swept, columns, rows)) == 0
        names = tuple(_names(lines, projection, free))
    return StillMap(projection, mask_blocks(mask), walls, low.dots[0], numbers, names, edge)


@lru_cache(maxsize=4)
def _scene_lines(scene: Scene) -> _SceneLines:
    solids = list(plan_shapes.solid_shapes(scene, EYE_HEIGHT))
    walls = _rings(shape for shape in solids if shape.role is ShapeRole.WALL)
    low = _rings(shape for shape in solids if shape.role is ShapeRole.LOW)
    start = scene.initial_joints
    swings = plan_shapes.swing_shapes(scene, start)
    bodies = plan_shapes.body_shapes(scene, start, EYE_HEIGHT)
    # All solids, also lintels and sills, so that the map is as large as its building.
    rings = [np.array(solid.polygon) for solid in scene.solids]
    rings += [np.array(region.outline) for region in scene.regions]
    edges, corners = ring_edges(walls), np.vstack([*rings, np.empty((0, 2))])
    return _SceneLines(
        walls=edges,
        middles=np.array([middle_line(ring) for ring in walls]).reshape(-1, 4),
        low=ring_edges(low),
        sweeps=ring_edges(_rings(shape for shape in (*swings, *bodies) if shape.form != "line")),
        corners=corners,
        turn=map_turn(main_axis(edges), corners) if rings else 0.0,
        spaces=tuple(plan_shapes.space_names(scene)),
        # Without people, whose names move along.
        doors=tuple(
            shape
            for shape in plan_shapes.object_names(scene, start)
            if shape.role is ShapeRole.OBJECT_NAME
        ),
    )


def _rings(shapes: Iterable[PlanShape]) -> list[Floats]:
    return [np.asarray(part, dtype=np.float64) for shape in shapes for part in shape.parts]


def _in_dots(lines: Floats, projection: MapProjection) -> Floats:
    return projection.dots(lines.reshape(-1, 2)).reshape(-1, 4)


def _wall_mask(lines: _SceneLines, projection: MapProjection, columns: int, rows: int) -> Mask:
    # Coordinates of squares start at edges, those of dots at middles; a square is two dots high.
    shape = np.array([1.0, 0.5] * 2)
    edges = (_in_dots(lines.walls, projection) + 0.5) * shape
    mask = fill_areas(edges, 2 * columns, 2 * rows)
    # Walls thinner than a square may miss the middles of all squares.
    draw_strokes(mask, (_in_dots(lines.middles, projection) + 0.5) * shape)
    return mask


def _numbers(dots: Floats, free: Mask, walls: Mask) -> dict[Place, MapLabel]:
    """Return the numbers of waypoints (n, 2) by the cells of their signs, joined in one cell.

    Cells of signs and numbers are marked as not ``free``. A number covers a wall only if there is
    no other place.
    """
    signs: dict[Place, list[str]] = {}
    for number, (x, y) in enumerate(dots.tolist(), start=1):
        row, column = cell_of(x, y)
        if 0 <= row < free.shape[0] and 0 <= column < free.shape[1]:
            signs.setdefault((row, column), []).append(str(number))
            free[row, column] = False
    numbers = {}
    for (row, column), texts in signs.items():
        words, box = keep_start(",".join(texts), _MOST_NUMBERS), (column, row, column, row)
        text = place_beside(words, Layer.WAYPOINT, box, free, walls=walls, gap=0)
        if text is not None:
            numbers[row, column] = text
    return numbers


def _names(lines: _SceneLines, projection: MapProjection, free: Mask) -> Iterator[MapLabel]:
    """Yield the names of doors, which have fewer possible places, then those of spaces."""
    for shape in lines.doors:
        dots = np.vstack([projection.dots(np.asarray(part)) for part in shape.parts])
        if np.ptp(dots, axis=0).max() < _LEAST_DOOR:
            continue
        if name := place_beside(shape.text, Layer.DOOR_NAME, box_of(dots), free):
            yield name
    for shape in lines.spaces:
        rings = [(projection.dots(np.asarray(part)) + 0.5) / _CELL for part in shape.parts]
        if name := place_inside(shape.text, Layer.SPACE_NAME, rings, free):
            yield name


def box_of(dots: Floats) -> Box:
    """Return the first and the last column and row of dots (n, 2)."""
    first = np.floor((dots.min(axis=0) + 0.5) / _CELL).astype(int).tolist()
    last = np.floor((dots.max(axis=0) + 0.5) / _CELL).astype(int).tolist()
    return (*first, *last)


def _scale_and_axes(projection: MapProjection, columns: int, rows: int) -> Iterator[MapLabel]:
    """Yield the bar of a round length at the lower left, and the axes of a turned map."""
    cells_a_metre = projection.scale / 2.0
    length = round_step(_BAR_SHARE * columns / cells_a_metre)
    # From the middle of its first cell to that of its last.
    bar = f"├{'─' * (round(length * cells_a_metre) - 1)}┤ {length:g} m"
    yield MapLabel(rows - 1, 0, bar, Layer.SCALE)
    if projection.turn != 0.0:
        x, y = (
            ARROWS[round((projection.turn + way) / (math.pi / 4)) % 8] for way in (0.0, math.pi / 2)
        )
        axes = f"x{x} y{y}"
        yield MapLabel(rows - 1, columns - len(axes), axes, Layer.SCALE)
