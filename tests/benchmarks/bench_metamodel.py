"""JSON-LD of building C: read, held to the shapes, and rdflib's own reading beside it."""

import json

from rdflib import Graph

from grammars.floorplan import load_floorplan
from grammars.jsonld import scene_document
from grammars.jsonld._checks import refuse_broken
from grammars.jsonld._expand import expand_text
from grammars.jsonld._plan_reader import read_plan
from grammars.jsonld.rdf import graph_of
from tests.benchmarks.measurement import side_by_side
from tests.parts import ROOT

PLAN = ROOT / "campaigns" / "ortega2024" / "building_c.fpm"


def measure():
    """Yield each step, rdflib reading the same document being the reference."""
    text = json.dumps(scene_document(load_floorplan(PLAN)))
    nodes = expand_text(text, "building_c.jsonld")
    graph = graph_of(nodes)
    works = {
        "rdflib reading the document by itself": lambda: Graph().parse(data=text, format="json-ld"),
        "read by PyLD": lambda: expand_text(text, "building_c.jsonld"),
        f"as a graph of {len(graph)} triples": lambda: graph_of(nodes),
        "held to the shapes": lambda: refuse_broken(nodes),
        "made a floor plan": lambda: read_plan(nodes, "building_c.jsonld"),
    }
    for work in works.values():
        work()
    yield from side_by_side(works, 3)
