"""What stands still on a map: walls as blocks, names, the bar of the scale, where x and y point.

Made once for a scene, a mission and a size; most of a map's work is here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np

from grammars.model.geometry import Floats, Point2
from grammars.model.mission import Mission
from grammars.model.scene import Scene
from scenario_tui.dashboard.widgets.block_cells import (
    ROWS,
    BlockLayer,
    Mask,
    area_dots,
    draw_strokes,
    fill_areas,
    mask_dots,
    middle_line,
    ring_edges,
    to_blocks,
)
from scenario_tui.dashboard.widgets.cell_view import Canvas, Cells
from scenario_tui.dashboard.widgets.map_names import MapName, name_area, name_thing, take_place
from scenario_tui.dashboard.widgets.map_projection import MapProjection, cell_of, fit, main_axis
from scenario_tui.dashboard.widgets.map_style import ARROWS, Layer
from scenario_tui.terminal.capabilities import Blocks
from templates import plan_shapes
from templates.plan_shapes import PlanShape, ShapeRole

EYE_HEIGHT: Final = 0.3
"""The view is cut at this height [m], about where laser scanners look."""
_LEAST_NAMED: Final = (30, 8)
"""Columns and rows of a map from which on it has names."""
_LEAST_DOOR: Final = 1.5
"""Dots a door is long at least to have its name beside it."""
_BAR_SHARE: Final = 0.2
"""Share of the width the bar of the scale has at most."""
_LEAST_BAR: Final = 3
_EVERY_OTHER: Final = 0b01010101
"""Dots of a braille cell that are shown of a dotted line."""


@dataclass(frozen=True, slots=True)
class _Same:
    """A value that equals itself only: comparing a scene would take as long as drawing it."""

    value: Any

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)


@dataclass(frozen=True, slots=True, eq=False)
class _SceneLines:
    """A scene in metres, as arrays: edges and middle lines (n, 4), corners (n, 2), its axis."""

    walls: Floats
    middles: Floats
    low: Floats
    floors: Floats
    sweeps: Floats
    corners: Floats
    axis: float
    spaces: tuple[PlanShape, ...]
    doors: tuple[PlanShape, ...]


@dataclass(frozen=True, slots=True)
class EdgeText:
    """A text on the map's edge: ``row`` and ``column`` of its first letter."""

    row: int
    column: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class StillMap:
    """What stands still on ``columns`` x ``rows`` cells; ``low`` are dots of braille."""

    columns: int
    rows: int
    projection: MapProjection
    walls: BlockLayer
    low: Canvas
    names: tuple[MapName, ...]
    texts: tuple[EdgeText, ...]


@lru_cache(maxsize=16)
def _still_map(
    scene: _Same, mission: _Same, columns: int, rows: int, zoom: int, middle: Point2 | None,
    blocks: Blocks,
) -> StillMap:  # fmt: skip
    lines = _scene_lines(scene)
    projection = _projection(lines, mission.value, columns, rows)
    if zoom > 1:
        projection = replace(
            projection, scale=projection.scale * zoom, middle=middle or projection.middle
        )
    walls = to_blocks(_wall_mask(lines, projection, columns, rows, blocks), blocks)
    low = Canvas(columns, rows, 1)
    low.lines(_in_dots(lines.low, projection), 0)
    low.merge(_open_borders(_in_dots(lines.floors, projection), walls), 0)
    texts = _scale_and_axes(projection, columns, rows)
    names: tuple[MapName, ...] = ()
    if columns >= _LEAST_NAMED[0] and rows >= _LEAST_NAMED[1]:
        free = _free_cells(lines, projection, walls, mission.value, texts)
        names = tuple(_names(lines, projection, free, walls.dots > 0))
    return StillMap(columns, rows, projection, walls, low, names, texts)


def still_map(
    scene: Scene, mission: Mission, columns: int, rows: int, *, zoom: int = 1,
    middle: Point2 | None = None, blocks: Blocks = "quadrants",
) -> StillMap:  # fmt: skip
    """Return what stands still: the whole map, or ``zoom`` times as large around ``middle`` [m]."""
    at = middle if zoom > 1 else None
    return _still_map(_Same(scene), _Same(mission), columns, rows, zoom, at, blocks)


@lru_cache(maxsize=4)
def _scene_lines(same: _Same) -> _SceneLines:
    scene: Scene = same.value
    solids = list(plan_shapes.solid_shapes(scene, EYE_HEIGHT))
    walls = _rings(shape for shape in solids if shape.role is ShapeRole.WALL)
    low = _rings(shape for shape in solids if shape.role is ShapeRole.LOW)
    start = scene.initial_joints
    swings = plan_shapes.swing_shapes(scene, start)
    bodies = plan_shapes.body_shapes(scene, start, EYE_HEIGHT)
    # Of lintels and sills alone, too: a map is as large as its building.
    rings = [np.array(solid.polygon) for solid in scene.solids]
    rings += [np.array(region.outline) for region in scene.regions]
    edges = ring_edges(walls)
    return _SceneLines(
        walls=edges,
        middles=np.array([middle_line(ring) for ring in walls]).reshape(-1, 4),
        low=ring_edges(low),
        floors=ring_edges(_rings(plan_shapes.floor_shapes(scene))),
        sweeps=ring_edges(_rings(shape for shape in (*swings, *bodies) if shape.form != "line")),
        corners=np.vstack(rings) if rings else np.empty((0, 2)),
        axis=main_axis(edges),
        spaces=tuple(plan_shapes.space_names(scene)),
        # Whoever walks takes their name along.
        doors=tuple(
            shape
            for shape in plan_shapes.object_names(scene, start)
            if shape.role is ShapeRole.OBJECT_NAME
        ),
    )


def _rings(shapes: Iterable[PlanShape]) -> list[Floats]:
    return [np.asarray(part, dtype=np.float64) for shape in shapes for part in shape.parts]


def _projection(lines: _SceneLines, mission: Mission, columns: int, rows: int) -> MapProjection:
    points = [(mission.start.x, mission.start.y), *((w.x, w.y) for w in mission.waypoints)]
    corners = np.vstack([lines.corners, np.array(points)])
    # The last row is that of the scale, which is to cover nothing.
    return fit(corners, lines.axis, 2 * columns, 4 * max(rows - 1, 1))


def _in_dots(lines: Floats, projection: MapProjection) -> Floats:
    return projection.dots(lines.reshape(-1, 2)).reshape(-1, 4)


def _wall_mask(
    lines: _SceneLines, projection: MapProjection, columns: int, rows: int, blocks: Blocks
) -> Mask:
    high = ROWS[blocks]
    # Squares are counted from their edges, dots from their middles.
    shape = np.array([1.0, high / 4.0] * 2)
    edges = (_in_dots(lines.walls, projection) + 0.5) * shape
    mask = fill_areas(edges, 2 * columns, high * rows)
    # Walls thinner than a square have no middle of one in them.
    draw_strokes(mask, (_in_dots(lines.middles, projection) + 0.5) * shape)
    return mask


def _open_borders(floors: Floats, walls: BlockLayer) -> Cells:
    """Return every other dot along the border of the floor where no wall is near.

    Maps that were imported end where nobody has looked.
    """
    rows, columns = walls.codes.shape
    floor = fill_areas(floors + 0.5, 2 * columns, 4 * rows)
    # Floor that goes on beyond the edge of the map has no border there.
    around = np.pad(floor, 1, mode="edge")
    inner = around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:] & floor
    near = np.zeros((rows + 2, columns + 2), dtype=np.bool_)
    for down in (0, 1, 2):
        for right in (0, 1, 2):
            near[down : down + rows, right : right + columns] |= walls.dots > 0
    dots = mask_dots(floor & ~inner, 4) & np.uint8(_EVERY_OTHER)
    return np.where(near[1:-1, 1:-1], 0, dots).astype(np.uint8)


def _free_cells(
    lines: _SceneLines, projection: MapProjection, walls: BlockLayer, mission: Mission,
    texts: Sequence[EdgeText],
) -> Mask:  # fmt: skip
    """Return the cells (rows, columns) a name may cover."""
    rows, columns = walls.codes.shape
    taken = Canvas(columns, rows, 1)
    sweeps = _in_dots(lines.sweeps, projection)
    taken.lines(sweeps, 0)
    taken.merge(area_dots(sweeps, columns, rows), 0)
    free: Mask = (walls.dots == 0) & (taken.layer(0) == 0)
    points = [(mission.start.x, mission.start.y), *((w.x, w.y) for w in mission.waypoints)]
    for x, y in projection.dots(np.array(points)).tolist():
        row, column = cell_of(x, y)
        if 0 <= row < rows:
            free[row, max(column - 1, 0) : max(column + 4, 0)] = False
    for text in texts:
        free[text.row, max(text.column - 1, 0) : text.column + len(text.text) + 1] = False
    return free


def _names(lines: _SceneLines, projection: MapProjection, free: Mask, walls: Mask) -> list[MapName]:
    found = []
    cell = np.array([2.0, 4.0])
    # Doors first, whose names have far fewer places to stand.
    for shape in lines.doors:
        dots = np.vstack([projection.dots(np.asarray(part)) for part in shape.parts])
        if np.ptp(dots, axis=0).max() < _LEAST_DOOR:
            continue
        box = [*((dots.min(axis=0) + 0.5) / cell), *((dots.max(axis=0) + 0.5) / cell)]
        name = name_thing(shape.text, Layer.DOOR_NAME, box, free, walls)
        if name is not None:
            take_place(name, free)
            found.append(name)
    for shape in lines.spaces:
        rings = [(projection.dots(np.asarray(part)) + 0.5) / cell for part in shape.parts]
        name = name_area(shape.text, Layer.SPACE_NAME, rings, free)
        if name is not None:
            take_place(name, free)
            found.append(name)
    return found


def _scale_and_axes(projection: MapProjection, columns: int, rows: int) -> tuple[EdgeText, ...]:
    """Return the bar of a round length at the lower left, and the axes of a turned map."""
    if rows < _LEAST_NAMED[1]:
        return ()
    cells_a_metre = projection.scale / 2.0
    length = _round_length(_BAR_SHARE * columns / cells_a_metre)
    cells = round(length * cells_a_metre)
    texts = []
    if cells >= _LEAST_BAR:
        # From the middle of its first cell to that of its last.
        bar = f"├{'─' * (cells - 1)}┤ {length:g} m"
        texts.append(EdgeText(rows - 1, 0, bar))
    if projection.turn != 0.0:
        x, y = (ARROWS[round((projection.turn + way) / (math.pi / 4)) % 8] for way in
                (0.0, math.pi / 2))  # fmt: skip
        axes = f"x{x} y{y}"
        texts.append(EdgeText(rows - 1, columns - len(axes), axes))
    return tuple(texts)


def _round_length(most: float) -> float:
    """Return the largest of 1, 2 or 5 times a power of ten that is not above ``most``."""
    power: float = 10.0 ** math.floor(math.log10(most))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most * 1.000001)
