"""JSON-LD documents as nodes, and what rdflib alone would lose."""

import json
from pathlib import Path

import pytest
from rdflib import URIRef

from grammars.floorplan import parse_floorplan
from grammars.jsonld import plan_documents
from grammars.jsonld import vocabulary as contexts
from grammars.jsonld._expand import expand_text
from grammars.jsonld.rdf import graph_of
from grammars.jsonld.vocabulary import COORD, GEOM
from grammars.text.diagnostics import InputError
from tests.languages.jsonld.published_tools import LIMIT, by_pyld, inlined, said
from tests.languages.jsonld.samples import document, hinged_door, two_leaves
from tests.languages.jsonld.test_plan_jsonld import CELL, DOOR

PLAN = parse_floorplan(CELL + DOOR)


def expanded(data):
    return expand_text(json.dumps(data), "data.json")


@pytest.mark.parametrize(
    "data",
    [plan_documents(PLAN)["coordinate"], plan_documents(PLAN)["floorplan"], document(hinged_door()),
     document(two_leaves())],
    ids=["coordinate", "floorplan", "door", "lift"],
)  # fmt: skip
def test_documents_mean_what_the_standard_says(data):
    ours = graph_of(expanded(data))
    # Others refer to more contexts than PyLD reads of one document.
    assert said(ours) == said(by_pyld(inlined(data)))


def test_every_type_of_a_node_brings_its_terms():
    graph = graph_of(expanded(plan_documents(PLAN)["coordinate"]))
    for term in ("as-seen-by", "x", "y", "z", "of-pose", "alpha"):
        of_poses = set(graph.subjects(None, URIRef(COORD["PoseCoordinate"])))
        assert of_poses
        assert all((node, URIRef(COORD[term]), None) in graph for node in of_poses), term


def test_numbers_keep_every_digit_in_a_graph():
    value = 0.1 + 0.2
    nodes = expanded({"@id": "urn:a:b", "urn:a:p": value})
    ((_, _, literal),) = list(graph_of(nodes))
    assert float(str(literal)) == value


@pytest.mark.parametrize(
    ("context", "message"),
    [
        ("https://example.org/metamodels/other.json", "is not known here and nothing is fetched"),
        ("https://secorolab.github.io/metamodels/geometry/polytop.json", "did you mean"),
        ({"a": "b:c", "b": "a:c"}, "Cyclical"),
        ({"a": 3}, "must be strings or objects"),
        ({"a": {"@id": "urn:x:a", "@container": "@nowhere"}}, "@container value"),
        ({"@import": "https://example.org/x"}, "is not known here"),
        ([3], "@context must be an object: 3"),
    ],
)
def test_contexts_that_cannot_be_read_are_refused(context, message):
    document = {"@context": context, "@graph": [{"@id": "urn:a:b", "@type": "a:b"}] * 3}
    with pytest.raises(InputError) as caught:
        expanded(document)
    (only,) = caught.value.findings
    assert message in only.message


def test_every_node_that_is_not_jsonld_is_reported_in_its_line():
    nodes = [{"@id": "urn:a:b", "@type": {}}, {"@id": "urn:a:c"}, {"@id": "urn:a:d", "@type": [5]}]
    with pytest.raises(InputError) as caught:
        expand_text(json.dumps(nodes, indent=0), "x.json")
    assert [d.where.line for d in caught.value.findings] == [3, 10]


def test_documents_may_refer_to_more_contexts_than_pyld_reads_by_default():
    addresses = [*map(contexts.rob2b, contexts.ROB2B_CONTEXTS),
                 *map(contexts.secoro, contexts.SECORO_CONTEXTS)]  # fmt: skip
    assert len(addresses) > LIMIT
    nodes = expanded({"@context": addresses, "@id": "urn:a:b", "@type": "Frame"})
    assert nodes.by_id["urn:a:b"].types == [GEOM["Frame"]]


def test_keys_that_lead_back_to_their_node_are_read():
    back = {"@id": "urn:a:b", "@reverse": {"urn:a:p": {"@id": "urn:a:c"}}}
    assert expanded(back).by_id["urn:a:c"].refs("urn:a:p") == ["urn:a:b"]


def test_text_in_the_place_of_a_node_is_refused():
    with pytest.raises(InputError, match='expected nodes in braces, found "hall"'):
        expanded({"@graph": [{"@id": "urn:a:b"}, "hall"]})


def test_our_contexts_are_documents_with_one_context_each():
    folder = Path(contexts.__file__).with_name("contexts")
    files = sorted(folder.glob("*.json"))
    assert len(files) == 13
    for file in files:
        assert list(json.loads(file.read_text())) == ["@context"]
        expanded(json.loads(file.read_text()) | {"@graph": []})
