"""Linked data about a world: its models as JSON-LD, and where its artefacts come from (PROV-O).

Models go into the six published files and into one. Provenance says of every artefact which
files, parameters and program it was made from, in W3C PROV-O as JSON-LD.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from grammars.floorplan import FloorPlan
from grammars.jsonld import (
    objects_document,
    plan_document,
    plan_documents,
    scenery_document,
)
from grammars.scenery import SceneryLayer
from grammars.text.codec import digest
from grammars.text.shipped import shipped_folder
from templates.naming import file_name
from templates.world import ExportJob


def export_jsonld(job: ExportJob) -> tuple[Path, ...]:
    """Write the folder ``jsonld``."""
    plan, layers = job.world.plan, job.world.layers
    if plan is None:
        return ()
    folder = job.folder / "jsonld"
    made = job.cached(("jsonld", plan, layers), lambda: write_jsonld(plan, folder, layers))
    return tuple(_copied(path, job.path("jsonld", path.name)) for path in made)


def _copied(path: Path, to: Path) -> Path:
    """Return ``to``, a copy of a file of this export."""
    if to != path:
        to.write_bytes(path.read_bytes())
    return to


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


_CONTEXT: Final = {
    "prov": "http://www.w3.org/ns/prov#",
    "dcterms": "http://purl.org/dc/terms/",
    "spdx": "http://spdx.org/rdf/terms#",
    "xsd": "http://www.w3.org/2001/XMLSchema#",
    "rdfs": "http://www.w3.org/2000/01/rdf-schema#",
    "id": "@id",
    "type": "@type",
    "label": "rdfs:label",
    "title": "dcterms:title",
    "identifier": "dcterms:identifier",
    "hasVersion": "dcterms:hasVersion",
    "extent": "dcterms:extent",
    "checksum": "spdx:checksum",
    "algorithm": {"@id": "spdx:algorithm", "@type": "@id"},
    "checksumValue": "spdx:checksumValue",
    "value": "prov:value",
    "used": {"@id": "prov:used", "@type": "@id"},
    "wasGeneratedBy": {"@id": "prov:wasGeneratedBy", "@type": "@id"},
    "wasDerivedFrom": {"@id": "prov:wasDerivedFrom", "@type": "@id"},
    "wasAssociatedWith": {"@id": "prov:wasAssociatedWith", "@type": "@id"},
    "wasAttributedTo": {"@id": "prov:wasAttributedTo", "@type": "@id"},
    "actedOnBehalfOf": {"@id": "prov:actedOnBehalfOf", "@type": "@id"},
    "hadMember": {"@id": "prov:hadMember", "@type": "@id"},
    "generatedAtTime": {"@id": "prov:generatedAtTime", "@type": "xsd:dateTime"},
}
_LIBRARIES: Final = ("jinja2", "manifold3d", "numpy", "resvg-py", "shapely", "trimesh")
_FOLDERS: Final = ("gazebo", "jsonld", "keyframes", "launch", "maps", "mesh", "tasks")


def write_provenance(job: ExportJob) -> tuple[Path, ...]:
    """Write ``<world>.prov.jsonld`` about what this export made so far.

    Alone, it tells of the artefacts that earlier exports of this world left in the folder.
    """
    job.finish()
    path = job.path(f"{job.name}.prov.jsonld")
    made = {kind: paths for kind, paths in job.made.items() if paths}
    graph = provenance(job, made or _found(job, path))
    document = {"@context": _CONTEXT | {"here": _base(job)}, "@graph": graph}
    text = json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False)
    return (job.write(path, text + "\n"),)


def provenance(job: ExportJob, made: dict[str, tuple[Path, ...]]) -> list[dict[str, Any]]:
    """Return the nodes of the provenance of ``made`` files by kind, each file once."""
    agent, *libraries = (_agent(name) for name in ("scenario-tui", *_LIBRARIES))
    plan = ["prov:Entity", "prov:Plan"]
    named = _named(job.world.sources)
    sources = [_file("here:source", plan, name, path) for name, path in named]
    scene = {
        "id": "here:scene",
        "type": "prov:Entity",
        "title": f"scene of {job.world.scene.name}",
        "checksum": _sha256(digest(job.world.scene)),
        "wasDerivedFrom": [source["id"] for source in sources],
    }
    values = dataclasses.asdict(job.settings)
    values |= {"laser_height": job.laser_height, "resolution": job.resolution}
    values |= {"rule": job.world.rule, "doors": job.world.doors}
    parameters = [
        {"id": f"here:parameter/{name}", "type": "prov:Entity", "label": name, "value": value}
        for name, value in values.items()
        if name != "timestamp"
    ]
    inputs = [scene["id"], *(s["id"] for s in sources), *(p["id"] for p in parameters)]
    nodes: dict[str, dict[str, Any]] = {}
    for kind, paths in made.items():
        activity = f"here:export/{kind}"
        nodes[activity] = {
            "id": activity,
            "type": "prov:Activity",
            "label": f"export {kind}",
            "used": inputs,
            "wasAssociatedWith": [agent["id"], *(library["id"] for library in libraries)],
        }
        for path in paths:
            name = path.relative_to(job.folder).as_posix()
            entity = _file("here:file", "prov:Entity", name, path) | {
                "wasGeneratedBy": activity,
                "wasDerivedFrom": scene["id"],
                "wasAttributedTo": agent["id"],
            }
            if job.settings.timestamp:
                entity["generatedAtTime"] = job.settings.timestamp
            nodes.setdefault(entity["id"], entity)
    whole = {
        "id": "here:artefacts",
        "type": ["prov:Entity", "prov:Collection"],
        "title": f"artefacts of {job.world.name}",
        "hadMember": [id for id, node in nodes.items() if node["type"] == "prov:Entity"],
    }
    return [agent, *libraries, *sources, scene, *parameters, *nodes.values(), whole]


def _base(job: ExportJob) -> str:
    return f"urn:x-scenario:{quote(job.name)}:"


def _found(job: ExportJob, own: Path) -> dict[str, tuple[Path, ...]]:
    """Return the files of earlier exports: those in our folders, and those with our name."""
    inside = [p for name in _FOLDERS for p in (job.folder / name).rglob("*") if p.is_file()]
    beside = [p for p in job.folder.glob("*") if p.is_file() and p != own and _ours(job, p)]
    found = tuple(sorted({*inside, *beside}, key=lambda p: p.as_posix()))
    return {"artefacts": found} if found else {}


def _ours(job: ExportJob, path: Path) -> bool:
    return path.name.split(".")[0] in (job.name, job.building)


def _named(paths: tuple[Path, ...]) -> Iterator[tuple[str, Path]]:
    """Name each source once, from the folder all of them lie in: where that is, is nobody's."""
    found = {path.resolve(): path for path in paths}
    # Absolute paths would tell whose machine it was, and change the bytes from one to the next.
    # What ships lies wherever the project is installed, unless all of it does.
    shipped = shipped_folder()
    own = [path for path in found if not path.is_relative_to(shipped)]
    folder = os.path.commonpath([path.parent for path in own or found]) if found else ""
    for whole, path in found.items():
        if own and whole not in own:
            yield f"shipped/{whole.relative_to(shipped).as_posix()}", path
        else:
            yield whole.relative_to(folder).as_posix(), path


def _agent(name: str) -> dict[str, Any]:
    return {
        "id": f"here:agent/{name}",
        "type": ["prov:Agent", "prov:SoftwareAgent"],
        "label": name,
        "hasVersion": _version(name),
    }


def _file(id: str, kind: str | list[str], name: str, path: Path) -> dict[str, Any]:
    data = path.read_bytes()
    return {
        "id": f"{id}/{quote(name)}",
        "type": kind,
        "title": name,
        "extent": len(data),
        "checksum": _sha256(hashlib.sha256(data).hexdigest()),
    }


def _sha256(value: str) -> dict[str, str]:
    algorithm = "spdx:checksumAlgorithm_sha256"
    return {"type": "spdx:Checksum", "algorithm": algorithm, "checksumValue": value}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
