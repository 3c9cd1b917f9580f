"""Checking oracles against a scene and a mission: each object, place and leg they name is there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from grammars.model.mission import Mission
from grammars.model.movers import is_mover
from grammars.model.scene import Joint, Scene, SceneObject
from grammars.oracle._model import ROBOT, Leg, Oracle, Reached, Signal, thing_of
from grammars.oracle._signals import SIGNALS, custom_signal_names, mover_hint
from grammars.text.diagnostics import Finding, did_you_mean
from grammars.text.words import count_noun


@dataclass(frozen=True, slots=True)
class JointReference:
    """A joint of a scene object, named by an object signal."""

    object: SceneObject
    joint: Joint


def object_signals(scene: Scene) -> dict[str, JointReference]:
    """Return the signals of scenery objects in ``scene`` and the joint each one reads."""
    found: dict[str, JointReference] = {}
    for item in scene.objects:
        for joint in item.joints:
            position = "angle" if joint.kind == "revolute" else "position"
            # Whoever has one joint need not name it: door_17.angle.
            prefixes = [f"{item.name}.{joint.name}"]
            if len(item.joints) == 1:
                prefixes.append(item.name)
            for prefix in prefixes:
                found[f"{prefix}.{position}"] = JointReference(item, joint)
                found[f"{prefix}.distance"] = JointReference(item, joint)
    return found


def check_references(oracle: Oracle, scene: Scene, mission: Mission) -> tuple[Finding, ...]:
    """Return what ``oracle`` speaks of that is not in ``scene`` or ``mission``."""
    known = object_signals(scene)
    everywhere = {*SIGNALS, *custom_signal_names()}
    found = []
    for signal in oracle.signals():
        if signal.name not in everywhere and signal.name not in known:
            found.append(_missing(oracle, signal, scene, known))
        declared = SIGNALS.get(signal.name)
        # The nodes of a tree are known to nobody but the stack.
        thing = thing_of(signal)
        if thing is not None and not (declared and declared.takes_node):
            things = _related_names(signal, scene)
            if thing.name not in things:
                found.append(_missing(oracle, thing, scene, things, signal.name))
    if isinstance(oracle.judgement, Reached) and not mission.waypoints:
        found.append(Finding(oracle.where, f'mission "{mission.name}" has no waypoints'))
    if oracle.leg is not None:
        try:
            leg_number(oracle.leg, mission)
        except ValueError as error:
            found.append(Finding(oracle.place(oracle.leg.column), str(error)))
    return tuple(found)


def obstacle_names(scene: Scene) -> tuple[str, ...]:
    """Return what clearance and contacts can be asked about: solids, objects and their links."""
    names = [solid.owner for solid in scene.solids]
    for item in scene.objects:
        names += [item.name, *(f"{item.name}.{link.name}" for link in item.links)]
    return tuple(dict.fromkeys(names))


def place_names(scene: Scene) -> tuple[str, ...]:
    """Return the parts of the floor the robot can be in: spaces and doorways."""
    names = [*(region.name for region in scene.regions), *(door.name for door in scene.doorways)]
    return tuple(dict.fromkeys(names))


def _related_names(signal: Signal, scene: Scene) -> tuple[str, ...]:
    """Return what may be named as the thing a signal is about."""
    declared = SIGNALS.get(signal.name)
    if declared is None or not declared.relates:
        return obstacle_names(scene)
    names = obstacle_names(scene) if "object" in declared.relates else ()
    return (*names, *place_names(scene))


def leg_number(leg: Leg, mission: Mission) -> int:
    """Return which waypoint ``leg`` leads to, from 1; raises ``ValueError`` when none or several.

    A mission may visit a waypoint more than once; its legs are then told apart by number.
    """
    count = len(mission.waypoints)
    if not leg.waypoint:
        if not 1 <= leg.number <= count:
            waypoints = count_noun(count, "waypoint")
            raise ValueError(f'no {leg} in mission "{mission.name}": it has {waypoints}')
        return leg.number
    ids = [waypoint.id for waypoint in mission.waypoints]
    found = [number for number, name in enumerate(ids, start=1) if name == leg.waypoint]
    if not found:
        hint = did_you_mean(leg.waypoint, ids)
        raise ValueError(f'no waypoint "{leg.waypoint}" in mission "{mission.name}": {hint}')
    if len(found) > 1:
        numbers = " and ".join(map(str, found))
        raise ValueError(f'legs {numbers} lead to "{leg.waypoint}": write the number of one')
    return found[0]


def _missing(
    oracle: Oracle, signal: Signal, scene: Scene, known: Iterable[str], asking: str = ""
) -> Finding:
    """Return that what a signal names is not there, or not what the signal ``asking`` takes."""
    message = f'no "{signal.name}" in scene "{scene.name}"'
    if signal.name in obstacle_names(scene):
        message = f'"{signal.name}" is no space or doorway, which {asking}({ROBOT}, …) takes'
    elif signal.name in place_names(scene):
        message = f'"{signal.name}" is a part of the floor, not an object'
    place = oracle.place(signal.column)
    owner = signal.name.rpartition(".")[0]
    if any(item.name == owner and is_mover(item.joints) for item in scene.objects):
        message = f'{owner} is a mover, which has no "{signal.name}"'
        return Finding(place, message, mover_hint(owner))
    return Finding(place, message, did_you_mean(signal.name, known))
