"""Doors and furniture on the page: every link where it starts, and where its joint can take it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from grammars.behaviour import Behaviour
from grammars.kinematics import link_poses
from grammars.scene import Joint, Link, Scene, SceneObject
from grammars.values import Point2
from templates.picture._figure import Disc, Item, Shape, Words
from templates.picture._labels import LETTER, Labels
from templates.picture._page import DOOR, MOVER, PAPER, POST, SWING, Page
from templates.world import driven, poses_at

_STEPS = 28


def swings(scene: Scene, page: Page, start: Mapping[str, float]) -> list[Item]:
    """Return the floor each moving link can sweep: sectors of hinges, tracks of sliders."""
    items: list[Item] = []
    for thing in scene.objects:
        if thing.frozen:
            continue
        positions = [start[f"{thing.name}.{joint.name}"] for joint in thing.joints]
        links = {link.name: link for link in thing.links}
        moving = driven(thing)
        for index, joint in enumerate(thing.joints):
            if joint in moving:
                items += _swing(thing, joint, links[joint.child], positions, index, page)
    return items


def walks(behaviours: Sequence[Behaviour], page: Page) -> list[Item]:
    """Return the routes of whoever walks, dotted, with their turning points."""
    items: list[Item] = []
    for behaviour in behaviours:
        if behaviour.kind == "walk":
            line = page.ring(behaviour.route)
            items.append(Shape((line,), line=MOVER, width=1.8, dash=(1.5, 4.0), open=True))
            items += [Disc(point, 2.6, MOVER) for point in line]
    return items


def bodies(scene: Scene, page: Page, start: Mapping[str, float]) -> list[Item]:
    """Return every link of every object where it stands at the start."""
    items: list[Item] = []
    for thing in scene.objects:
        poses = poses_at(thing, start)
        moving = {joint.child for joint in thing.joints} if not thing.frozen else set()
        for link in (link for link in thing.links if link.polygons):
            rings = tuple(page.ring(poses[link.name].apply_ring(r)) for r in link.polygons)
            colour = DOOR if link.name in moving else POST
            items.append(Shape(rings, fill=colour, line=colour, width=1.2))
    return items


def names(scene: Scene, page: Page, start: Mapping[str, float], labels: Labels) -> list[Item]:
    """Return the name of every object, beside it."""
    size = min(12.5, max(9.5, 0.38 * page.scale))
    items: list[Item] = []
    for thing in scene.objects:
        corners = [
            page.point(pose.apply(corner))
            for pose, link in zip(poses_at(thing, start).values(), thing.links, strict=True)
            for ring in link.polygons
            for corner in ring
        ]
        if not corners:
            continue
        text = thing.name.replace("_", " ")
        words = Words(_mean(corners), text, size, DOOR, halo=PAPER, centred=True)
        items.append(labels.place(words, _around(corners, words)))
    return items


def _around(corners: list[Point2], words: Words) -> list[Point2]:
    """Return spots for a text around the box of ``corners``, nearer ones first."""
    xs, ys = [c[0] for c in corners], [c[1] for c in corners]
    x, y = (min(xs) + max(xs)) / 2.0, (min(ys) + max(ys)) / 2.0
    wide = (max(xs) - min(xs)) / 2.0 + LETTER * words.size * len(words.text) / 2.0 + 6.0
    high = (max(ys) - min(ys)) / 2.0 + words.size * 0.6 + 5.0
    ways = ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, 1), (1, 1), (-1, -1))
    return [
        (round(x + far * a * wide, 2), round(y + far * b * high, 2))
        for far in (1.0, 1.4)
        for a, b in ways
    ]


def _swing(
    thing: SceneObject,
    joint: Joint,
    link: Link,
    positions: list[float],
    index: int,
    page: Page,
) -> list[Item]:
    def at(position: float, point: Point2) -> Point2:
        moved = [*positions[:index], position, *positions[index + 1 :]]
        return link_poses(thing, moved)[link.name].apply(point)

    if not (math.isfinite(joint.lower) and math.isfinite(joint.upper)):
        return []
    if joint.kind == "prismatic":
        ends = (joint.lower, joint.upper)
        return [
            Shape(
                tuple(page.ring(tuple(at(end, c) for c in ring)) for ring in link.polygons),
                line=SWING,
                width=1.0,
                dash=(4.0, 3.0),
            )
            for end in ends
        ]
    corners = [corner for ring in link.polygons for corner in ring]
    tip = max(corners, key=lambda c: math.dist(c, joint.anchor))
    upper = min(joint.upper, joint.lower + math.tau)
    angles = [joint.lower + (upper - joint.lower) * i / _STEPS for i in range(_STEPS + 1)]
    arc = page.ring(tuple(at(angle, tip) for angle in angles))
    hinge = page.point(at(joint.lower, joint.anchor))
    return [
        Shape(((hinge, *arc),), fill=SWING, opacity=0.28),
        Shape((arc,), line=SWING, width=1.1, dash=(4.0, 3.0), open=True),
    ]


def _mean(points: list[Point2]) -> Point2:
    n = len(points)
    return (sum(p[0] for p in points) / n, sum(p[1] for p in points) / n)
