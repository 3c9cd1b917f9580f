"""Composable models of building C: text to a checked graph, and rdflib's own JSON-LD beside it.

rdflib is given the same document with its contexts in line; it knows the terms of the first type
of a node only and loses the others.
"""

import json
import statistics
import time
from pathlib import Path

from rdflib import Graph

from grammars.floorplan import load_floorplan
from grammars.jsonld import (
    check_composition,
    compose,
    decompose,
    expand_text,
    scene_document,
    validate,
)
from grammars.jsonld import vocabulary as contexts
from grammars.jsonld.rdf import graph_of
from grammars.scenery import load_scenery
from tests.benchmarks.measurement import Measurement, Reference

FOLDER = Path(__file__).parents[2] / "campaigns" / "ortega2024"
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
    plan_file = FOLDER / "building_c.fpm"
    files = [FOLDER / f"{name}.scenery" for name in ("doors", "doors_random")]
    plan, layers = load_floorplan(plan_file), [load_scenery(file) for file in files]
    graph = compose(plan, layers)
    document = scene_document(plan)
    inlined = [contexts.context_for(c, set()) if isinstance(c, str) else c
               for c in document["@context"]]  # fmt: skip
    text = json.dumps(document | {"@context": inlined})
    ours = _timed(lambda: graph_of(expand_text(text, "building_c.jsonld")))
    theirs = _timed(lambda: Graph().parse(data=text, format="json-ld"))
    kept = len(graph_of(expand_text(text, "building_c.jsonld")))
    lost = kept - len(Graph().parse(data=text, format="json-ld"))
    rows = (
        ("text to plan and layers", _timed(lambda: (load_floorplan(plan_file),
                                                    [load_scenery(f) for f in files]))),
        ("checked as one graph, without rdflib", _timed(lambda: check_composition(plan, layers))),
        (f"composed, {len(graph)} triples", _timed(lambda: compose(plan, layers))),
        ("validated, with SHACL", _timed(lambda: validate(graph))),
        ("taken apart again", _timed(lambda: decompose(graph))),
    )  # fmt: skip
    beside = Reference("plan to rdflib by rdflib alone", 1e3 * theirs)
    for what, seconds in rows:
        yield Measurement(what, 1e3 * seconds, "ms", beside)
    yield Measurement(
        "plan as JSON-LD to rdflib", 1e3 * ours, "ms", beside, (), f"rdflib loses {lost} triples"
    )
