"""What we write is read by published tools: PyLD with its defaults, rdflib, scenery_builder."""

import functools
import json
import math
import warnings

import numpy as np
import pytest
from rdflib import RDF, Graph, Literal, URIRef

from grammars.floorplan import load_floorplan, parse_floorplan
from grammars.jsonld import (
    objects_document,
    plan_documents,
    scene_document,
    scenery_document,
)
from grammars.jsonld import vocabulary as contexts
from grammars.jsonld._expand import expand_text
from grammars.jsonld.rdf import graph_of
from grammars.jsonld.vocabulary import COORD, DYN, GZB, OBJ, REL
from tests.languages.plans import HERE, layer, model_text, two_rooms
from tests.languages.test_jsonld_plans import ODD

LIMIT = 10
"""Remote contexts that PyLD reads of one document."""

DOORS = """
object table
    link top circle radius 40 cm from 70 cm to 74 cm, mass 20 kg
way is a hinged_door in kitchen_doorway, hinge left, opening inwards, starts open
table_1 is a table in kitchen, x 0.2 m
"""


def plain(document):
    return json.loads(json.dumps(document))


MODELS = ("skeleton", "shape", "polyhedron", "spatial_relations", "coordinate", "floorplan")
NAMES = (*MODELS, "scene", "objects", "layer")


@functools.cache
def documents():
    plan, objects = two_rooms(), layer(DOORS)
    made = {
        **plan_documents(plan),
        "scene": scene_document(plan, [objects]),
        "objects": objects_document(plan, [objects]),
        "layer": scenery_document(objects, plan),
    }
    assert tuple(made) == NAMES
    return {name: plain(document) for name, document in made.items()}


def local_context(address, options=None):
    """Serve our context for a published address, as a document loader of PyLD."""
    context = contexts.context_for(address, set())
    return {
        "contentType": "application/ld+json",
        "contextUrl": None,
        "documentUrl": address,
        "document": {"@context": context},
    }


@functools.cache
def published(name):
    """Return what PyLD reads of one of the documents."""
    return by_pyld(documents()[name])


def by_pyld(data):
    """Return what PyLD reads by its default limits, contexts from here instead of the network."""
    from pyld import jsonld

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


def by_us(data):
    return graph_of(expand_text(json.dumps(data), "data.json"))


def facts(graph):
    """Return the triples of a graph with its lists as tuples, numbers with JSON-LD's 16 digits."""

    def value(node):
        if node == RDF.nil or (node, RDF.first, None) in graph:
            return tuple(value(item) for item in graph.items(node))
        is_number = isinstance(node, Literal) and type(node.value) in (int, float)
        return f"{node.value:.12g}" if is_number else str(node)

    links = (RDF.first, RDF.rest)
    return {(str(s), str(p), value(o)) for s, p, o in graph if p not in links}


@pytest.mark.parametrize("path", ["errors/door_graph/door.jsonld", "models/lift.jsonld"])
def test_documents_mean_what_the_standard_says(path):
    data = json.loads((HERE / path).read_text())
    # Others refer to more contexts than PyLD reads of one document.
    assert facts(by_us(data)) == facts(by_pyld(inlined(data)))


@pytest.mark.parametrize("name", NAMES)
def test_pyld_reads_by_its_defaults_what_we_write(name):
    data = documents()[name]
    if isinstance(data["@context"], list):
        assert sum(isinstance(part, str) for part in data["@context"]) <= LIMIT
    assert facts(published(name)) == facts(by_us(data))


@pytest.mark.parametrize("name", ["coordinate", "objects", "scene", "layer"])
def test_rdflib_loses_nothing_of_what_we_write(name):
    assert facts(by_rdflib(documents()[name])) == facts(published(name))


def world_corners(plan):
    """Return the corners of spaces, walls, features and openings by their published name."""
    corners = {}
    for space in plan.spaces:
        corners |= {f"{space.name}-corner-{k}": (*p, 0.0) for k, p in enumerate(space.outline)}
    solids = [(wall.id, wall.footprint, wall.height) for wall in plan.walls]
    solids += [(feature.id, feature.footprint, feature.height) for feature in plan.features]
    for id, ring, height in solids:
        points = [(*p, 0.0) for p in ring] + [(*p, height) for p in ring]
        corners |= {f"{id}-corner-{k}": p for k, p in enumerate(points)}
    for opening in plan.openings:
        corners |= {f"{opening.id}-corner-{k}": p for k, p in enumerate(opening.near)}
    return corners


def numbers(graph, node, *names):
    return [float(str(graph.value(node, URIRef(COORD[name])) or 0)) for name in names]


def coordinates(graph, kind):
    return graph.subjects(RDF.type, URIRef(COORD[f"{kind}Coordinate"]))


def matrix(x, y, z, alpha):
    c, s = math.cos(alpha), math.sin(alpha)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])


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
    poses = {graph.value(c, URIRef(COORD["of-pose"])): c for c in coordinates(graph, "Pose")}
    world = next(frame for frame in around if str(frame).endswith("/world-frame"))
    placed, queue = {world: (np.eye(4), "")}, [world]
    for node in queue:
        there, following = placed[node]
        for pose, other in around[node]:
            if other not in placed and other in around:
                step = matrix(*numbers(graph, poses[pose], "x", "y", "z", "alpha"))
                name = str(pose).rpartition("/")[2]
                is_opening = "entryway" in name or "window" in name
                if following.count("wall") > 1 and not is_opening:
                    step = np.linalg.inv(step)
                placed[other] = (there @ step, name)
                queue.append(other)
    points = {}
    for each in coordinates(graph, "Position"):
        there, _ = placed[graph.value(each, URIRef(COORD["as-seen-by"]))]
        position = graph.value(each, URIRef(COORD["of-position"]))
        at = there @ np.array([*numbers(graph, each, "x", "y", "z"), 1.0])
        points[str(graph.value(position, URIRef(REL["of"]))).rpartition("/")[2]] = at[:3]
    return points


# A pose that is tilted is beyond the published tool, which knows turns about z only.
UPRIGHT = (
    ODD.replace(" rotation: y: 3 deg", "")
    .replace("Column hall:", "Column post:")
    .replace("Entryway pillar", "Entryway passage")
)


@pytest.mark.parametrize("text", [model_text("by_walls.fpm"), UPRIGHT], ids=["walls", "odd"])
def test_poses_walked_by_their_names_lead_to_the_world(text):
    plan = parse_floorplan(text)
    points = walked_by_name(by_pyld(scene_document(plan)))
    expected = world_corners(plan)
    assert expected.keys() <= points.keys()
    for name, corner in expected.items():
        assert points[name] == pytest.approx(corner, abs=1e-9), name


def test_near_faces_are_level_to_the_last_digit(campaigns):
    """The published mesh generator tells the near face of an opening by ``y == 0.0``."""
    plan = load_floorplan(campaigns / "ortega2024" / "building_c.fpm")
    nodes = {node["@id"]: node for node in plan_documents(plan)["coordinate"]["@graph"]}
    for opening in plan.openings:
        frame = f"{opening.kind}-{opening.id}-frame"
        for k in range(len(opening.near)):
            assert nodes[f"coord-position-{opening.id}-corner-{k}-wrt-{frame}"]["y"] == 0.0


def test_bodies_have_what_a_model_for_gazebo_is_made_of():
    """A frame first among the simplices, moments, one shape for each view, a material."""
    nodes = documents()["objects"]["@graph"]
    frames = {node["@id"] for node in nodes if "Frame" in node["@type"]}
    bodies = [node for node in nodes if "SimplicialComplex" in node["@type"]]
    assert bodies
    assert all(body["simplices"][0] in frames for body in bodies)
    graph = published("objects")
    for _, _, link in graph.triples((None, URIRef(OBJ["object-links"]), None)):
        view = graph.value(predicate=URIRef(GZB["gz-link"]), object=link)
        inertia = graph.value(view, URIRef(GZB["inertia"]))
        for part in (GZB["visual"], GZB["collision"], GZB["material"]):
            assert graph.value(view, URIRef(part)) is not None
        for moment in ("mass", "xx", "yy", "zz"):
            assert float(str(graph.value(inertia, URIRef(DYN[moment])))) > 0.0


def test_identifiers_carry_the_words_published_tools_look_for():
    """Prefixes of four letters, ``pose`` in poses, the kind in frames of openings."""
    graph = published("scene")
    poses = set(graph.objects(None, URIRef(COORD["of-pose"])))
    assert poses
    assert all("pose" in str(pose) for pose in poses)
    frames = {str(f).rpartition("/")[2] for f in graph.objects(None, URIRef(COORD["as-seen-by"]))}
    assert {"entryway-kitchen_doorway-frame", "window-hall_window-frame"} <= frames
    assert documents()["objects"]["@context"]["item"] == "urn:scenario-tui:item:"
    assert all(node["@id"].startswith("item:") for node in documents()["objects"]["@graph"])
