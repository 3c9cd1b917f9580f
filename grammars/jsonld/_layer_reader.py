"""From JSON-LD to scenery layers: what we wrote, and objects and instances others wrote."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from grammars.jsonld._kinematics import PoseGraph
from grammars.jsonld._nodes import Node, NodeGraph
from grammars.jsonld._object_reader import ObjectReader, name_of, scenery_name
from grammars.jsonld._sentences import SentenceReader, frame_name, is_on_floor, sentence_fields
from grammars.jsonld.vocabulary import GEOM, OBJ, SCN, ST, local_name
from grammars.scenery import SceneryLayer
from grammars.scenery.model import At, In, Instance, Measure, Name, ObjectModel
from grammars.text.diagnostics import InputError, Where

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
        where = self._nodes.where(node.id, Where(self._file))
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
