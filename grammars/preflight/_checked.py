"""A scene under check: the floor that its parts cover, and the findings about it."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from grammars.floorplan import FloorPlan
from grammars.model.behaviour import Behaviour, Hold, Walk, start_positions
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
"""Width of slits between doorway and room that rounding may leave [m]."""
Range: TypeAlias = tuple[str, tuple[float, float]]
"""The name of a joint and its range of motion [rad or m]."""


def places_of(layers: Iterable[SceneryLayer], plan: FloorPlan | None = None) -> dict[str, Where]:
    """Return the places of all objects by name, and of the entryways of ``plan``."""
    places = {o.name: o.where for o in plan.openings} if plan is not None else {}
    places.update((i.name, i.where) for layer in layers for i in layer.instances)
    return places


@dataclass(frozen=True, slots=True)
class Footprint:
    """The floor that a link covers at one position, or during a motion.

    The joints of its object can move a ``jointed`` link, unless the object is frozen.
    """

    body: SceneObject
    link: Link
    shape: BaseGeometry
    jointed: bool

    @property
    def moves(self) -> bool:
        """``True`` if the link can move."""
        return self.jointed and not self.body.frozen

    def meets(self, other: Footprint) -> bool:
        """Return whether the links overlap at some height by more than touching."""
        return (
            self.link.z_min < other.link.z_max
            and other.link.z_min < self.link.z_max
            and is_overlap(self.shape.intersection(other.shape))
        )


def footprints(body: SceneObject, positions: Sequence[float]) -> list[Footprint]:
    """Return the footprints of the links of ``body`` at joint ``positions`` [rad or m]."""
    shapes = link_shapes(body, positions)
    jointed = {link.name for link in moving_links(body)}
    return [
        Footprint(body, link, shapes[link.name], link.name in jointed)
        for link in body.links
        if link.polygons
    ]


@functools.lru_cache(maxsize=256)
def sweeps(body: SceneObject, ranges: tuple[Range, ...]) -> tuple[Footprint, ...]:
    """Return the swept footprints of moving links while each joint moves alone through its range.

    The cache helps because scenarios and points of a search mostly change times, not ranges.
    """
    limits = dict(ranges)
    # While one joint moves, the others are at their start, which a behaviour may set.
    initial = tuple(
        min(max(q, limits[j.name][0]), limits[j.name][1]) if j.name in limits else q
        for j, q in zip(body.joints, body.initial, strict=True)
    )
    start = replace(body, initial=initial)
    return tuple(
        Footprint(body, link, swept_area(start, link, limits), jointed=True)
        for link in moving_links(body)
    )


def meetings(
    parts: Sequence[Footprint],
    others: Iterable[Footprint] = (),
    *,
    but: Collection[frozenset[str]] = (),
) -> dict[frozenset[str], tuple[Footprint, Footprint]]:
    """Return overlaps of ``parts`` with each other and ``others``, one for each pair of objects.

    Pairs of names in ``but`` are left out.
    """
    rows = [*parts, *others]
    shapes = np.array([row.shape for row in rows], dtype=object)
    near = shapely.STRtree(shapes).query(shapes[: len(parts)], predicate="intersects")
    overlaps: dict[frozenset[str], tuple[Footprint, Footprint]] = {}
    for first, second in sorted(near.T.tolist()):
        one, other = rows[first], rows[second]
        pair = frozenset({one.body.name, other.body.name})
        if first >= second or len(pair) == 1 or pair in but:
            continue
        # Prefer an overlap of moving links, which tells more.
        if not any(part.moves for part in overlaps.get(pair, ())) and one.meets(other):
            overlaps[pair] = (one, other)
    return overlaps


class SceneFloor:
    """The floor covered by the parts of a scene, the same for all its runs.

    Attributes:
        solids: walls, columns and dividers.
        rooms: floors of all spaces, then of all doorways.
        start: footprints of all links at the start.
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
    """Return the free floor below ``height`` [m], the same for all missions of a scene."""
    return FreeSpace(scene, height)


@dataclass(frozen=True)
class CheckedScene:
    """A scene under check with its findings.

    ``places`` maps names of objects, entryways and joints to places, ``home`` is the place of all
    others; ``behaviours`` are those of a run.
    """

    scene: Scene
    places: Mapping[str, Where]
    home: Where
    behaviours: Sequence[Behaviour] = ()
    findings: Findings = field(default_factory=Findings)

    @functools.cached_property
    def floor(self) -> SceneFloor:
        """The floor covered by the parts of the scene."""
        return _floor(self.scene)

    @functools.cached_property
    def ranges(self) -> dict[str, dict[str, tuple[float, float]]]:
        """Ranges of joint motion by behaviours [rad or m], by object and joint."""
        ranges: dict[str, dict[str, tuple[float, float]]] = {}
        for behaviour in self.behaviours:
            if not isinstance(behaviour, Walk):
                name, _, joint = behaviour.joint.partition(".")
                positions = behaviour.positions
                ranges.setdefault(name, {})[joint] = (min(positions), max(positions))
        return ranges

    @functools.cached_property
    def at_start(self) -> list[Footprint]:
        """Footprints of all links at the start of the run, where behaviours set it."""
        joints = start_positions(self.scene, self.behaviours)
        moved = {}
        for body in self.scene.objects:
            positions = [joints[f"{body.name}.{joint.name}"] for joint in body.joints]
            if positions != [*body.initial]:
                moved[body.name] = footprints(body, positions)
        still = (part for part in self.floor.start if part.body.name not in moved)
        return [*still, *itertools.chain.from_iterable(moved.values())]

    @functools.cached_property
    def shut(self) -> dict[str, list[Footprint]]:
        """Movable parts that never move, by object: frozen and held doors, movers at rest."""
        walking = {b.object for b in self.behaviours if isinstance(b, Walk)}
        holds = {b.joint: b.position for b in self.behaviours if isinstance(b, Hold)}
        shut = {}
        for body in self.scene.objects:
            names = [f"{body.name}.{joint.name}" for joint in body.joints]
            stays = all(f"{body.name}.{j.name}" in holds for j in own_joints(body.joints))
            if body.name not in walking and (body.frozen or stays):
                targets = {} if body.frozen else holds
                positions = map(targets.get, names, body.initial)
                shut[body.name] = [p for p in footprints(body, [*positions]) if p.jointed]
        return {name: parts for name, parts in shut.items() if parts}

    def shut_below(self, height: float) -> dict[str, list[BaseGeometry]]:
        """Return the outlines of shut parts below ``height`` [m], by object."""
        below = {
            name: [part.shape for part in parts if part.link.z_min < height]
            for name, parts in self.shut.items()
        }
        return {name: shapes for name, shapes in below.items() if shapes}

    def walls_at(self, part: Footprint) -> list[str]:
        """Return the owners of the walls, columns and dividers that overlap a part."""
        hits = self.floor.solids.hit_by(part.shape, part.link.z_min, part.link.z_max)
        # Leaves of doors turn in rebates; posts of doors and movers do not.
        is_leaf = part.jointed and not is_mover(part.body.joints)
        return [
            owner
            for owner, overlap in hits.items()
            if is_overlap(without_jamb(part.body, part.link, overlap) if is_leaf else overlap)
        ]

    def place(self, name: str) -> Where:
        """Return the place of a joint, otherwise of its object, otherwise ``home``."""
        owner = name.partition(".")[0]
        return self.places.get(name) or self.places.get(owner) or self.home

    def error(self, of: str | Where, message: str, hint: str = "") -> None:
        """Add an error at a place, or at the place of a name."""
        self.findings.error(of if isinstance(of, Where) else self.place(of), message, hint)

    def warn(self, of: str | Where, message: str, hint: str = "") -> None:
        """Add a warning at a place, or at the place of a name."""
        self.findings.warning(of if isinstance(of, Where) else self.place(of), message, hint)
