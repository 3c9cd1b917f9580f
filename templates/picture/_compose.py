"""Composition of the drawing of a world."""

from __future__ import annotations

import math
from typing import Final

from grammars.model.behaviour import start_positions
from grammars.model.geometry import Point2
from templates.picture import _mission, _page, _run, _scene
from templates.picture._drawing import Drawing, DrawingItem, Labels
from templates.picture._page import CUT, FILE, PageStyle, page_around, page_for
from templates.picture._run import RunOverlay
from templates.plan_shapes import is_below
from templates.world import ArtefactWorld

_BESIDE: Final = 0.9
"""Room [m] around the path in a close picture, for the robot and things beside it."""
_FAR: Final = 6.0
"""Length [m] beyond which a measured line may leave a close picture."""


def draw_world(
    world: ArtefactWorld, run: RunOverlay | None = None, style: PageStyle = FILE
) -> Drawing:
    """Return the drawing of a world at time 0 of its first repeat.

    A ``run`` adds the path of the robot. A close picture of a part of a run shows only its
    surroundings, at its end.
    """
    mission = world.mission
    points: tuple[Point2, ...] = ()
    if mission:
        points = ((mission.start.x, mission.start.y), *((w.x, w.y) for w in mission.waypoints))
    behaviours = world.draws[0].behaviours
    start = {**start_positions(world.scene, behaviours), **(run.positions if run else {})}
    closely = run is not None and run.closely and bool(run.points)
    if run and closely:
        page = page_around(_close_points(run), _BESIDE, style)
    else:
        page = page_for(world.scene, start, (*points, *run.points) if run else points, style)
    about = run.about if run and run.about else _about(world)
    ways = _run.way_data(run, page) if run else ""
    figure = Drawing(page.width, page.height, world.name, about, ways)
    labels = Labels()
    scene = _scene.part_on_page(world.scene, page)
    walls, swings = _scene.walls(scene, page), _scene.swings(scene, page, start)
    bodies = _scene.bodies(scene, page, start)
    figure.add("floors", _scene.floors(scene, page))
    figure.add("swings", swings)
    figure.add("walls", walls)
    axes = _page.axes(page, points[0] if points else None) if style.foot else []
    figure.add("axes", axes)
    figure.add("walks", _scene.walks(behaviours, page))
    figure.add("doors", bodies)
    # The costs of covering items were chosen by eye with the demo and building C: bodies and the
    # robot are the most expensive, lines the cheapest.
    labels.avoid(swings, 1.5)
    labels.avoid(bodies, 3.0)
    labels.avoid(axes, 1.0)
    labels.avoid(_scene.outlines(scene, page), 1.5)
    on_top: list[tuple[str, list[DrawingItem]]] = []
    if mission:
        # Straight lines between waypoints do not help in a picture of a few metres.
        way = [] if closely else _mission.route_lines(mission, page)
        machine = [] if closely else _mission.robot(mission, world.robot, page)
        stops = _mission.waypoints(mission, page)
        figure.add("way", way)
        labels.avoid(way, 0.8)
        labels.avoid([*machine, *stops], 4.0)
        on_top = [("robot", machine), ("waypoints", stops)]
    driven = _run.run_lines(run, page) if run else []
    labels.avoid(driven, 1.5)
    if run and run.mark:
        on_top.append(("mark", _run.mark_items(run.mark, page, labels)))
    # Names of doors are placed before those of spaces, which have far more free spots. Waypoints
    # and the robot are painted last, since the mission matters most.
    if style.names:
        object_names = _scene.object_names(scene, page, start, labels)
        if mission and not closely:
            on_top.append(("start", _mission.start_label(mission, world.robot, page, labels)))
        figure.add("space names", _scene.space_names(scene, page, labels))
        figure.add("names", object_names)
    # The path is painted above the names, since it matters more.
    figure.add("driven", driven)
    for name, items in on_top:
        figure.add(name, items)
    if style.foot:
        if closely:
            figure.add("margins", _page.margins(page))
        if style is FILE:
            figure.add("heading", _page.heading(figure, page))
        low = any(is_below(s, CUT) for s in scene.solids)
        doors = ("end" if closely else "start") if scene.objects else ""
        has_mission = mission is not None
        shows_robot = has_mission and not closely
        row = _page.legend(page, doors=doors, low=low, mission=has_mission, robot=shows_robot)
        figure.add("legend", row)
        if run:
            figure.add("key", _run.run_key(run, page))
    figure.add("scale", _page.scale_bar(page))
    return figure


def _close_points(run: RunOverlay) -> tuple[Point2, ...]:
    """Return the points that a close picture of a run must show."""
    if run.mark is None or math.dist(*run.mark.line) > _FAR:
        return run.points
    return (*run.points, *run.mark.line)


def _about(world: ArtefactWorld) -> str:
    scene = world.scene
    parts = [scene.name] if scene.name != world.name else []
    parts.append(f"{len(scene.regions)} spaces")
    if scene.objects:
        parts.append(f"{len(scene.objects)} objects as they start")
    if world.mission:
        parts.append(f"mission {world.mission.name}, {len(world.mission.waypoints)} waypoints")
    if world.robot:
        parts.append(f"robot {world.robot.name}")
    return "  ·  ".join(parts)
