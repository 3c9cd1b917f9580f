"""What ``scenario check`` says a single file is."""

import json

import pytest

from grammars.floorplan import load_floorplan
from grammars.jsonld import scene_document
from grammars.scenery import load_scenery
from scenario_tui.library.checking import check_file
from templates.jsonld import write_jsonld
from tests.languages.plans import world_of


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("demo/flat.fpm", "floor plan with 4 spaces, 18 walls, 4 openings"),
        ("demo/flat.variation", "variation of flat with 5 draws"),
        ("demo/doors.scenery", "scenery layer"),
        ("demo/courier.mission.yaml", "mission with 4 waypoints"),
        ("robots/robile.yaml", "robot robile"),
        ("suts/pilot.yaml", "system under test pilot"),
        ("demo/campaign.yaml", "3 scenarios, 15 runs, 1 search"),
    ],
)
def test_every_kind_of_layer_is_known_and_sound(campaigns, name, kind):
    assert check_file(campaigns / name) == (kind, ())


def test_a_json_ld_graph_is_checked_as_a_whole(campaigns, tmp_path):
    document = scene_document(load_floorplan(campaigns / "demo" / "flat.fpm"))
    path = tmp_path / "flat.jsonld"
    path.write_text(json.dumps(document).replace('"of": "hall-frame"', '"of": "nowhere-frame"'))
    kind, found = check_file(path)
    assert kind == "JSON-LD graph"
    assert any("nowhere-frame" in d.message for d in found)


def test_a_folder_of_json_ld_files_is_checked_as_a_whole(campaigns, tmp_path):
    plan = load_floorplan(campaigns / "demo" / "flat.fpm")
    layers = [load_scenery(campaigns / "demo" / "doors.scenery")]
    write_jsonld(world_of(plan, layers), tmp_path / "flat")
    assert check_file(tmp_path / "flat") == ("JSON-LD graph", ())
    (tmp_path / "flat" / "shape.json").unlink()
    found = check_file(tmp_path / "flat")[1]
    assert any("hall-polygon, which does not exist" in d.message for d in found)
    (tmp_path / "nothing").mkdir()
    assert check_file(tmp_path / "nothing")[1][0].message == "is a folder"


def test_an_unknown_kind_of_file_says_what_is_known(tmp_path):
    path = tmp_path / "plan.dxf"
    path.write_text("")
    (finding,) = check_file(path)[1]
    assert ".fpm, .scenery, .variation, .jsonld" in finding.hint
