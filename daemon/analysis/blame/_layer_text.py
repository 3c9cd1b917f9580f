"""Reduced scenery layers as text: behaviours as sentences, object statements copied.

Sentences are exact to the last bit, so that the text means the very run that failed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from grammars.model.behaviour import (
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
from grammars.model.movers import own_joints
from grammars.model.scene import Scene
from grammars.scenery import SceneryLayer
from grammars.text.diagnostics import Where
from grammars.text.sources import read_text


@dataclass(frozen=True, slots=True)
class JointUnits:
    """How amounts of one joint are written; a mirrored joint turns the other way in words."""

    turns: bool
    mirrored: bool

    def position(self, value: float) -> str:
        """Return a position as the object's model counts it."""
        # + 0.0: the mirrored zero would read "-0.0 rad".
        counted = -value + 0.0 if self.turns and self.mirrored else value
        return f"{counted!r} {'rad' if self.turns else 'm'}"


def joint_units(scene: Scene) -> dict[str, JointUnits]:
    """Return how to write about each joint of a scene, by its name there."""
    return {
        f"{thing.name}.{joint.name}": JointUnits(joint.kind == "revolute", thing.mirrored)
        for thing in scene.objects
        for joint in thing.joints
    }


def behaviour_sentences(behaviours: Iterable[Behaviour], scene: Scene) -> str:
    """Return the text of a behaviour layer that means exactly these behaviours in ``scene``."""
    units = joint_units(scene)
    return "".join(f"{_sentence(behaviour, units)}\n" for behaviour in behaviours)


def _sentence(behaviour: Behaviour, units: Mapping[str, JointUnits]) -> str:
    if isinstance(behaviour, Walk):
        return _walk_sentence(behaviour)
    return f"{behaviour.joint} {_predicate(behaviour, units[behaviour.joint])}"


def _predicate(behaviour: Hold | KeyFrames | Trigger | Reaction, units: JointUnits) -> str:
    at = units.position
    match behaviour:
        case Hold(position=position):
            return f"stays at {at(position)}"
        case KeyFrames(frames=frames, motion=motion):
            moves = (f"to {at(f.position)} at {f.time!r} s" for f in frames)
            order = "" if behaviour.in_order else ", as listed"
            return f"moves {', '.join(moves)}{order}, {_motion_phrase(motion, units.turns)}"
        case Trigger():
            return _trigger_phrase(behaviour, units)
        case Reaction(start=start, end=end, event=event, delay=delay, motion=motion):
            when = f"when {_event_phrase(event)}, after {delay!r} s"
            return (
                f"goes from {at(start)} to {at(end)} {when}, {_motion_phrase(motion, units.turns)}"
            )


def _trigger_phrase(trigger: Trigger, units: JointUnits) -> str:
    who = "the robot's footprint" if trigger.to == "footprint" else "the robot"
    said = [
        f"goes from {units.position(trigger.start)} to {units.position(trigger.end)} "
        f"when {who} is within {trigger.distance!r} m of its {trigger.of}"
    ]
    if trigger.rearm is not None:
        said.append(f"again beyond {trigger.rearm!r} m")
    if trigger.begin is not None:
        said.append(f"starting at {units.position(trigger.begin)}")
    return ", ".join((*said, _motion_phrase(trigger.motion, units.turns)))


def _motion_phrase(motion: Motion, turns: bool) -> str:
    match motion:
        case Jump():
            return "by jump"
        case Servo(rate=rate, effort=effort):
            units = ("rad/s", "N m") if turns else ("m/s", "N")
            return f"by servo at {rate!r} {units[0]} with {effort!r} {units[1]}"
        case Spring(stiffness=stiffness, damping=damping):
            units = ("N m/rad", "N m s/rad") if turns else ("N/m", "N s/m")
            return f"by spring of {stiffness!r} {units[0]} damped by {damping!r} {units[1]}"


def _event_phrase(event: Event) -> str:
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


def _walk_sentence(walk: Walk) -> str:
    said = [
        f"{walk.object} walks along " + ", ".join(f"({x!r} m, {y!r} m)" for x, y in walk.route),
        f"at {walk.speed!r} m/s",
        f"accelerating at {walk.acceleration!r} m/s^2",
        walk.manner.replace("-", " "),
    ]
    if walk.stops == "points":
        said.append(f"pausing {walk.pause!r} s at every point")
    elif walk.pause:
        said.append(f"pausing {walk.pause!r} s")
    if walk.event is None:
        said.append(f"from {walk.start!r} s")
    else:
        said += [f"when {_event_phrase(walk.event)}", f"after {walk.start!r} s"]
    said.append(f"facing {walk.facing if walk.facing != 'fixed' else f'{walk.yaw!r} rad'}")
    if walk.yielding is not None:
        said.append(f"yielding within {walk.yielding!r} m")
    return ", ".join(said)


def reduce_layers(layers: Sequence[SceneryLayer], names: Collection[str]) -> list[SceneryLayer]:
    """Return the layers with only the objects ``names`` and the models of these, if any are left.

    What objects do is left out, and so are groups and how they start: they would name objects
    that are not there. Parameters stay, they may place something.
    """
    used = {i.model.text for layer in layers for i in layer.instances if i.name in names}
    fewer = (
        dataclasses.replace(
            layer,
            models=tuple(model for model in layer.models if model.name in used),
            instances=tuple(i for i in layer.instances if i.name in names),
            groups=(),
            settings=(),
            sentences=(),
        )
        for layer in layers
    )
    return [layer for layer in fewer if layer.models or layer.instances]


def layer_text(layer: SceneryLayer, whole: SceneryLayer) -> str:
    """Return the text of a reduced ``.scenery`` layer: the statements of the ``whole``, copied."""
    # Statements are found by where they stand: names repeat, and places are unique.
    wanted = {_place_key(m.where) for m in layer.models} | {
        _place_key(p.where) for p in layer.parameters
    }
    wanted |= {_place_key(instance.where) for instance in layer.instances}
    parts = [
        part
        for where, part in _statements(whole, read_text(whole.file))
        if _place_key(where) in wanted
    ]
    return "\n".join(parts) + "\n"


def _statements(layer: SceneryLayer, text: str) -> Iterator[tuple[Where, str]]:
    """Yield where each statement begins and its text, without the comments after it."""
    kinds = (
        layer.models, layer.instances, layer.groups, layer.parameters,
        layer.settings, layer.sentences,
    )  # fmt: skip
    places = sorted((value.where for values in kinds for value in values), key=_place_key)
    # Layers know lines and columns, the text is cut at offsets.
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    offsets = [starts[w.line - 1] + w.column - 1 for w in places]
    for where, first, last in zip(places, offsets, (*offsets[1:], len(text)), strict=True):
        lines = text[first:last].rstrip().splitlines()
        while lines and lines[-1].lstrip().startswith("//"):
            lines.pop()
        yield where, "\n".join(lines).rstrip()


def _place_key(where: Where) -> tuple[int, int]:
    return where.line, where.column


def start_sentences(wanted: Scene, plain: Scene) -> str:
    """Return the sentences that make the objects of ``plain`` start as those of ``wanted``."""
    lines, units = [], joint_units(wanted)
    starting = {thing.name: thing for thing in plain.objects}
    for thing in wanted.objects:
        other = starting[thing.name]
        positions = dict(zip((j.name for j in thing.joints), thing.initial, strict=True))
        before = dict(zip((j.name for j in other.joints), other.initial, strict=True))
        for joint in own_joints(thing.joints):
            if positions[joint.name] != before[joint.name]:
                name = f"{thing.name}.{joint.name}"
                lines.append(f"{name} starts at {units[name].position(positions[joint.name])}")
        if thing.frozen and not other.frozen:
            lines.append(f"{thing.name} is frozen")
    return "".join(f"{line}\n" for line in lines)
