"""Our JSON-LD processor against PyLD, and what rdflib alone would lose."""

import json
from pathlib import Path

import pytest
from rdflib import URIRef

from grammars.floorplan import parse_floorplan
from grammars.jsonld import expand, plan_document, plan_documents
from grammars.jsonld import vocabulary as contexts
from grammars.jsonld.rdf import graph_of
from grammars.jsonld.vocabulary import COORD, ContextError, JsonLdContext
from tests.grammars.jsonld.published_tools import by_pyld, inlined, said
from tests.grammars.jsonld.samples import document, hinged_door, two_leaves
from tests.grammars.jsonld.test_plan_jsonld import CELL, DOOR

PLAN = parse_floorplan(CELL + DOOR)


@pytest.mark.parametrize(
    "data",
    [plan_documents(PLAN)["coordinate"], plan_documents(PLAN)["floorplan"], document(hinged_door()),
     document(two_leaves())],
    ids=["coordinate", "floorplan", "door", "lift"],
)  # fmt: skip
def test_documents_mean_what_the_standard_says(data):
    ours = graph_of(expand(json.loads(json.dumps(data)), "data.json"))
    # Others refer to more contexts than PyLD reads of one document.
    assert said(ours) == said(by_pyld(inlined(data)))


def test_every_type_of_a_node_brings_its_terms():
    graph = graph_of(expand(plan_document(PLAN), "plan.json"))
    for term in ("as-seen-by", "x", "y", "z", "of-pose", "alpha"):
        of_poses = set(graph.subjects(None, URIRef(COORD["PoseCoordinate"])))
        assert of_poses
        assert all((node, URIRef(COORD[term]), None) in graph for node in of_poses), term


def test_numbers_keep_every_digit_in_a_graph():
    value = 0.1 + 0.2
    nodes = expand({"@id": "urn:a:b", "urn:a:p": value}, "x.json")
    ((_, _, literal),) = list(graph_of(nodes))
    assert float(str(literal)) == value


@pytest.mark.parametrize(
    ("context", "message"),
    [
        ("https://example.org/metamodels/other.json", "is not known here"),
        ("https://secorolab.github.io/metamodels/geometry/polytop.json", "did you mean"),
        ({"a": "b", "b": "a"}, "is defined by itself"),
        ({"a": 3}, "is defined as 3"),
        ({"a": {"@id": "urn:x:a", "@container": "@language"}}, "is not read here"),
        ({"@import": "x"}, "@import is not read"),
        ([3], "an object or an address"),
        ({"a": "plain"}, "which is no IRI"),
    ],
)
def test_contexts_that_cannot_be_read_are_refused(context, message):
    with pytest.raises(ContextError, match=message):
        JsonLdContext("", "", {}).extended(context, set())


def test_our_contexts_are_documents_with_one_context_each():
    folder = Path(contexts.__file__).with_name("contexts")
    files = sorted(folder.glob("*.json"))
    assert len(files) == 13
    for file in files:
        assert list(json.loads(file.read_text())) == ["@context"]
        JsonLdContext("", "", {}).extended(json.loads(file.read_text())["@context"], set())
