"""What an outline implies: whether published walls are those the language would make."""

from __future__ import annotations

import math
from typing import Final

from grammars.floorplan import Space
from grammars.floorplan._placement import space_at
from grammars.values import Pose2, Ring

_SAME: Final = 1e-9


def implied(space: Space, ring: Ring) -> bool:
    """Return whether the walls of a space are those its outline ``ring`` (own frame) implies."""
    return implied_space(space, ring) is not None


def implied_space(space: Space, ring: Ring) -> Space | None:
    """Return the space that the language makes of ``ring``, if ``space`` is the same."""
    if not space.walls or len(space.walls) != len(ring) or not has_mitres(ring):
        return None
    first = space.walls[0]
    made = space_at(space.name, space.frame, ring, first.thickness, first.height, space.where)
    return made if same_walls(made, space) else None


def is_polygon(ring: Ring) -> bool:
    """Return whether a ring has an area."""
    pairs = zip(ring, ring[1:] + ring[:1], strict=True)
    return abs(sum(p[0] * q[1] - q[0] * p[1] for p, q in pairs)) > _SAME


def has_mitres(ring: Ring) -> bool:
    """Return whether every corner has one: no edge without length, none that turns back."""
    edges = [(q[0] - p[0], q[1] - p[1]) for p, q in zip(ring, ring[1:] + ring[:1], strict=True)]
    if any(math.hypot(*edge) < _SAME for edge in edges):
        return False
    units = [(x / math.hypot(x, y), y / math.hypot(x, y)) for x, y in edges]
    turns = zip(units[-1:] + units[:-1], units, strict=True)
    return all(1.0 + a[0] * b[0] + a[1] * b[1] > _SAME for a, b in turns)


def same_walls(one: Space, other: Space) -> bool:
    """Return whether two spaces have the same walls, to a nanometre."""
    return all(
        a.thickness == b.thickness
        and a.height == b.height
        and _close(a.frame, b.frame)
        and all(math.dist(p, q) < _SAME for p, q in zip(a.footprint, b.footprint, strict=True))
        for a, b in zip(one.walls, other.walls, strict=True)
    )


def _close(a: Pose2, b: Pose2) -> bool:
    turn = abs(math.remainder(a.yaw - b.yaw, math.tau))
    return math.dist((a.x, a.y), (b.x, b.y)) < _SAME and turn < _SAME
