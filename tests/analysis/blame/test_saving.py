"""The smallest failing run, written as a campaign: it specifies the very run, and fails again."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.analysis.blame import (
    Candidate,
    CandidateRunner,
    explain_failure,
    load_case,
    save_campaign,
)
from daemon.campaign import examine, expand, load_campaign
from daemon.model.verdicts import Outcome
from daemon.run import execute
from grammars.floorplan import load_floorplan
from grammars.jsonld import scenery_document
from grammars.model.grid import OCCUPIED
from grammars.model.map_files import write_map
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import Severity
from templates.occupancy import occupancy_grid
from tests.analysis.blame.cases import CAMPAIGN, failing_if, pretend, write


def explain_and_save(case, place):
    """Return what is found, the campaign file it is saved in, and the last run of that."""
    runner = CandidateRunner(300)
    found = explain_failure(case, runner)
    file = save_campaign(case, found, place, runner)
    return found, file, expand(load_campaign(file)).specs[-1]


def test_a_saved_run_is_the_smallest_one(folder, monkeypatch):
    (folder / "later.scenery").write_text("kitchen_door starts at 20 deg\ntom is frozen\n")
    models, instances = (folder / "people.scenery").read_text().split("visitor       is a")
    (folder / "kinds.scenery").write_text(models)
    (folder / "people.scenery").write_text(f"visitor       is a{instances}")
    text = CAMPAIGN.replace("[doors, people]", "[kinds, doors, people, later]")

    def fails(spec):
        joints = {b.joint for b in spec.behaviours}
        return {"kitchen_door.hinge", "visitor.x"} <= joints and spec.repeat == 1

    pretend(monkeypatch, failing_if(fails))
    case = load_case(write(folder, text), "rude", "pilot", 1)
    found, file, _ = explain_and_save(case, folder / "saved")
    assert found.story.objects == ("kitchen_door", "visitor")
    copy = folder / "saved" / "scenery" / "people.scenery"
    assert copy.read_bytes() == (folder / "people.scenery").read_bytes()
    campaign, findings = examine(file)
    (_, run) = expand(campaign).specs
    smallest = found.smallest.spec
    named = replace(run, campaign=smallest.campaign, scenario=smallest.scenario)
    assert named.digest == smallest.digest
    assert campaign.cells[0].scenario.without
    assert "repeat 1 that fails" in file.read_text()
    assert not [d for d in findings if d.severity is Severity.ERROR]


def test_doors_by_chance_and_parts_that_are_gone_already_stay_so(folder, monkeypatch):
    (folder / "lively.scenery").write_text(
        "living_room_door toggles between closed and open after uniform 3 s to 9 s, from 1 s\n"
    )
    text = CAMPAIGN.replace("- doors_open\n", "- doors_open\n      - lively\n")
    text = text.replace("mission: courier\n", "mission: courier\n    without: [tom, waypoint 1]\n")

    def fails(spec):
        moves = any(b.joint.startswith("living_room_door") for b in spec.behaviours)
        visited = [waypoint.id for waypoint in spec.mission.waypoints]
        return moves and "living-room" in visited and spec.repeat == 1

    pretend(monkeypatch, failing_if(fails))
    case = load_case(write(folder, text), "rude", "pilot", 1)
    found, _, run = explain_and_save(case, folder / "saved")
    smallest = found.smallest.spec
    assert dict(found.story.before)["waypoint"] == len(case.spec.mission.waypoints)
    assert (found.story.objects, len(smallest.mission.waypoints)) == (("living_room_door",), 1)
    assert run.behaviours == smallest.behaviours
    named = replace(run, campaign=smallest.campaign, scenario=smallest.scenario)
    assert named.digest == smallest.digest


def test_layers_of_one_name_in_two_folders_are_both_kept(folder, monkeypatch):
    models, instances = (folder / "doors.scenery").read_text().split("bedroom_door     is a")
    for name, part in (("kinds", models), ("flat", f"bedroom_door     is a{instances}")):
        (folder / name).mkdir()
        (folder / name / "doors.scenery").write_text(part)
    text = CAMPAIGN.replace("[doors, people]", "[kinds/doors.scenery, flat/doors.scenery]")
    pretend(monkeypatch, failing_if(lambda spec: bool(spec.behaviours)))
    case = load_case(write(folder, text), "rude", "pilot", 0)
    found, _, run = explain_and_save(case, folder / "saved")
    smallest = found.smallest.spec
    named = replace(run, campaign=smallest.campaign, scenario=smallest.scenario)
    assert named.digest == smallest.digest


def test_a_run_that_fails_in_the_first_repeat_as_well_is_saved_as_one(folder, monkeypatch):
    pretend(monkeypatch, failing_if(lambda spec: bool(spec.behaviours)))
    case = load_case(write(folder), "rude", "pilot", 1)
    _, file, _ = explain_and_save(case, folder / "saved")
    assert [run.repeat for run in expand(load_campaign(file)).specs] == [0]


def test_it_can_be_moved_elsewhere_and_fails_in_the_same_way(folder, tmp_path):
    text = CAMPAIGN.replace("[doors, people]", "doors").replace("16 s", "26 s")
    text = text.replace(": {near: 1 m}", "")
    (folder / "courier.mission.yaml").write_text(
        "mission: courier\nwaypoints:\n  - {id: hall, x: 1.0, y: 0.0}\n"
        "  - {id: kitchen, x: 0.2, y: -2.1}\n"
    )
    case = load_case(write(folder, text), "rude", "pilot", 1)
    found, _, _ = explain_and_save(case, folder / "saved")
    story = found.story
    assert story.minimal
    assert (story.objects, story.waypoints) == (("kitchen_door",), ("kitchen",))
    needed = {str(one.element): one.word for one in story.layers}
    assert needed["doors_in_your_face"] == "pass"
    moved = Path(shutil.move(folder / "saved", tmp_path / "elsewhere"))
    shutil.rmtree(folder)
    planned = expand(load_campaign(moved / "campaign.yaml"))
    run = planned.specs[-1]
    result = execute(run, planned.scenes[0], trace_path=tmp_path / "again.mcap")
    (verdict,) = result.verdicts
    assert verdict.outcome is Outcome.FAIL
    assert verdict.oracle == story.verdict.oracle
    if run.seed == found.smallest.spec.seed:
        assert verdict == story.last, "the same run, the same verdict"


def test_the_three_mistakes_of_the_papers_stack_are_three_suspects(
    campaigns, tmp_path, monkeypatch
):
    for name in ("ortega2024", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    text = (tmp_path / "ortega2024" / "first.yaml").read_text()
    path = tmp_path / "ortega2024" / "ros.yaml"
    path.write_text(text.replace("sut: [pilot]", "sut: [fro-diff, a2s]"))
    corrected, a2s = load_campaign(path).cells[0].suts
    case = load_case(path, "S1", "a2s", 0)
    settings = case.settings
    footprint, *others = settings.elements
    assert settings.like == "fro-diff"
    names = [element.setting for element in settings.elements]
    assert names == ["footprint", "scan/topic", "amcl/odom_model_type"]
    everything = settings.without(frozenset(settings.elements))
    assert everything.parameters == corrected.parameters
    assert settings.without(frozenset()) == a2s
    wanted = settings.without(frozenset(others)).parameters
    tiny = wanted["move_base"]["local_costmap"]["footprint"]

    def fails(spec):
        return bool(spec.sut.parameters["move_base"]["local_costmap"]["footprint"] == tiny)

    pretend(monkeypatch, failing_if(fails))
    found, _, run = explain_and_save(case, tmp_path / "saved")
    assert [str(one.element) for one in found.story.layers] == [footprint.name]
    assert run.sut.parameters == wanted
    assert "like:" in (tmp_path / "saved" / "suts" / "a2s.yaml").read_text()


def test_a_variant_of_a_plan_and_layers_of_others_are_saved_as_they_are(folder, monkeypatch):
    layers = [load_scenery(folder / f"{name}.scenery") for name in ("doors", "people")]
    plan = load_floorplan(folder / "flat.fpm")
    document = scenery_document(layers[1], plan, layers)
    (folder / "crowd.jsonld").write_text(json.dumps(document))
    text = CAMPAIGN.replace("floorplan: flat", "vary: {floorplan: flat, samples: 2}")
    text = text.replace("[doors, people]", "[crowd]").replace("[reached, no-contact]", "[reached]")
    text = text.replace("    behaviours:\n      - doors_open\n", "")
    text = text.replace("      - doors_in_your_face: {near: 1 m}\n", "")
    pretend(monkeypatch, failing_if(lambda spec: any(b.joint == "tom.x" for b in spec.behaviours)))
    path = write(folder, text)
    case = load_case(path, load_campaign(path).cells[-1].name, "", 0)
    found, _, run = explain_and_save(case, folder / "saved")
    assert found.story.objects == ("tom",)
    assert (run.scene, run.behaviours) == (
        found.smallest.spec.scene,
        found.smallest.spec.behaviours,
    )


def test_files_that_would_specify_another_run_are_refused(folder, monkeypatch):
    pretend(monkeypatch, failing_if(lambda spec: bool(spec.behaviours)))
    case = load_case(write(folder), "rude", "", 0)
    runner = CandidateRunner(100)
    found = explain_failure(case, runner)
    other = replace(found.smallest.spec, limit=17.0)
    changed = replace(found, smallest=Candidate(other, found.smallest.scene))
    with pytest.raises(ValueError, match="its limit differs"):
        save_campaign(case, changed, folder / "saved", runner)


def test_a_ros2_stack_is_saved_as_it_is_started_with_its_files(folder, monkeypatch):
    (folder / "params.yaml").write_text("amcl: {}\n")
    (folder / "base.yaml").write_text(
        "sut: base\nkind: ros2\nlaunch: nav {map} {params}\nfiles: {params: params.yaml}\n"
        "environment: {setup: /a.bash}\nready: amcl\nlate: 10 %\n"
    )
    (folder / "nav2.yaml").write_text("sut: nav2\nlike: base\nstart-up: 2 min\n")
    pretend(monkeypatch, failing_if(lambda spec: bool(spec.behaviours)))
    case = load_case(write(folder, CAMPAIGN.replace("[pilot]", "[nav2]")), "rude", "nav2", 0)
    assert case.settings.elements == ()
    _, _, run = explain_and_save(case, folder / "saved")
    assert run.sut == case.spec.sut
    assert (folder / "saved" / "suts" / "files" / "params").read_text() == "amcl: {}\n"


@pytest.mark.parametrize("value", [OCCUPIED, 37])
def test_the_map_of_ones_own_is_saved_beside_the_campaign(folder, monkeypatch, value):
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    scene = compile_scene(load_floorplan(folder / "flat.fpm"), [])
    grid = occupancy_grid(scene, laser_height=0.2)
    grid.cells[:2, :3] = value
    write_map(grid, folder / "own", laser_height=0.2)
    pretend(monkeypatch, failing_if(lambda spec: bool(spec.behaviours)))
    case = load_case(write(folder, f"{CAMPAIGN}map: {{file: own.yaml}}\n"), "rude", "pilot", 0)
    _, _, run = explain_and_save(case, folder / "saved")
    assert run.map == case.spec.map
    assert run.map.file


@pytest.mark.parametrize("rule", ["outline", "touch", "centre"])
def test_a_saved_campaign_draws_its_map_by_the_same_rule(folder, monkeypatch, rule):
    pretend(monkeypatch, failing_if(lambda spec: bool(spec.behaviours)))
    case = load_case(write(folder, f"{CAMPAIGN}map: {{rule: {rule}}}\n"), "rude", "pilot", 0)
    _, _, run = explain_and_save(case, folder / "saved")
    assert (run.map.rule, run.map) == (rule, case.spec.map)


def test_values_beside_the_names_of_layers_are_saved_with_them(folder, monkeypatch):
    text = CAMPAIGN.replace("floorplan: flat", "floorplan: {flat: {room_length: 3.1 m}}")
    text = text.replace("mission: courier", "mission: {courier: {start.y: 0.1}}")
    text = text.replace("robot: courier", "robot: {courier: {laser.noise: 2 cm}}")
    text = text.replace("sut: [pilot]", "sut: [{pilot: {max_speed: 0.4, lookahead: 0.5}}]")

    def fails(spec):
        fast = spec.sut.parameters.get("max_speed") == 0.4
        return fast and "kitchen_door.hinge" in {b.joint for b in spec.behaviours}

    pretend(monkeypatch, failing_if(fails))
    case = load_case(write(folder, text), "rude", "pilot", 0)
    found, _, run = explain_and_save(case, folder / "saved")
    assert found.story.parameters == ("max_speed: 0.4",)
    smallest = found.smallest.spec
    assert (run.scene, run.sut, run.robot, run.mission) == (
        smallest.scene, smallest.sut, smallest.robot, smallest.mission,
    )  # fmt: skip
    assert (run.robot.laser.noise, run.mission.start.y) == (0.02, 0.1)
