"""Checks of a scene alone."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Final

import numpy as np
import shapely
from shapely.geometry import Polygon

from grammars.model.movers import is_mover
from grammars.model.scene import Doorway, Scene
from grammars.preflight._checked import CheckedScene, Footprint, meetings, sweeps
from grammars.preflight._doors import check_doors
from grammars.preflight._parts import check_inside, check_meetings, check_starts, check_walls
from grammars.text.diagnostics import Finding, Where

_BLOCKED: Final = 0.05
"""Largest share of a passage that a wall may cover."""
_DENSITIES: Final = (1.0, 25_000.0)
"""Densities of things [kg/m3], from foam with air to the heaviest metals."""
_THRESHOLD: Final = 0.06
"""Required free distance of a passage beyond the faces of its walls [m]."""


def check_scene(scene: Scene, *, places: Mapping[str, Where] | None = None) -> tuple[Finding, ...]:
    """Return the problems of a scene, independent of runs.

    Errors: leaves that start inside a wall or are higher than their doorway, objects that overlap
    at the start. Warnings: leaves that would sweep through a wall or another object somewhere in
    the range of their joints, doors much narrower than their doorway, two doors in one doorway,
    objects outside the building, entryways closed by a wall that they do not list. ``places`` has
    the places of objects and entryways by name (see :func:`grammars.preflight.places_of`).
    """
    checked = CheckedScene(scene, places or {}, Where(scene.name))
    for doorway in scene.doorways:
        _check_passage(checked, doorway)
    standing = [body for body in scene.objects if not is_mover(body.joints)]
    clashes = check_doors(checked)
    overlaps = _check_overlaps(checked, clashes)
    check_inside(checked, standing)
    # Leaves that start in a wall, or are too high for their doorway, also sweep through the wall.
    # Report only the first problem.
    high = {name for name, *others in clashes if not others}
    in_walls = high | check_starts(checked, [body for body in standing if body.name not in high])
    _check_furniture(checked)
    _check_masses(checked)
    swept = [
        part
        for body in standing
        if not body.frozen
        for part in sweeps(body, tuple((j.name, (j.lower, j.upper)) for j in body.joints))
    ]
    loose = [part for part in swept if part.body.name not in in_walls]
    check_walls(checked, loose, "somewhere in its range")
    check_meetings(checked, swept, "somewhere in its range", clashes | overlaps)
    return checked.findings.all


def _check_passage(checked: CheckedScene, doorway: Doorway) -> None:
    passage = _passage(doorway)
    # One centimetre inside, because sill and lintel touch the passage.
    hits = checked.floor.solids.hit_by(passage, doorway.z_min + 0.01, doorway.z_max - 0.01)
    closing = [owner for owner, part in hits.items() if part.area > _BLOCKED * passage.area]
    if closing:
        hint = "list all walls that the entryway goes through"
        checked.warn(doorway.name, f"{doorway.name} is closed by {' and '.join(closing)}", hint)


def _passage(doorway: Doorway) -> Polygon:
    """Return the footprint of a doorway with a threshold on both sides of the wall."""
    local = doorway.frame.inverse().apply_ring(doorway.footprint)
    xs, ys = [p[0] for p in local], [p[1] for p in local]
    low, high = min(ys) - _THRESHOLD, max(ys) + _THRESHOLD
    # One centimetre inside, because the jambs touch the passage.
    start, end = min(xs) + 0.01, max(xs) - 0.01
    corners = ((start, low), (end, low), (end, high), (start, high))
    return Polygon(doorway.frame.apply_ring(corners))


def _check_overlaps(
    checked: CheckedScene, silent: Collection[frozenset[str]]
) -> set[frozenset[str]]:
    """Report objects that overlap at the start; return their pairs of names.

    An overlap is an error if a link there can move, because the simulator would push the objects
    apart at once, otherwise a warning. Pairs in ``silent`` are left out.
    """
    standing = [part for part in checked.floor.start if not is_mover(part.body.joints)]
    pairs = meetings(standing, but=silent)
    for one, other in pairs.values():
        _report_overlap(checked, one, other)
    return set(pairs)


def _report_overlap(checked: CheckedScene, one: Footprint, other: Footprint) -> None:
    common = one.shape.intersection(other.shape)
    around = shapely.get_coordinates(shapely.minimum_rotated_rectangle(common))
    width, length = sorted(np.linalg.norm(np.diff(around[:3], axis=0), axis=1).tolist())
    # Adding 0.0 turns -0.0 into 0.0.
    x, y = round(common.centroid.x, 2) + 0.0, round(common.centroid.y, 2) + 0.0
    message = (
        f"{other.body.name} and {one.body.name} overlap at the start: the {other.link.name} and "
        f"the {one.link.name} near ({x:.2f}, {y:.2f}) by {length:.2f} m x {width:.2f} m"
    )
    hint = f"the other one: {checked.place(one.body.name)}; move one of them"
    if one.moves or other.moves:
        checked.error(other.body.name, message, f"{hint}, or let it start elsewhere")
    else:
        checked.warn(other.body.name, message, hint)


def _check_furniture(checked: CheckedScene) -> None:
    """Report objects without moving parts that overlap a wall, as only posts of doors should."""
    doors = {part.body.name for part in checked.floor.start if part.jointed}
    owners: dict[str, dict[str, None]] = {}
    for part in checked.floor.start:
        if part.body.name not in doors:
            owners.setdefault(part.body.name, {}).update(dict.fromkeys(checked.walls_at(part)))
    for name, walls in owners.items():
        if walls:
            checked.warn(name, f"{name} is partly inside {' and '.join(walls)}", "move or turn it")


def _check_masses(checked: CheckedScene) -> None:
    """Report links that are lighter than air or heavier than any metal, once for each model."""
    models: set[tuple[str, str]] = set()
    for part in checked.floor.start:
        link = part.link
        volume = part.shape.area * (link.z_max - link.z_min)
        if (part.body.model, link.name) in models or not volume or not link.mass:
            continue
        models.add((part.body.model, link.name))
        density = link.mass / volume
        if not _DENSITIES[0] <= density <= _DENSITIES[1]:
            message = (
                f"the {link.name} of {part.body.name} has a mass of {link.mass:g} kg in "
                f"{volume:.2g} m3, {density:.2g} kg/m3"
            )
            checked.warn(part.body.name, message, "check the unit: water has 1000 kg/m3")
