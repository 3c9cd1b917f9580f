"""A map at one moment: what is to be seen, drawn over what stands still, as cells of a terminal."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from grammars.model.geometry import Floats, Point2, Pose2
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from scenario_tui.dashboard.widgets.block_cells import area_dots, ring_edges
from scenario_tui.dashboard.widgets.cell_view import BLANK, Canvas, Codes, write_text
from scenario_tui.dashboard.widgets.map_names import MapName, Place, name_thing, take_place
from scenario_tui.dashboard.widgets.map_projection import cell_of
from scenario_tui.dashboard.widgets.map_style import (
    AHEAD,
    ARROWS,
    CONTACT,
    ESTIMATE,
    LAYER_OF,
    REACHED,
    TOUCHING,
    Layer,
)
from scenario_tui.dashboard.widgets.still_map import EYE_HEIGHT, StillMap, still_map
from scenario_tui.terminal.capabilities import Blocks
from scenario_tui.text.formatting import keep_start
from templates import plan_shapes
from templates.plan_shapes import PlanShape, Points, ShapeRole

_DOT_GAP: Final = 3.0
"""Dots of the canvas from one dot of a plan to the next."""
_THICK: Final = ((0.001, 0.001), (1.001, 0.001), (0.001, 1.001), (1.001, 1.001))
"""Where the four dots of a thick line lie, seen from the dot of a thin one.

Not whole numbers: halves are rounded to even ones, and two lines could fall on each other.
"""
_LEAST_BODY: Final = 4.0
"""Dots a robot is long at least to be shown with a line to its nose."""
_CELL: Final = (2.0, 4.0)
"""Dots across and down a cell."""
_MOST_NUMBERS: Final = 7
"""Letters beside a waypoint at most: several may lie in one cell."""


@dataclass(frozen=True, slots=True)
class View:
    """What is to be seen: ``robot_pose`` is ``None`` before anything was heard of the robot.

    ``returns`` of the laser, the ``plan`` and ``contacts`` are those of this moment; all points in
    the map frame [m]. ``spread`` is how sure the estimate is of its position: xx, xy and yy of the
    covariance [m²]. ``clearances`` [m] belong to the points of the ``trail``, as many, NaN where
    unknown, or there are none; ``limit`` [m] is the clearance an oracle asks for. ``costmaps`` are
    the middles of their cells that block the robot, by name, the one shown unless another is
    chosen first.
    """

    scene: Scene
    robot: Robot
    mission: Mission
    joints: tuple[float, ...]
    robot_pose: Pose2 | None = None
    estimate: Pose2 | None = None
    reached: int = 0
    trail: tuple[Point2, ...] = ()
    returns: tuple[Point2, ...] = ()
    plan: tuple[Point2, ...] = ()
    contacts: tuple[Point2, ...] = ()
    spread: tuple[float, float, float] | None = None
    clearances: tuple[float, ...] = ()
    limit: float | None = None
    costmaps: Mapping[str, Points] = field(default_factory=dict, compare=False)

    @property
    def where(self) -> Pose2:
        """Where the robot is, or will start."""
        return self.robot_pose or self.mission.start


def shapes_of(view: View, costmap: str | None = None) -> Iterator[PlanShape]:
    """Yield the shapes of what moves or changes in a run, those painted over others later.

    ``costmap`` is the name of the one to show, empty for none, ``None`` for the first.
    """
    positions = dict(zip(view.scene.joint_names, view.joints, strict=True))
    name = next(iter(view.costmaps), "") if costmap is None else costmap
    yield PlanShape(ShapeRole.COSTMAP, "dots", (view.costmaps.get(name, ()),))
    yield PlanShape(ShapeRole.RETURN, "dots", (view.returns,))
    yield PlanShape(ShapeRole.PLAN, "line", (view.plan,))
    yield from plan_shapes.trail_shapes(view.trail, view.clearances, view.limit)
    bodies = plan_shapes.body_shapes(view.scene, positions, EYE_HEIGHT)
    yield from sorted(bodies, key=lambda shape: LAYER_OF[shape.role])
    yield from plan_shapes.waypoint_shapes(view.mission, view.reached)
    if view.estimate is not None and view.spread is not None:
        yield plan_shapes.spread_shape(view.estimate, view.spread)
    if view.estimate is not None:
        where = (view.estimate.x, view.estimate.y)
        yield PlanShape(ShapeRole.ESTIMATE, "dots", ((where,),))
    yield plan_shapes.footprint_shape(view.where, view.robot)
    yield plan_shapes.heading_shape(view.where, view.robot)
    yield PlanShape(ShapeRole.CONTACT, "dots", (view.contacts,))


class MapFrame:
    """A map at one moment: what moves, drawn over what stands still."""

    def __init__(self, still: StillMap) -> None:
        self.still = still
        self.canvas = Canvas(still.columns, still.rows, len(Layer))
        self.canvas.merge(still.low.layer(0), Layer.LOW)
        self._glyphs: dict[Place, tuple[str, Layer]] = {}
        self._numbers: dict[Place, dict[str, Layer]] = {}
        self._movers: dict[str, Floats] = {}
        self._shown: set[Layer] = set()

    @property
    def layers(self) -> frozenset[Layer]:
        """What is to be seen, for the legend."""
        return frozenset(self._shown)

    def draw(self, shape: PlanShape) -> None:
        """Draw a shape that moves."""
        layer = LAYER_OF[shape.role]
        points = [np.asarray(part, dtype=np.float64) for part in shape.parts if len(part)]
        # A recording may have poses that are no numbers: they are nowhere.
        points = [part[np.isfinite(part).all(axis=1)] for part in points]
        points = [part for part in points if len(part) > (shape.role is ShapeRole.HEADING)]
        if not points:
            return
        # All at once: each call of numpy takes its time.
        dots = self.still.projection.dots(np.vstack(points))
        parts = np.split(dots, np.cumsum([len(part) for part in points])[:-1])
        if shape.role is ShapeRole.MOVER:
            self._movers[shape.text] = dots
        if shape.form == "dots":
            self._mark(shape, layer, dots)
        elif shape.role is ShapeRole.HEADING:
            self._head(parts[0], layer)
        elif shape.role is ShapeRole.TOUCHING_TRAIL:
            for x, y in np.vstack([_along(part, 1.0) for part in parts]).tolist():
                self._glyph(x, y, TOUCHING, layer)
        elif shape.role is ShapeRole.PLAN:
            self.canvas.points(np.vstack([_along(part, _DOT_GAP) for part in parts]), layer)
        elif shape.form == "line":
            lines = np.vstack([np.hstack((part[:-1], part[1:])) for part in parts])
            # Told from the rest without colours by twice the thickness.
            for off in _THICK if shape.role is ShapeRole.NEAR_TRAIL else _THICK[:1]:
                self.canvas.lines(lines + np.array(off * 2), layer)
        else:
            edges = ring_edges(parts)
            self.canvas.lines(edges, layer)
            if shape.form == "area" and shape.role is not ShapeRole.ROBOT:
                self.canvas.merge(area_dots(edges, self.canvas.columns, self.canvas.rows), layer)
        marked = any(owner is layer for _, owner in self._glyphs.values())
        if marked or self.canvas.layer(layer).any():
            self._shown.add(layer)

    def _mark(self, shape: PlanShape, layer: Layer, dots: Floats) -> None:
        sign = _GLYPHS.get(shape.role)
        if sign is None:
            # Cells hardly wider than a dot would leave gaps.
            for off in _THICK if shape.role is ShapeRole.COSTMAP else _THICK[:1]:
                self.canvas.points(dots + np.array(off), layer)
            return
        for x, y in dots.tolist():
            self._glyph(x, y, sign, layer)
            if shape.text:
                self._numbers.setdefault(cell_of(x, y), {})[shape.text] = layer

    def _head(self, line: Floats, layer: Layer) -> None:
        """Draw the way a robot looks: a line to its nose where it is large, and an arrow."""
        (x, y), (nose_x, nose_y) = line.tolist()
        if math.dist((x, y), (nose_x, nose_y)) > _LEAST_BODY:
            self.canvas.lines(line.reshape(1, 4), Layer.ROBOT)
        angle = math.atan2(y - nose_y, nose_x - x)
        self._glyph(x, y, ARROWS[round(angle / (math.pi / 4)) % 8], layer)

    def _glyph(self, x: float, y: float, sign: str, layer: Layer) -> None:
        """Put a sign into the cell that holds a dot, over those of lower layers."""
        place = cell_of(x, y)
        inside = 0 <= place[0] < self.canvas.rows and 0 <= place[1] < self.canvas.columns
        if inside and (place not in self._glyphs or self._glyphs[place][1] <= layer):
            self._glyphs[place] = (sign, layer)

    def cells(self, names: dict[MapName, Place] | None = None) -> tuple[Codes, Codes]:
        """Return code points and styles, shape (rows, columns) each; style -1 is empty.

        ``names`` remembers where each name stood last: it stays there as long as it can.
        """
        walls = self.still.walls
        shape = (self.canvas.rows, self.canvas.columns)
        dots, owners = np.zeros(shape, dtype=np.uint8), np.full(shape, -1, dtype=np.int32)
        for layer in Layer:
            here = self.canvas.layer(layer)
            if layer in self._shown or layer is Layer.LOW:
                dots |= here
                owners[here > 0] = layer
        solid = walls.dots > 0
        # A wall with something before it is dots as well; where the laser meets it, it is lit.
        lit = solid & (owners == Layer.RETURN)
        plain = lit | (solid & (owners <= Layer.LOW))
        codes = (dots | walls.dots).astype(np.int32) + BLANK
        codes[(owners < 0) & ~solid] = ord(" ")
        codes[plain] = walls.codes[plain]
        owners[plain] = Layer.WALL
        owners[lit] = Layer.LIT
        self._write_names(codes, owners, {} if names is None else names)
        self._write_signs(codes, owners)
        for text in self.still.texts:
            write_text(codes, owners, text.row, text.column, text.text, Layer.SCALE)
        return codes, owners

    def _write_names(self, codes: Codes, owners: Codes, names: dict[MapName, Place]) -> None:
        """Write every name at the first of its places that nothing of the run is in."""
        taken = owners >= Layer.TRAIL
        for row, column in self._glyphs:
            taken[row, column] = True
        for name in self.still.names:
            before = names.get(name)
            for row, column in (*((before,) if before in name.spots else ()), *name.spots):
                if not taken[row : row + len(name.lines), column : column + name.width].any():
                    names[name] = (row, column)
                    # With a cell on either side, as where it was found room for.
                    beside = slice(max(column - 1, 0), column + name.width + 1)
                    taken[row : row + len(name.lines), beside] = True
                    for below, line in enumerate(name.lines):
                        shift = (name.width - len(line)) // 2
                        write_text(codes, owners, row + below, column + shift, line, name.layer)
                    break
        walls = self.still.walls.dots > 0
        free = ~(taken | walls)
        for text, dots in self._movers.items() if self.still.names else ():
            box = [*((dots.min(axis=0) + 0.5) / _CELL), *((dots.max(axis=0) + 0.5) / _CELL)]
            called = name_thing(text, Layer.DOOR_NAME, box, free, walls)
            if called is not None:
                write_text(codes, owners, *called.spots[0], text, called.layer)
                take_place(called, free)

    def _write_signs(self, codes: Codes, owners: Codes) -> None:
        """Write the numbers of waypoints beside them, then the signs, higher layers last."""
        solid = self.still.walls.dots > 0
        for (row, column), numbers in self._numbers.items():
            if not (0 <= row < self.canvas.rows and 0 <= column < self.canvas.columns):
                continue
            text = keep_start(",".join(numbers), _MOST_NUMBERS)
            left, right = column - len(text), column + 1
            # On the other side where a wall would be covered, if that has room.
            full = right + len(text) > codes.shape[1] or solid[row, right : right + len(text)].any()
            aside = full and left >= 0 and not solid[row, left:column].any()
            write_text(codes, owners, row, left if aside else right, text, max(numbers.values()))
        for place, (sign, layer) in sorted(self._glyphs.items(), key=lambda item: item[1][1]):
            codes[place], owners[place] = ord(sign), layer


_GLYPHS: Final = {
    ShapeRole.WAYPOINT: AHEAD,
    ShapeRole.REACHED: REACHED,
    ShapeRole.ESTIMATE: ESTIMATE,
    ShapeRole.CONTACT: CONTACT,
}
_TOLD: Final = (ShapeRole.WAYPOINT, ShapeRole.REACHED, ShapeRole.MOVER)
"""Roles whose texts are written beside their shapes."""


def _along(dots: Floats, gap: float) -> Floats:
    """Return dots every ``gap`` dots along a line (n, 2)."""
    if len(dots) < 2:
        return dots
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(dots, axis=0).T))))
    at = np.arange(0.0, along[-1], gap)
    return np.column_stack([np.interp(at, along, dots[:, axis]) for axis in (0, 1)])


def _joined(shapes: Iterable[PlanShape]) -> Iterator[PlanShape]:
    """Yield neighbours that are alike as one, for every drawing takes its time."""
    for (role, form, text), same in itertools.groupby(
        shapes, key=lambda one: (one.role, one.form, one.text if one.role in _TOLD else "")
    ):
        yield PlanShape(role, form, tuple(part for one in same for part in one.parts), text)


def draw_view(
    view: View, columns: int, rows: int, *, zoom: int = 1, middle: Point2 | None = None,
    blocks: Blocks = "quadrants", costmap: str | None = None,
) -> MapFrame:  # fmt: skip
    """Return the map of a view, when zoomed the part around ``middle`` [m], else the robot.

    ``costmap`` is that of :func:`shapes_of`.
    """
    around = middle or (view.where.x, view.where.y)
    frame = MapFrame(
        still_map(view.scene, view.mission, columns, rows, zoom=zoom, middle=around, blocks=blocks)
    )
    for shape in _joined(shapes_of(view, costmap)):
        frame.draw(shape)
    return frame
