"""Routes of movers: through rooms, not through walls."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from grammars.behaviour import Behaviour, Walk
from grammars.diagnostics import Diagnostic, Severity, Where, did_you_mean
from grammars.movers import body_link, is_mover
from grammars.preflight.places import place_of
from grammars.preflight.sweep import Obstacles, is_deep, link_shape, still_links
from grammars.preflight.world import starts_in_wall
from grammars.route import Route
from grammars.scene import Link, Scene, SceneObject
from grammars.values import Pose2

_STEP = 0.1


def check_walks(
    scene: Scene,
    obstacles: Obstacles,
    behaviours: Sequence[Behaviour],
    places: Mapping[str, Where],
    home: Where,
) -> list[Diagnostic]:
    """Return what is wrong with the routes of movers.

    Errors: walks of what is no mover, points inside of a wall or outside of every room, ways that
    lead through a wall, movers that stand in one. Warnings: bodies that brush a wall, or walk
    through what stands still.
    """
    bodies = {body.name: body for body in scene.objects}
    walking = {walk.object for walk in behaviours if isinstance(walk, Walk)}
    findings = [
        problem
        for body in scene.objects
        if is_mover(body.joints) and body.name not in walking
        for problem in starts_in_wall(body, obstacles, places, home)
    ]
    for walk in behaviours:
        if not isinstance(walk, Walk):
            continue
        place = place_of(places, walk.joint, home)
        body = bodies.get(walk.object)
        if body is None:
            hint = did_you_mean(walk.object, bodies)
            findings.append(Diagnostic(place, f'there is no object "{walk.object}"', hint))
        elif body.frozen or not is_mover(body.joints):
            why = "frozen" if body.frozen else "an object, not a mover"
            findings.append(Diagnostic(place, f"{body.name} cannot walk, it is {why}"))
        else:
            findings.extend(_check(scene, obstacles, body, walk, place))
    return findings


def _check(
    scene: Scene, obstacles: Obstacles, body: SceneObject, walk: Walk, place: Where
) -> list[Diagnostic]:
    low = min(link.z_min for link in body.links if link.polygons)
    high = max(link.z_max for link in body.links if link.polygons)
    rooms = [_valid(r.outline) for r in scene.regions]
    rooms.extend(_valid(d.footprint).buffer(0.02) for d in scene.doorways)
    findings = []
    for number, point in enumerate(walk.route, start=1):
        label = f"point {number} of the route of {body.name} ({point[0]:g}, {point[1]:g})"
        distance, owner = obstacles.nearest(*point, z_max=high)
        if distance == 0.0:
            findings.append(Diagnostic(place, f"{label} is inside of {owner}", "move it"))
        elif not any(room.covers(Point(point)) for room in rooms):
            hint = "check its frame and the signs of x and y"
            findings.append(Diagnostic(place, f"{label} is outside of every room", hint))
    return findings or _on_the_way(scene, obstacles, body, walk, place, (low, high))


def _on_the_way(
    scene: Scene,
    obstacles: Obstacles,
    body: SceneObject,
    walk: Walk,
    place: Where,
    heights: tuple[float, float],
) -> list[Diagnostic]:
    ends = [*walk.route, walk.route[0]] if walk.manner == "round" else walk.route
    through = list(obstacles.hit_by(LineString(ends), *heights))
    if through:
        message = f"{body.name} walks through {' and '.join(through)}"
        return [Diagnostic(place, message, "lead the route through a doorway")]
    link = next(part for part in body.links if part.name == body_link(body))
    area = walked_over(walk, link)
    brushed = [o for o, part in obstacles.hit_by(area, *heights).items() if is_deep(part)]
    met = [
        other.name
        for other in scene.objects
        if other is not body
        and any(
            part.z_min < heights[1]
            and part.z_max > heights[0]
            and is_deep(area.intersection(link_shape(other, part, other.initial)))
            for part in still_links(other)
        )
    ]
    return [
        Diagnostic(
            place,
            f"{body.name} {what} {' and '.join(names)} on its way",
            "nothing stops a mover but the robot: move the route",
            Severity.WARNING,
        )
        for what, names in (("brushes", brushed), ("walks through", met))
        if names
    ]


def walked_over(walk: Walk, link: Link) -> BaseGeometry:
    """Return the floor that the body ``link`` covers on the route once."""
    route = Route(walk)
    count = max(2, int(route.length / _STEP) + 1)
    ways = [route.length * i / (count - 1) for i in range(count)]
    placements = [
        shapely.union_all(
            [Polygon(Pose2(*route.point(w), route.yaw(w)).apply_ring(r)) for r in link.polygons]
        )
        for w in ways
    ]
    hulls = [shapely.convex_hull(shapely.union(a, b)) for a, b in itertools.pairwise(placements)]
    return shapely.union_all(hulls if len(link.polygons) == 1 else [*placements, *hulls])


def _valid(ring: tuple[tuple[float, float], ...]) -> BaseGeometry:
    polygon = Polygon(ring)
    return polygon if polygon.is_valid else polygon.buffer(0)
