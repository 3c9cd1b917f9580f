"""Checks of a scene by itself, and where the things it is made of were written."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from grammars.floorplan import FloorPlan
from grammars.model.free_space import (
    SolidIndex,
    is_overlap,
    link_shape,
    moving_links,
    swept_area,
    without_jamb,
)
from grammars.model.movers import is_mover
from grammars.model.scene import Doorway, Link, Scene, SceneObject
from grammars.scenery import SceneryLayer
from grammars.text.diagnostics import Diagnostic, Severity, Where


def places_of(layers: Iterable[SceneryLayer], plan: FloorPlan | None = None) -> dict[str, Where]:
    """Return the place of every object by its name, and of the entryways of ``plan``."""
    places = {o.name: o.where for o in plan.openings} if plan is not None else {}
    places.update((i.name, i.where) for layer in layers for i in layer.instances)
    return places


@dataclass(frozen=True)
class CheckedScene:
    """A scene under check: its solids, searchable, and where its things were written.

    ``places`` are those of objects, entryways and joints by name, ``home`` that of the rest.
    """

    scene: Scene
    places: Mapping[str, Where]
    home: Where

    @functools.cached_property
    def obstacles(self) -> SolidIndex:
        """The walls, columns and dividers."""
        return SolidIndex(self.scene)

    def place(self, name: str) -> Where:
        """Return the place of a joint, else of its object, else of everything."""
        owner = name.partition(".")[0]
        return self.places.get(name) or self.places.get(owner) or self.home


_TOLERANCE: Final = 1e-9
_BLOCKED: Final = 0.05
"""Share of a passage a wall may cover before the passage counts as walled up."""
_THRESHOLD: Final = 0.06
"""How far beyond the faces of its walls a passage must be free [m]."""

Sweeps = list[tuple[SceneObject, Link, BaseGeometry]]


def check_scene(
    scene: Scene, *, places: Mapping[str, Where] | None = None
) -> tuple[Diagnostic, ...]:
    """Return what is wrong with a scene, whatever runs in it.

    Errors: two objects of one name, joints that start outside of their limits, leaves that start
    inside of a wall. Warnings: leaves that would sweep through a wall or another object somewhere
    in the range of their joints, entryways that a wall not listed in them closes. ``places`` gives
    the places of objects and entryways by name (see :func:`grammars.preflight.places_of`).
    """
    checked = CheckedScene(scene, places or {}, Where(scene.name))
    findings = [
        *_duplicate_names(checked),
        *(d for body in scene.objects for d in _outside_limits(checked, body)),
        *_blocked_doorways(checked),
    ]
    stuck = {
        b.name: [] if is_mover(b.joints) else starts_in_wall(checked, b) for b in scene.objects
    }
    findings.extend(d for found in stuck.values() for d in found)
    findings.extend(_furniture_in_walls(checked))
    sweeps = [
        (body, link, swept_area(body, link, {j.name: (j.lower, j.upper) for j in body.joints}))
        for body in scene.objects
        if not body.frozen and not is_mover(body.joints)
        for link in moving_links(body)
    ]
    # A leaf that starts in a wall sweeps through it as well: that is said once.
    loose = [sweep for sweep in sweeps if not stuck[sweep[0].name]]
    findings.extend(wall_hits(checked, loose, "somewhere in its range"))
    findings.extend(object_hits(checked, sweeps, "somewhere in its range"))
    return tuple(findings)


def _duplicate_names(checked: CheckedScene) -> list[Diagnostic]:
    names = [body.name for body in checked.scene.objects]
    return [
        Diagnostic(checked.place(name), f'there are two objects called "{name}"')
        for name in dict.fromkeys(names)
        if names.count(name) > 1
    ]


def _outside_limits(checked: CheckedScene, body: SceneObject) -> list[Diagnostic]:
    return [
        Diagnostic(
            checked.place(body.name),
            f"{body.name}.{joint.name} starts at {position:g}, outside of its limits",
            f"between {joint.lower:g} and {joint.upper:g}",
        )
        for joint, position in zip(body.joints, body.initial, strict=True)
        if not joint.lower - _TOLERANCE <= position <= joint.upper + _TOLERANCE
    ]


def _blocked_doorways(checked: CheckedScene) -> list[Diagnostic]:
    findings = []
    for doorway in checked.scene.doorways:
        passage = _passage(doorway)
        # A centimetre inside: sill and lintel touch the passage and do not close it.
        hits = checked.obstacles.hit_by(passage, doorway.z_min + 0.01, doorway.z_max - 0.01)
        closing = [o for o, part in hits.items() if part.area > _BLOCKED * passage.area]
        if closing:
            findings.append(
                Diagnostic(
                    checked.place(doorway.name),
                    f"{doorway.name} is closed by {' and '.join(closing)}",
                    "list every wall that the entryway goes through",
                    Severity.WARNING,
                )
            )
    return findings


def _passage(doorway: Doorway) -> Polygon:
    """Return the footprint of a doorway with a threshold on both sides of the wall."""
    local = doorway.frame.inverse().apply_ring(doorway.footprint)
    xs, ys = [p[0] for p in local], [p[1] for p in local]
    low, high = min(ys) - _THRESHOLD, max(ys) + _THRESHOLD
    # The jambs touch the passage too.
    left, right = min(xs) + 0.01, max(xs) - 0.01
    corners = ((left, low), (right, low), (right, high), (left, high))
    return Polygon(doorway.frame.apply_ring(corners))


def starts_in_wall(checked: CheckedScene, body: SceneObject) -> list[Diagnostic]:
    """Return an error for every moving link that starts inside of a solid."""
    findings = []
    for link in moving_links(body):
        shape = link_shape(body, link, body.initial)
        for owner, overlap in checked.obstacles.hit_by(shape, link.z_min, link.z_max).items():
            if is_overlap(without_jamb(body, link, overlap)):
                findings.append(
                    Diagnostic(
                        checked.place(body.name),
                        f"the {link.name} of {body.name} starts inside of {owner}",
                        "check its place, which side the hinge is on and where it opens to",
                    )
                )
    return findings


def _furniture_in_walls(checked: CheckedScene) -> list[Diagnostic]:
    """Return a warning for every object without moving parts that stands in a wall.

    The posts of doors do so by design.
    """
    findings = []
    for body in checked.scene.objects:
        owners: dict[str, None] = {}
        for link in body.links if not moving_links(body) else ():
            shape = link_shape(body, link, body.initial)
            hits = checked.obstacles.hit_by(shape, link.z_min, link.z_max)
            owners.update((owner, None) for owner, part in hits.items() if is_overlap(part))
        if owners:
            findings.append(
                Diagnostic(
                    checked.place(body.name),
                    f"{body.name} stands in {' and '.join(owners)}",
                    "move or turn it",
                    Severity.WARNING,
                )
            )
    return findings


def wall_hits(checked: CheckedScene, sweeps: Sweeps, when: str) -> list[Diagnostic]:
    """Return a warning for every leaf that sweeps through a wall, column or divider."""
    findings = []
    for body, link, area in sweeps:
        hits = checked.obstacles.hit_by(area, link.z_min, link.z_max)
        through = [o for o, part in hits.items() if is_overlap(without_jamb(body, link, part))]
        if through:
            findings.append(
                Diagnostic(
                    checked.place(body.name),
                    f"the {link.name} of {body.name} sweeps through {' and '.join(through)} {when}",
                    "limit the joint, or move or turn the object",
                    Severity.WARNING,
                )
            )
    return findings


def object_hits(checked: CheckedScene, sweeps: Sweeps, when: str) -> list[Diagnostic]:
    """Return a warning for every leaf whose sweep meets another object (its own or its place)."""
    others: list[tuple[SceneObject, Link, BaseGeometry]] = list(sweeps)
    seen = {(id(body), link.name) for body, link, _ in sweeps}
    others.extend(
        (body, link, link_shape(body, link, body.initial))
        for body in checked.scene.objects
        if body.frozen or not is_mover(body.joints)
        for link in body.links
        if (id(body), link.name) not in seen
    )
    # Each leaf meets few neighbours: by the tree not every pair is looked at.
    tree = shapely.STRtree([area for _, _, area in others])
    findings, reported = [], set[tuple[int, int]]()
    for body, link, area in sweeps:
        for index in sorted(tree.query(area, predicate="intersects").tolist()):
            other, part, covered = others[index]
            pair = (min(id(body), id(other)), max(id(body), id(other)))
            apart = link.z_min >= part.z_max or part.z_min >= link.z_max
            if other is body or apart or pair in reported:
                continue
            if is_overlap(area.intersection(covered)):
                reported.add(pair)
                findings.append(
                    Diagnostic(
                        checked.place(body.name),
                        f"{body.name} and {other.name} can run into each other {when}",
                        f"the other one: {checked.place(other.name)}",
                        Severity.WARNING,
                    )
                )
    return findings
