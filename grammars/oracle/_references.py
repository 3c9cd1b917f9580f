"""Checks of oracles against a scene and a mission: objects, places and legs must exist."""

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
    """A joint of a scene object, as the target of an object signal."""

    object: SceneObject
    joint: Joint


def object_signals(scene: Scene) -> dict[str, JointReference]:
    """Return the signals of scenery objects in ``scene``, with the joint that each one reads."""
    signals: dict[str, JointReference] = {}
    for item in scene.objects:
        for joint in item.joints:
            position = "angle" if joint.kind == "revolute" else "position"
            # Signals of a single joint need not name it: door_17.angle.
            prefixes = [f"{item.name}.{joint.name}"]
            if len(item.joints) == 1:
                prefixes.append(item.name)
            for prefix in prefixes:
                signals[f"{prefix}.{position}"] = JointReference(item, joint)
                signals[f"{prefix}.distance"] = JointReference(item, joint)
    return signals


def check_references(oracle: Oracle, scene: Scene, mission: Mission) -> tuple[Finding, ...]:
    """Return a finding for each name in ``oracle`` that ``scene`` or ``mission`` lacks."""
    scene_signals = object_signals(scene)
    everywhere = {*SIGNALS, *custom_signal_names()}
    findings = []
    for signal in oracle.signals():
        if signal.name not in everywhere and signal.name not in scene_signals:
            findings.append(_missing(oracle, signal, scene, scene_signals))
        declared = SIGNALS.get(signal.name)
        # Only the stack knows the nodes of its tree.
        thing = thing_of(signal)
        if thing is not None and not (declared and declared.takes_node):
            things = _related_names(signal, scene)
            if thing.name not in things:
                findings.append(_missing(oracle, thing, scene, things, signal.name))
    if isinstance(oracle.judgement, Reached) and not mission.waypoints:
        findings.append(Finding(oracle.where, f'mission "{mission.name}" has no waypoints'))
    if oracle.leg is not None:
        try:
            leg_number(oracle.leg, mission)
        except ValueError as error:
            findings.append(Finding(oracle.place(oracle.leg.column), str(error)))
    return tuple(findings)


def obstacle_names(scene: Scene) -> tuple[str, ...]:
    """Return the names of possible obstacles: solids, objects and their links."""
    names = [solid.owner for solid in scene.solids]
    for item in scene.objects:
        names += [item.name, *(f"{item.name}.{link.name}" for link in item.links)]
    return tuple(dict.fromkeys(names))


def place_names(scene: Scene) -> tuple[str, ...]:
    """Return the names of spaces and doorways."""
    names = [*(region.name for region in scene.regions), *(door.name for door in scene.doorways)]
    return tuple(dict.fromkeys(names))


def _related_names(signal: Signal, scene: Scene) -> tuple[str, ...]:
    """Return the valid names for the subject of a signal."""
    declared = SIGNALS.get(signal.name)
    if declared is None or not declared.relates:
        return obstacle_names(scene)
    names = obstacle_names(scene) if "object" in declared.relates else ()
    return (*names, *place_names(scene))


def leg_number(leg: Leg, mission: Mission) -> int:
    """Return the number (from 1) of the waypoint of ``leg``; raises ``ValueError`` if not unique.

    Legs to a waypoint that a mission visits more than once need a number.
    """
    count = len(mission.waypoints)
    if not leg.waypoint:
        if not 1 <= leg.number <= count:
            waypoints = count_noun(count, "waypoint")
            raise ValueError(f'no {leg} in mission "{mission.name}": it has {waypoints}')
        return leg.number
    ids = [waypoint.id for waypoint in mission.waypoints]
    numbers = [number for number, name in enumerate(ids, start=1) if name == leg.waypoint]
    if not numbers:
        hint = did_you_mean(leg.waypoint, ids)
        raise ValueError(f'no waypoint "{leg.waypoint}" in mission "{mission.name}": {hint}')
    if len(numbers) > 1:
        legs = " and ".join(map(str, numbers))
        raise ValueError(f'legs {legs} lead to "{leg.waypoint}": write the number of one')
    return numbers[0]


def _missing(
    oracle: Oracle, signal: Signal, scene: Scene, names: Iterable[str], user: str = ""
) -> Finding:
    """Return the finding for an unknown name, or for a name that the signal ``user`` refuses."""
    message = f'no "{signal.name}" in scene "{scene.name}"'
    if signal.name in obstacle_names(scene):
        message = f'{user}({ROBOT}, …) needs a space or doorway, "{signal.name}" is neither'
    elif signal.name in place_names(scene):
        message = f'"{signal.name}" is a part of the floor, not an object'
    place = oracle.place(signal.column)
    owner = signal.name.rpartition(".")[0]
    if any(item.name == owner and is_mover(item.joints) for item in scene.objects):
        message = f'{owner} is a mover, which has no "{signal.name}"'
        return Finding(place, message, mover_hint(owner))
    return Finding(place, message, did_you_mean(signal.name, names))
