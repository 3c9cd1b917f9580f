"""Objects seen in a mirror: a door with its hinge on the other side."""

from __future__ import annotations

import dataclasses

from grammars.scene import Joint, Link
from grammars.values import Point2


def mirrored_links(links: tuple[Link, ...], across: Point2) -> tuple[Link, ...]:
    """Return links reflected about the line through the origin along the axis ``across``."""
    return tuple(
        dataclasses.replace(
            link, polygons=tuple(tuple(_reflect(p, across) for p in r) for r in link.polygons)
        )
        for link in links
    )


def mirrored_joints(joints: tuple[Joint, ...], across: Point2) -> tuple[Joint, ...]:
    """Return joints reflected the same way; what turned left turns right."""
    return tuple(
        dataclasses.replace(joint, axis=_reflect(joint.axis, across))
        if joint.kind == "prismatic"
        else dataclasses.replace(
            joint,
            anchor=_reflect(joint.anchor, across),
            lower=-joint.upper + 0.0,
            upper=-joint.lower + 0.0,
            rest=-joint.rest + 0.0,
        )
        for joint in joints
    )


def _reflect(point: Point2, across: Point2) -> Point2:
    along = point[0] * across[0] + point[1] * across[1]
    return (2 * along * across[0] - point[0], 2 * along * across[1] - point[1])
