"""Layers as files others can read, and read back as they were."""

import shutil

import pytest
from rdflib import Graph, Literal

from daemon.analysis.campaign_worlds import worlds_of_campaign
from grammars.floorplan import load_floorplan
from grammars.jsonld import check_jsonld, load_floorplan_jsonld, load_scenery_jsonld
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from templates.jsonld import write_jsonld
from tests.languages.plans import world_of


def test_a_scenario_written_as_jsonld_is_the_same_scene(campaigns, tmp_path):
    plan = load_floorplan(campaigns / "demo" / "flat.fpm")
    layers = [
        load_scenery(campaigns / "demo" / f"{name}.scenery") for name in ("doors", "doors_open")
    ]
    written = write_jsonld(world_of(plan, layers), tmp_path)
    assert [path.name for path in written] == [
        *("skeleton.json", "shape.json", "polyhedron.json"),
        *("spatial_relations.json", "coordinate.json", "floorplan.json"),
        *("objects.json", "flat.jsonld", "doors.scenery.jsonld", "doors_open.scenery.jsonld"),
    ]
    back = [load_scenery_jsonld(path) for path in written[-2:]]
    scene = compile_scene(load_floorplan_jsonld(written[7]), back)
    assert scene.digest == compile_scene(plan, layers).digest


# rdflib's own reader of JSON-LD makes graphs of a class that it calls deprecated.
pytestmark = pytest.mark.filterwarnings("ignore:ConjunctiveGraph:DeprecationWarning")


@pytest.fixture(scope="module")
def busy(campaigns, tmp_path_factory):
    """Return the folder of a scenario that does without some of its parts."""
    folder = shutil.copytree(campaigns / "demo", tmp_path_factory.mktemp("busy") / "demo")
    campaign = folder / "campaign.yaml"
    without = "without: [kitchen_door, behaviour of living_room_door]"
    text = campaign.read_text("utf-8")
    campaign.write_text(text.replace("doors_moving\n", f"doors_moving\n    {without}\n", 1))
    worlds, _ = worlds_of_campaign(campaign)
    write_jsonld(worlds[1], folder / "jsonld")
    return folder / "jsonld"


@pytest.fixture(scope="module")
def answers(busy):
    """Answer a query of the graph of that scenario."""
    graph = Graph().parse(busy / "flat.jsonld")
    return lambda query: {
        tuple(
            one.toPython() if isinstance(one, Literal) else one.n3(graph.namespace_manager)
            for one in row
        )
        for row in graph.query(query)
    }


def test_rdflib_reads_the_graph_of_a_scene_as_it_is(answers):
    opens = "SELECT ?at WHERE { ?move scn:of item:bedroom_door ; scn:to 'open' ; scn:at ?at }"
    assert answers(opens) == {(0.0,), (14.0,), (32.0,)}
    into = "SELECT ?door ?room WHERE { ?door scn:opens-into ?room }"
    assert answers(into) == {("item:bedroom_door", "fpm:bedroom")}


def test_what_a_scenario_does_without_is_in_the_files_of_layers_alone(busy, answers):
    assert check_jsonld(busy / "flat.jsonld") == ()
    for name in ("objects.json", "flat.jsonld"):
        assert '"@id": "item:kitchen_door"' not in (busy / name).read_text()
    moved = "SELECT DISTINCT ?door WHERE { ?move scn:of ?door }"
    assert answers(moved) == {("item:bedroom_door",)}
    told = "SELECT DISTINCT ?door WHERE { ?s scn:about ?door }"
    assert answers(told) == {("item:bedroom_door",), ("item:living_room_door",)}
    assert len(load_scenery_jsonld(busy / "doors.scenery.jsonld").instances) == 3
    assert len(load_scenery_jsonld(busy / "doors_moving.scenery.jsonld").sentences) == 3
