"""Writer of scenery as JSON-LD: objects in the published vocabulary, sentences as text.

Every instance gets its pose in the world. Published tools miscompute poses through rooms that are
placed by a side wall, and they cannot fit doors into entryways.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from grammars.floorplan import WORLD_FRAME, FloorPlan
from grammars.jsonld._kinematics import Json
from grammars.jsonld._object_writer import object_frame_nodes, object_nodes, object_pose_nodes
from grammars.jsonld._plan_writer import PlanWriter
from grammars.jsonld.vocabulary import plain_context
from grammars.model.behaviour import Behaviour, Hold, KeyFrames, Trigger
from grammars.scenery import SceneryLayer
from grammars.scenery.composition import (
    Catalogue,
    mirrored_joints,
    mirrored_links,
    place_instance,
)
from grammars.scenery.model import (
    Group,
    In,
    Instance,
    ObjectModel,
    Parameter,
    Sentence,
    Setting,
    Word,
)
from grammars.text.diagnostics import InputError


def scene_document(
    plan: FloorPlan,
    layers: Sequence[SceneryLayer] = (),
    *,
    left_out: Collection[str] = (),
    behaviours: Iterable[Behaviour] = (),
    states: Iterable[tuple[str, Iterable[tuple[str, float]]]] = (),
) -> Json:
    """Return a scene as one graph: its plan, its layers in order, and the moves of its objects.

    ``left_out`` are objects of the layers that the scene omits. ``states`` names positions
    [rad or m] of joints, which have scene-wide names. Raises :class:`InputError` for objects that
    cannot be placed.
    """
    writer = LayerWriter(PlanWriter(plan), layers, left_out)
    for layer in layers:
        writer.write_layer(layer)
    names = {place: name for name, positions in states for place in positions}
    moves = [node for behaviour in behaviours for node in _moves(behaviour, names)]
    return writer.document(writer.frames.nodes + writer.nodes + moves)


def scenery_document(
    layer: SceneryLayer, plan: FloorPlan, layers: Sequence[SceneryLayer] = ()
) -> Json:
    """Return a layer as one JSON-LD document; ``layers`` are all of the scenario, in order.

    Raises :class:`InputError` for objects that cannot be placed.
    """
    writer = LayerWriter(PlanWriter(plan), layers or (layer,))
    writer.write_layer(layer)
    return writer.document(writer.nodes)


def objects_document(
    plan: FloorPlan, layers: Sequence[SceneryLayer], left_out: Collection[str] = ()
) -> Json:
    """Return the objects of all layers as one document without sentences, for published tools.

    Raises :class:`InputError` for objects that cannot be placed.
    """
    writer = LayerWriter(PlanWriter(plan), layers, left_out)
    for layer in layers:
        writer.write_objects(layer)
    return writer.document(writer.nodes)


def _moves(behaviour: Behaviour, states: Mapping[tuple[str, float], str]) -> Iterator[Json]:
    """Yield the moves of a joint, each with its time [s] or trigger distance [m]."""
    name, _, joint = behaviour.joint.partition(".")
    moves: list[tuple[float, str, float]] = []
    if isinstance(behaviour, Hold):
        moves = [(behaviour.position, "scn:at", 0.0)]
    elif isinstance(behaviour, KeyFrames):
        moves = [(frame.position, "scn:at", frame.time) for frame in behaviour.frames]
    elif isinstance(behaviour, Trigger):
        moves = [(behaviour.end, "scn:within", behaviour.distance)]
    for number, (position, word, amount) in enumerate(moves):
        node: Json = {"@id": f"item:{behaviour.joint}.move-{number}", "@type": "scn:Move"}
        node |= {"scn:of": {"@id": f"item:{name}"}, "scn:joint": joint, word: amount}
        node["scn:position"] = position
        if (behaviour.joint, position) in states:
            node["scn:to"] = states[behaviour.joint, position]
        yield node


class LayerWriter:
    """Builder of the nodes of layers; ``left_out`` are objects to omit."""

    def __init__(
        self,
        frames: PlanWriter,
        layers: Sequence[SceneryLayer],
        left_out: Collection[str] = (),
    ) -> None:
        self.frames = frames
        self._layers = tuple(layers)
        self._left_out = left_out
        self._catalogue = Catalogue(layers)
        self._mirrored: set[str] = set()
        self.nodes: list[Json] = []

    def document(self, nodes: list[Json]) -> Json:
        """Return nodes as one document."""
        return {"@context": plain_context(self.frames.base), "@graph": nodes}

    def write_layer(self, layer: SceneryLayer) -> None:
        """Write a layer and its parts; each part names its layer and its place there."""
        id = f"item:layer.{layer.name}"
        number = self._layers.index(layer)
        node = {"@id": id, "@type": "scn:Layer", "scn:name": layer.name, "scn:number": number}
        self._add([node])
        parts = self.write_objects(layer)
        for part in (*layer.groups, *layer.parameters, *layer.settings, *layer.sentences):
            names = [] if isinstance(part, Parameter) else self._about(layer, part)
            about = [{"@id": f"item:{name}"} for name in names if name not in self._left_out]
            if names and not about:
                continue
            sentence: Json = {"@id": f"{id}.{len(parts)}", "@type": "scn:Sentence"}
            sentence |= {"scn:text": part.text} | ({"scn:about": about} if about else {})
            parts.append(self._add([sentence]))
        for place, part_node in enumerate(parts):
            part_node |= {"scn:in-layer": {"@id": id}, "scn:number": place}

    def write_objects(self, layer: SceneryLayer) -> list[Json]:
        """Write the models and instances of a layer and return the node of each."""
        models = [self._model(model) for model in layer.models]
        instances = (one for one in layer.instances if one.name not in self._left_out)
        return models + [self._instance(instance) for instance in instances]

    def _add(self, nodes: list[Json]) -> Json:
        """Add nodes and return the last of them."""
        self.nodes += nodes
        return nodes[-1]

    def _model_id(self, name: str) -> str:
        """Return the identifier of an object model: its name, unless an instance has it."""
        return f"item:{name}.model" if name in self._catalogue.instances else f"item:{name}"

    def _model(self, model: ObjectModel) -> Json:
        return self._add(object_nodes(self._model_id(model.name), model))

    def _instance(self, instance: Instance) -> Json:
        plan, ids = self.frames.plan, self.frames.ids
        model = self._catalogue.models[instance.model.text]
        placed = place_instance(plan, instance, model)
        id, kind = f"item:{instance.name}", self._model_id(model.name)
        if placed.mirrored:
            kind = self._mirror(model, placed.across)
        node: Json = {
            "@id": id,
            "@type": "ObjectInstance",
            "frame": f"{id}.frame",
            "world": f"fpm:{ids['plan', plan.name]}",
            "of-object": kind,
            "scn:name": instance.name,
        }
        if instance.text:
            node["scn:text"] = instance.text
        starts = instance.starts
        if isinstance(starts, Word) and any(s.name == starts.text for s in model.states):
            node["start-state"] = f"{kind}.state.{starts}"
        if isinstance(instance.place, In):
            node |= self._doorway(instance.place)
        wrt = f"fpm:{self.frames.frame(WORLD_FRAME)}"
        pose = object_pose_nodes(f"{id}.frame", wrt, placed.pose)
        return self._add([*object_frame_nodes(f"{id}.frame"), *pose, node])

    def _doorway(self, place: In) -> Json:
        """Return links to the entryway of an object and to the space its leaf opens into."""
        plan, ids = self.frames.plan, self.frames.ids
        opening = next(o for o in plan.openings if o.name == place.entryway.text)
        links = {"scn:stands-in": {"@id": f"fpm:{ids[opening.kind, opening.id]}"}}
        sides = {"in": opening.walls[:1], "out": opening.walls[1:]}
        space = str(place.towards)
        if not isinstance(place.towards, Word):
            beside = sides[place.towards]
            space = next((wall.space for wall in plan.walls if wall.id in beside), "")
        if place.manner == "hinge" and space:
            links["scn:opens-into"] = {"@id": f"fpm:{ids['space', space]}"}
        return links

    def _mirror(self, model: ObjectModel, across: tuple[float, float]) -> str:
        """Write the mirror image of a model, once, and return its identifier."""
        source = self._model_id(model.name)
        id = f"{source}.mirrored"
        if id not in self._mirrored:
            self._mirrored.add(id)
            turning = {joint.name for joint in model.joints if joint.kind == "revolute"}
            states = (
                replace(
                    state,
                    positions=tuple(
                        (name, -value + 0.0 if name in turning else value)
                        for name, value in state.positions
                    ),
                )
                for state in model.states
            )
            image = replace(
                model,
                links=mirrored_links(model.links, across),
                joints=mirrored_joints(model.joints, across),
                states=tuple(states),
            )
            self._add(object_nodes(id, image, mirror_of=source))
        return id

    def _about(self, layer: SceneryLayer, part: Group | Setting | Sentence) -> list[str]:
        """Return the objects a sentence is about, or none if a name is unknown."""
        subject = part.members if isinstance(part, Group) else part.subject
        try:
            targets = self._catalogue.targets(layer, subject)
        except InputError:
            # Resolving behaviours reports the names that matter.
            return []
        return list(dict.fromkeys(target.object for target in targets))
