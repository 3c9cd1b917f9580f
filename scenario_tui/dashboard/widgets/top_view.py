"""The top view: walls, doors at their angle, the robot, where it was and where it must go."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from rich.style import Style

from grammars.model.geometry import Floats, Point2, Pose2, Ring
from grammars.model.kinematics import object_rings, solid_rings
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from scenario_tui.dashboard.widgets.cell_view import Canvas, CellView, Codes
from scenario_tui.text.formatting import BAD, BROKEN, BUSY, FACT, GOOD, QUIET, UNSURE

_WALLS, _RETURNS, _PLAN, _TRAIL, _DOORS, _SPREAD, _DONE, _AHEAD, _BELIEF, _ROBOT, _CONTACT = range(
    11
)
STYLES: Final = (
    Style(color=QUIET),
    Style(color=BAD),
    Style(color=FACT),
    Style(color=BUSY),
    Style(color=UNSURE),
    Style(color=BROKEN),
    Style(color=GOOD),
    Style(color=FACT, bold=True),
    Style(color=BROKEN),
    Style(color=BAD, bold=True),
    Style(color=BAD, bold=True, reverse=True),
)
_ZOOMS: Final = (1, 2, 4, 8)
_ARROWS: Final = "→↗↑↖←↙↓↘"
_EYE_HEIGHT: Final = 0.3
"""The view is cut at this height [m], about where laser scanners look."""
_DOT_GAP: Final = 3.0
"""Dots of the canvas from one dot of a plan to the next."""
_SIGMAS: Final = 2.0
"""The ellipse around the estimate holds what lies within so many standard deviations."""
_MARGIN: Final = 0.3
"""A view that follows moves on when the robot comes this near to its edge, a share of its size:
moving it less often keeps the terminal quiet.
"""
_STRIDE: Final = 0.25
"""How far one key pans, a share of the view."""
LEGEND: Final = "↑ robot  + estimate  ◆ waypoint ahead  ◇ reached"
REPLAY_LEGEND: Final = f"{LEGEND}  ✱ contact  ⡀ ⡀ plan"


@dataclass(frozen=True, slots=True)
class View:
    """What is to be seen: ``robot_pose`` is ``None`` before anything was heard of the robot.

    ``returns`` of the laser, the ``plan`` and ``contacts`` are those of this moment; all points in
    the map frame [m]. ``spread`` is how sure the estimate is of its position: xx, xy and yy of the
    covariance [m²]. ``clearances`` [m] belong to the points of the ``trail``, as many, NaN where
    unknown, or there are none; ``limit`` [m] is the clearance an oracle asks for.
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

    @property
    def where(self) -> Pose2:
        """Where the robot is, or will start."""
        return self.robot_pose or self.mission.start


class _Projection:
    """Metres to dots, y upwards: everything as large as fits, or a part around ``middle`` [m]."""

    def __init__(
        self, view: View, width: int, height: int, zoom: int, middle: Point2 | None
    ) -> None:
        scene, mission = view.scene, view.mission
        points = [p for solid in scene.solids for p in solid.polygon]
        points.extend(p for region in scene.regions for p in region.outline)
        points.extend((w.x, w.y) for w in mission.waypoints)
        points.append((mission.start.x, mission.start.y))
        corners = np.array(points)
        low, high = corners.min(axis=0), corners.max(axis=0)
        extent = np.maximum(high - low, 0.1)
        self.scale = zoom * min((width - 1) / extent[0], (height - 1) / extent[1])
        # Dots are about square: a cell is twice as high as wide, and has four dots by two.
        self._middle = (low + high) / 2
        if zoom > 1:
            self._middle = np.array(middle or (view.where.x, view.where.y))
        self._centre = np.array([(width - 1) / 2, (height - 1) / 2])

    def dots(self, points: Iterable[Point2] | Floats) -> Floats:
        """Return points (n, 2) [m] as dots (n, 2)."""
        listed = points if isinstance(points, np.ndarray | tuple) else list(points)
        metres = np.asarray(listed, dtype=float).reshape(-1, 2)
        turned: Floats = self._centre + (metres - self._middle) * (self.scale, -self.scale)
        return turned

    def edges(self, rings: Iterable[Ring]) -> Floats:
        """Return the edges of closed rings as segments (n, 4) in dots."""
        found = [np.hstack([d, np.roll(d, -1, axis=0)]) for d in map(self.dots, rings)]
        return np.vstack(found) if found else np.empty((0, 4))


def draw_view(
    view: View, columns: int, rows: int, *, zoom: int = 1, middle: Point2 | None = None,
    walls: Canvas | None = None,
) -> Canvas:  # fmt: skip
    """Return the canvas of a view, when zoomed the part around ``middle`` [m], else the robot.

    ``walls`` is one of the same scene, size, zoom and middle, to copy the walls from.
    """
    canvas = Canvas(columns, rows, len(STYLES))
    project = _Projection(view, canvas.width, canvas.height, zoom, middle)
    # Walls are most of the work, and stand still.
    if walls is not None:
        canvas.copy_layer(walls, _WALLS)
    else:
        canvas.lines(project.edges(solid_rings(view.scene, _EYE_HEIGHT)), _WALLS)
    positions = dict(zip(view.scene.joint_names, view.joints, strict=True))
    # Lines in any order: a cell takes the style of its highest layer. Of characters the last stays.
    canvas.lines(project.edges(object_rings(view.scene, _EYE_HEIGHT, positions)), _DOORS)
    canvas.points(project.dots(view.returns), _RETURNS)
    canvas.points(_dotted(project.dots(view.plan)), _PLAN)
    if len(view.trail) > 1:
        dots = project.dots(view.trail)
        canvas.lines(np.hstack([dots[:-1], dots[1:]]), _TRAIL)
    for index, (x, y) in enumerate(project.dots((w.x, w.y) for w in view.mission.waypoints)):
        done = index < view.reached
        canvas.glyph(x, y, "◇" if done else "◆", _DONE if done else _AHEAD)
    _draw_robot(canvas, project, view)
    for x, y in project.dots(view.contacts):
        canvas.glyph(x, y, "✱", _CONTACT)
    return canvas


def _dotted(dots: Floats) -> Floats:
    """Return dots every few along a line (n, 2): told from the unbroken trail without colour."""
    if len(dots) < 2:
        return dots
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(dots, axis=0).T))))
    at = np.arange(0.0, along[-1], _DOT_GAP)
    return np.column_stack([np.interp(at, along, dots[:, axis]) for axis in (0, 1)])


def _draw_robot(canvas: Canvas, project: _Projection, view: View) -> None:
    pose = view.where
    canvas.lines(project.edges([pose.apply_ring(view.robot.footprint)]), _ROBOT)
    if view.estimate is not None and view.spread is not None:
        canvas.points(project.dots(ellipse(view.estimate, view.spread)), _SPREAD)
    if view.estimate is not None:
        ((x, y),) = project.dots([(view.estimate.x, view.estimate.y)])
        canvas.glyph(x, y, "+", _BELIEF)
    ((x, y),) = project.dots([(pose.x, pose.y)])
    canvas.glyph(x, y, _ARROWS[round(pose.yaw / (math.pi / 4)) % 8], _ROBOT)


def ellipse(centre: Pose2, spread: tuple[float, float, float], count: int = 48) -> Floats:
    """Return points (count, 2) [m] two standard deviations around a centre.

    ``spread`` is xx, xy and yy of the covariance [m²].
    """
    xx, xy, yy = spread
    # Axes of the covariance; rounding may make the smaller of two variances negative.
    sizes, axes = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    angles = np.linspace(0.0, math.tau, count, endpoint=False)
    unit = np.column_stack([np.cos(angles), np.sin(angles)])
    around: Floats = (centre.x, centre.y) + _SIGMAS * (
        unit * np.sqrt(np.maximum(sizes, 0.0)) @ axes.T
    )
    return around


@dataclass(frozen=True, slots=True, eq=False)
class _Same:
    """A scene that equals itself only: comparing all of it would take as long as drawing it."""

    scene: Scene

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.scene is other.scene


class TopView(CellView):
    """Draws a :class:`View`: all of it, or a part that follows the robot or is panned by hand."""

    STYLES: ClassVar[Sequence[Style]] = STYLES

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._view: View | None = None
        self._zoom = 1
        self._middle: Point2 | None = None
        self._follows = True
        self._walls: tuple[tuple[object, ...], Canvas] | None = None

    def show(self, view: View | None) -> None:
        """Show another view, or nothing."""
        self._view = view
        self.redraw()

    def zoom(self) -> int:
        """Come nearer to the robot, after the nearest back to everything; return how near."""
        self._zoom = _ZOOMS[(_ZOOMS.index(self._zoom) + 1) % len(_ZOOMS)]
        self._follows, self._middle = True, None
        self.redraw()
        return self._zoom

    def follow(self) -> bool:
        """Follow the robot, or stop following it; return whether it is followed now."""
        self._follows = not self._follows or self._zoom == 1
        if self._follows:
            self._middle = None
        self.redraw()
        return self._follows

    def pan(self, right: int, up: int) -> bool:
        """Look further to one side when zoomed; return whether there is anything to pan."""
        if self._zoom == 1 or self._view is None or not self.size:
            return False
        reach = self._reach(self._view)
        x, y = self._middle or (self._view.where.x, self._view.where.y)
        self._middle = (x + 2 * _STRIDE * right * reach[0], y + 2 * _STRIDE * up * reach[1])
        self._follows = False
        self.redraw()
        return True

    def _reach(self, view: View) -> Point2:
        """Return half the width and height of what is seen [m]."""
        width, height = 2 * self.size.width, 4 * self.size.height
        scale = _Projection(view, width, height, self._zoom, None).scale
        return width / scale / 2, height / scale / 2

    def _keep_up(self, view: View) -> None:
        """Have the part seen hold the robot when it is to be followed."""
        if self._zoom == 1 or not self._follows:
            return
        # Not centred all the time: every shift of the map sends all of it over the line.
        here = (view.where.x, view.where.y)
        if self._middle is None:
            self._middle = here
            return
        free = [(1.0 - 2 * _MARGIN) * reach for reach in self._reach(view)]
        off = (abs(a - b) for a, b in zip(here, self._middle, strict=True))
        if any(distance > most for distance, most in zip(off, free, strict=True)):
            self._middle = here

    def cells(self, columns: int, rows: int) -> tuple[Codes, Codes] | None:
        """Return the view as cells."""
        view = self._view
        if view is None:
            return None
        self._keep_up(view)
        middle = self._middle if self._zoom > 1 else None
        key = (_Same(view.scene), columns, rows, self._zoom, middle)
        walls = self._walls[1] if self._walls is not None and self._walls[0] == key else None
        canvas = draw_view(view, columns, rows, zoom=self._zoom, middle=middle, walls=walls)
        self._walls = (key, canvas)
        return canvas.cells()
