"""A scene under check: the floor that its parts cover, and what is found about them."""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from grammars.floorplan import FloorPlan
from grammars.model.behaviour import Behaviour, Hold, Walk
from grammars.model.free_space import (
    FreeSpace,
    SolidIndex,
    is_overlap,
    link_shapes,
    moving_links,
    swept_area,
    valid_polygon,
    without_jamb,
)
from grammars.model.geometry import Point2
from grammars.model.movers import is_mover, own_joints
from grammars.model.scene import Link, Scene, SceneObject
from grammars.scenery import SceneryLayer
from grammars.text.diagnostics import Findings, Where

_SLIT: Final = 0.02
"""Doorway and room share an edge only up to rounding: so wide a slit is part of both [m]."""
Range: TypeAlias = tuple[str, tuple[float, float]]
"""The name of a joint, and from where to where it moves [rad or m]."""


def places_of(layers: Iterable[SceneryLayer], plan: FloorPlan | None = None) -> dict[str, Where]:
    """Return the place of every object by its name, and of the entryways of ``plan``."""
    places = {o.name: o.where for o in plan.openings} if plan is not None else {}
    places.update((i.name, i.where) for layer in layers for i in layer.instances)
    return places


@dataclass(frozen=True, slots=True)
class Footprint:
    """The floor that a link covers where it is, or on all of its way.

    The joints of its object can move a ``jointed`` link, unless the object is frozen.
    """

    body: SceneObject
    link: Link
    shape: BaseGeometry
    jointed: bool

    @property
    def moves(self) -> bool:
        """Whether the link can move."""
        return self.jointed and not self.body.frozen

    def meets(self, other: Footprint) -> bool:
        """Return whether the links overlap in some height by more than touching."""
        return (
            self.link.z_min < other.link.z_max
            and other.link.z_min < self.link.z_max
            and is_overlap(self.shape.intersection(other.shape))
        )


def footprints(body: SceneObject, positions: Sequence[float]) -> list[Footprint]:
    """Return what the links of ``body`` cover when its joints are at ``positions`` [rad or m]."""
    shapes = link_shapes(body, positions)
    jointed = {link.name for link in moving_links(body)}
    return [
        Footprint(body, link, shapes[link.name], link.name in jointed)
        for link in body.links
        if link.polygons
    ]


@functools.lru_cache(maxsize=256)
def sweeps(body: SceneObject, ranges: tuple[Range, ...]) -> tuple[Footprint, ...]:
    """Return what the links that move cover while each joint moves alone through its range.

    Scenarios and the points of a search mostly differ in when a door moves, not in how far.
    """
    used = dict(ranges)
    # A joint is swept alone while the others stand at their start, and what a behaviour sets at
    # time 0 is never where the scene has it.
    initial = tuple(
        min(max(q, used[j.name][0]), used[j.name][1]) if j.name in used else q
        for j, q in zip(body.joints, body.initial, strict=True)
    )
    started = replace(body, initial=initial)
    return tuple(
        Footprint(body, link, swept_area(started, link, used), jointed=True)
        for link in moving_links(body)
    )


def meetings(
    parts: Sequence[Footprint],
    others: Iterable[Footprint] = (),
    *,
    but: Collection[frozenset[str]] = (),
) -> dict[frozenset[str], tuple[Footprint, Footprint]]:
    """Return where ``parts`` meet each other or ``others``, once for each pair of objects.

    The pairs of names in ``but`` are left out.
    """
    rows = [*parts, *others]
    # Each part meets few neighbours: by the tree not every pair is looked at.
    shapes = np.array([row.shape for row in rows], dtype=object)
    near = shapely.STRtree(shapes).query(shapes[: len(parts)], predicate="intersects")
    met: dict[frozenset[str], tuple[Footprint, Footprint]] = {}
    for first, second in sorted(near.T.tolist()):
        one, other = rows[first], rows[second]
        pair = frozenset({one.body.name, other.body.name})
        if first >= second or len(pair) == 1 or pair in but:
            continue
        # Of two objects the links that move say more than those that stand.
        if not any(part.moves for part in met.get(pair, ())) and one.meets(other):
            met[pair] = (one, other)
    return met


class SceneFloor:
    """What the parts of a scene cover of its floor; its runs have it in common.

    Attributes:
        solids: the walls, columns and dividers.
        rooms: the floor of every space, then that of every doorway.
        start: what the links of all objects cover at the start.
    """

    def __init__(self, scene: Scene) -> None:
        self.solids = SolidIndex(scene)
        rings = [r.outline for r in scene.regions] + [d.footprint for d in scene.doorways]
        self.rooms = np.array([valid_polygon(ring) for ring in rings], dtype=object)
        self.start = [part for body in scene.objects for part in footprints(body, body.initial)]

    def holds(self, point: Point2) -> bool:
        """Return whether a point is in a room or a doorway."""
        return bool(np.any(shapely.dwithin(self.rooms, Point(point), _SLIT)))


@functools.lru_cache(maxsize=4)
def _floor(scene: Scene) -> SceneFloor:
    return SceneFloor(scene)


@functools.lru_cache(maxsize=4)
def free_space(scene: Scene, height: float) -> FreeSpace:
    """Return the free floor below ``height`` [m], which all missions of a scene have in common."""
    return FreeSpace(scene, height)


@dataclass(frozen=True)
class CheckedScene:
    """A scene under check with what is found about it.

    ``places`` are those of objects, entryways and joints by name, ``home`` that of the rest;
    ``behaviours`` those of a run.
    """

    scene: Scene
    places: Mapping[str, Where]
    home: Where
    behaviours: Sequence[Behaviour] = ()
    findings: Findings = field(default_factory=Findings)

    @functools.cached_property
    def floor(self) -> SceneFloor:
        """What the parts of the scene cover."""
        return _floor(self.scene)

    @functools.cached_property
    def ranges(self) -> dict[str, dict[str, tuple[float, float]]]:
        """From where to where behaviours move joints [rad or m], by object and joint."""
        ranges: dict[str, dict[str, tuple[float, float]]] = {}
        for behaviour in self.behaviours:
            if not isinstance(behaviour, Walk):
                name, _, joint = behaviour.joint.partition(".")
                positions = behaviour.positions
                ranges.setdefault(name, {})[joint] = (min(positions), max(positions))
        return ranges

    @functools.cached_property
    def shut(self) -> dict[str, list[Footprint]]:
        """What could move and never does, by object: frozen and held doors, movers at rest."""
        walking = {b.object for b in self.behaviours if isinstance(b, Walk)}
        held = {b.joint: b.position for b in self.behaviours if isinstance(b, Hold)}
        shut = {}
        for body in self.scene.objects:
            names = [f"{body.name}.{joint.name}" for joint in body.joints]
            stays = all(f"{body.name}.{j.name}" in held for j in own_joints(body.joints))
            if body.name not in walking and (body.frozen or stays):
                told = {} if body.frozen else held
                positions = map(told.get, names, body.initial)
                shut[body.name] = [p for p in footprints(body, [*positions]) if p.jointed]
        return {name: parts for name, parts in shut.items() if parts}

    def shut_below(self, height: float) -> dict[str, list[BaseGeometry]]:
        """Return the outlines of what is shut below ``height`` [m], by object."""
        below = {
            name: [part.shape for part in parts if part.link.z_min < height]
            for name, parts in self.shut.items()
        }
        return {name: shapes for name, shapes in below.items() if shapes}

    def walls_at(self, part: Footprint) -> list[str]:
        """Return the owners of walls, columns and dividers that a part is in."""
        hits = self.floor.solids.hit_by(part.shape, part.link.z_min, part.link.z_max)
        # Doors turn in rebates; the posts of a door stand in the wall, and nobody hinges people.
        hung = part.jointed and not is_mover(part.body.joints)
        return [
            owner
            for owner, overlap in hits.items()
            if is_overlap(without_jamb(part.body, part.link, overlap) if hung else overlap)
        ]

    def place(self, name: str) -> Where:
        """Return the place of a joint, else of its object, else of everything."""
        owner = name.partition(".")[0]
        return self.places.get(name) or self.places.get(owner) or self.home

    def error(self, of: str | Where, message: str, hint: str = "") -> None:
        """Add an error about the thing of a name, or about what is written at a place."""
        self.findings.error(of if isinstance(of, Where) else self.place(of), message, hint)

    def warn(self, of: str | Where, message: str, hint: str = "") -> None:
        """Add a warning about the thing of a name, or about what is written at a place."""
        self.findings.warning(of if isinstance(of, Where) else self.place(of), message, hint)
