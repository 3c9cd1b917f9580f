"""Scenery layers as JSON-LD, written and read: what is published as published, the rest ours."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from grammars.floorplan import WORLD_FRAME, FloorPlan
from grammars.jsonld._kinematics import Json, PoseGraph
from grammars.jsonld._nodes import Node, NodeGraph
from grammars.jsonld._object_reader import ObjectReader, name_of, scenery_name
from grammars.jsonld._object_writer import (
    object_frame_nodes,
    object_nodes,
    object_pose_nodes,
    trim_rounding,
)
from grammars.jsonld._plan_writer import PlanWriter
from grammars.jsonld._sentences import (
    SentenceReader,
    frame_name,
    is_on_floor,
    sentence_fields,
    value_to_jsonld,
)
from grammars.jsonld._written_contexts import layer_context
from grammars.jsonld.vocabulary import GEOM, ITEMS, OBJ, SCN, ST, local_name
from grammars.model.geometry import Pose2
from grammars.scenery import SceneryLayer
from grammars.scenery.composition import (
    Catalogue,
    frame_named,
    mirrored_joints,
    mirrored_links,
    place_instance,
)
from grammars.scenery.measure import Measure
from grammars.scenery.model import At, FrameName, In, Instance, Name, ObjectModel
from grammars.text.diagnostics import InputError, Where


def scenery_document(
    layer: SceneryLayer, plan: FloorPlan, layers: Sequence[SceneryLayer] = ()
) -> Json:
    """Return a layer as one JSON-LD document; ``layers`` are all of the scenario, in order.

    Objects, states and instances are in the published vocabulary: every instance has a pose with
    respect to a frame of ``plan``, also one that is fitted into an entryway (a door that hangs
    the other way round is an instance of the mirrored model). Behaviours, groups, parameters and
    settings are in words of our own. Raises :class:`InputError` for what cannot be placed.
    """
    return LayerWriter(layer, PlanWriter(plan), layers or (layer,)).document()


def objects_document(plan: FloorPlan, layers: Sequence[SceneryLayer]) -> Json:
    """Return objects, states and instances of all layers as one document, without behaviours.

    What published tools read from the folder of a plan. Every instance has its pose in the world:
    scenery_builder goes astray on the way to it from rooms that are placed by a wall at their
    side. Raises :class:`InputError` for what cannot be placed.
    """
    frames = PlanWriter(plan)
    writers = [LayerWriter(layer, frames, layers, in_world=True) for layer in layers]
    nodes = [node for writer in writers for node in writer.write_objects()]
    # Two layers may each need the mirror image of a door.
    known = {node["@id"]: node for node in nodes}
    return {"@context": layer_context(frames.base), "@graph": list(known.values())}


class LayerWriter:
    """Builds the nodes of one layer; ``places`` tells where each was written in the text."""

    def __init__(
        self,
        layer: SceneryLayer,
        frames: PlanWriter,
        layers: Sequence[SceneryLayer],
        *,
        in_world: bool = False,
    ) -> None:
        self._in_world = in_world
        self._layer = layer
        self._plan = frames.plan
        self._catalogue = Catalogue(layers)
        self._frames = frames
        self._mirrored: set[str] = set()
        self.nodes: list[Json] = []
        self.places: dict[str, Where] = {}

    def document(self) -> Json:
        """Return the document."""
        self.write_objects()
        self._write_layer()
        return {"@context": layer_context(self._frames.base), "@graph": self.nodes}

    def write_objects(self) -> list[Json]:
        """Write what others know as well, objects and instances, and return it."""
        for model in self._layer.models:
            id = self._model(model.name)
            self._add(object_nodes(id, model), model.where)
            for state in model.states:
                self.places[f"{ITEMS}{id.removeprefix('item:')}.state.{state.name}"] = state.where
        for instance in self._layer.instances:
            self._instance(instance)
        return self.nodes

    def _add(self, nodes: list[Json], where: Where) -> None:
        self.nodes += nodes
        for node in nodes:
            if where.line and "@id" in node:
                self.places[ITEMS + node["@id"].removeprefix("item:")] = where

    def _model(self, name: str) -> str:
        """Return the identifier of an object model: its name, unless an instance has it."""
        return f"item:{name}.model" if name in self._catalogue.instances else f"item:{name}"

    def _instance(self, instance: Instance) -> None:
        model = self._catalogue.models[instance.model.text]
        id, kind = f"item:{instance.name}", self._model(model.name)
        node: Json = {"@id": id, "@type": "ObjectInstance", "frame": f"{id}.frame"}
        node["world"] = f"fpm:{self._frames.ids['plan', self._plan.name]}"
        node["scn:name"] = instance.name
        placed = place_instance(self._plan, instance, model)
        if placed.mirrored:
            kind = self._mirror(model, placed.across)
        if self._in_world:
            wrt, pose = f"fpm:{self._frames.frame(WORLD_FRAME)}", placed.pose
            node["scn:placement"] = value_to_jsonld(instance.place)
        elif isinstance(instance.place, At):
            wrt = self._frame(instance.place.frame)
            pose = self._at(instance, model, node, wrt)
        else:
            opening = next(o for o in self._plan.openings if o.name == instance.place.entryway.text)
            # Others know no entryways to fit doors into: they get a pose at the wall (in the world,
            # where it cuts none), and our own words say how it came about, for us to read back.
            walls = (w for w in self._plan.walls if w.id in opening.walls[:1])
            against = {f"{wall.id}-frame": wall.frame for wall in walls} or {WORLD_FRAME: Pose2()}
            ((frame, base),) = against.items()
            relative = base.inverse() @ placed.pose
            wrt = f"fpm:{self._frames.frame(frame)}"
            pose = Pose2(trim_rounding(relative.x), trim_rounding(relative.y), relative.yaw)
            node["scn:stands-in"] = {"@id": f"fpm:{self._frames.ids[opening.kind, opening.id]}"}
            node["scn:placement"] = value_to_jsonld(instance.place)
        node["of-object"] = kind
        self._start(node, instance, model)
        if instance.frozen:
            node["scn:frozen"] = True
        frames = [*object_frame_nodes(f"{id}.frame"), *object_pose_nodes(f"{id}.frame", wrt, pose)]
        self._add([*frames, node], instance.where)

    def _at(self, instance: Instance, model: ObjectModel, node: Json, wrt: str) -> Pose2:
        """Return the pose in the frame; a place that says more than a pose is written too."""
        at = instance.place
        assert isinstance(at, At)
        read_back = frame_name(wrt.removeprefix("fpm:"), at.frame.where)
        # A pose says it all, unless it is meant inside of a space or the frame has another name
        # here.
        if at == At(read_back, at.x, at.y, at.yaw):
            return Pose2(at.x, at.y, at.yaw)
        node["scn:placement"] = value_to_jsonld(at)
        frame = frame_named(self._plan, at.frame)
        relative = frame.inverse() @ place_instance(self._plan, instance, model).pose
        return Pose2(trim_rounding(relative.x), trim_rounding(relative.y), relative.yaw)

    def _start(self, node: Json, instance: Instance, model: ObjectModel) -> None:
        starts = instance.starts
        if isinstance(starts, Name) and any(s.name == starts.text for s in model.states):
            node["start-state"] = f"{node['of-object']}.state.{starts.text}"
        elif starts is not None:
            node["scn:starts"] = value_to_jsonld(starts)

    def _mirror(self, model: ObjectModel, across: tuple[float, float]) -> str:
        """Write the mirror image of a model, once, and return its identifier."""
        source = self._model(model.name)
        id = f"{source}.mirrored"
        if id not in self._mirrored:
            self._mirrored.add(id)
            turning = {joint.name for joint in model.joints if joint.kind == "revolute"}
            image = dataclasses.replace(
                model,
                links=mirrored_links(model.links, across),
                joints=mirrored_joints(model.joints, across),
                states=tuple(
                    dataclasses.replace(
                        state,
                        positions=tuple(
                            (name, -value + 0.0 if name in turning else value)
                            for name, value in state.positions
                        ),
                    )
                    for state in model.states
                ),
            )
            self._add(object_nodes(id, image, mirror_of=source), model.where)
        return id

    def _frame(self, name: FrameName) -> str:
        """Return the identifier of a frame of the plan; raises ``InputError`` if there is none."""
        frame_named(self._plan, name)
        published = WORLD_FRAME if name.name == "world" else f"{name.name}-frame"
        if name.wall is not None:
            published = f"{name.name}-wall-{name.wall}-frame"
        elif name.part:
            published = next(
                f"{f.kind}-{f.id}-frame"
                for f in self._plan.features
                if f.space == name.name and f.name == name.part
            )
        elif name.name != "world" and all(s.name != name.name for s in self._plan.spaces):
            published = next(
                f"{kind}-{id}-frame"
                for kind, id, called in (
                    *((o.kind, o.id, o.name) for o in self._plan.openings),
                    *((f.kind, f.id, f.name) for f in self._plan.features),
                )
                if name.name in (called, id)
            )
        return f"fpm:{self._frames.frame(published)}"

    def _write_layer(self) -> None:
        """Write the layer itself, with what it says about objects."""
        layer = self._layer
        id = f"item:layer.{layer.name}"
        node: Json = {"@id": id, "@type": "scn:Layer", "scn:name": layer.name}
        node["scn:models"] = _references(self._model(model.name) for model in layer.models)
        node["scn:instances"] = _references(f"item:{i.name}" for i in layer.instances)
        for word in sentence_fields():
            said = [
                {"@id": f"{id}.{word}-{k}", **value_to_jsonld(value), **self._subject_links(value)}
                for k, value in enumerate(getattr(layer, word))
            ]
            for part, value in zip(said, getattr(layer, word), strict=True):
                self._add([part], value.where)
            node[f"scn:{word}"] = _references(part["@id"] for part in said)
        self._add([node], Where(layer.file))

    def _subject_links(self, value: Any) -> Json:
        """Link a sentence to the objects it is about, where they can be told."""
        subject = getattr(value, "subject", getattr(value, "members", None))
        if subject is None:
            return {}
        try:
            targets = self._catalogue.targets(self._layer, subject)
        except InputError:
            # Names of a layer that is not here; resolving behaviours reports those that matter.
            return {}
        names = dict.fromkeys(f"item:{target.object}" for target in targets)
        return {"scn:about": [{"@id": name} for name in names]} if names else {}


def _references(ids: Any) -> Json:
    return {"@list": [{"@id": id} for id in ids]}


_ON_FLOOR: Final = 1e-6


def read_layers(nodes: NodeGraph, file: str) -> tuple[SceneryLayer, ...]:
    """Return the scenery layers in ``nodes``, in order; objects of no layer make one of their own.

    Raises :class:`InputError` with everything that cannot be read.
    """
    reader = _LayerReader(nodes, file)
    layers = nodes.of_type(SCN["Layer"])
    places = {id: k for k, id in enumerate(_order(nodes))}
    layers.sort(key=lambda node: places.get(node.id, len(places)))
    read = [reader.layer(node) for node in layers]
    loose = reader.loose()
    if loose is not None:
        read.append(loose)
    if nodes.errors:
        raise InputError(nodes.errors)
    return tuple(read)


def _order(nodes: NodeGraph) -> list[str]:
    """Return the layers of a composed scenario in the order they were composed."""
    return [str(id) for node in nodes.of_type(SCN["Scenario"]) for id in node.refs(SCN["layers"])]


class _LayerReader:
    def __init__(self, nodes: NodeGraph, file: str) -> None:
        self._nodes = nodes
        self._file = file
        self._objects = ObjectReader(nodes, file)
        self._sentences = SentenceReader(nodes, file)
        self._poses = PoseGraph(nodes)
        self._read: set[str] = set()

    def layer(self, node: Node) -> SceneryLayer:
        """Return a layer we wrote."""
        name = node.text(SCN["name"]) or scenery_name(local_name(node.id))
        return SceneryLayer(
            name,
            self._file,
            self._models(node.refs(SCN["models"])),
            self._instances(node.refs(SCN["instances"])),
            **{word: self._said(node, word, *kinds) for word, kinds in sentence_fields().items()},
        )

    def loose(self) -> SceneryLayer | None:
        """Return a layer of the objects and instances no layer lists, in order of appearance."""
        models = [
            node.id
            for node in self._nodes.of_type(OBJ["Object"])
            if node.id not in self._read and not node.refs(SCN["mirror-of"])
        ]
        instances = [
            node.id
            for node in self._nodes.of_type(OBJ["ObjectInstance"])
            if node.id not in self._read
        ]
        if not models and not instances:
            return None
        name = scenery_name(Path(self._file).stem)
        return SceneryLayer(name, self._file, self._models(models), self._instances(instances))

    def _said(self, node: Node, word: str, *kinds: type) -> tuple[Any, ...]:
        found = []
        for id in node.refs(SCN[word]):
            try:
                found.append(self._sentences.read(id, *kinds))
            except InputError as error:
                self._nodes.diagnostics.extend(error.diagnostics)
        return tuple(found)

    def _models(self, ids: list[Any]) -> tuple[ObjectModel, ...]:
        self._read.update(ids)
        read = [self._objects.read(self._nodes.get(id)) for id in ids]
        return tuple(model for model in read if model is not None)

    def _instances(self, ids: list[Any]) -> tuple[Instance, ...]:
        self._read.update(ids)
        found = []
        for id in ids:
            try:
                found.append(self._instance(self._nodes.get(id)))
            except InputError as error:
                self._nodes.diagnostics.extend(error.diagnostics)
        return tuple(found)

    def _instance(self, node: Node) -> Instance:
        where = self._nodes.where(node.id, Where(self._file, 1, 1))
        of = node.ref(OBJ["of-object"])
        if of is None:
            raise InputError.at(where, f"instance {local_name(node.id)} is of no object")
        kind = self._nodes.get(of)
        source = self._nodes.get(kind.ref(SCN["mirror-of"]) or of)
        placement = node.ref(SCN["placement"])
        return Instance(
            name_of(node),
            Name(name_of(source), where),
            self._place(node, where)
            if placement is None
            else self._sentences.read(placement, In, At),
            self._start(node, where),
            bool(node.all(SCN["frozen"])[:1] == [True]),
            where,
        )

    def _start(self, node: Node, where: Where) -> Measure | Name | None:
        state = node.ref(ST["start-state"])
        if state is not None:
            owner = self._nodes.by_id.get(node.ref(OBJ["of-object"]) or "")
            return Name(name_of(self._nodes.get(state), owner), where)
        starts = node.ref(SCN["starts"])
        if starts is None:
            return None
        amount: Measure | Name = self._sentences.read(starts, Measure, Name)
        return amount

    def _place(self, node: Node, where: Where) -> At:
        """Return the pose of an instance in the first frame of the floor plan it leads to."""
        frame = node.ref(OBJ["frame"])
        plan = node.ref(OBJ["world"]) or ""
        base = plan[: len(plan) - len(local_name(plan))]
        placed = self._poses.reach(frame) if frame is not None else {}
        for id, seen in placed.items():
            known = self._nodes.by_id.get(id)
            elsewhere = known is None or GEOM["Frame"] not in known.types
            # The first frame on the way that is of another file or of the plan: those before it are
            # the object's own.
            if id == frame or not (elsewhere or (base and id.startswith(base))):
                continue
            name = frame_name(local_name(id), where)
            if abs(seen.tilt) > _ON_FLOOR or (
                abs(seen.z) > _ON_FLOOR and is_on_floor(local_name(id))
            ):
                message = f"instance {local_name(node.id)} is lifted or tilted"
                self._nodes.add_warning(
                    node.id, message, "it is taken to stand upright on the floor"
                )
            edge = seen.edge
            pose = seen.pose.inverse()
            if edge is not None and edge.of == frame:
                # The pose as it is written, without the rounding of inverting it twice.
                pose = edge.pose
            return At(name, pose.x, pose.y, pose.yaw)
        message = f"instance {local_name(node.id)} is not connected to a frame of the floor plan"
        hint = "add a pose of its frame with respect to a wall or space"
        raise InputError.at(where, message, hint)
