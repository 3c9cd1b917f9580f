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

_SCHEMA: Final = Namespace("https://schema.org/")
"""Where the property ``sha256`` comes from."""


def write_provenance(job: ExportJob) -> tuple[Path, ...]:
    """Write ``<world>.prov.ttl`` about the files that this export made so far."""
    path = job.path(f"{job.name}.prov.ttl")
    text = provenance(job).serialize(format="turtle")
    return (job.write(path, text),)


def provenance(job: ExportJob) -> Graph:
    """Return the provenance of an export: each file was generated from the scene by a kind."""
    here, graph = Namespace(f"urn:x-scenario:{quote(job.name)}:"), Graph()

    def add(name: str, kind: URIRef, title: str, sha256: str = "") -> URIRef:
        node = here[quote(name)]
        graph.add((node, RDF.type, kind))
        graph.add((node, DCTERMS.title, Literal(title)))
        if sha256:
            graph.add((node, _SCHEMA.sha256, Literal(sha256)))
        return node

    program = add("program", PROV.SoftwareAgent, "scenario-tui")
    graph.add((program, DCTERMS.hasVersion, Literal(version("scenario-tui"))))
    scene = add("scene", PROV.Entity, f"scene of {job.world.scene.name}", digest(job.world.scene))
    for number, source in enumerate(job.world.sources, 1):
        plan = add(f"source/{number}/{source.name}", PROV.Plan, source.name, _digest(source))
        graph.add((scene, PROV.wasDerivedFrom, plan))
    values = dataclasses.asdict(job.settings) | {
        "laser_height": job.laser_height,
        "resolution": job.resolution,
        "rule": job.world.rule,
        "doors": job.world.doors,
    }
    timestamp = values.pop("timestamp")
    for kind, paths in job.made.items():
        activity = add(f"export/{kind}", PROV.Activity, f"export {kind}")
        graph.add((activity, PROV.wasAssociatedWith, program))
        graph.add((activity, PROV.used, scene))
        for name, value in values.items():
            parameter = add(f"parameter/{name}", PROV.Entity, name)
            graph.add((parameter, PROV.value, Literal(value)))
            graph.add((activity, PROV.used, parameter))
        for made in paths:
            name = made.relative_to(job.folder).as_posix()
            file = add(f"file/{name}", PROV.Entity, name, _digest(made))
            graph.add((file, PROV.wasGeneratedBy, activity))
            graph.add((file, PROV.wasDerivedFrom, scene))
            if timestamp:
                generated = Literal(timestamp, datatype=XSD.dateTime)
                graph.add((file, PROV.generatedAtTime, generated))
    return graph


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
