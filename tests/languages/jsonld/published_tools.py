"""What published tools do with JSON-LD: PyLD by its defaults, rdflib, poses walked by name."""

import json
import math
import warnings

import numpy as np
import pytest
from rdflib import RDF, Graph, Literal, URIRef
from rdflib.compare import to_isomorphic

from grammars.jsonld import vocabulary as contexts
from grammars.jsonld.vocabulary import COORD, REL

LIMIT = 10
"""Remote contexts that PyLD reads of one document."""


ROB2B_GEOMETRY = ("coordinates", "structural-entities", "spatial-relations")


def local_context(address, options=None):
    """Serve our context for a published address, as a document loader of PyLD."""
    context = contexts.context_for(address, set())
    return {
        "contentType": "application/ld+json",
        "contextUrl": None,
        "documentUrl": address,
        "document": {"@context": context},
    }


def by_pyld(data):
    """Return what PyLD reads by its default limits, contexts from here instead of the network."""
    jsonld = pytest.importorskip("pyld").jsonld
    options = {"format": "application/n-quads", "documentLoader": local_context}
    return Graph().parse(data=jsonld.to_rdf(data, options), format="nt")


def inlined(data):
    """Return a document with our contexts in the place of the published ones."""
    written = data["@context"]
    parts = [
        contexts.context_for(part, set()) if isinstance(part, str) else part
        for part in (written if isinstance(written, list) else [written])
    ]
    return data | {"@context": parts}


def by_rdflib(data):
    """Return what rdflib reads: of terms scoped to types, those of the first type of a node."""
    with warnings.catch_warnings():
        # Its own parser makes graphs of a class it calls deprecated.
        warnings.simplefilter("ignore", DeprecationWarning)
        return Graph().parse(data=json.dumps(inlined(data)), format="json-ld")


def compact(graph, plan):
    """Return the graph of a plan as one document, in the way ``transform`` writes it."""
    jsonld = pytest.importorskip("pyld").jsonld
    contexts_of_plans = [
        {plan: f"{contexts.PLANS}{plan}/"},
        contexts.rob2b("qudt.json").replace("https:", "http:"),
        *(contexts.rob2b(f"geometry/{name}.json") for name in ROB2B_GEOMETRY),
        contexts.secoro("geometry/coordinates.json"),
        contexts.secoro("geometry/polytope.json"),
        contexts.secoro("floorplan/floorplan.json"),
    ]
    expanded = jsonld.from_rdf(graph.serialize(format="nt"), {"format": "application/n-quads"})
    options = {"documentLoader": local_context}
    return jsonld.compact(expanded, {"@context": contexts_of_plans}, options)


def said(graph):
    """Return what a graph says, for comparison: numbers as JSON-LD's 16 digits have them."""
    settled = Graph()
    for subject, predicate, value in graph:
        is_number = isinstance(value, Literal) and type(value.value) in (int, float)
        settled.add((subject, predicate, Literal(f"{value.value:.12g}") if is_number else value))
    return to_isomorphic(settled)


def walked_by_name(graph):
    """Return points in the world as scenery_builder finds them.

    It goes from frame to frame along poses whichever way they point, and turns a pose round when
    the identifier of the next one has "wall" in it more than once, unless it is of an opening.
    """
    around = {}
    for pose, _, frame in graph.triples((None, URIRef(REL["of"]), None)):
        other = graph.value(pose, URIRef(REL["with-respect-to"]))
        around.setdefault(frame, []).append((pose, other))
        around.setdefault(other, []).append((pose, frame))
    numbers = {graph.value(c, URIRef(COORD["of-pose"])): c for c in _coordinates(graph, "Pose")}
    world = next(frame for frame in around if str(frame).endswith("/world-frame"))
    found = {}
    for each in _coordinates(graph, "Position"):
        frame = graph.value(each, URIRef(COORD["as-seen-by"]))
        position = graph.value(each, URIRef(COORD["of-position"]))
        at = np.array([*_numbers(graph, each, "x", "y", "z"), 1.0])
        poses = _path(around, frame, world)
        for pose, after in zip(poses, [*poses[1:], ""], strict=True):
            matrix = _matrix(*_numbers(graph, numbers[pose], "x", "y", "z", "alpha"))
            name = str(pose).rpartition("/")[2]
            opening = "entryway" in name or "window" in name
            if str(after).rpartition("/")[2].count("wall") > 1 and not opening:
                matrix = np.linalg.inv(matrix)
            at = matrix @ at
        point = str(graph.value(position, URIRef(REL["of"]))).rpartition("/")[2]
        found[point] = (float(at[0]), float(at[1]), float(at[2]))
    return found


def _coordinates(graph, kind):
    return graph.subjects(RDF.type, URIRef(COORD[f"{kind}Coordinate"]))


def _numbers(graph, node, *names):
    return [float(str(graph.value(node, URIRef(COORD[name])) or 0)) for name in names]


def _matrix(x, y, z, alpha):
    c, s = math.cos(alpha), math.sin(alpha)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])


def _path(around, start, goal):
    came = {start: (None, None)}
    queue = [start]
    for node in queue:
        for pose, other in around[node]:
            if other not in came and other in around:
                came[other] = (pose, node)
                queue.append(other)
    poses = []
    while goal != start:
        pose, goal = came[goal]
        poses.append(pose)
    return poses[::-1]
