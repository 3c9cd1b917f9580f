"""Everything wrong in a stage of loading at once, each thing once; what nobody uses."""

import json
import os
import re
import shutil
from pathlib import Path

import pytest

from daemon.campaign import examine
from grammars.text.diagnostics import InputError
from scenario_tui.library.campaign import load
from tests.campaign.findings import findings_of

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
    return [
        f"{Path(d.where.file).name}:{d.where.line} {d.severity[0].upper()} {d.message}"
        for d in findings_of(folder / "tiny.yaml")
        if "this sentence, not the one" not in d.message
    ]


def test_a_campaign_of_which_all_is_used_is_nothing_to_speak_of(folder):
    assert said(folder) == []


def test_what_is_submitted_is_told_all_of_it_too(folder):
    change(folder, "tiny.yaml")
    change(folder, "courier.mission.yaml", ("x: 0.2, y: -2.1", "x: 0.2, y: -0.85"))
    change(folder, "doors.scenery", ("to 1.98 m,   mass", "to 2.2 m, mass"))
    with pytest.raises(InputError) as caught:
        load(folder / "tiny.yaml").submission()
    messages = [d.message for d in caught.value.findings if d.severity == "error"]
    assert [m.split(" reaches")[0].split(" is ")[0] for m in messages] == [
        "the leaf of bedroom_door", "the leaf of kitchen_door", "waypoint kitchen"
    ]  # fmt: skip


def test_more_runs_than_the_daemon_takes_are_told_before_anything_is_drawn(folder):
    changes = (("seed: 3", "seed: 3\nrepeats: 100000"), ("[pilot]", "[pilot, idle]"))
    change(folder, "tiny.yaml", *changes)
    with pytest.raises(InputError, match=r"has 400000 runs.*may have 200000: split") as caught:
        load(folder / "tiny.yaml").submission()
    assert caught.value.findings[0].where.line == 3


def test_a_path_without_its_ending_is_told_the_file_that_is_there(folder):
    (folder / "more").mkdir()
    shutil.copy(folder / "more.scenery", folder / "more" / "more.scenery")
    change(folder, "tiny.yaml", ("[doors, more]", "[doors, more/more]"))
    (error,) = findings_of(folder / "tiny.yaml")
    assert error.message == 'no file "more/more" for the scenery'
    assert error.hint == "a path has an ending: more/more.scenery"


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
  - {warning: "no scenario uses an oracle of *", why: "kept for later"}
"""


def test_a_warning_that_is_meant_is_not_said(folder):
    change(folder, "tiny.yaml", ("oracles: house\n", "oracles: [house, spare]\n"))
    assert said(folder) == ["tiny.yaml:5 W no scenario uses an oracle of spare"]
    change(folder, "tiny.yaml", ("scenarios:\n", ALLOW + "scenarios:\n"))
    campaign, found = examine(folder / "tiny.yaml")
    assert not [one for one in found if "no scenario uses" in one.message]
    assert [one.message for one in campaign.allowed] == ["no scenario uses an oracle of spare"]


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


def test_what_is_allowed_changes_no_run(folder):
    change(folder, "tiny.yaml")
    before = load(folder / "tiny.yaml").submission()
    change(folder, "tiny.yaml", ("scenarios:\n", ALLOW + "scenarios:\n"))
    assert load(folder / "tiny.yaml").submission().runs == before.runs
