"""A point of a search is the run that a campaign specifies with the point's values written in."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.campaign import expand, load_campaign
from daemon.search.composition import search_case
from grammars.text.diagnostics import InputError
from tests.analysis.search.cases import load_search_case
from tests.analysis.search.pretended import made_trial

DOORS = """\
parameter swing = 60 deg/s
parameter closes = 6 s
parameter opens = 14 s
group leading: bedroom_door

all leading moves to open at 0 s, to closed at closes, to open at opens, by servo at swing
living_room_door toggles between closed and open every 5 s with probability 0.5
"""
CAMPAIGN = """\
campaign: tiny
seed: 3
repeats: 3
limit: 3 min
robot: courier
oracles: navigation
matrix: {sut: [pilot, idle]}
defaults:
  floorplan: PLAN
  objects: doors
  mission: courier
  oracles: [keeps-clear, nearest]
  chance: CHANCE
scenarios:
"""
BUSY = "  busy: {behaviours: [doors_open, doors_moving]}\n"
OTHER = """\
  calm: {behaviours: doors_open}
compare: {patience: delay(busy vs calm on leg kitchen) <= 9 s}
"""
SEARCH = """\
search:
  s:
    scenario: busy
    sut: pilot
    minimise: keeps-clear
    method: halton
    over:
      doors_moving.closes: 4 .. 20 s
      doors_moving.opens: 5 .. 25 s
      doors_moving.swing: 48 .. 72 deg/s
      doors_moving.leading: [bedroom_door, kitchen_door]
"""
WRITTEN = (6.0, 14.0, 60.0, "bedroom_door")


@pytest.fixture
def folder(tmp_path, campaigns):
    """The layers of the demonstration, with doors whose times have names."""
    folder = Path(shutil.copytree(campaigns / "demo", tmp_path / "mine"))
    (folder / "doors_moving.scenery").write_text(DOORS)
    return folder


def case_in(folder, *, chance="per repeat", plan="flat"):
    path = folder / "tiny.yaml"
    head = CAMPAIGN.replace("CHANCE", chance).replace("PLAN", plan)
    path.write_text(head + BUSY + OTHER + SEARCH)
    return load_search_case(path, "s")


def by_hand(folder, scenario, *, chance="per repeat"):
    """Return the runs with pilot of a campaign with that scenario alone."""
    path = folder / "hand.yaml"
    head = CAMPAIGN.replace("CHANCE", chance).replace("PLAN", "flat")
    path.write_text(head + scenario)
    return [run for run in expand(load_campaign(path)).specs if run.sut.name == "pilot"]


@pytest.mark.parametrize("chance", ["per repeat", "per campaign"])
def test_a_point_is_the_run_with_its_values_written_beside_the_layer(chance, folder):
    case = case_in(folder, chance=chance)
    values = "{closes: 6.25 s, opens: 15 s, swing: 52.5 deg/s, leading: kitchen_door}"
    scenario = f"  s.7: {{behaviours: [doors_open, doors_moving: {values}]}}\n"
    wanted = by_hand(folder, scenario, chance=chance)
    point = (6.25, 15.0, 52.5, "kitchen_door")
    made = [case.candidate(point, 7, repeat) for repeat in range(3)]
    assert [one.spec.digest for one in made] == [run.digest for run in wanted]
    assert all(one.spec.scene == one.scene.digest for one in made)


def test_the_written_values_are_the_scenario_as_it_stands(folder):
    case = case_in(folder)
    assert tuple(p.written for p in case.task.parameters) == WRITTEN
    scenario = "  s.0: {behaviours: [doors_open, doors_moving]}\n"
    wanted = by_hand(folder, scenario)
    assert [case.candidate(WRITTEN, 0, r).spec.digest for r in (0, 1, 2)] == [
        run.digest for run in wanted
    ]


EVERYWHERE = """\
search:
  s:
    scenario: busy
    sut: pilot
    minimise: any
    method: halton
    over:
      floorplan.hinged_width: 0.94 .. 1.0 m
      doors_moving.swing: 48 .. 72 deg/s
      mission.start.y: -0.2 .. 0.2 m
      courier.waypoints.kitchen.x: 0.1 .. 0.4
      courier.laser.noise: 0.01 .. 0.05 m, log
      robot.laser.rays: 100 .. 400
      robot.laser.too_near: [infinite, clamped]
      pilot.max_speed: 0.3 .. 0.8
"""
FAR = (0.95, 52.5, 0.125, 0.3, 0.02, 181.0, "clamped", 0.45)


def everywhere(folder):
    path = folder / "tiny.yaml"
    head = CAMPAIGN.replace("CHANCE", "per repeat").replace("PLAN", "flat")
    path.write_text(head + BUSY + EVERYWHERE)
    return load_search_case(path, "s")


def test_every_layer_can_be_searched(folder):
    spec = everywhere(folder).candidate(FAR, 5).spec
    assert spec.mission.start.y == 0.125
    assert spec.mission.waypoints[0].x == 0.3
    assert (spec.robot.laser.noise, spec.robot.laser.rays) == (0.02, 181)
    assert spec.robot.laser.too_near == "clamped"
    assert spec.sut.parameters["max_speed"] == 0.45
    other = everywhere(folder).candidate((1.0, *FAR[1:]), 5).spec
    assert other.scene != spec.scene


def test_the_campaign_of_a_point_has_its_very_run(folder):
    case = everywhere(folder)
    text = case.found_text(made_trial(FAR, -0.1, 5), comment="It fails.")
    assert text.startswith("# It fails.\n")
    (folder / "s.found.yaml").write_text(text)
    found = load_campaign(folder / "s.found.yaml")
    (run,) = expand(found).specs
    assert run.digest == case.candidate(FAR, 5).spec.digest
    assert found.searches == ()


def test_what_was_found_says_what_is_not_as_written_and_that_it_fails(folder):
    case = case_in(folder)
    point = (6.25, 14.0, 60.0, "bedroom_door")
    text = case.found_text(made_trial(point, -0.1, 5), comment="", why="closes 0.25 s later: bad")
    assert "doors_moving: {closes: 6.25 s}" in text
    (folder / "s.found.yaml").write_text(text)
    found = load_campaign(folder / "s.found.yaml")
    (run,) = expand(found).specs
    assert run.digest == case.candidate(point, 5).spec.digest
    (expected,) = found.declared.expectations
    assert (expected.oracle, expected.verdict) == ("keeps-clear", "fail")
    assert expected.why == "closes 0.25 s later: bad"


def test_what_is_written_with_more_digits_than_a_point_has_is_said_all_the_same(folder):
    (folder / "doors_moving.scenery").write_text(DOORS.replace("= 6 s", "= 6.00000000004 s"))
    case = case_in(folder)
    point = (case.task.parameters[0].written, 14.0, 61.0, "bedroom_door")
    assert point[0] is not None
    text = case.found_text(made_trial(point, -0.1, 5), comment="")
    (folder / "s.found.yaml").write_text(text)
    (run,) = expand(load_campaign(folder / "s.found.yaml")).specs
    assert run.digest == case.candidate(point, 5).spec.digest
    assert "closes" in text


def test_values_in_any_layer_can_be_taken_apart(folder):
    case = everywhere(folder)
    taken, candidate = case.run_case(FAR, 5), case.candidate(FAR, 5)
    again = taken.candidate(frozenset(), taken.spec.oracles[0])
    one = replace(candidate.spec, oracles=candidate.spec.oracles[:1])
    assert again.spec == one


def test_one_building_of_a_variation_can_be_searched(folder):
    path = folder / "tiny.yaml"
    head = CAMPAIGN.replace("CHANCE", "per repeat").replace("  floorplan: PLAN\n", "")
    vary = (
        "  busy: {behaviours: doors_open, vary: {floorplan: {flat: {slack: 0.1 m}}, samples: 1}}\n"
    )
    search = "search:\n  s: {scenario: busy, sut: pilot, minimise: keeps-clear, method: halton,\n"
    path.write_text(head + vary + search + "      over: {vary.slack: 0.09 .. 0.14 m}}\n")
    case = load_search_case(path, "s")
    (parameter,) = case.task.parameters
    assert (parameter.slot, parameter.key, parameter.written) == ("vary", "slack", 0.1)
    wide, mean = case.candidate((0.12,), 1), case.candidate((0.1,), 2)
    assert wide.spec.scene != mean.spec.scene
    (folder / "s.found.yaml").write_text(case.found_text(made_trial((0.12,), -0.1, 1), comment=""))
    (run,) = expand(load_campaign(folder / "s.found.yaml")).specs
    assert run.digest == wide.spec.digest


def test_what_comparisons_measure_is_left_out(folder):
    spec = case_in(folder).candidate(WRITTEN, 0).spec
    assert [oracle.name for oracle in spec.oracles] == ["keeps-clear", "nearest"]


def test_a_point_has_the_same_run_however_often_and_after_whatever(folder):
    case = case_in(folder)
    first = case.candidate(WRITTEN, 0).spec.digest
    others = {
        case.candidate((4.0 + n / 10, 20.0, 60.0, "bedroom_door"), n).spec.digest for n in range(99)
    }
    assert len(others) == 99
    assert case.candidate(WRITTEN, 0).spec.digest == first


def test_a_point_that_makes_no_run_is_bad_input(folder):
    case = case_in(folder)
    with pytest.raises(InputError, match="is not after"):
        case.candidate((15.0, 14.0, 60.0, "bedroom_door"), 1)
    assert case.candidate(WRITTEN, 2).spec.scenario == "s.2"


def test_a_point_can_be_taken_apart(folder):
    case = case_in(folder)
    point = (6.25, 15.0, 52.5, "kitchen_door")
    taken = case.run_case(point, 7)
    candidate = case.candidate(point, 7)
    assert taken.spec == candidate.spec
    again = taken.candidate(frozenset(), taken.spec.oracles[0])
    assert again.spec.behaviours == candidate.spec.behaviours
    assert any("closes 6.25 s" in element.name for element in taken.added)


def test_a_task_of_another_campaign_is_refused(folder):
    case = case_in(folder)
    first, *rest = case.task.parameters
    for changed, said in (
        (replace(case.task, scenario="other"), 'no scenario "other"'),
        (replace(case.task, sut="a2s"), 'no system under test "a2s"'),
        (replace(case.task, parameters=(replace(first, index=9), *rest)), "no layer 9 in"),
        (replace(case.task, parameters=(replace(first, slot="vary"), *rest)), "no layer 1 in vary"),
    ):
        with pytest.raises(InputError, match=said):
            search_case(case.campaign, changed)
