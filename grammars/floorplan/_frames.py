"""Published frames: one identifier for every frame of a plan."""

from __future__ import annotations

from grammars.floorplan.model import FloorPlan
from grammars.values import Pose2

WORLD_FRAME = "world-frame"


def frames(plan: FloorPlan) -> dict[str, Pose2]:
    """Return the world pose of every published frame by its identifier, in source order.

    ``world-frame``, ``<space>-frame``, ``<space>-wall-<i>-frame``, ``column-<id>-frame``,
    ``divider-<id>-frame``, ``entryway-<id>-frame`` and ``window-<id>-frame``. The frame of an
    opening is the one on the floor; its height is :attr:`Opening.z`.
    """
    found = {WORLD_FRAME: Pose2()}
    for space in plan.spaces:
        found[f"{space.name}-frame"] = space.frame
        found.update((f"{wall.id}-frame", wall.frame) for wall in space.walls)
    found.update((f"{f.kind}-{f.id}-frame", f.frame) for f in plan.features)
    found.update((f"{o.kind}-{o.id}-frame", o.frame) for o in plan.openings)
    return found


def frame_of(plan: FloorPlan, id: str) -> Pose2:
    """Return the world pose of one published frame; raises :class:`KeyError` if there is none."""
    return frames(plan)[id]
