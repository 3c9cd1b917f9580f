"""From a world to the figure people see."""

from __future__ import annotations

from grammars.values import Point2
from templates.picture import _building, _doors, _driven, _frame, _mission
from templates.picture._driven import Driven
from templates.picture._figure import Figure, Item
from templates.picture._labels import Labels
from templates.picture._page import PAPER, is_below, page_for
from templates.world import World, start_positions


def compose(world: World, run: Driven | None = None) -> Figure:
    """Return the drawing of a world as it is at time 0 of its first repeat.

    With a ``run`` of it, also the way the robot took.
    """
    scene, mission = world.scene, world.mission
    points: tuple[Point2, ...] = ()
    if mission:
        points = ((mission.start.x, mission.start.y), *((w.x, w.y) for w in mission.waypoints))
    if run:
        points += run.way
    behaviours = world.draws[0].behaviours
    start = start_positions(scene, behaviours)
    page = page_for(scene, start, points)
    about = run.about if run and run.about else _about(world)
    figure = Figure(page.width, page.height, PAPER, world.name, about)
    labels = Labels()
    walls, swings = _building.walls(scene, page), _doors.swings(scene, page, start)
    bodies = _doors.bodies(scene, page, start)
    figure.add("floors", _building.floors(scene, page))
    figure.add("swings", swings)
    figure.add("walls", walls)
    axes = _frame.axes(page, points[0] if points else None)
    figure.add("axes", axes)
    figure.add("walks", _doors.walks(behaviours, page))
    figure.add("doors", bodies)
    labels.avoid(swings, 1.5)
    labels.avoid(bodies, 3.0)
    labels.avoid(axes, 1.0)
    labels.avoid(_building.outlines(scene, page), 1.5)
    on_top: list[tuple[str, list[Item]]] = []
    if mission:
        way = _mission.way(mission, page)
        machine = _mission.robot(mission, world.robot, page)
        stops = _mission.waypoints(mission, page)
        figure.add("way", way)
        labels.avoid(way, 0.8)
        labels.avoid([*machine, *stops], 4.0)
        on_top = [("robot", machine), ("waypoints", stops)]
    names = _doors.names(scene, page, start, labels)
    if mission:
        on_top.append(("start", _mission.start_label(mission, world.robot, page, labels)))
    if run:
        figure.add("driven", _driven.driven(run, page))
    figure.add("space names", _building.names(scene, page, labels))
    figure.add("names", names)
    for name, items in on_top:
        figure.add(name, items)
    figure.add("heading", _frame.heading(figure))
    low = any(is_below(s.z_min, s.z_max) for s in scene.solids)
    doors, driven = bool(scene.objects), mission is not None
    figure.add("legend", _frame.legend(page, doors=doors, low=low, mission=driven))
    if run:
        figure.add("key", _driven.key(run, page))
    figure.add("scale", _frame.scale_bar(page))
    return figure


def _about(world: World) -> str:
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
