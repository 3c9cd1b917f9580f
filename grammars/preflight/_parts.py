"""Checks of parts of objects: overlaps at the start and during motion, and places outside."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import shapely

from grammars.model.movers import is_mover
from grammars.model.scene import SceneObject
from grammars.preflight._checked import CheckedScene, Footprint, meetings


def check_starts(checked: CheckedScene, bodies: Collection[SceneObject]) -> set[str]:
    """Report moving links that start inside a wall; return the names of their objects."""
    names = {body.name for body in bodies}
    in_walls = set()
    for part in checked.floor.start:
        body, link = part.body, part.link
        for owner in checked.walls_at(part) if part.jointed and body.name in names else ():
            checked.error(
                body.name,
                f"the {link.name} of {body.name} starts inside {owner}",
                "check its place, the side of the hinge and the opening direction",
            )
            in_walls.add(body.name)
    return in_walls


def check_inside(checked: CheckedScene, bodies: Collection[SceneObject]) -> None:
    """Report objects that touch neither a space nor a wall.

    Objects in doorways are exempt: they may hang on the outer face of the building.
    """
    scene, floor = checked.scene, checked.floor
    if not scene.regions:
        return
    names = [*(region.name for region in scene.regions), *(d.name for d in scene.doorways)]
    tree = shapely.STRtree(floor.rooms)
    for body in (body for body in bodies if not body.doorway):
        shape = shapely.union_all([part.shape for part in floor.start if part.body is body])
        if shape.is_empty or len(tree.query(shape, predicate="intersects")):
            continue
        if floor.solids.hit_by(shape, 0.0, float("inf")):
            continue
        index = int(tree.nearest(shape))
        away = shape.distance(floor.rooms[index])
        checked.warn(
            body.name,
            f"{body.name} is outside the building, {away:.2f} m from {names[index]}",
            "check its frame and the signs of x and y",
        )


def check_walls(checked: CheckedScene, swept: Sequence[Footprint], when: str) -> None:
    """Report leaves that sweep through a wall, column or divider; ``when`` ends the message."""
    for part in swept:
        walls = " and ".join(checked.walls_at(part))
        if walls:
            name = part.body.name
            message = f"the {part.link.name} of {name} sweeps through {walls} {when}"
            checked.warn(name, message, "limit the joint, or move or turn the object")


def check_meetings(
    checked: CheckedScene,
    swept: Sequence[Footprint],
    when: str,
    silent: Collection[frozenset[str]],
) -> None:
    """Report leaves that sweep over another object (over its own sweep if it has one).

    ``when`` ends the message. Pairs of names in ``silent`` are left out.
    """
    links = {(part.body.name, part.link.name) for part in swept}
    others = [
        part
        for part in checked.floor.start
        if (part.body.name, part.link.name) not in links
        and (part.body.frozen or not is_mover(part.body.joints))
    ]
    for one, other in meetings(swept, others, but=silent).values():
        message = f"{one.body.name} and {other.body.name} can collide {when}"
        checked.warn(one.body.name, message, f"the other one: {checked.place(other.body.name)}")
