"""A map at one moment as cells of a terminal: the view, drawn over the still parts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from grammars.model.geometry import Floats, Point2, Pose2
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from scenario_tui.dashboard.widgets.block_cells import Mask, area_dots, ring_edges
from scenario_tui.dashboard.widgets.cell_view import Canvas, Codes, write_text
from scenario_tui.dashboard.widgets.map_names import MapLabel, Place, place_beside
from scenario_tui.dashboard.widgets.map_projection import cell_of
from scenario_tui.dashboard.widgets.map_style import (
    AHEAD,
    ARROWS,
    CONTACT,
    DECISION,
    ESTIMATE,
    FAILURE,
    LAYER_OF,
    REACHED,
    TOUCHING,
    Layer,
)
from scenario_tui.dashboard.widgets.still_map import EYE_HEIGHT, StillMap, box_of, still_map
from templates import plan_shapes
from templates.plan_shapes import MeasuredMark, PlanShape, Points, ShapeRole

_DOT_GAP: Final = 3.0
"""Dots of the canvas from one dot of a plan to the next."""
_THICK: Final = 2
"""Thickness [dots] of the trail near an object, distinct without colours, and of costmap cells,
which would leave gaps otherwise.
"""
_LEAST_BODY: Final = 4.0
"""Least length [dots] of a robot with a line to its nose."""


@dataclass(frozen=True, slots=True)
class View:
    """A moment of a run; ``robot_pose`` is ``None`` before the first snapshot.

    ``returns`` of the laser, the ``plan`` and ``contacts`` belong to this moment; all points are in
    the map frame [m]. ``spread`` is the covariance of the estimated position, xx, xy and yy [m²].
    ``clearances`` [m] belong to the points of the ``trail``, NaN if unknown, or are empty.
    ``limit`` [m] is the clearance that an oracle requires. ``costmaps`` are the middles of blocking
    cells by name, the default first. ``decisive`` is the object that decides a verdict now.
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
    decisive: MeasuredMark | None = None

    @property
    def where(self) -> Pose2:
        """The pose of the robot, or of its start."""
        return self.robot_pose or self.mission.start


def shapes_of(view: View, costmap: str | None = None) -> Iterator[PlanShape]:
    """Yield the shapes that move or change in a run, in the order of painting.

    ``costmap`` is the name of the one to show, empty for none, ``None`` for the default.
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
    if view.estimate is not None:
        if view.spread is not None:
            yield plan_shapes.spread_shape(view.estimate, view.spread)
        yield PlanShape(ShapeRole.ESTIMATE, "dots", (((view.estimate.x, view.estimate.y),),))
    yield plan_shapes.footprint_shape(view.where, view.robot)
    yield plan_shapes.heading_shape(view.where, view.robot)
    if view.decisive is not None:
        yield from plan_shapes.mark_shapes(view.decisive)
    yield PlanShape(ShapeRole.CONTACT, "dots", (view.contacts,))


class MapFrame:
    """A map at one moment: moving shapes, drawn over the still parts."""

    def __init__(self, still: StillMap) -> None:
        self.still = still
        rows, columns = still.walls.shape
        self.canvas = Canvas(columns, rows, len(Layer))
        self.canvas.dots[Layer.LOW] = still.low
        self._signs: list[tuple[Layer, Place, str]] = []
        self._movers: dict[str, Floats] = {}
        self._measure: tuple[str, Layer, Floats] | None = None

    @property
    def layers(self) -> frozenset[Layer]:
        """The layers with something on the map, for the legend."""
        layers = {layer for layer, dots in zip(Layer, self.canvas.dots, strict=True) if dots.any()}
        return frozenset(layers).union(layer for layer, _, _ in self._signs)

    def draw(self, shape: PlanShape) -> None:
        """Draw a moving shape."""
        role, layer = shape.role, LAYER_OF[shape.role]
        points = [np.asarray(part, dtype=np.float64) for part in shape.parts if len(part)]
        # A recording may have poses that are not finite: leave them out.
        points = [part[np.isfinite(part).all(axis=1)] for part in points]
        points = [part for part in points if len(part) > (role is ShapeRole.HEADING)]
        if not points:
            return
        # All at once, because each call of numpy takes time.
        dots = self.still.projection.dots(np.vstack(points))
        parts = np.split(dots, np.cumsum([len(part) for part in points])[:-1])
        if role is ShapeRole.MOVER:
            self._movers[shape.text] = dots
        if shape.form == "dots" and role in _SIGNS:
            self._sign(dots, _SIGNS[role], layer)
            if shape.text:
                # With its sign, because a contact may cover the sign on the map.
                self._measure = (f"{_SIGNS[role]} {shape.text}", layer, dots)
        elif shape.form == "dots":
            self.canvas.points(dots, layer, _THICK if role is ShapeRole.COSTMAP else 1)
        elif role is ShapeRole.HEADING:
            self._head(parts[0], layer)
        elif role is ShapeRole.TOUCHING_TRAIL:
            self._sign(np.vstack([_along(part, 1.0) for part in parts]), TOUCHING, layer)
        elif role is ShapeRole.PLAN:
            self.canvas.points(np.vstack([_along(part, _DOT_GAP) for part in parts]), layer)
        elif shape.form == "line":
            lines = np.vstack([np.hstack((part[:-1], part[1:])) for part in parts])
            self.canvas.lines(lines, layer, _THICK if role is ShapeRole.NEAR_TRAIL else 1)
        else:
            edges = ring_edges(parts)
            self.canvas.lines(edges, layer)
            if shape.form == "area" and role is not ShapeRole.ROBOT:
                area = area_dots(edges, self.canvas.columns, self.canvas.rows)
                self.canvas.dots[layer] |= area

    def _head(self, line: Floats, layer: Layer) -> None:
        """Draw the heading of a robot: an arrow, and a line to the nose of a large one."""
        right, down = line[1] - line[0]
        if math.hypot(right, down) > _LEAST_BODY:
            self.canvas.lines(line.reshape(1, 4), Layer.ROBOT)
        self._sign(line[:1], ARROWS[round(math.atan2(-down, right) / (math.pi / 4)) % 8], layer)

    def _sign(self, dots: Floats, sign: str, layer: Layer) -> None:
        """Put a sign into the cells that hold dots (n, 2)."""
        for x, y in dots.tolist():
            row, column = cell_of(x, y)
            if 0 <= row < self.canvas.rows and 0 <= column < self.canvas.columns:
                self._signs.append((layer, (row, column), sign))

    def cells(self) -> tuple[Codes, Codes]:
        """Return code points and styles, shape (rows, columns) each; style -1 is empty."""
        codes, owners = self.canvas.cells()
        still, solid = self.still, self.still.walls > 0
        # A wall behind another layer is drawn as dots; a laser return lights it.
        codes[solid] |= still.walls[solid]
        lit = solid & (owners == Layer.RETURN)
        plain = lit | (solid & (owners <= Layer.LOW))
        codes[plain] = still.blocks[plain]
        owners[plain] = Layer.WALL
        owners[lit] = Layer.LIT
        for text in list(self._texts(owners)):
            write_text(codes, owners, text.row, text.column, text.text, text.layer)
        for layer, place, sign in sorted(self._signs, key=lambda one: one[0]):
            codes[place], owners[place] = ord(sign), layer
        return codes, owners

    def _texts(self, owners: Codes) -> Iterator[MapLabel]:
        """Yield the texts that fit, the most important first."""
        still, walls = self.still, self.still.walls > 0
        free = np.ones(owners.shape, dtype=np.bool_)
        for _, place, _ in self._signs:
            free[place] = False
        # Reached ones first, so that a cell with another one in it counts as ahead.
        numbers = {
            place: replace(still.numbers[place], layer=layer)
            for layer, place, _ in self._signs
            if layer in (Layer.REACHED, Layer.WAYPOINT) and place in still.numbers
        }
        yield from _with_room((*still.edge, *numbers.values()), free)
        if self._measure is not None:
            words, layer, dots = self._measure
            if measure := place_beside(words, layer, box_of(dots), free, walls=walls):
                yield measure
        free &= owners < Layer.TRAIL
        yield from _with_room(still.names, free)
        free &= ~walls
        # Names of movers, if the map is large enough for names.
        for text, dots in self._movers.items() if still.names else ():
            if name := place_beside(text, Layer.DOOR_NAME, box_of(dots), free):
                yield name


def _with_room(texts: Iterable[MapLabel], free: Mask) -> list[MapLabel]:
    """Return the texts whose cells are ``free`` (rows, columns), and mark these as taken."""
    fitting = [text for text in texts if free[text.cells].all()]
    for text in fitting:
        text.take_place(free)
    return fitting


_SIGNS: Final = {
    ShapeRole.WAYPOINT: AHEAD,
    ShapeRole.REACHED: REACHED,
    ShapeRole.ESTIMATE: ESTIMATE,
    ShapeRole.CONTACT: CONTACT,
    ShapeRole.FAILURE: FAILURE,
    ShapeRole.DECISION: DECISION,
}
_TEXTS: Final = (ShapeRole.MOVER, ShapeRole.FAILURE, ShapeRole.DECISION)
"""Roles whose texts are written beside their shapes."""


def _along(dots: Floats, gap: float) -> Floats:
    """Return dots every ``gap`` dots along a line (n, 2)."""
    if len(dots) < 2:
        return dots
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(dots, axis=0).T))))
    at = np.arange(0.0, along[-1], gap)
    return np.column_stack([np.interp(at, along, dots[:, axis]) for axis in (0, 1)])


def _joined(shapes: Iterable[PlanShape]) -> Iterator[PlanShape]:
    """Yield neighbouring shapes of one kind as one, because every drawing takes time."""
    for (role, form, text), same in itertools.groupby(
        shapes, key=lambda one: (one.role, one.form, one.text if one.role in _TEXTS else "")
    ):
        yield PlanShape(role, form, tuple(part for one in same for part in one.parts), text)


def draw_view(
    view: View, columns: int, rows: int, *, zoom: int = 1, middle: Point2 | None = None,
    costmap: str | None = None,
) -> MapFrame:  # fmt: skip
    """Return the map of a view, or the part around ``middle`` [m], ``zoom`` times larger.

    ``costmap`` is that of :func:`shapes_of`.
    """
    frame = MapFrame(still_map(view.scene, view.mission, columns, rows, zoom, middle))
    for shape in _joined(shapes_of(view, costmap)):
        frame.draw(shape)
    return frame
