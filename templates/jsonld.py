"""Models of a world as JSON-LD: in the six published files and in one."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from grammars.floorplan import FloorPlan
from grammars.jsonld import (
    objects_document,
    plan_document,
    plan_documents,
    scenery_document,
)
from grammars.scenery import SceneryLayer
from templates.naming import file_name
from templates.world import ExportJob


def export_jsonld(job: ExportJob) -> tuple[Path, ...]:
    """Write the folder ``jsonld``."""
    plan, layers = job.world.plan, job.world.layers
    if plan is None:
        return ()
    return write_jsonld(plan, job.folder / "jsonld", layers)


def write_jsonld(
    plan: FloorPlan, folder: Path, layers: Sequence[SceneryLayer] = ()
) -> tuple[Path, ...]:
    """Write a plan and scenery layers to ``folder``; return the paths of what was written.

    ``skeleton.json``, ``shape.json``, ``polyhedron.json``, ``spatial_relations.json``,
    ``coordinate.json`` and ``floorplan.json`` as the published tools read them from a folder, and
    the same nodes in one file, ``<plan>.jsonld``, which a campaign can name. Each layer is
    ``<layer>.scenery.jsonld``; objects and instances of all of them are in ``objects.json``, for
    the published tools again. Raises :class:`InputError` for objects that cannot be placed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = [
        _write(document, folder / f"{name}.json") for name, document in plan_documents(plan).items()
    ]
    written.append(_write(plan_document(plan), folder / f"{file_name(plan.name)}.jsonld"))
    if any(layer.models or layer.instances for layer in layers):
        written.append(_write(objects_document(plan, layers), folder / "objects.json"))
    for layer in layers:
        path = folder / f"{file_name(layer.name)}.scenery.jsonld"
        written.append(_write(scenery_document(layer, plan, layers), path))
    return tuple(written)


def _write(document: dict[str, Any], path: Path) -> Path:
    """Write a document, one node a line."""
    nodes = ",\n".join(f"  {_dump(node)}" for node in document["@graph"])
    head = f'{{\n"@context": {_dump(document["@context"])},\n"@graph": [\n'
    path.write_text(f"{head}{nodes}\n]\n}}\n", encoding="utf-8", newline="\n")
    return path


def _dump(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
