"""Reader of scenery layers from JSON-LD: published objects, sentences in the scenery language.

A frame published as ``hall-wall-2-frame`` is ``hall.walls[2]`` in a layer.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from grammars.floorplan import WORLD_FRAME
from grammars.jsonld._kinematics import PoseGraph
from grammars.jsonld._nodes import Node, NodeGraph
from grammars.jsonld._object_reader import ObjectReader, name_of, scenery_name
from grammars.jsonld.vocabulary import GEOM, OBJ, SCN, ST, local_name, namespace_of
from grammars.scenery import SceneryLayer, parse_scenery
from grammars.scenery.model import At, FrameName, Instance, Word
from grammars.text.diagnostics import InputError, Where

_WALL: Final = re.compile(r"(?P<space>.+)-wall-(?P<index>\d{1,9})-frame")
_FEATURE: Final = re.compile(r"(?:column|divider|wall)-(?P<name>.+)-frame")
_OPENING: Final = re.compile(r"(?:entryway|window)-(?P<name>.+)-frame")
# Frame names of 2023: frame-hall-wall-2, frame-center-hall.
_EARLIER_WALL: Final = re.compile(r"frame-(?P<space>.+)-wall-(?P<index>\d{1,9})")
_EARLIER_SPACE: Final = re.compile(r"frame-center-(?P<name>.+)")
_ON_FLOOR: Final = 1e-6


def read_layers(nodes: NodeGraph, file: str) -> tuple[SceneryLayer, ...]:
    """Return the scenery layers in ``nodes``, in order; objects without a layer form another one.

    Raises :class:`InputError` with all errors.
    """
    reader = _LayerReader(nodes, file)
    layers = sorted(nodes.of_type(SCN["Layer"]), key=_number)
    read = [reader.layer(node) for node in layers]
    loose = reader.loose()
    if loose is not None:
        read.append(loose)
    nodes.raise_errors()
    return tuple(read)


def _number(node: Node) -> float:
    return node.number(SCN["number"]) or 0.0


class _LayerReader:
    def __init__(self, nodes: NodeGraph, file: str) -> None:
        self._nodes = nodes
        self._file = file
        self._objects = ObjectReader(nodes, file)
        self._poses = PoseGraph(nodes)
        self._parts: dict[str, list[Node]] = {}
        for node in nodes.by_id.values():
            for layer in node.refs(SCN["in-layer"]):
                self._parts.setdefault(layer, []).append(node)

    def layer(self, node: Node) -> SceneryLayer:
        """Return a layer that our writer wrote."""
        name = node.text(SCN["name"]) or scenery_name(local_name(node.id))
        return self._made(name, sorted(self._parts.get(node.id, []), key=_number))

    def loose(self) -> SceneryLayer | None:
        """Return the layer of all objects and instances without a layer, in order of writing."""
        parts = [
            node
            for kind in ("Object", "ObjectInstance")
            for node in self._nodes.of_type(OBJ[kind])
            if not node.refs(SCN["in-layer"]) and not node.refs(SCN["mirror-of"])
        ]
        return self._made(scenery_name(Path(self._file).stem), parts) if parts else None

    def _made(self, name: str, parts: Sequence[Node]) -> SceneryLayer:
        read = []
        for part in parts:
            try:
                read.append(self._part(part))
            except InputError as error:
                self._nodes.findings.extend(error.findings)
        return SceneryLayer(
            name,
            self._file,
            tuple(model for one in read for model in one.models),
            tuple(instance for one in read for instance in one.instances),
            tuple(group for one in read for group in one.groups),
            tuple(parameter for one in read for parameter in one.parameters),
            tuple(setting for one in read for setting in one.settings),
            tuple(sentence for one in read for sentence in one.sentences),
        )

    def _part(self, node: Node) -> SceneryLayer:
        """Return one part of a layer as a layer of its own."""
        where = self._nodes.where(node.id, Where(self._file, 1))
        text = node.text(SCN["text"])
        if text is not None:
            # Columns of the text are not columns of the file.
            return parse_scenery(text, self._file, Where(where.file, where.line))
        if OBJ["Object"] in node.types:
            model = self._objects.read(node)
            return SceneryLayer("", self._file, models=() if model is None else (model,))
        if OBJ["ObjectInstance"] in node.types:
            return SceneryLayer("", self._file, instances=(self._instance(node, where),))
        hint = "give it scn:text, a sentence of the scenery language"
        raise InputError.at(where, f"{local_name(node.id)} has no content", hint)

    def _instance(self, node: Node, where: Where) -> Instance:
        """Return an instance placed by its pose."""
        of = node.refs(OBJ["of-object"])[0]
        owner = self._nodes.get(of)
        model = self._nodes.get(owner.ref(SCN["mirror-of"]) or of)
        state = node.ref(ST["start-state"])
        starts = Word(name_of(self._nodes.get(state), owner), where) if state else None
        place = self._place(node, where)
        return Instance(name_of(node), Word(name_of(model), where), place, starts, False, where)

    def _place(self, node: Node, where: Where) -> At:
        """Return the pose of an instance in the first frame of the floor plan on its chain."""
        frame = node.ref(OBJ["frame"])
        base = namespace_of(node.ref(OBJ["world"]) or "")
        placed = self._poses.reach(frame) if frame is not None else {}
        for id, view in placed.items():
            node_there = self._nodes.by_id.get(id)
            elsewhere = node_there is None or GEOM["Frame"] not in node_there.types
            # Frames before the first one of another file or of the plan belong to the object.
            if id == frame or not (elsewhere or (base and id.startswith(base))):
                continue
            # The origin of an opening is in its middle; other origins lie on the floor.
            is_on_floor = _OPENING.fullmatch(local_name(id)) is None
            if abs(view.tilt) > _ON_FLOOR or (abs(view.z) > _ON_FLOOR and is_on_floor):
                message = f"instance {local_name(node.id)} is lifted or tilted"
                self._nodes.add_warning(node.id, message, "it is placed upright on the floor")
            edge = view.edge
            pose = view.pose.inverse()
            if edge is not None and edge.of == frame:
                # The written pose has no rounding from two inversions.
                pose = edge.pose
            return At(_frame_name(local_name(id), where), pose.x, pose.y, pose.yaw)
        message = f"instance {local_name(node.id)} is not connected to a frame of the floor plan"
        hint = "add a pose of its frame with respect to a wall or space"
        raise InputError.at(where, message, hint)


def _frame_name(published: str, where: Where) -> FrameName:
    """Return the name of a published frame in the scenery language."""
    if published == WORLD_FRAME:
        return FrameName("world", None, "", where)
    wall = _WALL.fullmatch(published) or _EARLIER_WALL.fullmatch(published)
    if wall is not None:
        return FrameName(wall["space"], int(wall["index"]), "", where)
    patterns = (_FEATURE, _OPENING, _EARLIER_SPACE)
    thing = next(filter(None, (pattern.fullmatch(published) for pattern in patterns)), None)
    name = thing["name"] if thing is not None else published.removesuffix("-frame")
    return FrameName(name, None, "", where)
