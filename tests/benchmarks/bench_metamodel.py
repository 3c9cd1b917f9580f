"""JSON-LD of building C: read, held to the shapes, and rdflib's own reading beside it."""

import json
import statistics
import time
from pathlib import Path

from rdflib import Graph

from grammars.floorplan import load_floorplan
from grammars.jsonld import scene_document
from grammars.jsonld._checks import refuse_broken
from grammars.jsonld._expand import expand_text
from grammars.jsonld._plan_reader import read_plan
from grammars.jsonld.rdf import graph_of
from tests.benchmarks.measurement import Measurement, Reference

PLAN = Path(__file__).parents[2] / "campaigns" / "ortega2024" / "building_c.fpm"
REPEATS = 3


def _timed(work):
    """Return the median CPU seconds of some runs, one before them not counted."""
    work()
    taken = []
    for _ in range(REPEATS):
        begin = time.process_time()
        work()
        taken.append(time.process_time() - begin)
    return statistics.median(taken)


def measure():
    """Yield each step, rdflib reading the same document being the reference."""
    text = json.dumps(scene_document(load_floorplan(PLAN)))
    nodes = expand_text(text, "building_c.jsonld")
    graph = graph_of(nodes)
    theirs = _timed(lambda: Graph().parse(data=text, format="json-ld"))
    beside = Reference("rdflib reading the document by itself", 1e3 * theirs)
    rows = (
        ("read by PyLD", lambda: expand_text(text, "building_c.jsonld")),
        (f"as a graph of {len(graph)} triples", lambda: graph_of(nodes)),
        ("held to the shapes", lambda: refuse_broken(nodes)),
        ("made a floor plan", lambda: read_plan(nodes, "building_c.jsonld")),
    )
    for what, work in rows:
        yield Measurement(what, 1e3 * _timed(work), "ms", beside)
