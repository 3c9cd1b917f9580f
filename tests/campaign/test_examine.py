"""Findings about whole campaigns: each thing once, allowed warnings, files beside a campaign."""

import os
import re
import shutil

import pytest

from daemon.campaign import examine
from grammars.text.diagnostics import InputError
from scenario_tui.library.campaign import load
from tests.campaign.loaded import findings_of, messages

LAYERS = {
    "house.oracles.yaml": "reached: reached(mission, 0.3 m)\nnear: min(clearance) >= 1 cm\n",
    "spare.oracles.yaml": "spare: never(contact)\n",
    "more.scenery": "group both: bedroom_door, kitchen_door\n",
    "moods.scenery": "all both stay open\n",
}
CALM = {
    "floorplan": "flat",
    "objects": ["doors", "more"],
    "behaviours": "moods",
    "mission": "courier",
    "oracles": ["reached"],
}
NEAR = {"like": "calm", "oracles": ["near"]}


@pytest.fixture
def house(demo, campaign):
    """Write a campaign every word of which has an effect, with changes."""
    for name, text in LAYERS.items():
        (demo / name).write_text(text)

    def write(calm=CALM, near=NEAR, **changes):
        scenarios = {"calm": calm, "near": near} | changes.pop("scenarios", {})
        return campaign(**{"oracles": "house", "limit": "3 min", "scenarios": scenarios} | changes)

    return write


def change(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def found(path):
    return [f"{d.severity[0].upper()} {d.message}" for d in findings_of(path)]


KITCHEN = ("courier.mission.yaml", "x: 0.2, y: -2.1", "x: 0.2, y: -0.85")
TWICE = ("courier.mission.yaml", "id: home", "id: kitchen")
VARIED = {"vary": {"floorplan": "flat", "samples": 4, "seed": 1}, "mission": "courier",
          "oracles": ["reached"]}  # fmt: skip
HOUSES = {
    "every word has an effect": ((), {}),
    "a path without its ending": ((), {"calm": CALM | {"objects": ["doors", "more/more"]}}),
    "an oracle that no scenario uses": ((), {"near": None}),
    "variants of a plan say the same thing once": ((KITCHEN,), {"calm": VARIED}),
    "two places of one name": ((TWICE,), {}),
    "one place that is visited twice": (
        (TWICE, ("courier.mission.yaml", "x: 0.4, y: 0.0", "x: 0.2, y: -2.1")), {}),
}  # fmt: skip


def test_findings_about_campaigns(house, demo, golden):
    """``findings.txt``: what is found in campaigns that differ from one that is sound."""
    (demo / "more").mkdir()
    shutil.copy(demo / "more.scenery", demo / "more" / "more.scenery")
    mission, lines = (demo / "courier.mission.yaml").read_text(), []
    for name, (changes, keys) in HOUSES.items():
        (demo / "courier.mission.yaml").write_text(mission)
        for file, old, new in changes:
            change(demo / file, old, new)
        lines += [f"--- {name}", *messages(house(**keys))]
    golden("findings.txt", "\n".join(lines) + "\n")


def test_oracles_that_another_campaign_may_use_are_an_offer(house, demo):
    path = house(near=None)
    shutil.copy(path, demo / "other.yaml")
    change(demo / "other.yaml", "campaign: tiny", "campaign: other")
    assert found(path) == []


def test_a_submission_is_refused_with_all_errors(house, demo):
    change(demo / "courier.mission.yaml", "x: 0.2, y: -2.1", "x: 0.2, y: -0.85")
    change(demo / "doors.scenery", "to 1.98 m,   mass", "to 2.2 m, mass")
    with pytest.raises(InputError) as refusal:
        load(house()).submission()
    errors = [d.message for d in refusal.value.findings if d.severity == "error"]
    assert [m.split(" reaches")[0].split(" is ")[0] for m in errors] == [
        "the leaf of bedroom_door", "the leaf of kitchen_door", "waypoint kitchen"
    ]  # fmt: skip


def test_more_runs_than_the_daemon_takes_are_refused_before_anything_is_drawn(house):
    path = house(repeats=100000, matrix={"sut": ["pilot", "idle"]})
    with pytest.raises(InputError, match=r"has 400000 runs.*limit is 200000: split") as refusal:
        load(path).submission()
    line = refusal.value.findings[0].where.line
    assert path.read_text().splitlines()[line - 1] == "repeats: 100000"


def test_a_pipe_and_a_folder_beside_a_campaign_are_no_campaigns(house, demo):
    path = house(oracles=["house", "spare"], robot="nobody")
    expected = found(path)
    # Opening a pipe that nobody writes to would wait for ever.
    os.mkfifo(demo / "pipe.yaml")
    (demo / "folder.yaml").mkdir()
    assert found(path) == expected


def test_a_warning_that_is_meant_is_allowed_and_changes_no_run(house):
    path = house(oracles=["house", "spare"])
    assert found(path) == ["W no scenario uses an oracle of spare"]
    runs = load(path).submission().runs
    allow = [{"warning": "no scenario uses an oracle of *", "why": "kept for later"}]
    path = house(oracles=["house", "spare"], allow=allow)
    campaign, findings = examine(path)
    assert list(findings) == []
    assert [one.message for one in campaign.allowed] == ["no scenario uses an oracle of spare"]
    assert load(path).submission().runs == runs


def test_a_warning_that_stands_for_several_is_allowed_as_it_is_said(house, demo, campaigns):
    robot = (campaigns / "robots" / "courier.yaml").read_text()
    for name, speed in (("slow", "0.3 m/s"), ("slower", "0.2 m/s")):
        text = re.sub(r"max_vx: .*", f"max_vx: {speed}", robot.replace("courier", name))
        (demo / f"{name}.yaml").write_text(text)
    slow = {name: {"like": "calm", "robot": name} for name in ("slow", "slower")}
    (warning,) = [
        d for d in findings_of(house(limit="2 s", scenarios=slow)) if "short" in d.message
    ]
    assert warning.hint.endswith("; 2 more like it, with other sizes")
    allow = [{"warning": warning.message, "why": "it is a glance"}]
    campaign, findings = examine(house(limit="2 s", scenarios=slow, allow=allow))
    assert not [d for d in findings if "too short" in d.message or "no warning" in d.message]
    assert [one.message for one in campaign.allowed] == [warning.message]
