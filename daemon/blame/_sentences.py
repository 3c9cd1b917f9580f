"""Concrete behaviours as sentences of the scenery language, exact to the last bit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from grammars.behaviour import (
    Behaviour,
    Event,
    Hold,
    JointActs,
    Jump,
    KeyFrames,
    LegBegins,
    Motion,
    Reaction,
    Servo,
    Spring,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.scene import Scene

_MANNERS: Final = {"once": "once", "back-and-forth": "back and forth", "round": "round"}


@dataclass(frozen=True, slots=True)
class Units:
    """How amounts of one joint are written; a mirrored joint turns the other way in words."""

    turns: bool
    mirrored: bool

    def position(self, value: float) -> str:
        """Return a position as the object's model counts it."""
        counted = -value + 0.0 if self.turns and self.mirrored else value
        return f"{counted!r} {'rad' if self.turns else 'm'}"


def units_of(scene: Scene) -> dict[str, Units]:
    """Return how to write about each joint of a scene, by its name there."""
    return {
        f"{thing.name}.{joint.name}": Units(joint.kind == "revolute", thing.mirrored)
        for thing in scene.objects
        for joint in thing.joints
    }


def sentences(behaviours: Iterable[Behaviour], scene: Scene) -> str:
    """Return the text of a behaviour layer that means exactly these behaviours in ``scene``."""
    units = units_of(scene)
    return "".join(f"{_sentence(behaviour, units)}\n" for behaviour in behaviours)


def _sentence(behaviour: Behaviour, units: Mapping[str, Units]) -> str:
    if isinstance(behaviour, Walk):
        return _walks(behaviour)
    return f"{behaviour.joint} {_predicate(behaviour, units[behaviour.joint])}"


def _predicate(behaviour: Hold | KeyFrames | Trigger | Reaction, units: Units) -> str:
    at = units.position
    match behaviour:
        case Hold(position=position):
            return f"stays at {at(position)}"
        case KeyFrames(frames=frames, motion=motion):
            moves = (f"to {at(f.position)} at {f.time!r} s" for f in frames)
            return f"moves {', '.join(moves)}, {_by(motion, units.turns)}"
        case Trigger():
            return _goes(behaviour, units)
        case Reaction(start=start, end=end, event=event, delay=delay, motion=motion):
            when = f"when {_event(event)}, after {delay!r} s"
            return f"goes from {at(start)} to {at(end)} {when}, {_by(motion, units.turns)}"


def _goes(trigger: Trigger, units: Units) -> str:
    who = "the robot's footprint" if trigger.to == "footprint" else "the robot"
    said = [
        f"goes from {units.position(trigger.start)} to {units.position(trigger.end)} "
        f"when {who} is within {trigger.distance!r} m of its {trigger.of}"
    ]
    if trigger.rearm is not None:
        said.append(f"again beyond {trigger.rearm!r} m")
    if trigger.begin is not None:
        said.append(f"starting at {units.position(trigger.begin)}")
    return ", ".join((*said, _by(trigger.motion, units.turns)))


def _by(motion: Motion, turns: bool) -> str:
    match motion:
        case Jump():
            return "by jump"
        case Servo(rate=rate, effort=effort):
            units = ("rad/s", "N m") if turns else ("m/s", "N")
            return f"by servo at {rate!r} {units[0]} with {effort!r} {units[1]}"
        case Spring(stiffness=stiffness, damping=damping):
            units = ("N m/rad", "N m s/rad") if turns else ("N/m", "N s/m")
            return f"by spring of {stiffness!r} {units[0]} damped by {damping!r} {units[1]}"


def _event(event: Event) -> str:
    match event:
        case LegBegins(leg=leg):
            return f"leg {leg} begins"
        case WaypointReached(waypoint=name):
            return f'waypoint "{name}" is reached'
        case JointActs(joints=(first, *more), act=act):
            does = "fires" if act == "fires" else "starts to move"
            # Several joints are those of one object, which is how one speaks of all of them.
            return f"{first.rpartition('.')[0] if more else first} {does}"
    raise ValueError("an event of no joint")


def _walks(walk: Walk) -> str:
    said = [
        f"{walk.object} walks along " + ", ".join(f"({x!r} m, {y!r} m)" for x, y in walk.route),
        f"at {walk.speed!r} m/s",
        f"accelerating at {walk.acceleration!r} m/s^2",
        _MANNERS[walk.manner],
    ]
    if walk.stops == "points":
        said.append(f"pausing {walk.pause!r} s at every point")
    elif walk.pause:
        said.append(f"pausing {walk.pause!r} s")
    if walk.event is None:
        said.append(f"from {walk.start!r} s")
    else:
        said += [f"when {_event(walk.event)}", f"after {walk.start!r} s"]
    said.append(f"facing {walk.facing if walk.facing != 'fixed' else f'{walk.yaw!r} rad'}")
    if walk.yielding is not None:
        said.append(f"yielding within {walk.yielding!r} m")
    return ", ".join(said)
