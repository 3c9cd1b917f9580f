"""Everything wrong with a campaign at once, each thing once; what it names and nobody uses."""

import json
import os
import re
import shutil
from pathlib import Path

import pytest

from daemon.campaign import examine
from grammars.text.diagnostics import InputError
from scenario_tui.submission import prepare_submission

CAMPAIGN = """\
campaign: tiny
seed: 3
limit: 3 min
robot: courier
oracles: house
matrix: {sut: [pilot]}
scenarios:
  calm:
    floorplan: flat
    objects: [doors, more]
    behaviours: [doors_open, moods]
    mission: courier
    oracles: [reached]
  second:
    like: calm
    oracles: [near]
"""
LAYERS = {
    "house.oracles.yaml": "reached: reached(mission, 0.3 m)\nnear: min(clearance) >= 1 cm\n",
    "spare.oracles.yaml": "spare: never(contact)\n",
    "more.scenery": "group both: bedroom_door, kitchen_door\n",
    "moods.scenery": "all both stay open\n",
}


@pytest.fixture
def folder(tmp_path, campaigns):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    for name, text in LAYERS.items():
        (tmp_path / "demo" / name).write_text(text)
    return tmp_path / "demo"


def change(folder, name, *changes):
    path = folder / name
    text = path.read_text() if path.exists() else CAMPAIGN
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)


def said(folder):
    """Return what is found of the campaign: file and line, an E or a W, and the message."""
    change(folder, "tiny.yaml")
    _, found = examine(folder / "tiny.yaml")
    return [
        f"{Path(d.where.file).name}:{d.where.line} {d.severity[0].upper()} {d.message}"
        for d in found
        if "this sentence, not the one" not in d.message
    ]


def test_a_campaign_of_which_all_is_used_is_nothing_to_speak_of(folder):
    assert said(folder) == []


def test_errors_of_all_kinds_come_at_once_and_once(folder):
    change(
        folder, "tiny.yaml",
        ("    oracles: [near]", "    oracles: [near]\n    objcts: doors"),
        ("seed: 3", "seed: 3\ncolour: blue"),
        ("[pilot]", "[pilto]"),
    )  # fmt: skip
    change(folder, "house.oracles.yaml", ("clearance", "clearence"))
    change(folder, "courier.mission.yaml", ("x: 0.2, y: -2.1", "x: 0.2, y: -0.85"))
    change(folder, "doors.scenery", ("to 1.98 m,   mass", "to 2.2 m, mass"))
    assert sorted(text.split(":", 1)[0] + text.split(" ", 1)[1] for text in said(folder)) == [
        "courier.mission.yamlE waypoint kitchen is inside of hall-wall-5",
        "doors.sceneryE the leaf of bedroom_door reaches 2.20 m high, bedroom_doorway only 2.00 m",
        "doors.sceneryE the leaf of kitchen_door reaches 2.20 m high, kitchen_doorway only 2.00 m",
        'house.oracles.yamlE unknown signal "clearence"',
        'tiny.yamlE no system under test "pilto": there is no pilto.yaml beside the campaign nor '
        "in suts/, and none of that name ships",
        'tiny.yamlE unknown key "colour"',
        'tiny.yamlE unknown key "objcts"',
    ]


def test_what_is_submitted_is_told_all_of_it_too(folder):
    change(folder, "tiny.yaml", ("mission: courier", "mission: curier"))
    change(folder, "doors.scenery", ("to 1.98 m,   mass", "to 2.2 m, mass"))
    with pytest.raises(InputError) as caught:
        prepare_submission(folder / "tiny.yaml")
    messages = [d.message for d in caught.value.diagnostics if d.severity == "error"]
    assert [m.split(" reaches")[0].split(":")[0] for m in messages] == [
        'no mission "curier"', "the leaf of bedroom_door", "the leaf of kitchen_door"
    ]  # fmt: skip


def test_more_runs_than_the_daemon_takes_are_told_before_anything_is_drawn(folder):
    changes = (("seed: 3", "seed: 3\nrepeats: 100000"), ("[pilot]", "[pilot, idle]"))
    change(folder, "tiny.yaml", *changes)
    with pytest.raises(InputError, match=r"has 400000 runs.*may have 200000: split") as caught:
        prepare_submission(folder / "tiny.yaml")
    assert caught.value.diagnostics[0].where.line == 3


@pytest.mark.parametrize(
    ("layer", "old", "new", "errors"),
    [
        ("moods.scenery", "open", "opne", ["moods.scenery:1", "courier.mission.yaml:6"]),
        ("moods.scenery", "all both stay", "all both sway",
         ["moods.scenery:1", "courier.mission.yaml:6"]),
        ("doors.scenery", "in kitchen_doorway", "in kitchn_doorway",
         ["doors.scenery:19", "courier.mission.yaml:6"]),
        ("tiny.yaml", "like: calm", "like: clam", ["tiny.yaml:15", "courier.mission.yaml:6"]),
        ("tiny.yaml", "floorplan: flat", "floorplan: {flat: {}, x: {}}",
         ["tiny.yaml:9", "tiny.yaml:15"]),
    ],
)  # fmt: skip
def test_a_layer_that_cannot_be_used_hides_no_waypoint_in_a_wall(folder, layer, old, new, errors):
    change(folder, "courier.mission.yaml", ("x: 0.2, y: -2.1", "x: 0.2, y: -0.85"))
    change(folder, layer, (old, new))
    found = [text.split(" ")[0] for text in said(folder) if " E " in text]
    assert found[0] == errors[0]
    assert len(found) == len(set(found)) <= 2
    if errors[1].startswith("courier"):
        assert found == errors


def test_a_sentence_that_cannot_be_read_hides_no_door(folder):
    change(folder, "moods.scenery", ("all both stay", "all both sway"))
    change(folder, "doors.scenery", ("to 1.98 m,   mass", "to 2.2 m, mass"))
    assert [text.split(":")[0] for text in said(folder)] == [
        "moods.scenery", "doors.scenery", "doors.scenery"
    ]  # fmt: skip


def test_an_object_without_a_place_hides_no_other_one(folder):
    change(
        folder, "doors.scenery",
        ("in kitchen_doorway", "in kitchn_doorway"), ("to 1.98 m,   mass", "to 2.2 m, mass"),
    )  # fmt: skip
    assert [text.split(" ", 1)[1] for text in said(folder)] == [
        'E there is no entryway "kitchn_doorway" in the floor plan',
        "E the leaf of bedroom_door reaches 2.20 m high, bedroom_doorway only 2.00 m",
    ]


def test_a_leaf_too_wide_hides_nothing_that_can_be_known_without_it(folder):
    change(
        folder, "doors.scenery",
        ("box 4 cm x 88 cm  at (0 cm, 47 cm)", "box 4 cm x 1.2 m at (0 cm, 63 cm)"),
        ("to 1.98 m,   mass", "to 2.2 m, mass"),
    )  # fmt: skip
    change(folder, "doors_open.scenery", ("sliding_door stays open", "sliding_door stays closed"))
    oracles = "min(distance(robot, {})) >= 1 cm"
    change(
        folder, "house.oracles.yaml",
        ("min(clearance) >= 1 cm", oracles.format("kitchen_door")),
        ("reached(mission, 0.3 m)", oracles.format("kitchen_dor")),
    )  # fmt: skip
    doors = [("bedroom_door", "bedroom_doorway"), ("kitchen_door", "kitchen_doorway")]
    found = [text.split(" ", 1)[1] for text in said(folder)]
    for door, doorway in doors:
        assert f"E the leaf of {door} reaches 2.20 m high, {doorway} only 2.00 m" in found
        assert any(text.startswith(f"E {door} is 1.250 m wide, {doorway} only") for text in found)
    stays = "cannot be reached while living_room_door stays as told"
    assert f"W waypoint living-room {stays}" in found
    assert 'E no "kitchen_dor" in scene "flat"' in found
    assert len(found) == 6


def test_what_waits_for_an_object_that_hangs_nowhere_is_not_said_to_wait_for_ever(folder):
    change(folder, "doors.scenery", ("in kitchen_doorway", "in kitchn_doorway"))
    sentence = "goes from closed to open when kitchen_door.hinge starts to move"
    change(folder, "moods.scenery", ("all both stay open", f"bedroom_door {sentence}"))
    assert [text.split(":")[0] for text in said(folder)] == ["doors.scenery"]


def test_the_cells_no_run_can_be_made_of_are_counted(folder):
    change(folder, "tiny.yaml", ("mission: courier", "mission: curier"))
    campaign, _ = examine(folder / "tiny.yaml")
    assert (campaign.runs, campaign.lost_runs, len(campaign.lost)) == (0, 2, 2)


def test_a_layer_with_objects_is_to_be_named_once(folder):
    change(folder, "tiny.yaml", ("[doors_open, moods]", "[doors_open, moods, doors]"))
    assert said(folder) == ["tiny.yaml:11 E doors is named under objects and behaviours"]


@pytest.mark.parametrize(
    ("layer", "old", "new", "expected"),
    [
        ("moods.scenery", "all both", "parameter pace = 1 m\nall both",
         "moods.scenery:1 W no sentence of moods uses the parameter pace"),
        ("moods.scenery", "all both", "group idle: bedroom_door\nall both",
         "moods.scenery:1 W no sentence is about the group idle"),
        ("more.scenery", "group", "group odd: bedrom_door\ngroup both_of: every odd\ngroup",
         'more.scenery:1 W group odd: there is no object "bedrom_door"'),
        ("tiny.yaml", "oracles: [near]", "oracles: [reached]",
         "house.oracles.yaml:2 W no scenario uses the oracle near"),
        ("tiny.yaml", "oracles: house", "oracles: [house, spare]",
         "tiny.yaml:5 W no scenario uses an oracle of spare"),
        ("tiny.yaml", "  second:", "  base: {abstract: true}\n  second:",
         'tiny.yaml:14 W scenario "base" is abstract and no other one is like it'),
        ("tiny.yaml", "mission: courier", "mission: courier\n    robot: shuttle",
         "tiny.yaml:4 W no scenario uses the robot courier, each names another"),
        ("tiny.yaml", "mission: courier", "mission: courier\n    sut: idle",
         "tiny.yaml:6 W no scenario uses the system under test pilot, each names others"),
        ("tiny.yaml", "[doors_open, moods]", "[doors_moving, doors_open, moods]",
         "tiny.yaml:11 W doors_moving changes nothing: it places no object, and what its "
         "sentences say is replaced by later layers or about no object"),
        ("tiny.yaml", "like: calm", "like: calm\n    floorplan: flat\n    "
         "vary: {floorplan: flat, samples: 1}",
         "tiny.yaml:16 W not used: the plans are variants of flat"),
        ("tiny.yaml", "scenarios:", "defaults: {robot: shuttle, map: {doors: initial}}\nscenarios:",
         "tiny.yaml:4 W no scenario uses the robot courier, each names another"),
        ("tiny.yaml", "scenarios:", "map: {doors: none}\ndefaults: {map: {doors: initial}}\n"
         "scenarios:", "tiny.yaml:7 W no scenario uses the map said for all, each has another"),
        ("tiny.yaml", "scenarios:", "defaults: {mission: courier, limit: 2 min}\nscenarios:",
         "tiny.yaml:7 W no scenario uses the mission said for all, each has another"),
        ("tiny.yaml", "scenarios:",
         "defaults: {floorplan: flat, vary: {floorplan: flat, samples: 1}}\nscenarios:",
         "tiny.yaml:7 W not used: the plans are variants of flat"),
        ("tiny.yaml", "scenarios:", "defaults: {limit: 10 s}\nscenarios:",
         "tiny.yaml:7 W 10 s are too short for mission courier: it takes pilot at least "),
        ("tiny.yaml", "like: calm", "like: calm\n    limit: 10 s",
         "tiny.yaml:16 W 10 s are too short for mission courier: it takes pilot at least "),
    ],
)  # fmt: skip
def test_what_has_no_effect_is_told(folder, layer, old, new, expected):
    change(folder, layer, (old, new))
    found = said(folder)
    assert any(text.startswith(expected) for text in found), found


@pytest.mark.parametrize("wrong", ["defaults: {objects: 5}", "objects: doors", "default: {a: 1}"])
def test_what_could_not_be_read_for_all_scenarios_is_missed_in_none(folder, wrong):
    change(folder, "tiny.yaml", ("scenarios:", f"{wrong}\nscenarios:"))
    change(folder, "tiny.yaml", ("    objects: [doors, more]\n", ""))
    change(folder, "courier.mission.yaml", ("x: 0.2, y: -2.1", "x: 0.2, y: -0.85"))
    found = [text.split(" ")[0] for text in said(folder)]
    assert found == ["tiny.yaml:7", "courier.mission.yaml:6"]


def test_a_scenario_that_could_not_be_read_is_not_missed(folder):
    change(folder, "tiny.yaml", ("  second:", "  odd: 5\n  third: {like: odd}\n  second:"))
    assert [text.split(" ")[0] for text in said(folder)] == ["tiny.yaml:14"]


def test_what_all_scenarios_lack_is_said_once(folder):
    change(folder, "tiny.yaml", ("    mission: courier\n", ""))
    assert said(folder) == ["tiny.yaml:7 E no scenario names a mission"]


def test_oracles_that_another_campaign_may_use_are_an_offer(folder):
    change(folder, "tiny.yaml", ("oracles: [near]", "oracles: [reached]"))
    (folder / "other.yaml").write_text(CAMPAIGN.replace("tiny", "other"))
    assert said(folder) == []


def test_variants_of_a_plan_say_the_same_thing_once(folder):
    change(
        folder, "tiny.yaml",
        ("    floorplan: flat\n", "    vary: {floorplan: flat, samples: 4, seed: 1}\n"),
        ("    objects: [doors, more]\n    behaviours: [doors_open, moods]\n", ""),
    )  # fmt: skip
    change(folder, "courier.mission.yaml", ("x: 0.2, y: -2.1", "x: 0.2, y: -0.85"))
    about = [text for text in said(folder) if "kitchen" in text]
    assert len(about) == len({text.split("(")[0] for text in about})
    assert len(about) < 4


def test_two_places_of_one_name_are_told_apart(folder):
    change(folder, "courier.mission.yaml", ("id: home", "id: kitchen"))
    found = [text for text in said(folder) if " E " in text]
    assert found == [
        'courier.mission.yaml:9 E two waypoints are called "kitchen": one at (0.2, -2.1), '
        "one at (0.4, 0)"
    ]
    change(folder, "courier.mission.yaml", ("x: 0.4, y: 0.0", "x: 0.2, y: -2.1"))
    assert said(folder) == []


def test_a_pipe_and_a_folder_beside_a_campaign_are_no_campaigns(folder):
    change(folder, "tiny.yaml", ("oracles: house\n", "oracles: [house, spare]\n"))
    change(folder, "tiny.yaml", ("robot: courier", "robot: nobody"))
    before = said(folder)
    # Opening a pipe that nobody writes to would wait for ever.
    os.mkfifo(folder / "pipe.yaml")
    (folder / "folder.yaml").mkdir()
    assert said(folder) == before


ALLOW = """\
allow:
  - {warning: "scenario * is abstract and no other one is like it", why: "kept for later"}
"""


def test_a_warning_that_is_meant_is_not_said(folder):
    lone = ("scenarios:\n", "scenarios:\n  lone: {like: calm, abstract: true}\n")
    change(folder, "tiny.yaml", lone)
    assert any("is abstract and no other one" in one for one in said(folder))
    change(folder, "tiny.yaml", ("scenarios:\n", ALLOW + "scenarios:\n"))
    campaign, found = examine(folder / "tiny.yaml")
    assert not [one for one in found if "is abstract" in one.message]
    assert [one.message for one in campaign.allowed] == [
        'scenario "lone" is abstract and no other one is like it'
    ]


def test_a_warning_that_stands_for_several_is_allowed_as_it_is_said(folder):
    slow = "  slow: {like: calm, robot: slow}\n  slower: {like: calm, robot: slower}\n"
    change(folder, "tiny.yaml", ("limit: 3 min", "limit: 2 s"), ("  second:", f"{slow}  second:"))
    robot = (folder.parent / "robots" / "courier.yaml").read_text()
    for name, speed in (("slow", "0.3 m/s"), ("slower", "0.2 m/s")):
        text = re.sub(r"max_vx: .*", f"max_vx: {speed}", robot.replace("courier", name))
        (folder / f"{name}.yaml").write_text(text)
    (short,) = [one for one in examine(folder / "tiny.yaml")[1] if "too short" in one.message]
    assert short.hint.endswith("; 2 more like it, with other sizes")
    allow = f"allow:\n  - {{warning: {json.dumps(short.message)}, why: it is a glance}}\n"
    change(folder, "tiny.yaml", ("scenarios:\n", f"{allow}scenarios:\n"))
    campaign, found = examine(folder / "tiny.yaml")
    assert not [one for one in found if "too short" in one.message or "no warning" in one.message]
    assert [one.message for one in campaign.allowed] == [short.message]


def test_what_is_allowed_and_never_said_is_a_warning(folder):
    change(folder, "tiny.yaml", ("scenarios:\n", ALLOW + "scenarios:\n"))
    assert said(folder) == ["tiny.yaml:8 W no warning is like this one"]


def test_no_error_is_allowed(folder):
    allow = 'allow:\n  - {warning: "*", why: "I do not care"}\n'
    change(folder, "tiny.yaml", ("scenarios:\n", allow + "scenarios:\n"))
    change(folder, "tiny.yaml", ("mission: courier", "mission: curier"))
    assert [one for one in said(folder) if " E " in one and "curier" in one]


def test_a_reason_is_asked_for(folder):
    change(folder, "tiny.yaml", ("scenarios:\n", 'allow:\n  - {warning: "*"}\nscenarios:\n'))
    assert [one for one in said(folder) if " E " in one and '"why"' in one]


def test_what_is_allowed_changes_no_run(folder):
    change(folder, "tiny.yaml")
    before = prepare_submission(folder / "tiny.yaml").submission
    change(folder, "tiny.yaml", ("scenarios:\n", ALLOW + "scenarios:\n"))
    assert prepare_submission(folder / "tiny.yaml").submission.runs == before.runs
