"""Whether a sampled plan is still a building: what is worse in it than in the plan it comes from.

A defect that the source plan already has, to the same extent, is the author's choice.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Final

from grammars.floorplan import FloorPlan, Opening, Wall
from grammars.text.diagnostics import Diagnostic, Where

_SLACK: Final = 1e-3
"""By how much a defect may grow [m]."""
_AREA: Final = 1e-2
"""By how much an overlap may grow [m²]."""
_LOW: Final = 1.0
"""Height below which solids are in the way [m]; lintels are above, sills below."""
_STANDING: Final = 1e-4
"""Area [m²] the centre of the robot needs in a space to have been there."""


@dataclass(frozen=True, slots=True)
class Defect:
    """Something unsound: ``extent`` says how much of it, ``slack`` how much more is the same."""

    message: str
    extent: float
    slack: float
    where: Where


def check_soundness(
    plan: FloorPlan, source: Mapping[str, Defect], radius: float
) -> tuple[Diagnostic, ...]:
    """Return what is unsound in ``plan`` beyond the defects of its source.

    Rooms that overlap, openings that reach beyond their walls or into each other, second walls
    that do not touch the first, walls without thickness or height, and spaces that a disc of
    ``radius`` [m] cannot reach from the others through entryways.
    """
    worse = _worse(_geometric(plan), source)
    # The free floor of a broken building means nothing.
    return worse or _worse(dict(_unreachable(plan, radius)), source)


def _worse(found: Mapping[str, Defect], source: Mapping[str, Defect]) -> tuple[Diagnostic, ...]:
    return tuple(
        Diagnostic(defect.where, defect.message)
        for key, defect in found.items()
        if defect.extent > (source[key].extent if key in source else 0.0) + defect.slack
    )


def defects(plan: FloorPlan, radius: float) -> dict[str, Defect]:
    """Return every defect of a plan by a name that its variants share."""
    return _geometric(plan) | dict(_unreachable(plan, radius))


def _geometric(plan: FloorPlan) -> dict[str, Defect]:
    checks = (_flat_walls, _overlaps, _stray_openings, _colliding_openings)
    return {key: defect for check in checks for key, defect in check(plan)}


def _flat_walls(plan: FloorPlan) -> Iterator[tuple[str, Defect]]:
    for space in plan.spaces:
        for what in ("thickness", "height"):
            size = getattr(space.walls[0], what)
            if size <= 0.0:
                message = f"the walls of {space.name} have no {what}"
                yield f"{what} {space.name}", Defect(message, 1.0, 0.0, space.where)


def _overlaps(plan: FloorPlan) -> Iterator[tuple[str, Defect]]:
    import shapely

    outlines = [shapely.Polygon(space.outline) for space in plan.spaces]
    tree = shapely.STRtree(outlines)
    # Neighbours share an edge and intersect too: only areas beyond the slack are defects.
    first, second = tree.query(outlines, predicate="intersects")
    for a, b in sorted(zip(first.tolist(), second.tolist(), strict=True)):
        if a < b:
            one, other = plan.spaces[a], plan.spaces[b]
            message = f"{one.name} and {other.name} overlap"
            area = float(outlines[a].intersection(outlines[b]).area)
            yield f"overlap {one.name} {other.name}", Defect(message, area, _AREA, other.where)


def _stray_openings(plan: FloorPlan) -> Iterator[tuple[str, Defect]]:
    walls = {wall.id: wall for wall in plan.walls}
    for opening in plan.openings:
        cut = [walls[name] for name in opening.walls]
        for wall in cut:
            label = f"{opening.name} reaches beyond {wall.id}"
            yield (
                f"{opening.name} {wall.id}",
                Defect(label, max(0.0, _overhang(opening, wall)), _SLACK, opening.where),
            )
        if len(cut) == 2:
            label = f"{opening.name}: {cut[0].id} and {cut[1].id} do not touch"
            yield (
                f"{opening.name} depth",
                Defect(label, _mismatch(opening, cut[0], cut[1]), _SLACK, opening.where),
            )


def _overhang(opening: Opening, wall: Wall) -> float:
    """Return how far an opening sticks out of a wall, sideways, above or below the floor [m]."""
    to_wall = wall.frame.inverse()
    along = max(abs(to_wall.apply((x, y))[0]) for x, y, _ in opening.near)
    return max(along - wall.length / 2, opening.z_max - wall.height, -opening.z_min)


def _mismatch(opening: Opening, first: Wall, second: Wall) -> float:
    """Return how far the outer faces of two walls are apart; turned ones by their length [m]."""
    relative = first.frame.inverse() @ second.frame
    turned = abs(math.sin(relative.yaw)) if math.cos(relative.yaw) < 0.0 else 1.0
    return abs(relative.y - opening.depth) + turned * second.length / 2


def _colliding_openings(plan: FloorPlan) -> Iterator[tuple[str, Defect]]:
    import shapely

    in_wall: dict[str, list[Opening]] = {}
    for opening in plan.openings:
        for name in opening.walls:
            in_wall.setdefault(name, []).append(opening)
    walls = {wall.id: wall for wall in plan.walls}
    for name, openings in in_wall.items():
        to_wall = walls[name].frame.inverse()
        shapes = [
            shapely.Polygon([(to_wall.apply((x, y))[0], z) for x, y, z in o.near]) for o in openings
        ]
        for a, b in combinations(range(len(openings)), 2):
            area = float(shapes[a].intersection(shapes[b]).area)
            message = f"{openings[a].name} and {openings[b].name} run into each other"
            key = f"openings {openings[a].name} {openings[b].name}"
            yield key, Defect(message, area, _SLACK, openings[b].where)


def _unreachable(plan: FloorPlan, radius: float) -> Iterator[tuple[str, Defect]]:
    """Spaces outside of the part of the free floor that touches most spaces."""
    import shapely

    from grammars.model.free_space import FreeSpace
    from grammars.scenery.composition import compile_scene

    parts = FreeSpace(compile_scene(plan, ()), _LOW).for_radius(radius).parts
    rooms = [shapely.Polygon(space.outline) for space in plan.spaces]
    touched = [
        {k for k, room in enumerate(rooms) if part.intersection(room).area > _STANDING}
        for part in parts
    ]
    main: set[int] = max(touched, key=len, default=set())
    for k, space in enumerate(plan.spaces):
        if k not in main:
            message = f"{space.name} cannot be reached with a radius of {radius:g} m"
            yield f"reach {space.name}", Defect(message, 1.0, 0.0, space.where)
