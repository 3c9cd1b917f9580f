"""Models that others published load: those of 2023, whole folders, with the faults they have."""

import json
import math
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from grammars.floorplan import load_floorplan, parse_floorplan
from grammars.jsonld import check_jsonld, load_floorplan_jsonld, load_scenery_jsonld
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import InputError, Severity
from templates.jsonld import write_jsonld
from tests.languages.jsonld.earlier_models import write_plan
from tests.languages.jsonld.samples import document, hinged_door, table
from tests.languages.plans import two_rooms, world_of


def assert_same_rooms(plan, expected):
    """Hold spaces and walls to those expected, to a micrometre."""
    assert [s.name for s in plan.spaces] == [s.name for s in expected.spaces]
    for space, other in zip(plan.spaces, expected.spaces, strict=True):
        for p, q in zip(space.outline, other.outline, strict=True):
            assert p == pytest.approx(q, abs=1e-6), space.name
        for wall, same in zip(space.walls, other.walls, strict=True):
            assert wall.id == same.id
            assert wall.thickness == pytest.approx(same.thickness, abs=1e-9)
            assert abs(math.remainder(wall.frame.yaw - same.frame.yaw, math.tau)) < 1e-6
            for p, q in zip(wall.footprint, same.footprint, strict=True):
                assert p == pytest.approx(q, abs=1e-6), wall.id


def test_a_plan_of_2023_is_read(tmp_path):
    plan = two_rooms()
    back = load_floorplan_jsonld(write_plan(plan, tmp_path / "plan"))
    assert back.name == "two_rooms"
    assert_same_rooms(back, plan)
    assert {wall.height for wall in back.walls} == {2.5}
    said = "\n".join(f"{d.message} ({d.hint})" for d in back.warnings)
    for word in (
        "theta",
        '"degrees" is no unit',
        "given in the frame of its space",
        "the height of wall",
        "2.5 m is taken",
        "with respect to a frame (its origin is taken)",
        "no coordinates are given for feature",
        "no entryways and windows are given",
    ):
        assert word in said
    assert all(Path(d.where.file).parent == tmp_path / "plan" for d in back.warnings)


def test_a_folder_names_a_plan_and_what_stands_beside_it(tmp_path):
    folder = write_plan(two_rooms(), tmp_path / "plan")
    (folder / "door.json").write_text(json.dumps(document(hinged_door())))
    assert_same_rooms(load_floorplan_jsonld(folder), two_rooms())
    assert [m.name for m in load_scenery_jsonld(folder).models] == ["door"]


def test_plans_of_2023_come_back_from_an_export(tmp_path):
    plan = load_floorplan_jsonld(write_plan(two_rooms(), tmp_path / "earlier"))
    write_jsonld(world_of(plan), tmp_path / "now")
    for path in (tmp_path / "now", tmp_path / "now" / "two_rooms.jsonld"):
        back = load_floorplan_jsonld(path)
        assert back == plan
        assert back.warnings == ()


def test_what_a_plan_lacks_is_said_with_its_place(tmp_path):
    folder = write_plan(two_rooms(), tmp_path / "plan")
    (folder / "shape.json").unlink()
    with pytest.raises(InputError) as caught:
        load_floorplan_jsonld(folder)
    first = caught.value.findings[0]
    assert Path(first.where.file).name == "floorplan.json"
    assert first.where.line > 0
    assert "polygon-hall-wall-0, which does not exist" in first.message


def test_a_relative_identifier_resolves_against_a_given_base(tmp_path):
    """A plan without ``@base``, and a file that calls its things by their whole address."""
    write_jsonld(world_of(two_rooms()), tmp_path)
    for file in tmp_path.glob("*.json"):
        data = json.loads(file.read_text())
        data["@context"] = [c for c in data["@context"] if not isinstance(c, dict)]
        file.write_text(json.dumps(data))
    assert load_floorplan_jsonld(tmp_path) == two_rooms()
    base = "https://example.org/two_rooms/"
    whole = json.loads((tmp_path / "floorplan.json").read_text())
    whole["@context"].append({"@base": base})
    (tmp_path / "floorplan.json").write_text(json.dumps(whole))
    plan = load_floorplan_jsonld(tmp_path, base)
    assert plan == two_rooms()
    assert plan.warnings == ()


EARLIER_HOST = "/hbrs-sesame.github.io"


def faulty_door():
    """Return the door with the faults of the published one."""
    nodes = json.loads(json.dumps(hinged_door()))
    for node in nodes:
        if node["@id"] == "door:leaf":
            node["@id"] = "leaf"
        if node["@id"] == "door:hinge":
            node["origin-offset"] = "door:offset"
        if node["@id"] == "door:hinge-on-post-z":
            node["start"] = "door:nowhere"
        if node["@id"] == "door:ajar-angle":
            node["@type"].append("JointLowerLimit")
    offset = {"@id": "door:offset", "@type": "Position", "of": "door:hinge-on-leaf-origin"}
    return [*nodes, offset | {"with-respect-to": "door:hinge-on-post-origin"}]


def test_faults_of_the_published_door_are_said_and_read(tmp_path):
    text = json.dumps(document(faulty_door())).replace("/secorolab.github.io", EARLIER_HOST)
    (tmp_path / "door.json").write_text(text)
    (tmp_path / "sound.jsonld").write_text(json.dumps(document(hinged_door())))
    warnings = []
    layer = load_scenery_jsonld(tmp_path / "door.json", warnings)
    sound = load_scenery_jsonld(tmp_path / "sound.jsonld")
    assert layer.models[0].links == sound.models[0].links
    assert layer.models[0].joints == sound.models[0].joints
    said = "\n".join(f"{d.message} ({d.hint})" for d in warnings)
    for word in (
        'nothing is called "https://example.org/objects/door/leaf"',
        '"start" of hinge-on-post-z is nowhere, which does not exist',
        "offset: this position has no coordinates",
        "ajar-angle is the position of a state and typed JointLowerLimit",
    ):
        assert word in said


def split_door(folder):
    """Write the door as it is published: model, states and instance each in a file."""
    folder.mkdir(parents=True)
    nodes = hinged_door()
    of_states = [n for n in nodes if "ajar" in n["@id"]]
    of_instance = [n for n in nodes if "door:here" in n["@id"] or "instance" in n["@id"]]
    rest = [n for n in nodes if n not in of_states and n not in of_instance]
    for name, part in (("model", rest), ("states", of_states), ("instance", of_instance)):
        (folder / f"{name}.json").write_text(json.dumps(document(part)))


def test_an_object_is_read_with_its_states_and_instances(tmp_path):
    split_door(tmp_path / "door")
    (tmp_path / "door" / "table.json").write_text(
        json.dumps(document(table())).replace("/objects/door/", "/objects/table/")
    )
    together = load_scenery_jsonld(tmp_path / "door")
    assert {model.name for model in together.models} == {"door", "table"}
    (door,) = (model for model in together.models if model.name == "door")
    assert [state.name for state in door.states] == ["ajar"]
    assert len(together.instances) == 1
    assert together.name == "door"
    assert not [d for d in check_jsonld(tmp_path / "door") if d.severity is Severity.ERROR]


PLAN_FILES = {}
VALUES = st.sampled_from(
    [None, False, 0, -3.5, 1e300, "", "geom:world-frame", [], {}, [[1]], {"@id": "x"}, "M", ["x"],
     {"@list": ["geom:world-frame"]}, "_:b", {"@type": 3}]
)  # fmt: skip


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_mutated_plans_of_2023_give_diagnostics_and_nothing_else(tmp_path, data):
    folder = tmp_path / "plan"
    if not folder.exists():
        write_plan(two_rooms(), folder)
        PLAN_FILES.update({f.name: json.loads(f.read_text()) for f in folder.iterdir()})
    files = json.loads(json.dumps(PLAN_FILES))
    for _ in range(data.draw(st.integers(1, 3))):
        nodes = files[data.draw(st.sampled_from(sorted(files)))]["@graph"]
        victim = nodes[data.draw(st.integers(0, len(nodes) - 1))]
        key = data.draw(st.sampled_from(sorted(victim) or ["x"]))
        if data.draw(st.booleans()):
            victim[key] = data.draw(VALUES)
        else:
            victim.pop(key, None)
    for name, content in files.items():
        (folder / name).write_text(json.dumps(content))
    try:
        load_floorplan_jsonld(folder)
    except InputError as error:
        assert error.findings


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"M", "degrees"', '"feet", "degrees"', 'the unit is none of .*, found feet'),
        ('"theta": 0.0, "x": 0.0, "y": 0.0', '"z": null', "have none of x, y, z and alpha"),
        ("metamodels/qudt.json", "metamodels/qdut.json", 'did you mean "qudt.json"'),
        ('"as-seen-by": "geom:frame-hall-wall-0"', '"as-seen-by": "geom:frame-kitchen-wall-0"',
         "is not drawn in one frame|is seen by"),
    ],
)  # fmt: skip
def test_what_has_no_sane_reading_is_refused(tmp_path, old, new, message):
    folder = write_plan(two_rooms(), tmp_path / "plan")
    text = (folder / "coordinate.json").read_text()
    assert old in text
    (folder / "coordinate.json").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        load_floorplan_jsonld(folder)
    assert all(d.where.line > 0 for d in caught.value.findings)


def golden_rooms(path):
    return {space["name"]: space for space in json.loads(path.read_text())["spaces"]}


MOVED = {"hbrs": {}, "building_c": {"study_nook_left": 1.38}}
"""What the published graphs place elsewhere than the texts of today, in metres along a wall."""


@pytest.mark.parametrize(
    ("name", "golden"), [("hbrs", "hbrs"), ("building_c", "brsu_building_c_with_doorways")]
)
def test_published_plans_are_where_the_published_tool_puts_them(
    reference_data, tmp_path, name, golden
):
    folder = reference_data / "jsonld" / name
    plan = load_floorplan_jsonld(folder)
    expected = golden_rooms(reference_data / "goldens" / f"{golden}.json")
    assert [space.name for space in plan.spaces] == list(expected)
    for space in plan.spaces:
        there = expected[space.name]
        moved = max(map(math.dist, space.outline, there["polygon"]))
        assert moved == pytest.approx(MOVED[name].get(space.name, 0.0), abs=1e-6), space.name
        for wall, same in zip(space.walls, there["walls"], strict=True):
            assert wall.thickness == pytest.approx(same["thickness"], abs=1e-6)
            if space.name not in MOVED[name]:
                for p, q in zip(wall.footprint, same["footprint"], strict=True):
                    assert p == pytest.approx(tuple(q), abs=1e-6), wall.id
    write_jsonld(world_of(plan), tmp_path)
    assert load_floorplan_jsonld(tmp_path) == plan
    assert not [d for d in check_jsonld(folder) if d.severity is Severity.ERROR]


def test_the_published_door_is_the_one_described(reference_data):
    layer = load_scenery_jsonld(reference_data / "jsonld" / "objects")
    (model,) = layer.models
    leaf, post = model.links
    assert (leaf.polygons[0][0], leaf.polygons[0][2]) == ((-0.025, 0.025), (0.025, 0.955))
    assert (leaf.z_min, leaf.z_max, leaf.mass) == (0.01, 1.99, 1.0)
    assert (post.polygons[0][0], post.polygons[0][2]) == ((-0.025, -0.025), (0.025, 0.025))
    assert (post.z_min, post.z_max, post.mass) == (0.0, 1.99, 100.0)
    (hinge,) = model.joints
    assert (hinge.kind, hinge.anchor, hinge.lower, hinge.upper) == (
        *("revolute", (-0.025, 0.025)),
        *(0.0, 2.0),
    )
    states = {state.name: dict(state.positions)[hinge.name] for state in model.states}
    assert states == {"fully_opened": 1.6, "partially_opened": 0.7, "fully_closed": 0.0}
    name = "brsu_building_c_with_doorways"
    for plan in (
        load_floorplan(reference_data / "floorplans" / f"{name}.fpm"),
        load_floorplan_jsonld(reference_data / "jsonld" / "building_c"),
    ):
        (door,) = compile_scene(plan, [layer]).objects
        assert (door.pose.x, door.pose.y, door.pose.yaw) == pytest.approx(
            (-6.456217554968366, 18.71830066760646, 2.530727415391777), abs=1e-6
        )
        assert door.initial == (0.7,)


def test_a_space_may_still_be_called_like_an_earlier_identifier(tmp_path):
    text = "Floor plan: p Space space: shape: Rectangle width=2 m, length=2 m location: wrt: world of: this walls: thickness: 0.2 m height: 2 m"  # noqa: E501
    plan = parse_floorplan(text)
    write_jsonld(world_of(plan), tmp_path)
    assert load_floorplan_jsonld(tmp_path) == plan
