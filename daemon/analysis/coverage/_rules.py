"""Facts about a run that features are recognised by, and the rules that take more than a line.

A run is told before or after it was executed; see the model for what each rule means.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from grammars.model.behaviour import Behaviour, JointEvent, KeyFrames, Reaction, Walk, joint_event
from grammars.model.geometry import Floats, Point2, Ring
from grammars.model.movers import is_mover, own_joints
from grammars.model.robot import Robot
from grammars.model.scene import Region, Scene, SceneObject
from grammars.oracle import Reached, parse_oracle
from grammars.text.diagnostics import InputError, Where

if TYPE_CHECKING:
    from daemon.model.spec import RunSpec
    from daemon.trace import Trace

Mask: TypeAlias = npt.NDArray[np.bool_]

MOVED = 0.01
"""A joint has moved once it is this far from where it started [rad or m]."""
MISSION = "mission"
"""Stands for the mission among the signals an oracle reads: ``reached(mission, …)``."""


@dataclass(frozen=True, slots=True)
class OracleSignals:
    """An oracle as far as objectives go: the signals it reads, whether it has a limit."""

    signals: frozenset[str]
    judges: bool


@dataclass(frozen=True, slots=True)
class RunFacts:
    """A run to recognise features in; ``trace`` is ``None`` for one that is only planned."""

    spec: RunSpec
    scene: Scene
    asked: tuple[OracleSignals, ...]
    rooms: tuple[str, ...]
    trace: Trace | None = None

    def judges(self, *names: str) -> bool:
        """Say whether an oracle with a limit reads a signal of these names or below them."""
        return any(one.judges and _reads_signal(one, names) for one in self.asked)

    def measures(self, *names: str) -> bool:
        """Say whether any oracle, a mere measure included, reads such a signal."""
        return any(_reads_signal(one, names) for one in self.asked)

    def has_behaviour(self, *kinds: type[Behaviour]) -> bool:
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

    def logged(self, wanted: JointEvent) -> bool:
        """Say whether a joint acted so by the log of the world; only with a trace."""
        events = self.trace.events if self.trace is not None else ()
        return any(joint_event(event.text) is wanted for event in events)


def run_facts(spec: RunSpec, scene: Scene, trace: Trace | None = None) -> RunFacts:
    """Return what rules look at."""
    asked = tuple(_oracle_signals(oracle.text) for oracle in spec.oracles)
    facts = RunFacts(spec, scene, asked, (), trace)
    rooms = tuple(room_at(scene, point) for point in facts.points)
    return dataclasses.replace(facts, rooms=rooms)


@functools.lru_cache(maxsize=256)
def _oracle_signals(text: str) -> OracleSignals:
    """Read an oracle; one that cannot be read asks for nothing (its verdict says so)."""
    try:
        oracle = parse_oracle("", text, Where("an oracle"))
    except InputError:
        return OracleSignals(frozenset(), False)
    # What only says when to judge is not what is judged: a guard on a door makes no door oracle.
    judged = dataclasses.replace(oracle, guard=None)
    names = {signal.name for signal in judged.signals()}
    if isinstance(oracle.judgement, Reached):
        names.add(MISSION)
    return OracleSignals(frozenset(names), not oracle.is_measure)


def _reads_signal(asked: OracleSignals, names: tuple[str, ...]) -> bool:
    return any(
        signal == name or signal.startswith(f"{name}.")
        for signal in asked.signals
        for name in names
    )


def room_at(scene: Scene, point: Point2) -> str:
    """Return the region a point stands in, empty outside of all; the first one where they meet."""
    return next((r.name for r in scene.regions if _has_point(r, point)), "")


def _has_point(region: Region, point: Point2) -> bool:
    in_hole = any(contains_point(hole, point) for hole in region.holes)
    return contains_point(region.outline, point) and not in_hole


def contains_point(ring: Ring, point: Point2) -> bool:
    """Say whether a point lies in a simple polygon (even-odd rule; its border counts by half).

    Not by shapely, to which a border is outside: a waypoint on the line between two rooms is in one
    of them, and :func:`daemon.analysis.coverage.room_cells` counts cells by the same rule.
    """
    x, y = point
    found = False
    for (ax, ay), (bx, by) in zip(ring, (*ring[1:], *ring[:1]), strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            found = not found
    return found


def articulated_objects(scene: Scene) -> tuple[SceneObject, ...]:
    """Return the articulated objects: those with a joint that has room to move, no movers."""
    return tuple(
        thing for thing in scene.objects if not is_mover(thing.joints) and own_joints(thing.joints)
    )


# The paper names the features, not where one ends and the next begins; these are ours but SPARE.
FAR: Final = 15.0
"""Waypoints this far apart [m] are far from each other."""
FEW: Final = 5
"""More waypoints than this are many."""
SPARE: Final = 0.2
"""A doorway with less room than this [m] on either side of the robot is narrow: the safety
distance of the paper (section 4.3)."""
SAME: Final = 0.5
"""Points nearer than this [m] are the same place."""


def robustness(facts: RunFacts) -> bool:
    changes = facts.has_behaviour(KeyFrames, Reaction, Walk)
    return changes and any(one.judges for one in facts.asked)


def perfect_odometry(facts: RunFacts) -> bool:
    noise = facts.spec.robot.odometry
    return noise.translation == noise.rotation == noise.drift == 0.0


def crossed_rooms(facts: RunFacts) -> bool:
    """Say whether the robot has been in two of the rooms its mission is about."""
    if facts.trace is None:
        return False
    truth, wanted = facts.trace.ground_truth, set(facts.rooms) - {""}
    # The first pose of each second is enough: no robot crosses a room in less.
    kept = np.flatnonzero(np.diff(np.floor(truth.time), prepend=-np.inf))
    return len(_rooms_entered(facts.scene, truth.x[kept], truth.y[kept]) & wanted) > 1


def _rooms_entered(scene: Scene, x: Floats, y: Floats) -> set[str]:
    """Return what :func:`room_at` says of all points (n,), each once; nothing outside of rooms."""
    found: set[str] = set()
    outside: Mask = np.ones(len(x), np.bool_)
    for region in scene.regions:
        inside = _contains_points(region.outline, x, y)
        for hole in region.holes:
            inside &= ~_contains_points(hole, x, y)
        if (inside & outside).any():
            found.add(region.name)
        outside &= ~inside
    return found


def _contains_points(ring: Ring, x: Floats, y: Floats) -> Mask:
    """Say of points (n,) what :func:`contains_point` says of one."""
    found: Mask = np.zeros(len(x), np.bool_)
    for (ax, ay), (bx, by) in zip(ring, (*ring[1:], *ring[:1]), strict=True):
        if ay != by:
            found ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / (by - ay))
    return found


def circuit(facts: RunFacts) -> bool:
    points = facts.points
    return len(points) > 2 and any(
        math.dist(point, earlier) < SAME
        for index, point in enumerate(points)
        for earlier in points[: max(0, index - 1)]
    )


def narrow_doorways(facts: RunFacts) -> bool:
    least = _width(facts.spec.robot) + 2.0 * SPARE
    return any(door.z_min <= 0.0 and door.width < least for door in facts.scene.doorways)


def _width(robot: Robot) -> float:
    across = [y for _, y in robot.footprint]
    return max(across) - min(across)


def hinged(facts: RunFacts) -> bool:
    return any(
        joint.kind == "revolute" for o in facts.scene.objects for joint in own_joints(o.joints)
    )


def sliding(facts: RunFacts) -> bool:
    return any(
        joint.kind == "prismatic" for o in facts.scene.objects for joint in own_joints(o.joints)
    )


def furniture(facts: RunFacts) -> bool:
    return any(not own_joints(o.joints) and not is_mover(o.joints) for o in facts.scene.objects)


def pushable(facts: RunFacts) -> bool:
    spoken_of = {behaviour.joint for behaviour in facts.spec.behaviours}
    return any(
        f"{thing.name}.{joint.name}" not in spoken_of
        for thing in facts.scene.objects
        if not thing.frozen
        for joint in own_joints(thing.joints)
    )


def walked(facts: RunFacts) -> bool:
    """Say whether any walking joint has left where it stood."""
    if facts.trace is None:
        return False
    track, walks = (
        facts.trace.joints,
        {b.joint for b in facts.spec.behaviours if isinstance(b, Walk)},
    )
    columns = [i for i, name in enumerate(track.names) if name.rpartition(".")[0] + ".x" in walks]
    if not columns or not len(track.time):
        return False
    position = track.position[:, columns]
    return bool((np.abs(position - position[0]) > MOVED).any())
