"""Values beside the names of layers, in every slot of a scenario."""

import math
import shutil
from dataclasses import replace

import pytest

from daemon.campaign import (
    LayerLibrary,
    campaign_text,
    expand,
    load_campaign,
    with_overrides,
)

CAMPAIGN = """\
campaign: tiny
seed: 3
limit: 30 s
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
defaults:
  floorplan: flat
  objects: doors
  behaviours: doors_moving
  mission: courier
  oracles: [reached]
scenarios:
  plain: {}
"""


@pytest.fixture
def folder(tmp_path, campaigns):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    return tmp_path / "demo"


def load(folder, slots, head=""):
    """Load a scenario with other ``slots`` than the plain one."""
    path = folder / "tiny.yaml"
    path.write_text(f"{CAMPAIGN}  changed:\n    {slots}\n{head}")
    return load_campaign(path)


def cell(folder, slots):
    return next(c for c in load(folder, slots).cells if c.name.startswith("changed"))


def test_keys_of_a_mission_and_its_waypoints_by_their_names(folder):
    found = cell(folder, "mission: {courier: {start: {y: 10 cm}, waypoints.kitchen.x: 0.3}}")
    assert found.mission.start.y == 0.1
    assert found.mission.waypoints[0].x == 0.3
    plain = load(folder, "about: same").cells[0].mission
    assert found.mission.waypoints[1:] == plain.waypoints[1:]


def test_a_waypoint_without_an_id_has_its_number(folder):
    (folder / "short.mission.yaml").write_text("waypoints: [{x: 0.2, y: 0.1}, {x: 0.5, y: 0.0}]\n")
    found = cell(folder, "mission: {short: {waypoints.waypoint-2.yaw: 90 deg}}")
    assert [w.yaw for w in found.mission.waypoints] == [None, math.pi / 2]


def test_a_place_that_is_visited_twice_moves_as_one(folder):
    text = "waypoints: [{id: a, x: 0.2, y: 0}, {id: b, x: 0.5, y: 0}, {id: a, x: 0.2, y: 0}]\n"
    (folder / "round.mission.yaml").write_text(text)
    found = cell(folder, "mission: {round: {waypoints.a.x: 0.3}}")
    assert [w.x for w in found.mission.waypoints] == [0.3, 0.5, 0.3]


def test_keys_of_a_robot_and_its_lasers_by_their_names(folder):
    found = cell(folder, "robot: {courier: {laser.noise: 2 cm, drive.max_vx: 0.6 m/s}}")
    assert (found.robot.laser.noise, found.robot.drive.max_vx) == (0.02, 0.6)
    two = cell(folder, "robot: {shuttle: {lasers.rear.noise: 5 cm}}").robot
    assert {laser.name: laser.noise for laser in two.lasers}["rear"] == 0.05
    assert len({laser.noise for laser in two.lasers}) == 2


def test_parameters_of_a_system_in_its_own_units_or_with_one(folder):
    (sut,) = cell(folder, "sut: {pilot: {max_speed: 0.4 m/s, patience: 30}}").suts
    assert sut.parameters == {"max_speed": 0.4, "patience": 30}
    text = "sut: mine\nkind: pilot\nparameters: {max_speed: 0.2, max_turn: 0.8}\n"
    (folder / "mine.yaml").write_text(text)
    (tuned,) = cell(folder, "sut: [{mine: {max_speed: 0.3}}]").suts
    assert (tuned.name, tuned.parameters) == ("mine", {"max_speed": 0.3, "max_turn": 0.8})


@pytest.mark.parametrize(
    "key",
    [
        "move_base/local_costmap/inflation_radius",
        "move_base.local_costmap.inflation_radius",
        "move_base: {local_costmap/inflation_radius",
    ],
)
def test_nested_parameters_of_a_ros_stack_by_either_spelling(folder, key):
    end = "}" * key.count("{")
    (sut,) = cell(folder, f"sut: [{{a2s: {{{key}: 30 cm}}}}{end}]").suts
    (other,) = cell(folder, "sut: a2s").suts
    costmap, plain = (s.parameters["move_base"]["local_costmap"] for s in (sut, other))
    assert costmap == plain | {"inflation_radius": 0.3} != plain


def test_groups_of_objects_and_values_at_the_top(folder):
    (folder / "two.scenery").write_text(
        (folder / "doors.scenery").read_text() + "\ngroup both: kitchen_door, bedroom_door\n"
    )
    assert "both" in {
        group.name
        for layer in cell(folder, "objects: {two: {both: kitchen_door}}").layers
        for group in layer.groups
    }
    path = folder / "top.yaml"
    text = CAMPAIGN.replace("robot: courier", "robot: {courier: {mass: 40 kg}}")
    path.write_text(text.replace("[pilot]", "{pilot: {max_speed: 0.3}}"))
    (found,) = load_campaign(path).cells
    assert (found.robot.mass, found.suts[0].parameters) == (40.0, {"max_speed": 0.3})


def test_a_draw_with_a_value_leaves_the_other_draws_as_they_were(folder):
    bare = "objects: []\n    behaviours: []\n    "
    varied = f"{bare}vary: {{floorplan: flat, samples: 3}}"
    before = [c.plan for c in load(folder, varied).cells if c.name.startswith("changed")]
    value = "kitchen_doorway.location.translation.x: 0.5 m"
    fixed = f"{bare}vary: {{floorplan: {{flat: {{{value}}}}}, samples: 3}}"
    after = [c.plan for c in load(folder, fixed).cells if c.name.startswith("changed")]
    assert len(before) == len(after) == 3
    for one, other in zip(before, after, strict=True):
        differing = {a.name for a, b in zip(one.openings, other.openings, strict=True) if a != b}
        assert differing <= {"kitchen_doorway"}
        assert one.features == other.features


def test_one_file_is_read_once_for_all_values(folder):
    campaign = load(folder, "about: same")
    scenario, library = campaign.cells[0].scenario, LayerLibrary(folder)
    library.mission(scenario.mission)
    (folder / "courier.mission.yaml").unlink()
    (folder / "courier.mission.yaml").write_text("no mission any more")
    missions = [
        library.mission(with_overrides(scenario, "mission", 0, {"start.y": n / 100}).mission)[0]
        for n in range(200)
    ]
    assert [mission.start.y for mission in missions] == [n / 100 for n in range(200)]


def test_a_plan_that_was_compiled_with_other_values_is_as_it_was(folder):
    scenario, library = load(folder, "about: same").cells[0].scenario, LayerLibrary(folder)
    text = library.plan_text(folder / "flat.fpm")
    plain = text.compile()
    wide = library.floorplan(
        with_overrides(scenario, "floorplan", 0, {"room_length": "4 m"}).floorplan
    )
    assert wide != plain
    assert text.compile() == plain == library.floorplan(scenario.floorplan)


def test_later_values_win_over_those_that_are_written(folder):
    scenario = cell(folder, "behaviours: [{doors_moving: {swing: 50 deg/s}}]").scenario
    changed = with_overrides(scenario, "behaviours", 0, {"swing": "70 deg/s", "slide": "1 m/s"})
    assert changed.behaviours[0].overrides == {"swing": "70 deg/s", "slide": "1 m/s"}
    with pytest.raises(ValueError, match="no layer 1 in sut"):
        with_overrides(scenario, "sut", 1, {})
    with pytest.raises(ValueError, match="no layer 0 in vary"):
        with_overrides(scenario, "vary", 0, {})


VARIED = "vary: {floorplan: %s, samples: 1}"


@pytest.mark.parametrize(
    ("slots", "over", "expected"),
    [
        ("about: x", "doors_moving.swing: 30 .. 90 deg/s", ("swing", 60.0, "deg/s")),
        ("about: x", "doors_moving.kitchen-opens: 7 .. 9 s", ("kitchen_opens", 8.0, "s")),
        ("about: x", "flat.room_length: 2.9 .. 3.1 m", ("room_length", 3.0, "m")),
        (
            "floorplan: {flat: {room-length: 4 m}}",
            "floorplan.room_length: 3 .. 5 m",
            ("room_length", 4.0, "m"),
        ),
        ("about: x", "mission.start.y: -1 .. 1", ("start.y", 0.0, "m")),
        (
            "mission: {courier: {start.y: 10 cm}}",
            "mission.start.y: -1 .. 1 m",
            ("start.y", 0.1, "m"),
        ),
        ("about: x", "mission.waypoints.kitchen.x: 0 .. 1", ("waypoints.kitchen.x", 0.2, "m")),
        (
            "about: x",
            "mission.waypoints.kitchen.yaw: 0 .. 1",
            ("waypoints.kitchen.yaw", None, "rad"),
        ),
        ("about: x", "robot.laser.dropout: 0 .. 5 %", ("laser.dropout", 0.5, "%")),
        ("about: x", "robot.laser.rays: 90 .. 200", ("laser.rays", 361.0, "")),
        ("about: x", "robot.laser.mount.yaw: 0 .. 2 deg", ("laser.mount.yaw", 0.0, "deg")),
        (
            "about: x",
            "robot.laser.too_near: [clamped, infinite]",
            ("laser.too_near", "infinite", ""),
        ),
        ("about: x", "pilot.max_speed: 0.2 .. 0.6", ("max_speed", 0.5, "")),
        (
            "sut: [{pilot: {max_speed: 0.3}}]",
            "sut.max_speed: 20 .. 60 cm/s",
            ("max_speed", 30, "cm/s"),
        ),
        (VARIED % "flat", "vary.slack: 0.02 .. 0.04 m", ("slack", None, "m")),
        (VARIED % "{flat: {slack: 0.1}}", "vary.slack: 0.09 .. 0.2 m", ("slack", 0.1, "m")),
    ],
)
def test_a_search_begins_at_the_value_that_a_layer_has(folder, slots, over, expected):
    text = f"search: {{s: {{scenario: changed, minimise: reached, over: {{{over}}}}}}}\n"
    ((parameter,),) = (task.parameters for task in load(folder, slots, text).searches)
    assert (parameter.key, parameter.written, parameter.unit) == expected


SHIPPED = (
    "demo/campaign", "two_lasers/campaign", "ortega2024/campaign", "ortega2024/paper",
    "ortega2024/first", "ortega2024/swinging_doors",
)  # fmt: skip


@pytest.mark.parametrize("name", SHIPPED)
def test_each_shipped_scenario_as_a_campaign_of_its_own_has_the_same_runs(
    tmp_path, campaigns, name
):
    shutil.copytree(campaigns, tmp_path, dirs_exist_ok=True)
    campaign = load_campaign(tmp_path / f"{name}.yaml")
    # Those left out differ from others in nothing but their missions.
    cells = tuple(c for c in campaign.cells if c.name not in ("S3.2", "S3.3", "S3.5"))
    wanted = {run.label: run.digest for run in expand(replace(campaign, cells=cells)).specs}
    file = (tmp_path / name).parent / "alone.yaml"
    found = {}
    for one in cells:
        text = campaign_text(
            campaign, one.scenario, name=one.name, repeats=campaign.repeats or 1, comment="Alone."
        )
        file.write_text(text)
        found |= {run.label: run.digest for run in expand(load_campaign(file)).specs}
    assert found == wanted


def test_a_scenario_with_values_in_every_slot_runs_alone_as_it_does_there(folder):
    (folder / "mine.yaml").write_text("sut: mine\nlike: pilot\n")
    slots = """\
floorplan: {flat: {room_length: 3.1 m}}
    behaviours: [{doors_moving: {swing: 52.5 deg/s, kitchen_opens: 8.54 s}}]
    mission: {courier: {start.y: 0.1, waypoints.kitchen.x: 30 cm}}
    robot: {courier: {laser: {noise: 2 cm}}}
    sut: [mine, {pilot: {max_speed: 0.4 m/s}}]
    map: {resolution: 4 cm, doors: initial}
    chance: per campaign
    limit: 45.5 s"""
    campaign = load(folder, slots)
    wanted = [r.digest for r in expand(campaign).specs if r.scenario == "changed"]
    scenario = campaign.cells[1].scenario
    text = campaign_text(
        campaign, scenario, name="changed", about="x", comment="Two\nlines",
        expect=[{"scenario": "changed", "oracle": "reached", "verdict": "fail", "why": "found"}],
    )  # fmt: skip
    (folder / "alone.yaml").write_text(text)
    alone = load_campaign(folder / "alone.yaml")
    assert [r.digest for r in expand(alone).specs] == wanted
    assert len(wanted) == 2
    assert alone.declared.expectations[0].why == "found"
    (folder / "alone.yaml").write_text(campaign_text(campaign, scenario, name="changed", sut=1))
    assert [r.digest for r in expand(load_campaign(folder / "alone.yaml")).specs] == wanted[1:]


def test_variants_with_values_run_alone_as_they_do_there(folder):
    campaign = load(folder, "vary: {floorplan: {flat: {slack: 0.1 m}}, samples: 2}")
    wanted = [r.digest for r in expand(campaign).specs if r.scenario != "plain"]
    scenario = replace(campaign.cells[1].scenario, name="other")
    (folder / "alone.yaml").write_text(campaign_text(campaign, scenario, name="changed"))
    assert [r.digest for r in expand(load_campaign(folder / "alone.yaml")).specs] == wanted
