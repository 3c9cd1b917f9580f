"""Checks of doors against their doorways: two doors in one, wrong sizes of leaves."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import shapely
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

from grammars.model.free_space import inscribed_radius, is_overlap, moving_links
from grammars.model.movers import is_mover
from grammars.model.robot import Robot
from grammars.model.scene import Doorway, Scene, SceneObject
from grammars.preflight._checked import CheckedScene, Footprint, footprints
from grammars.scenery.composition import height_problem

_BESIDE: Final = 0.2
"""Leaves up to this distance from the faces of the wall [m] close the doorway, such as sliders."""
_LEAST_SHARE: Final = 0.8
"""Shut doors that cover a smaller share of the width of their doorway get a warning."""
_SLACK: Final = 0.05
"""Width that an open door may take from a robot [m] without a warning."""
_SHARED_SHARE: Final = 0.5
"""Doors whose common width is at least this share of the narrower one conflict."""


@dataclass(frozen=True, slots=True)
class _ShutDoor:
    """A door in the position that closes most of its doorway; shapes in the doorway's frame [m].

    ``passage`` is the hole with a margin on both sides; leaves inside it close the doorway.
    """

    name: str
    leaves: tuple[Footprint, ...]
    still: BaseGeometry
    passage: BaseGeometry

    @property
    def closing(self) -> BaseGeometry:
        """The area closed by its leaves."""
        return shapely.union_all([leaf.shape for leaf in self.leaves]).intersection(self.passage)

    def meets(self, other: _ShutDoor) -> bool:
        """Return whether the leaves of two doors overlap."""
        return any(one.meets(another) for one in self.leaves for another in other.leaves)


def check_doors(checked: CheckedScene) -> set[frozenset[str]]:
    """Report problems of doors in their doorways; return the pairs of objects with problems.

    Errors: leaves higher than their doorway, doors that overlap when shut. Warnings: two doors
    that both close the same doorway, doors that leave a fifth of theirs open. Later checks skip
    the returned pairs of names; an object too high for its doorway is a pair with itself.
    """
    pairs: set[frozenset[str]] = set()
    for doorway, doors in _doors_by_doorway(checked.scene):
        high = [door for door in doors if _check_height(checked, door, doorway)]
        clashes = [p for p in combinations(doors, 2) if _check_pair(checked, *p, doorway)]
        # Overlapping leaves leave a gap only because of the overlap.
        if not any(one.meets(other) for one, other in clashes):
            _check_gap(checked, doors, doorway)
        pairs |= {frozenset({door.name for door in group}) for group in (*zip(high), *clashes)}
    return pairs


def colliding_doors(scene: Scene) -> set[frozenset[str]]:
    """Return the pairs of names of doors that overlap when shut in one doorway."""
    return {
        frozenset({one.name, other.name})
        for _, doors in _doors_by_doorway(scene)
        for one, other in combinations(doors, 2)
        if one.meets(other)
    }


def check_openings(checked: CheckedScene, robot: Robot) -> None:
    """Warn of doors that never open wide enough for a robot, and of leaves that it passes below."""
    needed = 2.0 * inscribed_radius(robot.footprint)
    bodies = {body.name: body for body in checked.scene.objects}
    for doorway, doors in _doors_by_doorway(checked.scene):
        for door in doors:
            low = min(leaf.link.z_min for leaf in door.leaves)
            if low >= robot.height:
                message = (
                    f"{robot.name} is {robot.height:.2f} m high and passes below {door.name}, "
                    f"which begins {low:.2f} m above the floor"
                )
                checked.warn(door.name, message, "let its leaf begin at the floor")
        widest = doorway.width - _extent(*(_open(bodies[d.name], doorway) for d in doors))
        posts = _extent(*(door.still.intersection(door.passage) for door in doors))
        if widest + _SLACK < needed <= doorway.width - posts and checked.shut.keys().isdisjoint(
            door.name for door in doors
        ):
            names = " and ".join(door.name for door in doors)
            message = (
                f"{doorway.name} opens {widest:.2f} m at most with {names}, {robot.name} is "
                f"{needed:.2f} m wide"
            )
            checked.warn(doors[-1].name, message, "check the range of its joint")


@functools.lru_cache(maxsize=256)
def _open(body: SceneObject, doorway: Doorway) -> BaseGeometry:
    """Return the part of a doorway that a door covers when it is open, in the doorway's frame."""
    to_local = doorway.frame.inverse()
    x_min, y_min, x_max, y_max = Polygon(to_local.apply_ring(doorway.footprint)).bounds
    hole = box(x_min, y_min - _BESIDE, x_max, y_max + _BESIDE)
    body = replace(body, pose=to_local @ body.pose)
    ends = (tuple(getattr(j, end) for j in body.joints) for end in ("lower", "upper"))
    covers = [
        shapely.union_all([part.shape for part in footprints(body, positions)]).intersection(hole)
        for positions in (body.initial, *ends)
    ]
    return min(covers, key=_extent)


@functools.lru_cache(maxsize=4)
def _doors_by_doorway(scene: Scene) -> tuple[tuple[Doorway, tuple[_ShutDoor, ...]], ...]:
    """Return the doorways with doors, and their doors."""
    bodies: dict[str, list[SceneObject]] = {}
    for body in scene.objects:
        if body.doorway and moving_links(body) and not is_mover(body.joints):
            bodies.setdefault(body.doorway, []).append(body)
    return tuple(
        (doorway, tuple(_shut(body, doorway) for body in bodies[doorway.name]))
        for doorway in scene.doorways
        if doorway.name in bodies
    )


def _shut(body: SceneObject, doorway: Doorway) -> _ShutDoor:
    to_local = doorway.frame.inverse()
    body = replace(body, pose=to_local @ body.pose)
    x_min, y_min, x_max, y_max = Polygon(to_local.apply_ring(doorway.footprint)).bounds
    passage = box(x_min, y_min - _BESIDE, x_max, y_max + _BESIDE)
    # A scene does not define the shut position of a door. Try zero, the start and the limits.
    zero = tuple(min(max(0.0, j.lower), j.upper) for j in body.joints)
    lowest, highest = (tuple(getattr(j, end) for j in body.joints) for end in ("lower", "upper"))
    best = _placed(body, zero, passage)
    for positions in dict.fromkeys((body.initial, lowest, highest)):
        if _extent(best.closing) >= _LEAST_SHARE * doorway.width:
            break
        other = _placed(body, positions, passage)
        best = max(best, other, key=lambda door: round(_extent(door.closing), 6))
    return best


def _placed(body: SceneObject, positions: Sequence[float], passage: BaseGeometry) -> _ShutDoor:
    parts = footprints(body, positions)
    still = shapely.union_all([part.shape for part in parts if not part.jointed])
    return _ShutDoor(body.name, tuple(part for part in parts if part.jointed), still, passage)


def _extent(*shapes: BaseGeometry) -> float:
    """Return the width of a doorway that the shapes cover together [m]."""
    parts = shapely.get_parts(shapes)
    low, _, high, _ = shapely.bounds(parts[~shapely.is_empty(parts)]).T
    return float(shapely.union_all(shapely.box(low, 0.0, high, 1.0)).area)


def _check_height(checked: CheckedScene, door: _ShutDoor, doorway: Doorway) -> bool:
    """Report leaves higher than their doorway; return whether there are any."""
    hole = Polygon(doorway.frame.inverse().apply_ring(doorway.footprint))
    high = False
    for leaf in door.leaves:
        problem = height_problem(door.name, leaf.link, doorway)
        # Leaves in front of the wall, such as sliders, may be higher than the hole.
        if problem and is_overlap(leaf.shape.intersection(hole)):
            checked.error(door.name, *problem)
            high = True
    return high


def _check_pair(checked: CheckedScene, one: _ShutDoor, other: _ShutDoor, doorway: Doorway) -> bool:
    """Report two doors that close the same part of a doorway; return whether they do."""
    collide = one.meets(other)
    first, second = _extent(one.closing), _extent(other.closing)
    shared = first + second - _extent(one.closing, other.closing)
    if not collide and shared < _SHARED_SHARE * min(first, second):
        return False
    message = (
        f"{one.name} and {other.name} hang in one doorway: {doorway.name} is "
        f"{doorway.width:.2f} m wide, they close {first:.2f} m and {second:.2f} m of it"
    )
    hint = f"the other one: {checked.place(one.name)}; {_remedy(one, other, doorway)}"
    if collide:
        checked.error(other.name, f"{message} and overlap", hint)
    else:
        checked.warn(other.name, message, hint)
    return True


def _remedy(one: _ShutDoor, other: _ShutDoor, doorway: Doorway) -> str:
    """Return a hint for two doors that close the same part of a doorway."""
    widths = [_extent(door.closing) for door in (one, other)]
    if max(widths) >= _LEAST_SHARE * doorway.width:
        return "place one of them in another doorway"
    if _hangs_low(one) == _hangs_low(other):
        return "both have the hinge on the same side: hang one left, the other one right"
    return (
        f"together {sum(widths):.2f} m wide, the doorway is {doorway.width:.2f} m: "
        "make the leaves narrower"
    )


def _hangs_low(door: _ShutDoor) -> bool:
    """Return whether most of a shut door lies before the middle of its doorway."""
    (low, _, high, _), (start, _, end, _) = door.closing.bounds, door.passage.bounds
    return low + high < start + end


def _check_gap(checked: CheckedScene, doors: Sequence[_ShutDoor], doorway: Doorway) -> None:
    closed = _extent(*(door.closing for door in doors))
    posts = [door.still.intersection(door.passage) for door in doors]
    covered = _extent(*(door.closing for door in doors), *posts)
    # Doors far from their doorway never close it: an open gate, a lift.
    if closed == 0.0 or covered >= _LEAST_SHARE * doorway.width:
        return
    names = " and ".join(door.name for door in doors)
    checked.warn(
        doors[-1].name,
        f"{names} {'close' if len(doors) > 1 else 'closes'} {closed:.2f} m of {doorway.name}, "
        f"which is {doorway.width:.2f} m wide: {doorway.width - covered:.2f} m stay open",
        "use a wider door or make the entryway narrower",
    )
