"""What leaves start in and sweep through: walls, columns, other objects."""

from __future__ import annotations

from collections.abc import Container

import shapely
from shapely.geometry.base import BaseGeometry

from grammars.model.free_space import is_overlap, link_shape, moving_links, without_jamb
from grammars.model.movers import is_mover
from grammars.model.scene import Link, SceneObject
from grammars.preflight._checked import CheckedScene
from grammars.text.diagnostics import Diagnostic, Severity

Sweeps = list[tuple[SceneObject, Link, BaseGeometry]]


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


def object_hits(
    checked: CheckedScene, sweeps: Sweeps, when: str, said: Container[frozenset[str]] = ()
) -> list[Diagnostic]:
    """Return a warning for every leaf whose sweep meets another object (its own or its place).

    Pairs of names in ``said`` are left out.
    """
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
            if frozenset({body.name, other.name}) in said:
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
