"""How campaigns are written: defaults, and answers to what people write in the wrong place."""

import shutil
from pathlib import Path

import pytest

from daemon.campaign import expand, load_campaign
from grammars.model.mission_files import load_mission
from grammars.model.robot_files import load_robot
from grammars.text.diagnostics import InputError

CAMPAIGN = """\
campaign: tiny
limit: 30 s
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
defaults:
  floorplan: flat
  objects: doors
  mission: courier
  oracles: [reached]
  limit: 40 s
scenarios:
  calm:
    behaviours: doors_open
  rude:
    like: calm
    behaviours: doors_in_your_face
    oracles+: [no-contact]
  other:
    robot: shuttle
    sut: idle
    limit: 50 s
"""


@pytest.fixture
def folder(tmp_path, campaigns):
    """The files of a campaign far from everything that ships."""
    return Path(shutil.copytree(campaigns / "demo", tmp_path / "mine"))


def write(folder, text):
    path = folder / "tiny.yaml"
    path.write_text(text)
    return path


def messages(path):
    with pytest.raises(InputError) as caught:
        load_campaign(path)
    return [str(d).replace(f"{path.parent}/", "") for d in caught.value.diagnostics]


def test_defaults_hold_where_a_scenario_says_nothing_itself_or_by_like(folder):
    runs = {run.scenario: run for run in expand(load_campaign(write(folder, CAMPAIGN))).specs}
    assert {name: [o.name for o in run.oracles] for name, run in runs.items()} == {
        "calm": ["reached"],
        "rude": ["reached", "no-contact"],
        "other": ["reached"],
    }
    assert {name: run.limit for name, run in runs.items()} == {
        "calm": 40.0,
        "rude": 40.0,
        "other": 50.0,
    }
    assert (runs["calm"].robot.name, runs["other"].robot.name) == ("courier", "shuttle")
    assert (runs["calm"].sut.kind, runs["other"].sut.kind) == ("pilot", "idle")


def test_defaults_make_the_same_runs_as_writing_it_out(folder):
    a, b = CAMPAIGN.index("defaults:"), CAMPAIGN.index("scenarios:")
    slots = "".join(f"  {line}\n" for line in CAMPAIGN[a:b].splitlines()[1:])
    spelled = CAMPAIGN[:a] + CAMPAIGN[b:].replace("  calm:\n", f"  calm:\n{slots}").replace(
        "  other:\n", f"  other:\n{slots.replace('    limit: 40 s', '')}"
    )
    here, there = (expand(load_campaign(write(folder, text))) for text in (CAMPAIGN, spelled))
    assert here.runs == there.runs
    assert here.scenes == there.scenes


def test_variants_may_be_a_default(folder):
    text = CAMPAIGN.replace("  floorplan: flat\n", "  vary: {floorplan: flat, samples: 1}\n")
    cells = load_campaign(write(folder, text)).cells
    assert {cell.name for cell in cells} == {"calm@0", "rude@0", "other@0"}


def test_robots_and_systems_that_ship_come_last(folder, campaigns):
    text = CAMPAIGN.replace("[pilot]", "[pilot, fro-omni]")
    shipped = load_campaign(write(folder, text))
    assert [sut.name for sut in shipped.cells[0].suts] == ["pilot", "fro-omni"]
    own = (campaigns / "robots" / "courier.yaml").read_text().replace("mass: 30", "mass: 31")
    (folder / "courier.yaml").write_text(own)
    (folder / "suts").mkdir()
    (folder / "suts" / "fro-omni.yaml").write_text("sut: mine\nlike: a2s\n")
    cell = load_campaign(write(folder, text)).cells[0]
    assert cell.robot.mass == 31.0
    # What one that ships is like is found beside it.
    assert [sut.name for sut in cell.suts] == ["pilot", "mine"]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("limit: 30 s", "limit: 30 s\nfloorplan: flat", 'or under "defaults:" for all of them'),
        ("limit: 30 s", "limit: 30 s\nflorplan: flat", "floorplan: it belongs in a scenario, or"),
        ("limit: 30 s", "limit: 30 s\nsut: pilot", "matrix: {sut: [pilot]}"),
        ("limit: 30 s", "limit: 30 s\nwaypoints: []", "belongs in a mission file: NAME.mission."),
        ("limit: 30 s", "limit: 30 s\nfootprint: {}", "belongs in a robot file: robots/NAME.yaml"),
        ("limit: 30 s", "limit: 30 s\nparameters: {}", "belongs in a SUT file: suts/NAME.yaml"),
        (
            "limit: 30 s",
            "limit: 30 s\ntimeout: 9 s",
            'unknown key "timeout"\n    it is called limit',
        ),
        ("limit: 30 s", "limit: 30 s\ndoors: open", '"objects:" names those with the models and'),
        ("oracles: navigation", "oracles: {a: never(contact)}", "such as: oracles: navigation"),
        ("limit: 30 s", "lmit: 30 s", 'did you mean "limit"?'),
        ("limit: 30 s\n", "", "such as: limit: 3 min"),
        ("matrix: {sut: [pilot]}", "matrix: pilot", "such as: matrix: {sut: [pilot]}"),
        ("  calm:\n", "  calm:\n    repeats: 3\n", "belongs at the top of the campaign file"),
        ("  calm:\n", "  calm:\n    matrix: {}\n", "here write: sut: [pilot]"),
        ("  limit: 40 s", "  like: calm", 'key "like" is in the wrong place'),
        ("oracles: [reached]", "oracles: navigation", "that is a file: name lines of it here"),
        ("oracles: navigation\n", "", "write at the top of the campaign file in which file"),
        ("robot: courier", "robot: curier", 'did you mean "courier"?'),
        ("robot: courier", "robot: zzz", "known here: courier, robile, robile-planar-move, sh"),
        ("[pilot]", "[fro-dif]", 'did you mean "fro-diff"?'),
    ],
)
def test_what_stands_in_the_wrong_place_is_answered_with_the_right_one(folder, old, new, expected):
    assert expected in "\n".join(messages(write(folder, CAMPAIGN.replace(old, new, 1))))


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("behaviours", "5", 'must be text\n    5 is a number: write it as "5"'),
        ("behaviours", "true", 'must be text\n    true is true or false: write it as "true"'),
        ("behaviours", "{}", "must be NAME or NAME: {parameter: value}, not nothing"),
        ("behaviours", "[[a]]", "takes one layer here, not a list: write its name without"),
        ("behaviours", "[doors_open: ]", '"doors_open:" has no values behind it'),
        (
            "behaviours",
            "{doors_open: 5}",
            "write doors_open: {parameter: value}, not doors_open",
        ),
        ("floorplan", "[flat]", "takes one layer here, not a list: write its name without"),
        ("floorplan", "{}", "must be NAME or NAME: {parameter: value}, not nothing"),
        ("mission", "[courier]", "takes one layer here, not a list: write its name without"),
        ("mission", "{start: 1}", "write start: {parameter: value}, not start: 1"),
        ("objects", "{doors: 1}", "write doors: {parameter: value}, not doors: 1"),
        ("objects", "[5]", "must be text"),
        ("oracles", "{a: b}", "takes names, not keys: what is named is written elsewhere"),
        ("without", "{a: b}", "takes names, not keys: what is named is written elsewhere"),
        ("map", "office", "such as: map: {file: office.yaml}"),
        ("vary", "flat", "such as: vary: {floorplan: flat, samples: 20}"),
    ],
)
def test_a_value_of_the_wrong_form_is_one_finding_in_plain_words(folder, key, value, expected):
    text = CAMPAIGN.replace("  other:\n", f"  other:\n    {key}: {value}\n")
    (found,) = messages(write(folder, text))
    assert expected in found
    assert "dict[" not in found


@pytest.mark.parametrize(
    ("slot", "expected"),
    [
        ("mission: courier", "mission: courier (the file courier.mission.yaml)"),
        ("floorplan: flat", "floorplan: flat (the file flat.fpm)"),
        ("robot: courier", "`scenario new --layers` names those that ship"),
        ("matrix: {sut: [pilot]}", "matrix: {sut: [pilot]}"),
        ("oracles: [reached]", '"oracles: navigation" at the top names files that hold oracles'),
    ],
)
def test_what_no_scenario_names_is_said_once_with_a_line_to_write(folder, slot, expected):
    text = CAMPAIGN.replace(f"{slot}\n", "\n")
    if slot == "oracles: [reached]":
        text = text.replace("    oracles+: [no-contact]\n", "")
    text = text.replace("    robot: shuttle\n    sut: idle\n", "    about: some\n")
    (found,) = messages(write(folder, text))
    assert found.startswith("tiny.yaml:")
    assert "no scenario names" in found
    assert expected in found


def test_a_single_scenario_without_a_slot_is_named(folder):
    text = CAMPAIGN.replace("  oracles: [reached]\n", "").replace(
        "behaviours: doors_open", "oracles: [reached]"
    )
    (found,) = messages(write(folder, text))
    assert 'scenario "other" names no oracles' in found


def test_missions_and_robots_answer_misplaced_keys_too(tmp_path):
    path = tmp_path / "m.mission.yaml"
    path.write_text("mission: m\nwaypoint: [{x: 0, y: 0}]\nlimit: 3 min\n")
    with pytest.raises(InputError) as caught:
        load_mission(path)
    said = str(caught.value)
    assert 'did you mean "waypoints"?' in said
    assert 'key "limit" is in the wrong place\n    it belongs in the campaign file' in said
    path.write_text("robot: r\nmax_vx: 1 m/s\nradius: 30 cm\nstart: {}\n")
    with pytest.raises(InputError) as caught:
        load_robot(path)
    said = str(caught.value)
    for part in ('belongs in "drive:"', 'belongs in "footprint:"', "belongs in a mission file"):
        assert part in said


def test_keys_of_a_robot_in_a_system_under_test(folder):
    (folder / "fast.yaml").write_text("sut: fast\nlike: pilot\ndrive: {}\nlookahead: 1\n")
    said = "\n".join(messages(write(folder, CAMPAIGN.replace("[pilot]", "[fast]"))))
    assert "fast.yaml:3:1: " in said
    assert "it belongs in a robot file: robots/NAME.yaml" in said
    assert 'what differs from the defaults of its kind stands under "parameters:"' in said
