"""Models in files: floor plans and layers written in JSON-LD, read and checked.

Published models are several ``.json`` files in a folder, linked by their identifiers: a plan is
skeleton, shapes, relations, coordinates and elements, an object has its states and its instances
apart. Naming the folder names the model.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from grammars.floorplan import FloorPlan
from grammars.jsonld._checks import check_nodes, refuse_broken
from grammars.jsonld._earlier import rename_terms, settle_models
from grammars.jsonld._expand import expand_text
from grammars.jsonld._layer_reader import read_layers
from grammars.jsonld._nodes import NodeGraph
from grammars.jsonld._plan_reader import read_plan
from grammars.jsonld.vocabulary import FP, KC, OBJ, SCN, ST
from grammars.scenery import SceneryLayer
from grammars.text.diagnostics import Finding, Findings, InputError, Where
from grammars.text.sources import is_folder, model_files, read_text

_OF_OBJECTS: Final = (
    *(OBJ[kind] for kind in ("Object", "ObjectInstance")),
    *(ST[kind] for kind in ("State", "JointState")),
    KC["Joint"],
    SCN["Layer"],
)


def load_floorplan_jsonld(path: str | Path, base: str = "") -> FloorPlan:
    """Read a floor plan from JSON-LD in the published vocabulary.

    ``path`` is a file or a folder, whose objects are left out. Relative identifiers resolve against
    ``base``, else against the address of their file. Raises :class:`InputError` with everything
    that is wrong; warnings are in the plan.
    """
    nodes = _model(path, base, lambda part: not _is_of_objects(part))
    refuse_broken(nodes)
    return read_plan(nodes, str(path))


def load_scenery_jsonld(
    path: str | Path, warnings: list[Finding] | None = None, base: str = ""
) -> SceneryLayer:
    """Read a scenery layer from JSON-LD: objects, states, instances, and behaviours of ours.

    ``path`` is a file or a folder, whose floor plan is left out. Relative identifiers resolve
    against ``base``, else against the address of their file. A layer is complete without the floor
    plan and the objects of other layers that it refers to. Names become such that sentences can
    contain them (``door-instance-1`` is ``door_instance_1``). Readings that are assumptions are
    added to ``warnings``. Raises :class:`InputError` with everything that is wrong.
    """
    nodes = _model(path, base, _is_of_objects)
    refuse_broken(nodes, partial=True)
    layers = read_layers(nodes, str(path))
    if len(layers) == 1:
        if warnings is not None:
            warnings.extend(dict.fromkeys(nodes.findings))
        return layers[0]
    hint = "an Object, an ObjectInstance or a layer of ours is needed"
    message = f"there are {len(layers)} layers in it" if layers else "there is no scenery in it"
    raise InputError.at(Where(str(path), 1, 1), message, "" if layers else hint)


def check_jsonld(path: str | Path, base: str = "") -> tuple[Finding, ...]:
    """Return everything that is wrong with a file or folder, errors and warnings.

    Without a floor plan in it, it is one layer, which refers to a plan that is elsewhere. Raises
    :class:`InputError` when it cannot be read at all.
    """
    nodes = _model(path, base, lambda part: True)
    findings = Findings()
    is_whole = bool(nodes.of_type(FP["FloorPlan"]))
    check_nodes(nodes, partial=not is_whole)
    if not nodes.errors:
        with findings.collecting():
            if is_whole:
                findings.add(read_plan(nodes, str(path)).warnings)
            read_layers(nodes, str(path))
    return tuple(dict.fromkeys((*nodes.findings, *findings.all)))


def _model(path: str | Path, base: str, is_part: Callable[[NodeGraph], bool]) -> NodeGraph:
    """Read the files of a model, of a folder only its parts.

    Raises :class:`InputError` with everything that cannot be read.
    """
    path = Path(path)
    findings = Findings()
    parts: list[NodeGraph] = []
    for file in model_files(path):
        with findings.collecting():
            parts.append(rename_terms(expand_text(read_text(file), str(file), base)))
    findings.raise_errors()
    if not parts:
        raise InputError.at(Where(str(path)), "there is no .json or .jsonld file in this folder")
    nodes = NodeGraph()
    for part in parts:
        if is_part(part) or not is_folder(path):
            nodes.merge(part)
    settle_models(nodes)
    return nodes


def _is_of_objects(nodes: NodeGraph) -> bool:
    return any(kind in node.types for node in nodes.by_id.values() for kind in _OF_OBJECTS)
