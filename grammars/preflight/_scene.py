"""Checks of a scene by itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from shapely.geometry import Polygon

from grammars.model.free_space import (
    is_overlap,
    link_shape,
    moving_links,
    swept_area,
)
from grammars.model.movers import is_mover
from grammars.model.scene import Doorway, Scene, SceneObject
from grammars.preflight._checked import CheckedScene
from grammars.preflight._doors import check_doors
from grammars.preflight._standing import check_inside, check_overlaps
from grammars.preflight._sweeps import object_hits, starts_in_wall, wall_hits
from grammars.text.diagnostics import Diagnostic, Severity, Where

_TOLERANCE: Final = 1e-9
_BLOCKED: Final = 0.05
"""Share of a passage a wall may cover before the passage counts as walled up."""
_THRESHOLD: Final = 0.06
"""How far beyond the faces of its walls a passage must be free [m]."""


def check_scene(
    scene: Scene, *, places: Mapping[str, Where] | None = None
) -> tuple[Diagnostic, ...]:
    """Return what is wrong with a scene, whatever runs in it.

    Errors: two objects of one name, joints that start outside of their limits, leaves that start
    inside of a wall or are higher than their doorway, objects that start inside of each other.
    Warnings: leaves that would sweep through a wall or another object somewhere in the range of
    their joints, doors much narrower than their doorway, two doors in one doorway, objects outside
    of the building, entryways that a wall not listed in them closes. ``places`` gives
    the places of objects and entryways by name (see :func:`grammars.preflight.places_of`).
    """
    checked = CheckedScene(scene, places or {}, Where(scene.name))
    findings = [
        *_duplicate_names(checked),
        *(d for body in scene.objects for d in _outside_limits(checked, body)),
        *_blocked_doorways(checked),
    ]
    standing = [body for body in scene.objects if not is_mover(body.joints)]
    doors, hung = check_doors(checked)
    overlaps, met = check_overlaps(checked, standing, hung)
    findings += [*doors, *overlaps, *check_inside(checked, standing)]
    stuck = {b.name: starts_in_wall(checked, b) for b in standing if {b.name} not in hung}
    findings.extend(d for found in stuck.values() for d in found)
    findings.extend(_furniture_in_walls(checked))
    sweeps = [
        (body, link, swept_area(body, link, {j.name: (j.lower, j.upper) for j in body.joints}))
        for body in standing
        if not body.frozen
        for link in moving_links(body)
    ]
    # A leaf that starts in a wall, or is too high for its doorway, sweeps through the wall as
    # well: that is said once.
    loose = [sweep for sweep in sweeps if not stuck.get(sweep[0].name, [True])]
    findings.extend(wall_hits(checked, loose, "somewhere in its range"))
    findings.extend(object_hits(checked, sweeps, "somewhere in its range", hung | met))
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
