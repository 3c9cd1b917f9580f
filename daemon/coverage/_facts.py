"""What the rules of the feature model look at: one run, told before or after it was executed."""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from grammars.behaviour import Behaviour
from grammars.diagnostics import InputError, Where
from grammars.movers import is_mover, own_joints
from grammars.oracle import Reached, parse_oracle, signals_of
from grammars.scene import Scene, SceneObject
from grammars.values import Point2, Ring

if TYPE_CHECKING:
    from daemon.spec import RunSpec
    from daemon.trace import Trace

MOVED = 0.01
"""A joint has moved once it is this far from where it started [rad or m]."""
MISSION = "mission"
"""Stands for the mission among the signals an oracle reads: ``reached(mission, …)``."""


@dataclass(frozen=True, slots=True)
class Asked:
    """An oracle as far as objectives go: the signals it reads, whether it has a limit."""

    signals: frozenset[str]
    judges: bool


@dataclass(frozen=True, slots=True)
class Facts:
    """A run to recognise features in; ``trace`` is ``None`` for one that is only planned."""

    spec: RunSpec
    scene: Scene
    asked: tuple[Asked, ...]
    rooms: tuple[str, ...]
    trace: Trace | None = None

    def judges(self, *names: str) -> bool:
        """Say whether an oracle with a limit reads a signal of these names or below them."""
        return any(one.judges and _reads(one, names) for one in self.asked)

    def measures(self, *names: str) -> bool:
        """Say whether any oracle, a mere measure included, reads such a signal."""
        return any(_reads(one, names) for one in self.asked)

    def behaves(self, *kinds: type[Behaviour]) -> bool:
        """Say whether a joint has a behaviour of one of these kinds."""
        return any(isinstance(behaviour, kinds) for behaviour in self.spec.behaviours)

    @property
    def points(self) -> tuple[Point2, ...]:
        """The start and every waypoint, in order [m]."""
        mission = self.spec.mission
        start = (mission.start.x, mission.start.y)
        return (start, *((w.x, w.y) for w in mission.waypoints))

    @property
    def longest_leg(self) -> float:
        """Longest straight line from one point of the mission to the next [m]."""
        return max((math.dist(a, b) for a, b in pairwise(self.points)), default=0.0)

    def happened(self, *beginnings: str) -> bool:
        """Say whether the log of the world has a line that begins so; only with a trace."""
        events = self.trace.events if self.trace is not None else ()
        return any(event.text.startswith(beginnings) for event in events)


def facts_of(spec: RunSpec, scene: Scene, trace: Trace | None = None) -> Facts:
    """Return what rules look at."""
    asked = tuple(_asked(oracle.text) for oracle in spec.oracles)
    facts = Facts(spec, scene, asked, (), trace)
    rooms = tuple(room_at(scene, point) for point in facts.points)
    return dataclasses.replace(facts, rooms=rooms)


@functools.lru_cache(maxsize=256)
def _asked(text: str) -> Asked:
    """Read an oracle; one that cannot be read asks for nothing (its verdict says so)."""
    try:
        oracle = parse_oracle("", text, Where("an oracle"))
    except InputError:
        return Asked(frozenset(), False)
    judged = dataclasses.replace(oracle, guard=None)
    names = {signal.name for signal in signals_of(judged)}
    if isinstance(oracle.judgement, Reached):
        names.add(MISSION)
    return Asked(frozenset(names), not oracle.is_measure)


def _reads(asked: Asked, names: tuple[str, ...]) -> bool:
    return any(
        signal == name or signal.startswith(f"{name}.")
        for signal in asked.signals
        for name in names
    )


def room_at(scene: Scene, point: Point2) -> str:
    """Return the region a point stands in, empty outside of all; the first one where they meet."""
    return next((r.name for r in scene.regions if inside(r.outline, point)), "")


def inside(ring: Ring, point: Point2) -> bool:
    """Say whether a point lies in a simple polygon (even-odd rule; its border counts by half)."""
    x, y = point
    found = False
    for (ax, ay), (bx, by) in zip(ring, (*ring[1:], *ring[:1]), strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            found = not found
    return found


def doors_of(scene: Scene) -> tuple[SceneObject, ...]:
    """Return the articulated objects: those with a joint that has room to move, no movers."""
    return tuple(
        thing for thing in scene.objects if not is_mover(thing.joints) and own_joints(thing.joints)
    )
