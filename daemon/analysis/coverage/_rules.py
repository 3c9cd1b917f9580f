"""Facts about a run, and the rules for features that need more than a line.

A run is a specification, perhaps with a trace; the model describes each rule.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Collection
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
import shapely

from daemon.judging.oracles import written_oracle
from daemon.model.spec import OracleText, RunSpec
from grammars.model.behaviour import Behaviour, JointEvent, Walk, joint_event
from grammars.model.geometry import Point2
from grammars.model.movers import own_joints
from grammars.model.scene import Joint, Region, Scene
from grammars.oracle import Reached

if TYPE_CHECKING:
    from daemon.trace import Trace

MOVED: Final = 0.01
"""Distance from its start at which a joint has moved [rad or m]."""
MISSION: Final = "mission"
"""Name of the mission among the signals of an oracle: ``reached(mission, …)``."""
# The paper names the features without their bounds; these are ours, except SPARE.
FAR: Final = 15.0
"""Distance [m] from which on two waypoints are far from each other."""
FEW: Final = 5
"""More waypoints than this are many."""
SPARE: Final = 0.2
"""Room [m] on either side of the robot below which a doorway is narrow: the safety distance of the
paper (section 4.3)."""
SAME: Final = 0.5
"""Points nearer than this [m] are the same place."""


@dataclass(frozen=True)
class RunFacts:
    """Facts of a run; ``trace`` is ``None`` for a run that is only planned.

    ``judged`` are the signals of oracles with a limit, ``measured`` those of all oracles.
    """

    spec: RunSpec
    scene: Scene
    judged: frozenset[str]
    measured: frozenset[str]
    trace: Trace | None = None

    def judges(self, *names: str) -> bool:
        """Return whether an oracle with a limit reads a signal of these names or below them."""
        return _has_signal(self.judged, names)

    def measures(self, *names: str) -> bool:
        """Return whether any oracle, a mere measure included, reads such a signal."""
        return _has_signal(self.measured, names)

    def has_behaviour(self, *kinds: type[Behaviour]) -> bool:
        """Return whether a joint has a behaviour of one of these kinds."""
        return any(isinstance(behaviour, kinds) for behaviour in self.spec.behaviours)

    @property
    def points(self) -> tuple[Point2, ...]:
        """The start and every waypoint, in order [m]."""
        mission = self.spec.mission
        start = (mission.start.x, mission.start.y)
        return (start, *((w.x, w.y) for w in mission.waypoints))

    @functools.cached_property
    def rooms(self) -> frozenset[str]:
        """Regions of the mission's points, the first of overlapping ones; empty outside of all."""
        x, y = np.array(self.points).T
        rooms, outside = set(), np.ones(len(x), np.bool_)
        for region in self.scene.regions:
            inside = outside & shapely.intersects_xy(region_polygon(region), x, y)
            if inside.any():
                rooms.add(region.name)
            outside &= ~inside
        return frozenset(rooms | {""}) if outside.any() else frozenset(rooms)

    @property
    def longest_leg(self) -> float:
        """Longest straight line from one point of the mission to the next [m]."""
        return max((math.dist(a, b) for a, b in pairwise(self.points)), default=0.0)

    @property
    def own_joints(self) -> tuple[Joint, ...]:
        """Joints of objects that have room to move, without those of walking movers."""
        return tuple(joint for one in self.scene.objects for joint in own_joints(one.joints))

    def logged(self, event: JointEvent) -> bool:
        """Return whether a joint acted so by the log of the world; only with a trace."""
        events = self.trace.events if self.trace is not None else ()
        return any(joint_event(one.text) is event for one in events)


def run_facts(spec: RunSpec, scene: Scene, trace: Trace | None = None) -> RunFacts:
    """Return the facts of a run, and of its trace if there is one."""
    oracles = [_oracle_signals(oracle.text) for oracle in spec.oracles]
    judged = frozenset[str]().union(*(signals for signals, judges in oracles if judges))
    measured = frozenset[str]().union(*(signals for signals, _ in oracles))
    return RunFacts(spec, scene, judged, measured, trace)


@functools.lru_cache(maxsize=256)
def _oracle_signals(text: str) -> tuple[frozenset[str], bool]:
    """Return the signals that an oracle judges, and whether it has a limit."""
    oracle = written_oracle(OracleText("", text))
    if oracle is None:
        return frozenset(), False  # its verdict is an error
    # A guard only says when to judge: with a guard on a door it is not an oracle about doors.
    judged = dataclasses.replace(oracle, guard=None)
    names = {signal.name for signal in judged.signals()}
    if isinstance(oracle.judgement, Reached):
        names.add(MISSION)
    return frozenset(names), not oracle.is_measure


def _has_signal(signals: frozenset[str], names: tuple[str, ...]) -> bool:
    return any(
        signal == name or signal.startswith(f"{name}.") for signal in signals for name in names
    )


@functools.lru_cache(maxsize=1024)
def region_polygon(region: Region) -> shapely.Polygon:
    """Return the floor of a region with its border, prepared for many queries."""
    polygon = shapely.Polygon(region.outline, region.holes)
    shapely.prepare(polygon)
    return polygon


def perfect_odometry(facts: RunFacts) -> bool:
    noise = facts.spec.robot.odometry
    return noise.translation == noise.rotation == noise.drift == 0.0


def crossed_rooms(facts: RunFacts) -> bool:
    """Return whether the robot has been in two of the rooms its mission is about."""
    if facts.trace is None:
        return False
    truth, rooms = facts.trace.ground_truth, facts.rooms
    # The first pose of each second is enough: no robot crosses a room in less.
    seconds = np.flatnonzero(np.diff(np.floor(truth.time), prepend=-np.inf))
    regions = [region_polygon(region) for region in facts.scene.regions if region.name in rooms]
    x, y = truth.x[seconds], truth.y[seconds]
    return sum(bool(shapely.intersects_xy(floor, x, y).any()) for floor in regions) > 1


def circuit(facts: RunFacts) -> bool:
    points = facts.points
    return len(points) > 2 and any(
        math.dist(point, earlier) < SAME
        for index, point in enumerate(points)
        for earlier in points[: max(0, index - 1)]
    )


def narrow_doorways(facts: RunFacts) -> bool:
    across = [y for _, y in facts.spec.robot.footprint]
    least = max(across) - min(across) + 2.0 * SPARE
    return any(door.z_min <= 0.0 and door.width < least for door in facts.scene.doorways)


def pushable(facts: RunFacts) -> bool:
    driven = {behaviour.joint for behaviour in facts.spec.behaviours}
    return any(
        f"{thing.name}.{joint.name}" not in driven
        for thing in facts.scene.objects
        if not thing.frozen
        for joint in own_joints(thing.joints)
    )


def walked(facts: RunFacts) -> bool:
    """Return whether any walking joint has left its start."""
    if facts.trace is None:
        return False
    walks = {b.joint for b in facts.spec.behaviours if isinstance(b, Walk)}
    names = facts.trace.joints.names
    walking = {name for name in names if name.rpartition(".")[0] + ".x" in walks}
    return has_moved(facts.trace, walking)


def has_moved(trace: Trace, joints: Collection[str]) -> bool:
    """Return whether any of the ``joints``, by scene-wide names, has left its start."""
    columns = [i for i, name in enumerate(trace.joints.names) if name in joints]
    # Compare with the start, not with the last sample: a slow door moves little between two.
    position = trace.joints.position[:, columns]
    return bool(position.size and (np.abs(position - position[0]) > MOVED).any())
