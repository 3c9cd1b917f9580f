"""The top view: walls, doors at their angle, the robot, where it was and where it must go."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from rich.segment import Segment
from rich.style import Style
from textual.geometry import Region, Size
from textual.strip import Strip
from textual.widget import Widget

from grammars.kinematics import link_poses
from grammars.mission import Mission
from grammars.robot import Robot
from grammars.scene import Scene
from grammars.values import Floats, Point2, Pose2, Ring
from scenario_tui.palette import BAD, BROKEN, BUSY, FACT, GOOD, QUIET, UNSURE
from scenario_tui.widgets.braille import Canvas, Codes

_WALLS, _RETURNS, _PLAN, _TRAIL, _DOORS, _DONE, _AHEAD, _BELIEF, _ROBOT, _CONTACT = range(10)
_STYLES: Final = (
    Style(color=QUIET),
    Style(color=BAD),
    Style(color=FACT),
    Style(color=BUSY),
    Style(color=UNSURE),
    Style(color=GOOD),
    Style(color=FACT, bold=True),
    Style(color=BROKEN),
    Style(color=BAD, bold=True),
    Style(color=BAD, bold=True, reverse=True),
)
_ZOOMS: Final = (1, 2, 4)
_ARROWS: Final = "→↗↑↖←↙↓↘"
_EYE_HEIGHT: Final = 0.3
"""The view is cut at this height [m], about where laser scanners look."""
_DOT_GAP: Final = 3.0
"""Dots of the canvas from one dot of a plan to the next."""
LEGEND: Final = "↑ robot  + estimate  ◆ waypoint ahead  ◇ reached"
REPLAY_LEGEND: Final = f"{LEGEND}  ✱ contact  ⡀ ⡀ plan"


@dataclass(frozen=True, slots=True)
class View:
    """What is to be seen: ``robot_pose`` is ``None`` before anything was heard of the robot.

    ``returns`` of the laser, the ``plan`` and ``contacts`` of this moment are known of recorded
    runs only; all points in the map frame [m].
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

    @property
    def where(self) -> Pose2:
        """Where the robot is, or will start."""
        return self.robot_pose or self.mission.start


class _Projection:
    """Metres to dots, y upwards: everything as large as fits, or a part around the robot."""

    def __init__(self, view: View, width: int, height: int, zoom: int) -> None:
        scene, mission = view.scene, view.mission
        points = [p for solid in scene.solids for p in solid.polygon]
        points.extend(p for region in scene.regions for p in region.outline)
        points.extend((w.x, w.y) for w in mission.waypoints)
        points.append((mission.start.x, mission.start.y))
        corners = np.array(points)
        low, high = corners.min(axis=0), corners.max(axis=0)
        extent = np.maximum(high - low, 0.1)
        self.scale = zoom * min((width - 1) / extent[0], (height - 1) / extent[1])
        self._middle = (low + high) / 2
        if zoom > 1:
            self._middle = np.array((view.where.x, view.where.y))
        self._centre = np.array([(width - 1) / 2, (height - 1) / 2])

    def dots(self, points: Iterable[Point2] | Floats) -> Floats:
        """Return points (n, 2) [m] as dots (n, 2)."""
        metres = np.asarray(list(points), dtype=float).reshape(-1, 2)
        turned: Floats = self._centre + (metres - self._middle) * (self.scale, -self.scale)
        return turned

    def edges(self, rings: Iterable[Ring]) -> Floats:
        """Return the edges of closed rings as segments (n, 4) in dots."""
        found = [np.hstack([d, np.roll(d, -1, axis=0)]) for d in map(self.dots, rings)]
        return np.vstack(found) if found else np.empty((0, 4))


def _cut(z_min: float, z_max: float) -> bool:
    return z_min <= _EYE_HEIGHT < z_max


def object_rings(scene: Scene, joints: Sequence[float]) -> list[Ring]:
    """Return the outlines of all object links for joint positions in scene order."""
    rings: list[Ring] = []
    start = 0
    for obj in scene.objects:
        positions = joints[start : start + len(obj.joints)]
        start += len(obj.joints)
        poses = link_poses(obj, positions)
        rings.extend(
            poses[link.name].apply_ring(ring)
            for link in obj.links
            if _cut(link.z_min, link.z_max)
            for ring in link.polygons
        )
    return rings


def drawn(
    view: View, columns: int, rows: int, *, zoom: int = 1, walls: Canvas | None = None
) -> Canvas:
    """Return the canvas of a view.

    ``walls`` is one of the same scene and size, not zoomed, to copy the walls from.
    """
    canvas = Canvas(columns, rows, len(_STYLES))
    project = _Projection(view, canvas.width, canvas.height, zoom)
    if walls is not None and zoom == 1:
        canvas.copy_layer(walls, _WALLS)
    else:
        solids = [s.polygon for s in view.scene.solids if _cut(s.z_min, s.z_max)]
        canvas.lines(project.edges(solids), _WALLS)
    canvas.lines(project.edges(object_rings(view.scene, view.joints)), _DOORS)
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
    if view.estimate is not None:
        ((x, y),) = project.dots([(view.estimate.x, view.estimate.y)])
        canvas.glyph(x, y, "+", _BELIEF)
    ((x, y),) = project.dots([(pose.x, pose.y)])
    canvas.glyph(x, y, _ARROWS[round(pose.yaw / (math.pi / 4)) % 8], _ROBOT)


def row_segments(codes: Codes, owners: Codes, base: Style) -> list[Segment]:
    """Return one row of cells (columns,) as text with styles over ``base``, one per layer run."""
    text = "".join(map(chr, codes.tolist()))
    cuts = [0, *(np.flatnonzero(np.diff(owners)) + 1).tolist(), len(text)]
    return [
        Segment(text[a:b], base + _STYLES[owners[a]] if owners[a] >= 0 else base)
        for a, b in itertools.pairwise(cuts)
    ]


class TopView(Widget):
    """Draws a :class:`View`; only rows that changed are sent to the terminal."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._view: View | None = None
        self._zoom = 1
        self._walls: tuple[Scene, Size, Canvas] | None = None
        self._codes: Codes | None = None
        self._owners: Codes | None = None

    def show(self, view: View | None) -> None:
        """Show another view, or nothing."""
        if view != self._view:
            self._view = view
            self._redraw()

    def zoom(self) -> int:
        """Come nearer to the robot, after the nearest back to everything; return how near."""
        self._zoom = _ZOOMS[(_ZOOMS.index(self._zoom) + 1) % len(_ZOOMS)]
        self._redraw()
        return self._zoom

    def on_resize(self) -> None:
        """Draw for the new size."""
        self._codes = self._owners = None
        self._redraw()

    def _redraw(self) -> None:
        size = self.size
        if self._view is None or not size.width or not size.height:
            self._codes = self._owners = None
            self.refresh()
            return
        before = (self._codes, self._owners)
        walls = self._cached_walls(size)
        canvas = drawn(self._view, size.width, size.height, zoom=self._zoom, walls=walls)
        if self._zoom == 1:
            self._walls = (self._view.scene, size, canvas)
        self._codes, self._owners = canvas.cells()
        if before[0] is None or before[1] is None or before[0].shape != self._codes.shape:
            self.refresh()
            return
        changed = np.any((self._codes != before[0]) | (self._owners != before[1]), axis=1)
        rows = np.flatnonzero(changed)
        if len(rows):
            self.refresh(*(Region(0, int(row), size.width, 1) for row in rows))

    def _cached_walls(self, size: Size) -> Canvas | None:
        if self._walls is None or self._view is None:
            return None
        scene, drawn_size, canvas = self._walls
        return canvas if scene is self._view.scene and drawn_size == size else None

    def render_line(self, y: int) -> Strip:
        """Return one row of cells, runs of one layer joined."""
        if self._codes is None or self._owners is None or y >= len(self._codes):
            return Strip.blank(self.size.width, self.rich_style)
        segments = row_segments(self._codes[y], self._owners[y], self.rich_style)
        return Strip(segments, self._codes.shape[1])
