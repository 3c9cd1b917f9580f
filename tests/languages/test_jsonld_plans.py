"""Floor plans as JSON-LD: our files, those of 2023, and the same plan back from either."""

import json
import math
import shutil
from pathlib import Path

import pytest

from grammars.floorplan import parse_floorplan
from grammars.jsonld import (
    check_jsonld,
    load_floorplan_jsonld,
    load_scenery_jsonld,
    plan_documents,
    scene_document,
)
from grammars.jsonld import vocabulary as contexts
from grammars.jsonld._expand import expand_text
from grammars.jsonld.rdf import graph_of
from grammars.jsonld.vocabulary import GEOM
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import InputError, Severity
from templates.jsonld import write_jsonld
from tests.languages.plans import HERE, model_text, two_rooms, world_of

CELL, CELL_WITH_DOORWAY, ODD = map(model_text, ("cell.fpm", "cell_with_doorway.fpm", "odd.fpm"))
# Earlier identifiers began with "space-".
SPACE = CELL.replace("Space cell", "Space space")


def written(plan, folder):
    return write_jsonld(world_of(plan), folder)[-1]


def described(findings, folder):
    return "".join(f"{finding}\n" for finding in findings).replace(f"{folder}/", "")


def test_a_plan_has_the_published_nodes():
    plan = parse_floorplan(CELL_WITH_DOORWAY)
    published = json.loads((HERE / "errors" / "plan_graph" / "cell.jsonld").read_text())
    assert scene_document(plan)["@graph"] == published["@graph"]
    documents = plan_documents(parse_floorplan(CELL))
    assert documents["skeleton"]["@context"][0] == published["@context"][0]
    assert {name: len(document["@graph"]) for name, document in documents.items()} == {
        "skeleton": 48,
        "shape": 5,
        "polyhedron": 4,
        "spatial_relations": 41,
        "coordinate": 41,
        "floorplan": 6,
    }


def test_things_with_one_name_get_identifiers_of_their_own():
    document = plan_documents(parse_floorplan(ODD))["floorplan"]
    ids = [node["@id"] for node in document["@graph"]]
    assert len(set(ids)) == len(ids)
    assert {"hall", "column-hall", "plan-hall", "hall-pillar", "annex-pillar", "pillar"} <= set(ids)


@pytest.mark.parametrize("text", [ODD, SPACE], ids=["odd", "space"])
def test_a_plan_comes_back_bit_by_bit(text, tmp_path):
    plan = parse_floorplan(text, "plan.fpm")
    file, digest = written(plan, tmp_path), compile_scene(plan).digest
    for source in (file, tmp_path):
        back = load_floorplan_jsonld(source)
        assert back == plan
        assert compile_scene(back).digest == digest
    again = written(parse_floorplan(text, "other.fpm"), tmp_path / "again")
    assert again.read_bytes() == file.read_bytes()


def test_the_files_of_the_published_tool_are_read(tmp_path):
    """It writes keys its contexts lack, openings without a unit, corners of columns without z."""
    plan = parse_floorplan(ODD.replace("Column hall:", "Column post:"))
    for name, document in plan_documents(plan).items():
        for each in document["@graph"]:
            if "features" in each and each["@type"] == "Space":
                each["feature"] = each.pop("features")
            if each["@type"] in ("Pose", "Position"):
                each["quantity-kind"] = ["Angle", "Length"]
            if each["@type"] in ("Entryway", "Window"):
                del each["unit"]
            if each["@id"].startswith("coord-position-post-corner"):
                del each["z"]
        (tmp_path / f"{name}.json").write_text(json.dumps(document))
    back = load_floorplan_jsonld(tmp_path)
    assert back == plan
    assert any("quantity-kind" in warning.message for warning in back.warnings)


def test_one_divider_in_several_rooms_is_found(tmp_path):
    """Five dividers with the same names in four spaces send the published tools 50 m astray."""
    text = json.dumps(scene_document(parse_floorplan(ODD)))
    assert "annex-screen" in text
    (tmp_path / "hall.json").write_text(text.replace("annex-", "").replace("hall-screen", "screen"))
    errors = [d for d in check_jsonld(tmp_path / "hall.json") if d.severity is Severity.ERROR]
    assert any("divider-screen-frame is placed 2 times" in error.message for error in errors)
    assert any("screen: this belongs to several spaces" in error.message for error in errors)


def test_a_relative_identifier_resolves_against_a_given_base(tmp_path):
    """A plan without ``@base``, and a file that calls its things by their whole address."""
    written(two_rooms(), tmp_path)
    for file in tmp_path.glob("*.json"):
        document = json.loads(file.read_text())
        document["@context"] = [c for c in document["@context"] if not isinstance(c, dict)]
        file.write_text(json.dumps(document))
    assert load_floorplan_jsonld(tmp_path) == two_rooms()
    base = "https://example.org/two_rooms/"
    document = json.loads((tmp_path / "floorplan.json").read_text())
    document["@context"].append({"@base": base})
    (tmp_path / "floorplan.json").write_text(json.dumps(document))
    plan = load_floorplan_jsonld(tmp_path, base)
    assert plan == two_rooms()
    assert plan.warnings == ()


@pytest.fixture
def earlier(tmp_path):
    """A folder with the two rooms as a plan of December 2023, with the faults those have."""
    return shutil.copytree(HERE / "models" / "plan_2023", tmp_path / "plan")


def assert_same_rooms(plan, expected):
    """Hold spaces and walls to those expected, to a micrometre."""
    assert [space.name for space in plan.spaces] == [space.name for space in expected.spaces]
    for space, other in zip(plan.spaces, expected.spaces, strict=True):
        assert max(map(math.dist, space.outline, other.outline)) < 1e-6, space.name
        for wall, same in zip(space.walls, other.walls, strict=True):
            assert wall.id == same.id
            assert wall.thickness == pytest.approx(same.thickness, abs=1e-9)
            assert abs(math.remainder(wall.frame.yaw - same.frame.yaw, math.tau)) < 1e-6
            assert max(map(math.dist, wall.footprint, same.footprint)) < 1e-6, wall.id


def test_a_plan_of_2023_is_read_and_comes_back_from_an_export(earlier, tmp_path, golden):
    plan = load_floorplan_jsonld(earlier)
    assert plan.name == "two_rooms"
    assert_same_rooms(plan, two_rooms())
    assert {wall.height for wall in plan.walls} == {2.5}
    golden("models/plan_2023.txt", described(plan.warnings, earlier))
    written(plan, tmp_path / "now")
    for path in (tmp_path / "now", tmp_path / "now" / "two_rooms.jsonld"):
        back = load_floorplan_jsonld(path)
        assert back == plan
        assert back.warnings == ()


def test_a_folder_names_a_plan_and_what_stands_beside_it(earlier):
    shutil.copy(HERE / "errors" / "door_graph" / "door.jsonld", earlier / "door.json")
    assert_same_rooms(load_floorplan_jsonld(earlier), two_rooms())
    assert [model.name for model in load_scenery_jsonld(earlier).models] == ["door"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"M", "degrees"', '"feet", "degrees"', "the unit is not .*, found feet"),
        ('"theta": 0.0, "x": 0.0, "y": 0.0', '"z": null', "have none of x, y, z and alpha"),
        ("metamodels/qudt.json", "metamodels/qdut.json", 'did you mean "qudt.json"'),
        ('"as-seen-by": "geom:frame-hall-wall-0"', '"as-seen-by": "geom:frame-kitchen-wall-0"',
         "is not drawn in one frame|is seen by"),
    ],
)  # fmt: skip
def test_a_plan_of_2023_without_a_sane_reading_is_refused(earlier, old, new, message):
    text = (earlier / "coordinate.json").read_text()
    assert old in text
    (earlier / "coordinate.json").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        load_floorplan_jsonld(earlier)
    assert all(finding.where.line > 0 for finding in caught.value.findings)


def test_the_message_about_a_missing_file_names_the_file_that_needs_it(earlier):
    (earlier / "shape.json").unlink()
    with pytest.raises(InputError) as caught:
        load_floorplan_jsonld(earlier)
    first = caught.value.findings[0]
    assert (Path(first.where.file).name, first.where.line > 0) == ("floorplan.json", True)
    assert "polygon-hall-wall-0, which does not exist" in first.message


def test_numbers_keep_every_digit_in_a_graph():
    value = 0.1 + 0.2
    ((_, _, literal),) = graph_of(expand_text(f'{{"@id": "urn:a:b", "urn:a:p": {value!r}}}', "x"))
    assert float(str(literal)) == value


def test_keys_that_lead_back_to_their_node_are_read():
    back = '{"@id": "urn:a:b", "@reverse": {"urn:a:p": {"@id": "urn:a:c"}}}'
    assert expand_text(back, "x").by_id["urn:a:c"].refs("urn:a:p") == ["urn:a:b"]


def test_a_document_may_refer_to_all_contexts_that_are_kept_here():
    folder = Path(contexts.__file__).with_name("contexts")
    files = sorted(folder.glob("*.json"))
    assert len(files) == 13
    for file in files:
        assert list(json.loads(file.read_text())) == ["@context"]
    addresses = [*map(contexts.rob2b, contexts.ROB2B_CONTEXTS),
                 *map(contexts.secoro, contexts.SECORO_CONTEXTS)]  # fmt: skip
    document = {"@context": addresses, "@id": "urn:a:b", "@type": "Frame"}
    assert expand_text(json.dumps(document), "x").by_id["urn:a:b"].types == [GEOM["Frame"]]
