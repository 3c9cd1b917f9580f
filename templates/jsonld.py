"""Models of a world as JSON-LD: six published files, and one graph."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from grammars.jsonld import (
    objects_document,
    plan_documents,
    scene_document,
    scenery_document,
)
from templates.naming import file_name
from templates.world import ArtefactWorld, ExportJob


def export_jsonld(job: ExportJob) -> tuple[Path, ...]:
    """Write the folder ``jsonld``."""
    return write_jsonld(job.world, job.folder / "jsonld")


def write_jsonld(world: ArtefactWorld, folder: Path) -> tuple[Path, ...]:
    """Write the models of a world to ``folder``; return the paths of the files.

    Published tools read ``skeleton.json``, ``shape.json``, ``polyhedron.json``,
    ``spatial_relations.json``, ``coordinate.json``, ``floorplan.json`` and ``objects.json`` from a
    folder. ``<plan>.jsonld`` is the whole scene as one graph, with the moves of its first repeat.
    ``<layer>.scenery.jsonld`` is one layer with all parts, including those absent from the scene.
    Raises :class:`InputError` for objects that cannot be placed.
    """
    plan, layers = world.plan, world.layers
    if plan is None:
        return ()
    folder.mkdir(parents=True, exist_ok=True)
    objects = {instance.name for layer in layers for instance in layer.instances}
    left_out = objects - {body.name for body in world.scene.objects}
    documents = {f"{name}.json": document for name, document in plan_documents(plan).items()}
    if any(layer.models or layer.instances for layer in layers):
        documents["objects.json"] = objects_document(plan, layers, left_out)
    documents[f"{file_name(plan.name)}.jsonld"] = scene_document(
        plan,
        layers,
        left_out=left_out,
        behaviours=world.draws[0].behaviours,
        states=world.states,
    )
    for layer in layers:
        name = f"{file_name(layer.name)}.scenery.jsonld"
        documents[name] = scenery_document(layer, plan, layers)
    return tuple(_write(document, folder / name) for name, document in documents.items())


def _write(document: dict[str, Any], path: Path) -> Path:
    """Write a document with one node per line."""
    nodes = ",\n".join(f"  {_dump(node)}" for node in document["@graph"])
    head = f'{{\n"@context": {_dump(document["@context"])},\n"@graph": [\n'
    path.write_text(f"{head}{nodes}\n]\n}}\n", encoding="utf-8", newline="\n")
    return path


def _dump(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
