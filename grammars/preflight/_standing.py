"""Checks of where objects stand at the start: inside of each other, or nowhere in the building."""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grammars.model.free_space import is_overlap, link_shape, moving_links
from grammars.model.scene import Link, SceneObject
from grammars.preflight._checked import CheckedScene
from grammars.text.diagnostics import Diagnostic, Severity


@dataclass(frozen=True, slots=True)
class _StandingLink:
    """A link where it is at the start."""

    body: SceneObject
    link: Link
    shape: BaseGeometry
    moves: bool


def check_overlaps(
    checked: CheckedScene, bodies: Iterable[SceneObject], said: Container[frozenset[str]] = ()
) -> tuple[list[Diagnostic], set[frozenset[str]]]:
    """Return which objects stand in each other at the start, and those pairs by name.

    Errors where one of the two can move there: the simulator would push them apart at once.
    Warnings where both stand still. Pairs in ``said`` are left out.
    """
    links = [
        _StandingLink(body, link, link_shape(body, link, body.initial), _moves(body, link))
        for body in bodies
        for link in body.links
        if link.polygons
    ]
    shapes = np.array([part.shape for part in links], dtype=object)
    found: dict[frozenset[str], tuple[_StandingLink, _StandingLink]] = {}
    for first, second in shapely.STRtree(shapes).query(shapes, predicate="intersects").T.tolist():
        one, other = links[first], links[second]
        pair = frozenset({one.body.name, other.body.name})
        if first >= second or len(pair) == 1 or pair in said or not _meet(one, other):
            continue
        # Of two objects the links that move say more than those that stand.
        if pair not in found or not any(part.moves for part in found[pair]):
            found[pair] = (one, other)
    return [_overlap(checked, *links) for links in found.values()], set(found)


def _moves(body: SceneObject, link: Link) -> bool:
    return not body.frozen and link in moving_links(body)


def _meet(one: _StandingLink, other: _StandingLink) -> bool:
    return (
        one.link.z_min < other.link.z_max
        and other.link.z_min < one.link.z_max
        and is_overlap(one.shape.intersection(other.shape))
    )


def _overlap(checked: CheckedScene, one: _StandingLink, other: _StandingLink) -> Diagnostic:
    common = one.shape.intersection(other.shape)
    around = shapely.get_coordinates(shapely.minimum_rotated_rectangle(common))
    width, length = sorted(np.linalg.norm(np.diff(around[:3], axis=0), axis=1).tolist())
    # Adding 0.0 makes 0.0 of -0.0.
    x, y = round(common.centroid.x, 2) + 0.0, round(common.centroid.y, 2) + 0.0
    loose = one.moves or other.moves
    return Diagnostic(
        checked.place(other.body.name),
        f"{other.body.name} and {one.body.name} stand in each other at the start: the "
        f"{other.link.name} and the {one.link.name} overlap near "
        f"({x:.2f}, {y:.2f}) by "
        f"{length:.2f} m x {width:.2f} m",
        f"the other one: {checked.place(one.body.name)}; move one of them"
        + (", or let it start elsewhere" if loose else ""),
        Severity.ERROR if loose else Severity.WARNING,
    )


def check_inside(checked: CheckedScene, bodies: Iterable[SceneObject]) -> list[Diagnostic]:
    """Return a warning for every object that touches neither a space nor a wall.

    What hangs in a doorway may be on the outer face of the building.
    """
    scene = checked.scene
    if not scene.regions:
        return []
    names = [region.name for region in scene.regions]
    floors = shapely.STRtree(checked.floors)
    findings = []
    for body in (body for body in bodies if not body.doorway):
        shape = shapely.union_all(
            [link_shape(body, link, body.initial) for link in body.links if link.polygons]
        )
        if shape.is_empty or len(floors.query(shape, predicate="intersects")):
            continue
        if checked.obstacles.hit_by(shape, 0.0, float("inf")):
            continue
        index = int(floors.nearest(shape))
        away = shape.distance(checked.floors[index])
        where = names[index] if index < len(names) else scene.doorways[index - len(names)].name
        findings.append(
            Diagnostic(
                checked.place(body.name),
                f"{body.name} stands outside of the building, {away:.2f} m from {where}",
                "check the frame it is placed in and the signs of x and y",
                Severity.WARNING,
            )
        )
    return findings
