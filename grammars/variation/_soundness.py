"""Soundness of a sampled plan: it has no flaws beyond those of its source plan.

Flaws of the source plan, to the same extent, are the choice of its author.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from grammars.floorplan import Flaw, FloorPlan, geometric_flaws
from grammars.text.diagnostics import Finding

_LOW: Final = 1.0
"""Height below which solids are obstacles [m]; lintels are above, sills below."""
_STANDING: Final = 1e-4
"""Area [m²] for the centre of the robot that a reachable space must have."""


def check_soundness(
    plan: FloorPlan, source: Mapping[str, float], radius: float
) -> tuple[Finding, ...]:
    """Return the flaws of ``plan`` beyond ``source``, the extents of accepted flaws.

    Flaws are suspicious geometry, walls without thickness or height, and
    spaces that a disc of ``radius`` [m] cannot reach from the others through entryways.
    """
    worse = _worse(_geometric(plan), source)
    # The free floor of a broken building has no meaning.
    return worse or _worse(_unreachable(plan, radius), source)


def _worse(flaws: Iterable[Flaw], source: Mapping[str, float]) -> tuple[Finding, ...]:
    return tuple(
        Finding(flaw.where, flaw.message)
        for flaw in flaws
        if flaw.extent > flaw.slack + source.get(flaw.key, 0.0)
    )


def flaws_of(plan: FloorPlan, radius: float) -> tuple[Flaw, ...]:
    """Return all flaws of a plan, including those within their slack."""
    return (*_geometric(plan), *_unreachable(plan, radius))


def _geometric(plan: FloorPlan) -> Iterator[Flaw]:
    for space in plan.spaces:
        for dimension in ("thickness", "height"):
            size = getattr(space.walls[0], dimension)
            message = f"the walls of {space.name} have no {dimension}"
            yield Flaw(f"{dimension} {space.name}", float(size <= 0.0), 0.0, space.where, message)
    yield from geometric_flaws(plan)


def _unreachable(plan: FloorPlan, radius: float) -> Iterator[Flaw]:
    """Yield the spaces outside the part of the free floor that reaches most spaces."""
    import shapely

    from grammars.model.free_space import FreeSpace
    from grammars.scenery.composition import compile_scene

    parts = FreeSpace(compile_scene(plan, ()), _LOW).for_radius(radius).parts
    rooms = [shapely.Polygon(space.outline) for space in plan.spaces]
    reachable = [
        {k for k, room in enumerate(rooms) if part.intersection(room).area > _STANDING}
        for part in parts
    ]
    main: set[int] = max(reachable, key=len, default=set())
    for k, space in enumerate(plan.spaces):
        if k not in main:
            message = f"{space.name} cannot be reached with a radius of {radius:g} m"
            yield Flaw(f"reach {space.name}", 1.0, 0.0, space.where, message)
