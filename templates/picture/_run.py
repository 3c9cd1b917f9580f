"""Runs on the page: paths, footprints, contacts, and the object that decides a verdict."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from grammars.model.geometry import Point2, Ring
from templates.picture._drawing import Colour, Disc, DrawingItem, Labels, Shape, TextLabel
from templates.picture._page import Page, legend_row
from templates.picture._scene import spots_around
from templates.plan_shapes import MeasuredMark, ShapeRole, trail_shapes

Samples: TypeAlias = npt.NDArray[np.floating[Any]]
_DEVIATION: Final = 0.15
"""Largest deviation of a line from its samples, in page units."""
_PLACES: Final = 150
"""Approximate number of places of a path that scripts find by time."""
_SHORT: Final = 10.0
"""Length on the page below which a measured line gets a circle."""
_LINES: Final = {
    ShapeRole.TRAIL: (Colour.DRIVEN, 1.8),
    ShapeRole.NEAR_TRAIL: (Colour.CLOSE, 3.2),
    ShapeRole.TOUCHING_TRAIL: (Colour.TOUCHED, 4.5),
}
"""Colours and widths of a path that is clear, inside the buffer, or touching."""


@dataclass(frozen=True, slots=True, eq=False)
class DrivenWay:
    """Places (n, 2) [m] of a robot, with the ``clearance`` (n,) [m] there, NaN if unknown.

    Below ``limit`` [m] something is inside the safety buffer. Scripts of a page find places by
    ``repeat`` and ``time`` (n,) [s].
    """

    points: Samples
    clearance: Samples = field(default_factory=lambda: np.empty(0))
    limit: float = 0.0
    repeat: int = 0
    time: Samples = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True, slots=True)
class RunOverlay:
    """Paths of one or several runs with their events, in the map frame [m].

    The last of the ``footprints`` is that at the end of the run, or of the shown part. A part also
    has earlier ones, and ``apparent_goals``: the places of the current waypoint by the robot's
    estimate. ``positions`` [rad or m] of joints by scene-wide name are those at the end. With
    ``closely``, only the surroundings of the paths are shown.
    """

    ways: tuple[DrivenWay, ...]
    believed: tuple[Point2, ...] = ()
    contacts: tuple[Point2, ...] = ()
    about: str = ""
    footprints: tuple[Ring, ...] = ()
    apparent_goals: tuple[Point2, ...] = ()
    positions: Mapping[str, float] = field(default_factory=dict)
    mark: MeasuredMark | None = None
    closely: bool = False

    @property
    def points(self) -> tuple[Point2, ...]:
        """All points of the paths."""
        return tuple((x, y) for way in self.ways for x, y in way.points.tolist())


def run_lines(run: RunOverlay, page: Page) -> list[DrawingItem]:
    """Return the lines of a run, with the estimate below the true path."""
    items: list[DrawingItem] = [
        Shape((page.ring(ring),), line=Colour.ROBOT, width=0.9, opacity=0.55)
        for ring in run.footprints
    ]
    if run.footprints:
        last = page.ring(run.footprints[-1])
        items.append(Shape((last,), fill=Colour.ROBOT, line=Colour.ROBOT, width=2.0, opacity=0.45))
    if len(run.believed) > 1:
        line = page.ring(run.believed)
        items.append(Shape((line,), line=Colour.BELIEVED, width=1.6, dash=(6.0, 4.0), open=True))
    pieces = [
        (shape.role, _simple_line(page.ring(part)))
        for way in run.ways
        for shape in trail_shapes(way.points.tolist(), way.clearance.tolist(), way.limit)
        for part in shape.parts
    ]
    for role, (colour, width) in _LINES.items():
        lines = tuple(line for its_role, line in pieces if its_role is role)
        if lines:
            items.append(Shape(lines, line=colour, width=width, open=True))
    if len(run.ways) == 1 and run.points:
        items.append(Disc(page.point(run.points[-1]), 5.0, Colour.DRIVEN, Colour.FLOOR, 1.5))
    items += [Disc(page.point(goal), 2.6, Colour.APPARENT) for goal in run.apparent_goals]
    for point in run.contacts:
        x, y = page.point(point)
        cross = (
            ((x - 6.0, y - 6.0), (x + 6.0, y + 6.0)),
            ((x - 6.0, y + 6.0), (x + 6.0, y - 6.0)),
        )
        items.append(Shape(cross, line=Colour.TOUCHED, width=3.0, open=True))
    return items


def _simple_line(line: tuple[Point2, ...]) -> tuple[Point2, ...]:
    """Return a line of the page without its redundant points."""
    simple = shapely.simplify(shapely.LineString(line), _DEVIATION)
    return tuple((x, y) for x, y in shapely.get_coordinates(simple).tolist())


def way_data(run: RunOverlay, page: Page) -> str:
    """Return the paths as JSON, each with ``repeat``, ``t`` [s], ``x`` and ``y`` on the page.

    The text is empty if no path has times.
    """
    ways: list[dict[str, object]] = []
    for way in run.ways:
        every = slice(None, None, 1 + len(way.time) // _PLACES)
        places = [page.point((x, y)) for x, y in way.points[every].tolist()]
        if len(way.time):
            ways.append(
                {
                    "repeat": way.repeat,
                    "t": np.round(way.time[every].astype(np.float64), 1).tolist(),
                    "x": [round(x, 1) for x, _ in places],
                    "y": [round(y, 1) for _, y in places],
                }
            )
    return json.dumps(ways, separators=(",", ":")) if ways else ""


def mark_items(mark: MeasuredMark, page: Page, labels: Labels) -> list[DrawingItem]:
    """Return the deciding object in red, the measured line, and its words beside it."""
    items: list[DrawingItem] = []
    colour = Colour.TOUCHED if mark.fails else Colour.INK
    if mark.rings:
        rings = tuple(page.ring(ring) for ring in mark.rings)
        items.append(Shape(rings, fill=colour, line=colour, width=1.6))
    if mark.place:
        place = page.ring(mark.place)
        items.append(Shape((place,), line=colour, width=2.0, dash=(5.0, 3.0)))
    ends = [page.point(end) for end in mark.line]
    items.append(Shape((tuple(ends),), line=colour, width=1.2, open=True))
    if math.dist(*ends) < _SHORT:
        items.append(Disc(ends[0], 12.0, line=colour, width=1.6))
    else:
        items += [Disc(end, 2.2, colour, Colour.FLOOR, 0.8) for end in ends]
    words = TextLabel(ends[0], mark.words, 13.0, colour, bold=True, halo=Colour.FLOOR, centred=True)
    visible = [(x, y) for x, y in ends if 0.0 <= x <= page.width and 0.0 <= y <= page.height]
    around = [(x + d, y + d) for x, y in visible or ends for d in (-12.0, 12.0)]
    items.append(labels.place(words, spots_around(around, words, page)))
    return items


def run_key(run: RunOverlay, page: Page) -> list[DrawingItem]:
    """Return the meaning of the lines, in a separate row at the foot of the page."""
    nearest = min((float(np.nanmin(w.clearance, initial=math.inf)) for w in run.ways), default=0.0)
    limit = max((way.limit for way in run.ways), default=0.0)
    entries = (
        ("driven", Colour.DRIVEN, len(run.points) > 1),
        ("believed", Colour.BELIEVED, len(run.believed) > 1),
        ("inside the buffer", Colour.CLOSE, nearest < limit),
        ("contact", Colour.TOUCHED, bool(run.contacts)),
        ("what decides", Colour.TOUCHED, run.mark is not None and run.mark.fails),
        ("robot at the end of its way", Colour.ROBOT, len(run.footprints) == 1),
        ("footprint, filled at the end", Colour.ROBOT, len(run.footprints) > 1),
        ("the waypoint as the robot sees it", Colour.APPARENT, bool(run.apparent_goals)),
    )
    return legend_row(
        page,
        [(text, colour) for text, colour, is_drawn in entries if is_drawn],
        22.0,
        lambda colour, x, y: Shape((((x, y), (x + 16.0, y)),), line=colour, width=4.0, open=True),
    )
