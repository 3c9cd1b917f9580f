"""JSON-LD exchange: floor plans and scenery in the published vocabulary, written and read.

Files use the vocabulary of the comp-rob2b and secorolab metamodels. A published model is a folder
of ``.json`` files, linked by identifiers. A plan has files for its skeleton, shapes, relations,
coordinates and elements; an object has separate files for its states and its instances. PyLD
expands the documents; the SHACL shapes in ``shapes/`` define valid models
(:mod:`grammars.jsonld.rdf`).
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
from grammars.jsonld._layer_writer import objects_document, scene_document, scenery_document
from grammars.jsonld._nodes import NodeGraph
from grammars.jsonld._plan_reader import read_plan
from grammars.jsonld._plan_writer import plan_documents
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

    ``path`` is a file or a folder, whose objects are ignored. Relative identifiers resolve against
    ``base``, by default the address of their file. Raises :class:`InputError` with all errors;
    warnings are in the plan.
    """
    nodes = _model(path, base, lambda part: not _is_of_objects(part))
    refuse_broken(nodes)
    return read_plan(nodes, str(path))


def load_scenery_jsonld(path: str | Path, warnings: list[Finding] | None = None) -> SceneryLayer:
    """Read a scenery layer from JSON-LD: objects, states, instances, and our own behaviours.

    ``path`` is a file or a folder, whose floor plan is ignored. A layer may refer to a floor plan
    and to objects of other layers outside of ``path``. Names change so that sentences can contain
    them (``door-instance-1`` is ``door_instance_1``). Assumptions are added to ``warnings``. Raises
    :class:`InputError` with all errors.
    """
    nodes = _model(path, "", _is_of_objects)
    refuse_broken(nodes, partial=True)
    layers = read_layers(nodes, str(path))
    if len(layers) == 1:
        if warnings is not None:
            warnings.extend(dict.fromkeys(nodes.findings))
        return layers[0]
    hint = "add an Object, an ObjectInstance or a scenery layer"
    message = f"there are {len(layers)} layers in it" if layers else "there is no scenery in it"
    raise InputError.at(Where(str(path), 1, 1), message, "" if layers else hint)


def check_jsonld(path: str | Path, base: str = "") -> tuple[Finding, ...]:
    """Return the errors and warnings of a file or folder.

    A model without a floor plan is one layer, which refers to a plan elsewhere. Raises
    :class:`InputError` if a file cannot be read at all.
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
    """Read a file, or those files of a folder for which ``is_part`` holds.

    Raises :class:`InputError` for files that cannot be read.
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
