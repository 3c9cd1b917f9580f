"""The mission on the page: waypoints in their order, the robot at its start."""

from __future__ import annotations

import itertools
import math
from typing import Final

from grammars.model.geometry import Point2
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from templates.picture._drawing import LETTER, Colour, Disc, DrawingItem, Labels, Shape, TextLabel
from templates.picture._page import Page
from templates.plan_shapes import footprint_shape, nose_reach, waypoint_shapes

_RADIUS: Final = 10.0
_NEAR: Final = 2.0 * _RADIUS
_NUMBER: Final = 11.0


def route_lines(mission: Mission, page: Page) -> list[DrawingItem]:
    """Return straight lines from the start through all waypoints, with arrow heads."""
    points = [(mission.start.x, mission.start.y), *((w.x, w.y) for w in mission.waypoints)]
    items: list[DrawingItem] = []
    for a, b in itertools.pairwise(map(page.point, points)):
        length = math.dist(a, b)
        items.append(Shape(((a, b),), line=Colour.ROUTE, width=1.8, dash=(7.0, 5.0), open=True))
        if length > 4.0 * _RADIUS:
            items.append(_arrow(a, b, length))
    return items


def waypoints(mission: Mission, page: Page) -> list[DrawingItem]:
    """Return the waypoints with their numbers; waypoints of one place share a disc."""
    places: list[tuple[Point2, list[str]]] = []
    for shape in waypoint_shapes(mission):
        (at,) = page.ring(shape.parts[0])
        for place, numbers in places:
            # Within a pixel of the page.
            if math.dist(at, place) < 1.0:
                numbers.append(shape.text)
                break
        else:
            places.append((at, [shape.text]))
    discs: list[Point2] = []
    items: list[DrawingItem] = [
        _look(page.point((waypoint.x, waypoint.y)), waypoint.yaw)
        for waypoint in mission.waypoints
        if waypoint.yaw is not None
    ]
    for at, numbers in places:
        spot = _beside(at, discs)
        discs.append(spot)
        if spot != at:
            items.append(Disc(at, 3.0, Colour.ROUTE))
            items.append(Shape(((at, spot),), line=Colour.ROUTE, width=1.0, open=True))
        text = ", ".join(numbers)
        radius = _RADIUS + 2.6 * (len(text) - 1)
        items.append(Disc(spot, radius, Colour.ROUTE, Colour.FLOOR, 2.0))
        items.append(TextLabel(spot, text, _NUMBER, Colour.FLOOR, bold=True, centred=True))
    return items


def robot(mission: Mission, machine: Robot | None, page: Page) -> list[DrawingItem]:
    """Return the footprint of the robot at its start, and an arrow in its direction."""
    start = mission.start
    items: list[DrawingItem] = []
    reach = 0.35
    if machine is not None:
        body = page.ring(footprint_shape(start, machine).parts[0])
        items.append(Shape((body,), fill=Colour.ROBOT, line=Colour.FLOOR, width=1.5))
        reach = nose_reach(machine)
    length = max(reach, 16.0 / page.scale)
    nose, left, right = (
        page.point(start.apply(p))
        for p in ((length, 0.0), (-0.35 * length, 0.55 * length), (-0.35 * length, -0.55 * length))
    )
    if machine is None or reach * page.scale < 16.0:
        items.append(Shape(((nose, left, right),), fill=Colour.ROBOT, line=Colour.FLOOR, width=1.5))
    else:
        items.append(Shape(((nose, left, right),), fill=Colour.FLOOR, opacity=0.85))
    return items


def start_label(
    mission: Mission, machine: Robot | None, page: Page, labels: Labels
) -> list[DrawingItem]:
    """Return the name of the robot, placed beside its start."""
    x, y = page.point((mission.start.x, mission.start.y))
    text = f"start, {machine.name}" if machine else "start"
    corners = machine.footprint if machine else ((0.35, 0.35),)
    reach = max(max(math.hypot(*c) for c in corners) * page.scale, 16.0)
    wide, high = reach + LETTER * 12.0 * len(text) / 2.0 + 4.0, reach + 11.0
    spots = [(x, y + high), (x, y - high), (x + wide, y), (x - wide, y)]
    words = TextLabel((x, y), text, 12.0, Colour.ROBOT, bold=True, halo=Colour.FLOOR, centred=True)
    return [labels.place(words, spots)]


def _beside(at: Point2, discs: list[Point2]) -> Point2:
    """Return the nearest spot around ``at`` without another number."""
    for ring in range(4):
        for step in range(8 if ring else 1):
            angle = step * math.tau / 8.0
            out = ring * _NEAR
            spot = (at[0] + out * math.cos(angle), at[1] + out * math.sin(angle))
            if all(math.dist(spot, other) > _NEAR + 2.0 for other in discs):
                return spot
    return at


def _arrow(a: Point2, b: Point2, length: float) -> Shape:
    ux, uy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
    x, y = (a[0] + b[0]) / 2.0 + 6.0 * ux, (a[1] + b[1]) / 2.0 + 6.0 * uy
    tail = (x - 12.0 * ux, y - 12.0 * uy)
    ring = (
        (x, y),
        (tail[0] - 5.0 * uy, tail[1] + 5.0 * ux),
        (tail[0] + 5.0 * uy, tail[1] - 5.0 * ux),
    )
    return Shape((ring,), fill=Colour.ROUTE)


def _look(at: Point2, yaw: float) -> Shape:
    end = (at[0] + 2.1 * _RADIUS * math.cos(yaw), at[1] - 2.1 * _RADIUS * math.sin(yaw))
    return Shape(((at, end),), line=Colour.ROUTE, width=3.0, open=True)
