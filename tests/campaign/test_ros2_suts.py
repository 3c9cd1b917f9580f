"""Stacks of ROS 2 under test: their files, and how often a stack that is not repeatable runs."""

import re

import pytest

from daemon.campaign import examine, load_campaign
from daemon.stacks.ros2.keys import ROS2_KEYS, Ros2Frames, Ros2Topics
from daemon.stacks.ros2.settings import read_settings, settings_not_written
from grammars.text.diagnostics import InputError, Severity
from tests.campaign.loaded import findings_of, load_sut, messages, runs
from tests.parts import ROOT

BASE = """\
sut: nav2
kind: ros2
launch: nav map:={map} params:={params}
files: {params: nav2_params.yaml}
environment: {setup: [/a.bash, /b.bash], RMW_IMPLEMENTATION: rmw_x, DEBUG: "1"}
ready: [amcl, controller_server]
start-up: 2 min
late: 10 %
"""
BOTH = {"sut": ["pilot", "nav2"]}


@pytest.fixture(autouse=True)
def nav2(demo):
    (demo / "nav2_params.yaml").write_text("amcl: {ros__parameters: {max_beams: 60}}\n")
    (demo / "nav2.yaml").write_text(BASE)
    return demo / "nav2.yaml"


def load(folder, name="nav2", values=None):
    sut, warnings = load_sut(folder, name, values)
    assert warnings == []
    return sut


def repeats_by_sut(path):
    found = {}
    for run in runs(path):
        found.setdefault(run.sut.name, []).append(run.repeat)
    return found


def test_the_specification_holds_the_keys_as_they_are_written(demo):
    sut = load(demo)
    assert (sut.kind, sut.repeatable, sut.parameters["repeatable"]) == ("ros2", False, False)
    assert sut.parameters["start-up"] == "2 min"
    assert sut.files.keys() == {"params"}
    # Files count by their content.
    (demo / "other.yaml").write_text("sut: other\nlike: nav2\nfiles: {params: other.params}\n")
    for text, is_other in ((demo / "nav2_params.yaml").read_text(), False), ("a: 1\n", True):
        (demo / "other.params").write_text(text)
        assert (load(demo, "other").files != sut.files) is is_other
    settings = read_settings(sut.local_parameters)
    assert (settings.start_up, settings.late) == (120.0, 0.1)


def test_a_stack_named_by_its_kind_is_not_repeatable_either(demo, campaign):
    launch = {"launch": "nav {map}", "ready": ["amcl"]}
    named = load(demo, "ros2", launch)
    assert (named.repeatable, named.parameters["repeatable"]) == (False, False)
    path = campaign(matrix={"sut": ["pilot", {"ros2": launch}]})
    assert repeats_by_sut(path) == {"pilot": [0], "ros2": [0, 1, 2, 3, 4]}


@pytest.mark.parametrize("name", ["ros2", "nav2"])
def test_no_stack_can_be_called_repeatable(demo, name):
    with pytest.raises(InputError, match="never repeatable"):
        load(demo, name, {"launch": "nav {map}", "repeatable": True})


def test_a_system_that_is_not_repeatable_runs_more_often_unless_repeats_are_written(campaign):
    silent = campaign(matrix=BOTH)
    assert repeats_by_sut(silent) == {"pilot": [0], "nav2": [0, 1, 2, 3, 4]}
    warning = "nav2: not repeatable, so every scenario is run 5 times"
    assert any(warning in text for text in messages(silent))
    assert load_campaign(silent).runs == 6
    by_default = runs(silent)
    assert len({(run.repeat, run.seed) for run in by_default}) == 5
    # Repeats draw from the same seeds however many there are.
    written = runs(campaign(matrix=BOTH, repeats=5))
    assert {run.digest for run in by_default} < {run.digest for run in written}
    twice = campaign(matrix=BOTH, repeats=2)
    assert repeats_by_sut(twice) == {"pilot": [0, 1], "nav2": [0, 1]}
    assert not any("not repeatable" in text for text in messages(twice))


def test_sensors_that_do_not_fit_the_cycles_are_worth_a_warning(nav2, campaign):
    path = campaign(matrix=BOTH, repeats=1)
    assert not any("cycles of" in d.message for d in examine(path)[1])
    nav2.write_text(BASE + "period: 0.07 s\n")
    warnings = [d for d in examine(path)[1] if "cycles of 0.07 s" in d.message]
    assert {d.severity for d in warnings} == {Severity.WARNING}
    assert any("the laser of robot" in d.message for d in warnings)


@pytest.mark.parametrize(
    ("sut", "expected"),
    [
        ("nav2", "bt.recoveries is unknown for nav2, which does not record it"),
        ("pilot", "warning: bt.recoveries is unknown for pilot: the oracle is inconclusive there"),
    ],
)
def test_an_oracle_about_a_signal_that_is_not_recorded_is_refused_or_warned_of(
    demo, nav2, campaign, sut, expected
):
    (demo / "tree.oracles.yaml").write_text("recoveries: always(bt.recoveries <= 2)\n")
    calm = {"floorplan": "flat", "mission": "courier", "oracles": ["recoveries"]}
    path = campaign(matrix={"sut": sut}, oracles="tree", scenarios={"calm": calm})
    (finding,) = [d for d in findings_of(path) if "bt.recoveries" in d.message]
    assert f"tree.oracles.yaml:1:20: {expected}" in str(finding)
    if sut == "nav2":
        assert finding.hint == "write record: [behavior tree] in its file"
        nav2.write_text(f"{BASE}record: [behavior tree]\n")
        assert not [d for d in findings_of(path) if "bt.recoveries" in d.message]


def test_every_key_is_documented_with_its_default():
    text = (ROOT / "docs" / "languages" / "systems-under-test.md").read_text()
    section = text.partition("## ROS 2")[2].partition("\n## ")[0]
    rows = dict(re.findall(r"^\| `([a-z-]+)` \| (.*?) \|", section, re.MULTILINE))
    assert rows.keys() == {*ROS2_KEYS, "files"}
    defaults = settings_not_written(read_settings({"launch": "nav {map}"}))
    for key, value in defaults["stack"].items():
        if value != "none" and key != "action":
            assert rows[key].strip("`") == str(value), key
    for key, section in (("topics", Ros2Topics), ("frames", Ros2Frames)):
        fields = {field.alias or n: field.default for n, field in section.model_fields.items()}
        listed = [f"`{name}`" if name == x else f"`{name}: {x}`" for name, x in fields.items()]
        assert rows[key] == ", ".join(listed), key


def test_checking_starts_nothing(demo, nav2, campaign):
    nav2.write_text(f"sut: nav2\nkind: ros2\nlaunch: touch {demo / 'started'}\n")
    runs(campaign(matrix=BOTH))
    assert not (demo / "started").exists()
