"""What becomes of behaviours that wait for something when parts of a run are taken away."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

from grammars.behaviour import (
    Behaviour,
    Event,
    JointActs,
    LegBegins,
    Reaction,
    Walk,
    WaypointReached,
)
from grammars.mission import Waypoint


@dataclass(frozen=True, slots=True)
class Surviving:
    """Joints and waypoints that are left; ``indices`` are the waypoints' places in the whole."""

    joints: frozenset[str]
    indices: tuple[int, ...]
    waypoints: tuple[Waypoint, ...]


def without_lost(behaviours: Iterable[Behaviour], left: Surviving) -> tuple[Behaviour, ...]:
    """Return behaviours of the joints that are left, legs numbered anew.

    Raises ``ValueError`` for one that waits for what is not there any more: its run would be
    another one, not a smaller one.
    """
    return tuple(_adapted(b, left) for b in behaviours if b.joint in left.joints)


def _adapted(behaviour: Behaviour, left: Surviving) -> Behaviour:
    if not isinstance(behaviour, Reaction | Walk) or behaviour.event is None:
        return behaviour
    event = _event(behaviour.event, left)
    if event is None:
        raise ValueError(f"{behaviour.joint} waits for what is not there")
    return dataclasses.replace(behaviour, event=event)


def _event(event: Event, left: Surviving) -> Event | None:
    match event:
        case LegBegins(leg=leg):
            return LegBegins(left.indices.index(leg - 1) + 1) if leg - 1 in left.indices else None
        case WaypointReached(waypoint=name):
            return event if any(w.id == name for w in left.waypoints) else None
        case JointActs(joints=joints, act=act):
            there = tuple(joint for joint in joints if joint in left.joints)
            return JointActs(there, act) if there else None
