"""Checks of doors against their doorways: two in one, leaves of another size than the hole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
import shapely
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

from grammars.model.free_space import is_overlap, link_shape, moving_links, still_links
from grammars.model.geometry import Floats
from grammars.model.movers import is_mover
from grammars.model.scene import Doorway, Link, Scene, SceneObject
from grammars.preflight._checked import CheckedScene
from grammars.text.diagnostics import Diagnostic, Severity

_BESIDE: Final = 0.2
"""A leaf this near to the faces of the wall [m] closes the doorway, as sliding ones do."""
_HIGHER: Final = 0.01
"""So far may a leaf reach above its doorway [m] before it is said to be too high."""
_LEAST_SHARE: Final = 0.8
"""Shut doors that cover less of the width of their doorway leave a gap worth a word."""
_SHARED_SHARE: Final = 0.5
"""Two doors that both close so much of the narrower one's width hang in each other's place."""


@dataclass(frozen=True, slots=True)
class _ShutDoor:
    """A door where it closes the most of its doorway; shapes in the doorway's frame [m]."""

    body: SceneObject
    leaves: tuple[tuple[Link, BaseGeometry], ...]
    still: BaseGeometry
    passage: BaseGeometry
    """What of a doorway is closed by what lies in it: the hole and a little on both sides."""

    @property
    def closing(self) -> BaseGeometry:
        """What its leaves close."""
        return shapely.union_all([shape for _, shape in self.leaves]).intersection(self.passage)


def check_doors(checked: CheckedScene) -> tuple[list[Diagnostic], set[frozenset[str]]]:
    """Return what is wrong with doors in their doorways, and the pairs of objects it is about.

    Errors: leaves higher than their doorway, doors that stand in each other when shut. Warnings:
    two doors that each close the same doorway, doors that leave a fifth of theirs open. A pair
    names objects of which nothing more is to be said when they touch; an object too high for its
    doorway is a pair with itself.
    """
    findings: list[Diagnostic] = []
    said: set[frozenset[str]] = set()
    for doorway, bodies in _hung(checked.scene):
        doors = [_shut(body, doorway) for body in bodies]
        # Leaves that are in each other leave open what they would not if they hung as meant.
        collide = False
        for door in doors:
            high = _too_high(checked, door, doorway)
            findings += high
            if high:
                said.add(frozenset({door.body.name}))
        for one, other in combinations(doors, 2):
            found = _same_place(checked, one, other, doorway)
            if found is not None:
                findings.append(found)
                said.add(frozenset({one.body.name, other.body.name}))
                collide = collide or found.severity is Severity.ERROR
        findings += [] if collide else _gap(checked, doors, doorway)
    return findings, said


def colliding_doors(checked: CheckedScene) -> set[frozenset[str]]:
    """Return the pairs of names of doors that are in each other when shut in one doorway."""
    return {
        frozenset({one.body.name, other.body.name})
        for doorway, bodies in _hung(checked.scene)
        for one, other in combinations([_shut(b, doorway) for b in bodies if len(bodies) > 1], 2)
        if _meet(one, other)
    }


def _hung(scene: Scene) -> Iterator[tuple[Doorway, list[SceneObject]]]:
    doors: dict[str, list[SceneObject]] = {}
    for body in scene.objects:
        if body.doorway and moving_links(body) and not is_mover(body.joints):
            doors.setdefault(body.doorway, []).append(body)
    for doorway in scene.doorways:
        if doorway.name in doors:
            yield doorway, doors[doorway.name]


def _shut(body: SceneObject, doorway: Doorway) -> _ShutDoor:
    x_min, y_min, x_max, y_max = Polygon(
        doorway.frame.inverse().apply_ring(doorway.footprint)
    ).bounds
    passage = box(x_min, y_min - _BESIDE, x_max, y_max + _BESIDE)
    # A scene does not say where a door is shut. It is at rest, at zero or at a limit that most of
    # the doorway is closed.
    zero = tuple(min(max(0.0, j.lower), j.upper) for j in body.joints)
    lowest, highest = (tuple(getattr(j, end) for j in body.joints) for end in ("lower", "upper"))
    best = _placed(body, zero, doorway, passage)
    for positions in dict.fromkeys((body.initial, lowest, highest)):
        if _extent(best.closing) >= _LEAST_SHARE * doorway.width:
            break
        other = _placed(body, positions, doorway, passage)
        best = max(best, other, key=lambda door: round(_extent(door.closing), 6))
    return best


def _placed(
    body: SceneObject, positions: Sequence[float], doorway: Doorway, passage: BaseGeometry
) -> _ShutDoor:
    def local(link: Link) -> BaseGeometry:
        return _in_frame(link_shape(body, link, positions), doorway)

    leaves = tuple((link, local(link)) for link in moving_links(body))
    still = shapely.union_all([local(link) for link in still_links(body)])
    return _ShutDoor(body, leaves, still, passage)


def _in_frame(shape: BaseGeometry, doorway: Doorway) -> BaseGeometry:
    to_local = doorway.frame.inverse()

    def turned(points: Floats) -> Floats:
        return np.array([to_local.apply((x, y)) for x, y in points.tolist()]).reshape(-1, 2)

    moved: BaseGeometry = shapely.transform(shape, turned)
    return moved


def _spans(shape: BaseGeometry) -> list[tuple[float, float]]:
    """Return from where to where the parts of a shape reach along the doorway [m], in order."""
    bounds = [part.bounds for part in shapely.get_parts(shape).tolist() if not part.is_empty]
    return sorted((bound[0], bound[2]) for bound in bounds)


def _extent(*shapes: BaseGeometry) -> float:
    """Return how much of a doorway's width the shapes cover together [m]."""
    covered, reached = 0.0, -np.inf
    for low, high in sorted(span for shape in shapes for span in _spans(shape)):
        covered += max(0.0, high - max(low, reached))
        reached = max(reached, high)
    return covered


def _too_high(checked: CheckedScene, door: _ShutDoor, doorway: Doorway) -> list[Diagnostic]:
    hole = Polygon(doorway.frame.inverse().apply_ring(doorway.footprint))
    # What hangs in front of the wall may be higher than the hole, as sliding leaves are.
    return [
        Diagnostic(
            checked.place(door.body.name),
            f"the {link.name} of {door.body.name} reaches {link.z_max:.2f} m high, "
            f"{doorway.name} only {doorway.z_max:.2f} m",
            "take a lower door or make the entryway higher",
        )
        for link, shape in door.leaves
        if link.z_max > doorway.z_max + _HIGHER and is_overlap(shape.intersection(hole))
    ]


def _same_place(
    checked: CheckedScene, one: _ShutDoor, other: _ShutDoor, doorway: Doorway
) -> Diagnostic | None:
    met = _meet(one, other)
    first, second = _extent(one.closing), _extent(other.closing)
    shared = first + second - _extent(one.closing, other.closing)
    if not met and shared < _SHARED_SHARE * min(first, second):
        return None
    message = (
        f"{one.body.name} and {other.body.name} hang in one doorway: {doorway.name} is "
        f"{doorway.width:.2f} m wide, they close {first:.2f} m and {second:.2f} m of it"
    )
    return Diagnostic(
        checked.place(other.body.name),
        f"{message}, one inside of the other" if met else message,
        f"the other one: {checked.place(one.body.name)}; {_remedy(one, other, doorway)}",
        Severity.ERROR if met else Severity.WARNING,
    )


def _meet(one: _ShutDoor, other: _ShutDoor) -> bool:
    return any(
        a.z_min < b.z_max and b.z_min < a.z_max and is_overlap(first.intersection(second))
        for a, first in one.leaves
        for b, second in other.leaves
    )


def _remedy(one: _ShutDoor, other: _ShutDoor, doorway: Doorway) -> str:
    """Return what to do with two doors in each other's place: double doors are to stay together."""
    widths = [_extent(door.closing) for door in (one, other)]
    if max(widths) >= _LEAST_SHARE * doorway.width:
        return "give one of them another doorway"
    ends = [_nearer_end(door) for door in (one, other)]
    if ends[0] == ends[1]:
        return "both hang on the same side: hang one of them left, the other one right"
    return (
        f"together {sum(widths):.2f} m wide, the doorway is {doorway.width:.2f} m: "
        "make the leaves narrower"
    )


def _nearer_end(door: _ShutDoor) -> str:
    """Return on which side of the middle of its doorway most of a shut door lies."""
    low, _, high, _ = door.passage.bounds
    spans = _spans(door.closing)
    return "low" if spans[0][0] + spans[-1][1] < low + high else "high"


def _gap(checked: CheckedScene, doors: Sequence[_ShutDoor], doorway: Doorway) -> list[Diagnostic]:
    closed = _extent(*(door.closing for door in doors))
    posts = [door.still.intersection(door.passage) for door in doors]
    covered = _extent(*(door.closing for door in doors), *posts)
    # A door whose leaf is nowhere near is one by its sentence only: an open gate, a lift.
    if closed == 0.0 or covered >= _LEAST_SHARE * doorway.width:
        return []
    names = " and ".join(door.body.name for door in doors)
    return [
        Diagnostic(
            checked.place(doors[-1].body.name),
            f"{names} {'close' if len(doors) > 1 else 'closes'} {closed:.2f} m of {doorway.name}, "
            f"which is {doorway.width:.2f} m wide: {doorway.width - covered:.2f} m stay open",
            "take a wider door or make the entryway narrower",
            Severity.WARNING,
        )
    ]
