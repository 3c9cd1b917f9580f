"""Systems under test: layers, configurations that ship; test_settings.py has their files."""

import shutil

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.campaign import (
    LayerLibrary,
    LayerReference,
    RefusedSutError,
    flatten_parameters,
    merge_parameters,
    parameter_tree,
)
from daemon.stacks.ros1.configuration import read_ros
from daemon.stacks.ros1.wiring import Wiring
from grammars.text import codec
from grammars.text.diagnostics import InputError, Where
from tests.campaign.loaded import findings_of, load_sut, write_sut

ONE_LASER = ("",)


def parameters(folder, name):
    return load_sut(folder, name)[0].parameters


def test_a_system_may_be_like_one_beside_the_campaign(tmp_path):
    (tmp_path / "suts").mkdir()
    (tmp_path / "mine" / "suts").mkdir(parents=True)
    write_sut(tmp_path / "suts", "shared", "kind: pilot\nparameters: {max_speed: 0.4}\n")
    write_sut(tmp_path / "mine" / "suts", "own", "like: shared\n")
    assert parameters(tmp_path / "mine", "own") == {"max_speed": 0.4}


def test_a_long_chain_of_files_is_refused_at_its_line(tmp_path):
    write_sut(tmp_path, "s0", "kind: pilot\n")
    for number in range(1, 60):
        write_sut(tmp_path, f"s{number}", f"like: s{number - 1}\n")
    assert parameters(tmp_path, "s50") == {}
    with pytest.raises(InputError, match="s9.yaml:2:1: like: more than 50 files"):
        load_sut(tmp_path, "s59")


def test_a_kind_named_without_a_file_is_warned_of_as_files_are(tmp_path):
    sut, warnings = load_sut(tmp_path, "ros")
    assert (sut.kind, sut.parameters) == ("ros", {})
    assert any("the local costmap has no source" in w for w in warnings)
    values = {"amcl.gui_publish_rate": 2.0, "amcl.laser_max_beams": 60}
    reference = LayerReference("ros", values, Where("campaign.yaml", 3, 1))
    sut = LayerLibrary(tmp_path).loaded_sut(reference)
    assert sut.reference.parameters == {"amcl": {"gui_publish_rate": 2.0, "laser_max_beams": 60}}
    (idle,) = sut.idle
    assert (idle.message, idle.hint) == ("without effect here: amcl/gui_publish_rate", "")


_trees = st.recursive(
    st.integers() | st.booleans() | st.lists(st.integers(), max_size=2),
    lambda inner: st.dictionaries(st.sampled_from("abc"), inner, min_size=1, max_size=3),
    max_leaves=8,
)
_roots = st.dictionaries(st.sampled_from("abc"), _trees)


@given(_roots, _roots)
def test_a_later_layer_changes_what_it_names_and_leaves_the_rest(base, over):
    one, other = (flatten_parameters(tree, lambda _: Where("f")) for tree in (base, over))
    assert parameter_tree(one) == base
    assert parameter_tree(merge_parameters(one, other)) == plainly_merged(base, over)


def plainly_merged(base, over):
    if not isinstance(base, dict) or not isinstance(over, dict):
        return over
    return base | {name: plainly_merged(base.get(name), value) for name, value in over.items()}


def test_the_three_mistakes_of_the_paper_are_three_lines(campaigns):
    wrong, right = (
        {"/".join(path): value.value for path, value in flatten_parameters(
            parameters(campaigns, name), lambda _: Where("f")).items()}
        for name in ("a2s", "fro-diff")
    )  # fmt: skip
    assert {name for name in wrong | right if wrong.get(name) != right.get(name)} == {
        "amcl/odom_model_type",
        "move_base/global_costmap/footprint",
        "move_base/global_costmap/scan/topic",
        "move_base/local_costmap/footprint",
        "move_base/local_costmap/scan/topic",
    }
    text = (campaigns / "suts" / "a2s.yaml").read_text()
    lines = text.partition("parameters:\n")[2].splitlines()
    assert len([line for line in lines if line.strip() != "costmap_common:"]) == 3


def test_only_the_blind_costmaps_do_not_hear_the_scan(campaigns):
    for name in ("a2s", "fro-diff", "fro-omni", "a2s-blind"):
        read = read_ros(parameters(campaigns, name))
        heard = () if name == "a2s-blind" else ONE_LASER
        assert read.topics.wire(ONE_LASER) == Wiring(ONE_LASER, heard, heard)
        assert read.findings.problems == ()


def test_a_campaign_reports_every_bad_ros_file_at_once(campaign, campaigns):
    path = campaign(matrix={"sut": ["a2s", "fro-omni", "pilot"]})
    suts = shutil.copytree(campaigns / "suts", path.parent.parent / "suts")
    for name, old, new in (
        ("costmap_common_params.yaml", "inflation_radius: 0.5", "inflation_radius: -0.5"),
        ("dwa_local_planner_params.yaml", "min_vel_trans: 0.11", "min_vel_trans: 0.3"),
    ):
        file = suts / "fro-diff" / name
        file.write_text(file.read_text().replace(old, new))
    assert {str(d).partition("/suts/")[2].partition(": ")[0] for d in findings_of(path)} == {
        "fro-diff/costmap_common_params.yaml:10:19",
        "fro-diff/dwa_local_planner_params.yaml:9:18",
    }


LAUNCH = """\
<launch>
  <arg name="speed" default="0.5"/>
  <node pkg="move_base" type="move_base" name="move_base">
    <param name="base_local_planner" value="dwa_local_planner/DWAPlannerROS"/>
    <param name="DWAPlannerROS/max_vel_trans" value="$(arg speed)"/>
    <param name="DWAPlannerROS/min_vel_trans" value="0.1"/>
    <param name="map" value="$(dirname)/a.yaml"/>
    <param name="config" value="$(find nav)/b"/>
  </node>
</launch>
"""


@pytest.fixture
def launched(tmp_path):
    """A folder with a package of ROS and a system under test of its launch file."""
    (tmp_path / "nav").mkdir()
    (tmp_path / "nav" / "package.xml").write_text("<package><name>nav</name></package>")
    (tmp_path / "nav" / "all.launch").write_text(LAUNCH)
    write_sut(tmp_path, "robot", "kind: ros\nros: {launch: nav/all.launch}\n")
    return tmp_path


def test_the_same_launch_files_elsewhere_are_the_same_system(launched):
    before = LayerLibrary(launched).sut_file(launched / "robot.yaml").reference
    moved = launched / "somewhere" / "else"
    moved.mkdir(parents=True)
    for name in ("nav", "robot.yaml"):
        (launched / name).rename(moved / name)
    after = LayerLibrary(moved).sut_file(moved / "robot.yaml").reference
    assert codec.digest(after) == codec.digest(before)
    assert after.parameters["move_base"]["map"] == "$(find nav)/a.yaml"


def test_what_a_refused_configuration_would_be_is_known(launched):
    write_sut(launched, "robot", "kind: ros\nros: {launch: nav/all.launch, args: {speed: 0.05}}\n")
    with pytest.raises(RefusedSutError) as refusal:
        load_sut(launched, "robot")
    setting = refusal.value.settings["move_base", "DWAPlannerROS", "max_vel_trans"]
    assert setting.value == 0.05
