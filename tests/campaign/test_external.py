"""Systems under test outside of the simulator: their files, and how often they are run."""

import re
from pathlib import Path

import pytest

from daemon.campaign import LayerLibrary, LayerReference, examine, expand, load_campaign
from daemon.stacks.ros2.keys import ROS2_KEYS, Ros2Frames, Ros2Topics
from daemon.stacks.ros2.settings import read_settings, settings_not_written
from grammars.text.diagnostics import InputError, Severity, Where

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
CAMPAIGN = """\
campaign: flat
seed: 7
limit: 30 s
{repeats}robot: courier
matrix: {{sut: [pilot, nav2]}}
oracles: navigation
scenarios:
  A: {{floorplan: flat, mission: courier, oracles: [reached]}}
"""


@pytest.fixture
def folder(tmp_path, campaigns):
    (tmp_path / "nav2_params.yaml").write_text("amcl: {ros__parameters: {max_beams: 60}}\n")
    (tmp_path / "nav2.yaml").write_text(BASE)
    demo = campaigns / "demo"
    for path in demo.iterdir():
        if path.suffix in (".fpm", ".yaml") and path.name != "campaign.yaml":
            (tmp_path / path.name).write_text(path.read_text())
    (tmp_path / "courier.yaml").write_text((campaigns / "robots" / "courier.yaml").read_text())
    return tmp_path


def load(folder, name="nav2"):
    library = LayerLibrary(folder)
    sut = library.sut(LayerReference(name, {}, Where("campaign.yaml", 1, 1)))
    return sut, [str(w).replace(f"{folder}/", "") for w in library.warnings]


def test_the_specification_holds_the_keys_as_they_are_written(folder):
    sut, warnings = load(folder)
    assert (sut.kind, sut.repeatable, warnings) == ("ros2", False, [])
    assert sut.parameters["start-up"] == "2 min"
    assert sut.parameters["repeatable"] is False
    assert sut.files.keys() == {"params"}
    settings = read_settings(sut.local_parameters)
    assert (settings.start_up, settings.late) == (120.0, 0.1)


def test_a_stack_named_by_its_kind_is_not_repeatable_either(folder):
    launch = {"launch": "nav {map}", "ready": ["amcl"]}
    named = LayerLibrary(folder).sut(LayerReference("ros2", launch, Where("campaign.yaml", 1, 1)))
    assert (named.repeatable, named.parameters["repeatable"]) == (False, False)
    path = folder / "campaign.yaml"
    by_kind = "{ros2: {launch: 'nav {map}', ready: [amcl]}}"
    path.write_text(CAMPAIGN.format(repeats="").replace("nav2]}", f"{by_kind}]}}"))
    assert repeats_by_sut(path) == {"pilot": [0], "ros2": [0, 1, 2, 3, 4]}


def test_no_stack_can_be_called_repeatable(folder):
    keys = {"launch": "nav {map}", "repeatable": True}
    with pytest.raises(InputError, match="never repeatable"):
        LayerLibrary(folder).sut(LayerReference("ros2", keys, Where("campaign.yaml", 1, 1)))
    with pytest.raises(InputError, match="never repeatable"):
        LayerLibrary(folder).sut(LayerReference("nav2", keys, Where("campaign.yaml", 1, 1)))


def test_a_stack_like_another_is_the_same_except_for_what_it_says(folder):
    (folder / "nav2_other.yaml").write_text("a: 1\n")
    (folder / "other.yaml").write_text(
        "sut: other\nlike: nav2\nlate: null\nready: [amcl]\n"
        "environment: {setup: /c.bash, DEBUG: null, MORE: x}\nfiles: {params: nav2_other.yaml}\n"
    )
    base, other = load(folder)[0], load(folder, "other")[0]
    assert "late" not in other.parameters
    assert other.parameters["ready"] == ["amcl"]
    assert other.parameters["environment"] == {
        "setup": "/c.bash",
        "RMW_IMPLEMENTATION": "rmw_x",
        "MORE": "x",
    }
    assert other.parameters["launch"] == base.parameters["launch"]
    assert other.files != base.files


def write_campaign(folder, repeats=""):
    path = folder / "campaign.yaml"
    path.write_text(CAMPAIGN.format(repeats=repeats))
    return path


def repeats_by_sut(path):
    found = {}
    for run in expand(load_campaign(path)).specs:
        found.setdefault(run.sut.name, []).append(run.repeat)
    return found


def test_what_is_not_repeatable_is_run_more_often_unless_told_otherwise(folder):
    silent = write_campaign(folder)
    assert repeats_by_sut(silent) == {"pilot": [0], "nav2": [0, 1, 2, 3, 4]}
    told = [d.message for d in examine(silent)[1] if d.severity is Severity.WARNING]
    assert any("nav2: not repeatable, so every scenario is run 5 times" in text for text in told)
    assert examine(silent)[0].runs == 6
    spoken = write_campaign(folder, "repeats: 2\n")
    assert repeats_by_sut(spoken) == {"pilot": [0, 1], "nav2": [0, 1]}
    assert not any("not repeatable" in d.message for d in examine(spoken)[1])


def test_repeats_draw_from_the_same_seeds_however_many_there_are(folder):
    by_default = expand(load_campaign(write_campaign(folder))).specs
    spoken = expand(load_campaign(write_campaign(folder, "repeats: 5\n"))).specs
    assert {run.digest for run in by_default} < {run.digest for run in spoken}
    pairs = {(run.repeat, run.seed) for run in by_default}
    assert len(pairs) == 5


def test_sensors_that_do_not_fit_the_cycles_are_worth_a_warning(folder):
    path = write_campaign(folder, "repeats: 1\n")
    assert not any("cycles of" in d.message for d in examine(path)[1])
    (folder / "nav2.yaml").write_text(BASE + "period: 0.07 s\n")
    found = [d for d in examine(path)[1] if "cycles of 0.07 s" in d.message]
    assert {d.severity for d in found} == {Severity.WARNING}
    assert any("the laser of robot" in d.message for d in found)


@pytest.mark.parametrize(
    ("sut", "expected"),
    [
        ("nav2", "bt.recoveries is unknown of nav2, which does not record it"),
        ("pilot", "warning: bt.recoveries is unknown of pilot: the oracle is inconclusive there"),
    ],
)
def test_an_oracle_about_what_is_not_recorded_is_refused_or_warned_of(folder, sut, expected):
    path = folder / "campaign.yaml"
    (folder / "tree.oracles.yaml").write_text("recoveries: always(bt.recoveries <= 2)\n")
    text = CAMPAIGN.format(repeats="").replace("[pilot, nav2]", f"[{sut}]")
    path.write_text(text.replace("navigation", "tree").replace("[reached]", "[recoveries]"))
    (found,) = [d for d in examine(path)[1] if "bt.recoveries" in d.message]
    assert f"tree.oracles.yaml:1:20: {expected}" in str(found)
    if sut == "nav2":
        assert found.hint == "write record: [behavior tree] in its file"
        (folder / "nav2.yaml").write_text(f"{BASE}record: [behavior tree]\n")
        assert not [d for d in examine(path)[1] if "bt.recoveries" in d.message]


def test_every_key_is_documented_with_its_default():
    text = (Path(__file__).parents[2] / "docs" / "campaigns.md").read_text()
    section = text.partition("## A ROS 2 stack")[2]
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


def test_checking_starts_nothing(folder):
    mark = folder / "started"
    (folder / "nav2.yaml").write_text(f"sut: nav2\nkind: ros2\nlaunch: touch {mark}\n")
    expand(load_campaign(write_campaign(folder)))
    assert not mark.exists()
