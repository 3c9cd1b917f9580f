"""Flaws of plans: suspicious places of rooms, openings and features, measured."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

from grammars.floorplan.model import FloorPlan, Opening, Wall
from grammars.text.diagnostics import Findings, Where

_TOUCHING: Final = 1e-3
"""Distance up to which walls touch, or openings may stick out [m]."""
_OVERLAP: Final = 1e-2
"""Area that two rooms may share without a warning [m²]."""
_SHARED: Final = 1e-3
"""Area that two openings of a wall may share [m²]."""
_LONGEST: Final = 1000.0
"""Length up to which a space is usual [m]."""
_LOWEST: Final = 0.1
"""Height from which a column or divider is usual [m]."""
_TURNED: Final = 1e-6
"""One minus the cosine of the angle by which facing walls may be turned."""


@dataclass(frozen=True, slots=True)
class Flaw:
    """Valid geometry in a plan that is probably not intended.

    ``key`` names it in all variants of a plan. It counts as a flaw only if ``extent`` is beyond
    ``slack``; both have the same unit. Plans may be ``intended`` so, their variants not.
    """

    key: str
    extent: float
    slack: float
    where: Where
    message: str
    hint: str = ""
    intended: bool = False


def warn_of(flaws: Iterable[Flaw], findings: Findings) -> None:
    """Add a warning for every flaw beyond its slack that is not intended."""
    for flaw in flaws:
        if flaw.extent > flaw.slack and not flaw.intended:
            findings.warning(flaw.where, flaw.message, flaw.hint)


def geometric_flaws(plan: FloorPlan) -> Iterator[Flaw]:
    """Yield the measured flaws of a plan, including those within their slack."""
    walls = {wall.id: wall for wall in plan.walls}
    for opening in plan.openings:
        yield from _of_opening(plan, opening, [walls[name] for name in opening.walls])
    yield from _colliding_openings(plan, walls)
    yield from overlaps(plan)
    yield from _of_sizes(plan)
    yield from _of_features(plan)


def _of_opening(plan: FloorPlan, opening: Opening, walls: Sequence[Wall]) -> Iterator[Flaw]:
    """Yield the distances by which an opening sticks out of its walls, and a misfit of two."""
    name, where = opening.name, opening.where
    label = f'{opening.kind} "{name}"'
    for wall in walls:
        along = [wall.frame.inverse().apply((x, y))[0] for x, y, _ in opening.near]
        low, high = _ends(wall, min(along), max(along))
        beyond = max(low - min(along), max(along) - high)
        message = f"{label} reaches {beyond:.3g} m beyond the end of {wall.id}"
        hint = f"the wall reaches from x = {low:.6g} m to {high:.6g} m"
        yield Flaw(f"{name} beyond {wall.id}", beyond, _TOUCHING, where, message, hint)
        above = opening.z_max - wall.height
        message = f"{label} reaches above {wall.id} ({wall.height:g} m high)"
        yield Flaw(f"{name} above {wall.id}", above, _TOUCHING, where, message)
    message = f"{label} reaches below the floor (z = {opening.z_min:g} m)"
    hint = "z is the height of its middle: half its height for a door"
    yield Flaw(f"{name} below the floor", -opening.z_min, _TOUCHING, where, message, hint)
    if len(walls) == 2:
        yield _of_pair(plan, opening, *walls)


def _ends(wall: Wall, first: float, last: float) -> tuple[float, float]:
    """Return the ends of a wall that limit an opening from ``first`` to ``last`` [m]."""
    inner = wall.length / 2
    if first > -inner or last < inner:
        return -inner, inner
    # The opening removes the whole wall between two spaces. In a corner that points outwards the
    # outer face is longer than the inner one; the part beyond it belongs to this wall too.
    to_wall = wall.frame.inverse()
    ends = [to_wall.apply(corner)[0] for corner in wall.footprint]
    return min(ends), max(ends)


def _of_pair(plan: FloorPlan, opening: Opening, first: Wall, second: Wall) -> Flaw:
    relative = first.frame.inverse() @ second.frame
    label = f'{opening.kind} "{opening.name}": {first.id} and {second.id}'
    turned = _turned(first, second)
    if turned > _TURNED:
        message = f"{label} do not face each other"
        facing = [
            f"{wall.space}.walls[{wall.index}]"
            for wall in plan.walls
            if wall.space == second.space and _turned(first, wall) <= _TURNED
        ]
        hint = f"{first.id} faces {' and '.join(facing)}" if facing else "turn one of the spaces"
        return Flaw(f"{opening.name} turned", turned, _TURNED, opening.where, message, hint)
    message = (
        f"{label} do not touch: {relative.y:.3f} m between their inner faces, "
        f"{opening.depth:.3f} m thick together"
    )
    apart = abs(relative.y - opening.depth)
    return Flaw(f"{opening.name} depth", apart, _TOUCHING, opening.where, message)


def _turned(first: Wall, second: Wall) -> float:
    """Return 0 for walls that face each other, half a turn apart, up to 2."""
    return 1.0 + math.cos(second.frame.yaw - first.frame.yaw)


def _colliding_openings(plan: FloorPlan, walls: Mapping[str, Wall]) -> Iterator[Flaw]:
    """Yield the pairs of openings in one wall, each pair once, with the area that they share."""
    import shapely

    in_wall: dict[str, list[Opening]] = {}
    for opening in plan.openings:
        for name in opening.walls:
            in_wall.setdefault(name, []).append(opening)
    flaws: dict[str, Flaw] = {}
    for name, openings in in_wall.items():
        to_wall = walls[name].frame.inverse()
        shapes = [
            shapely.Polygon([(to_wall.apply((x, y))[0], z) for x, y, z in o.near]) for o in openings
        ]
        for (one, shape), (other, second) in combinations(zip(openings, shapes, strict=True), 2):
            key = f"openings {one.name} {other.name}"
            message = f"{one.name} and {other.name} overlap in {name}"
            hint = f"the other one: {one.where}; move one of them along the wall"
            area = float(shape.intersection(second).area)
            # Plans without doors remove walls by overlapping entryways to different spaces.
            removes = one.kind == other.kind == "entryway" and one.walls != other.walls
            flaw = Flaw(key, area, _SHARED, other.where, message, hint, removes)
            flaws.setdefault(key, flaw)
    yield from flaws.values()


def overlaps(plan: FloorPlan) -> Iterator[Flaw]:
    """Yield the pairs of spaces that share floor or touch."""
    import shapely

    # A large plan has too many pairs of rooms to test them all, hence the tree.
    outlines = [shapely.Polygon(space.outline, space.holes) for space in plan.spaces]
    first, second = shapely.STRtree(outlines).query(outlines, predicate="intersects")
    for a, b in sorted(zip(first.tolist(), second.tolist(), strict=True)):
        if a < b:
            one, other = plan.spaces[a], plan.spaces[b]
            area = float(outlines[a].intersection(outlines[b]).area)
            message = f'"{other.name}" and "{one.name}" overlap ({area:.2f} m²)'
            yield Flaw(f"overlap {one.name} {other.name}", area, _OVERLAP, other.where, message)


def _of_sizes(plan: FloorPlan) -> Iterator[Flaw]:
    """Yield the lengths of spaces and the missing heights of features."""
    for space in plan.spaces:
        corners = list(zip(*space.outline, strict=True))
        size = max(max(values) - min(values) for values in corners)
        message = f'space "{space.name}" is {size:g} m long'
        hint = "lengths without a unit are metres: write mm or cm if these are meant"
        yield Flaw(f"{space.name} long", size, _LONGEST, space.where, message, hint)
    for feature in plan.features:
        message = f'{feature.kind} "{feature.name}" is only {feature.height:g} m high'
        low = _LOWEST - feature.height if feature.height > 0.0 else 0.0
        yield Flaw(f"{feature.id} low", low, 0.0, feature.where, message, "check the unit")


def _of_features(plan: FloorPlan) -> Iterator[Flaw]:
    """Yield the features outside of their space."""
    import shapely

    floors = {space.name: shapely.Polygon(space.outline, space.holes) for space in plan.spaces}
    for feature in plan.features:
        if feature.space and not floors[feature.space].intersects(
            shapely.Polygon(feature.footprint)
        ):
            message = f'{feature.kind} "{feature.name}" stands outside "{feature.space}"'
            yield Flaw(f"{feature.id} outside", 1.0, 0.0, feature.where, message)
