"""Provenance of an export in W3C PROV-O, as Turtle: sources, parameters, program, files."""

from __future__ import annotations

import dataclasses
import hashlib
from importlib.metadata import version
from pathlib import Path
from typing import Final
from urllib.parse import quote

from rdflib import Graph, Literal, Namespace, URIRef
from rdflib.namespace import DCTERMS, PROV, RDF, XSD

from grammars.text.codec import digest
from templates.world import ExportJob

_SHA256: Final = URIRef("https://schema.org/sha256")


def write_provenance(job: ExportJob) -> tuple[Path, ...]:
    """Write ``<world>.prov.ttl``: the files of this export so far, and their scene."""
    here, graph = Namespace(f"urn:x-scenario:{quote(job.name)}:"), Graph()

    def add(name: str, kind: URIRef, title: str, sha256: str = "") -> URIRef:
        node = here[quote(name)]
        graph.add((node, RDF.type, kind))
        graph.add((node, DCTERMS.title, Literal(title)))
        if sha256:
            graph.add((node, _SHA256, Literal(sha256)))
        return node

    program = add("program", PROV.SoftwareAgent, "scenario-tui")
    graph.add((program, DCTERMS.hasVersion, Literal(version("scenario-tui"))))
    world, settings = job.world, dataclasses.asdict(job.settings)
    scene = add("scene", PROV.Entity, f"scene of {world.scene.name}", digest(world.scene))
    for number, source in enumerate(world.sources, 1):
        plan = add(f"source/{number}/{source.name}", PROV.Plan, source.name, _digest(source))
        graph.add((scene, PROV.wasDerivedFrom, plan))
    activity = add("export", PROV.Activity, "export")
    graph.add((activity, PROV.wasAssociatedWith, program))
    graph.add((activity, PROV.used, scene))
    timestamp = settings.pop("timestamp")
    settings |= {"laser_height": job.laser_height, "resolution": job.resolution}
    for name, value in {**settings, "rule": world.rule, "doors": world.doors}.items():
        parameter = add(f"parameter/{name}", PROV.Entity, name)
        graph.add((parameter, PROV.value, Literal(value)))
        graph.add((activity, PROV.used, parameter))
    for path in (path for paths in job.files.values() for path in paths):
        name = path.relative_to(job.folder).as_posix()
        file = add(f"file/{name}", PROV.Entity, name, _digest(path))
        graph.add((file, PROV.wasGeneratedBy, activity))
        graph.add((file, PROV.wasDerivedFrom, scene))
        if timestamp:
            graph.add((file, PROV.generatedAtTime, Literal(timestamp, datatype=XSD.dateTime)))
    return (job.write(job.path(f"{job.name}.prov.ttl"), graph.serialize(format="turtle")),)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
