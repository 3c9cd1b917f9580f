"""Systems under test in layers: like another, or of a folder of ROS parameter files."""

import shutil

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.campaign import (
    LayerLibrary,
    LayerReference,
    flatten_parameters,
    merge_parameters,
    parameter_tree,
)
from daemon.stacks.ros1.configuration import read_ros
from daemon.stacks.ros1.costmap import InflationLayer
from daemon.stacks.ros1.wiring import Wiring
from grammars.text import codec
from grammars.text.diagnostics import InputError, Where
from grammars.text.ros_yaml import load_ros_yaml
from tests.campaign.loaded import findings_of, load_sut, write_sut
from tests.parts import ROOT

ONE_LASER = ("",)


@pytest.fixture
def folder(tmp_path):
    """A folder with the parameter files of a robot and the system under test they make."""
    shutil.copytree(ROOT / "tests/languages/errors/ros_robot/robot", tmp_path / "robot")
    write_sut(tmp_path, "robot", "kind: ros\nros: robot\n")
    return tmp_path


def parameters(folder, name):
    return load_sut(folder, name)[0].parameters


def test_a_system_like_another_is_the_same_except_for_its_own_words(tmp_path):
    write_sut(tmp_path, "base", "kind: pilot\nparameters: {max_speed: 0.4, max_turn: 0.8}\n")
    write_sut(tmp_path, "slow", "like: base\nparameters: {max_speed: 0.2}\n")
    write_sut(tmp_path, "free", "like: slow\nparameters: {max_turn: null, patience: 30.0}\n")
    assert parameters(tmp_path, "slow") == {"max_speed": 0.2, "max_turn": 0.8}
    sut, _ = load_sut(tmp_path, "free")
    assert (sut.name, sut.kind) == ("free", "pilot")
    assert sut.parameters == {"max_speed": 0.2, "patience": 30.0}
    # The other one may also lie beside the campaign.
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


def test_a_folder_of_ros_files_is_loaded_as_launch_files_load_it(folder):
    sut, warnings = load_sut(folder, "robot")
    assert warnings == []
    move_base = sut.parameters["move_base"]
    assert sut.parameters["amcl"] == {"odom_alpha1": 0.1}
    assert move_base["controller_frequency"] == 10.0
    assert move_base["DWAPlannerROS"]["max_vel_trans"] == 0.5
    assert move_base["global_costmap"]["inflation_radius"] == 0.5
    assert move_base["local_costmap"]["inflation_radius"] == 0.4
    assert len(move_base["local_costmap"]["footprint"]) == 4
    # Files that are named one by one give the same tree.
    names = ["costmap_global", "costmap_local", "dwa_local_planner", "move_base"]
    files = ", ".join(f"robot/{name}_params.yaml" for name in names)
    common = "amcl: robot/amcl.yaml, costmap_common: robot/costmap_common_params.yaml"
    write_sut(folder, "listed", f"kind: ros\nfiles: {{{common}, move_base: [{files}]}}\n")
    listed = parameters(folder, "listed")
    assert codec.digest(listed) == codec.digest(sut.parameters)
    assert listed == sut.parameters


def test_a_file_about_one_section_may_leave_its_name_out(folder):
    expected = parameters(folder, "robot")
    file = folder / "robot" / "costmap_local_params.yaml"
    lines = file.read_text().replace("  ", "").splitlines()[1:]
    file.rename(file.with_name("local_costmap_params.yaml")).write_text("\n".join(lines))
    assert parameters(folder, "robot") == expected


def test_a_name_with_slashes_means_levels_and_a_leading_one_leaves_the_namespace(folder):
    text = "DWAPlannerROS/sim_time: 1.5\n/amcl/odom_alpha2: 0.3\n"
    (folder / "robot" / "move_base_params.yaml").write_text(text)
    found = parameters(folder, "robot")
    assert found["move_base"]["DWAPlannerROS"]["sim_time"] == 1.5
    assert found["amcl"]["odom_alpha2"] == 0.3


def test_what_both_costmaps_share_is_overridden_in_one_line(folder):
    shared = "{costmap_common: {inflation_radius: 0.9, scan: {topic: s}}}"
    write_sut(folder, "mine", f"like: robot\nparameters: {shared}\n")
    found = parameters(folder, "mine")
    costmaps = [found["move_base"][f"{name}_costmap"] for name in ("global", "local")]
    assert [costmap["inflation_radius"] for costmap in costmaps] == [0.9, 0.4]
    assert costmaps[1]["scan"]["data_type"] == "LaserScan"
    assert read_ros(found).topics.local_costmap == ("/s",)


def test_a_missing_file_is_warned_of_once_however_many_systems_are_like_it(folder):
    (folder / "robot" / "amcl.yaml").unlink()
    write_sut(folder, "mine", "like: robot\nros: robot\n")
    assert sum("ROS defaults apply" in w for w in load_sut(folder, "mine")[1]) == 1


def test_of_two_names_for_a_file_the_usual_one_is_read(folder):
    (folder / "robot" / "amcl_params.yaml").write_text("odom_alpha1: 0.7\n")
    sut, warnings = load_sut(folder, "robot")
    assert sut.parameters["amcl"] == {"odom_alpha1": 0.1}
    assert any("not read in robot: amcl_params.yaml" in w for w in warnings)
    (folder / "robot" / "amcl.yaml").unlink()
    sut, warnings = load_sut(folder, "robot")
    assert sut.parameters["amcl"] == {"odom_alpha1": 0.7}
    assert not any("not read" in w for w in warnings)


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


LAYERED = {
    "costmap_common_params.yaml": """\
footprint: [[0.2, 0.2], [0.2, -0.2], [-0.2, -0.2], [-0.2, 0.2]]
static: {enabled: true}
laser_layer:
  observation_sources: laser
  laser: {data_type: LaserScan, topic: scan, marking: true, clearing: true}
inflation: {inflation_radius: 1.0}
""",
    "costmap_global_params.yaml": """\
global_frame: map
plugins:
- {name: static, type: 'costmap_2d::StaticLayer'}
- {name: laser_layer, type: 'costmap_2d::ObstacleLayer'}
- {name: inflation, type: 'costmap_2d::InflationLayer'}
""",
    "costmap_local_params.yaml": """\
global_frame: odom
rolling_window: true
plugins:
- {name: laser_layer, type: 'costmap_2d::ObstacleLayer'}
- {name: inflation, type: 'costmap_2d::InflationLayer'}
""",
}


def test_files_with_plugins_one_section_each_and_no_section_names_are_understood(folder):
    for name, text in LAYERED.items():
        (folder / "robot" / name).write_text(text)
    sut, warnings = load_sut(folder, "robot")
    assert [w for w in warnings if "without effect here: local_costmap/static" not in w] == []
    read = read_ros(sut.parameters)
    assert read.topics.heard(ONE_LASER) == Wiring(ONE_LASER, ONE_LASER, ONE_LASER)
    names = [layer.name for layer in read.global_costmap.layers]
    assert names == ["static", "laser_layer", "inflation"]
    assert [layer.name for layer in read.local_costmap.layers] == ["laser_layer", "inflation"]
    assert read.local_costmap.layers[1] == InflationLayer("inflation", inflation_radius=1.0)


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


@pytest.mark.parametrize(
    ("name", "hears"), [("a2s", True), ("fro-diff", True), ("fro-omni", True), ("a2s-blind", False)]
)
def test_only_the_blind_costmaps_do_not_hear_the_scan(campaigns, name, hears):
    read = read_ros(parameters(campaigns, name))
    heard = ONE_LASER if hears else ()
    assert read.topics.heard(ONE_LASER) == Wiring(ONE_LASER, heard, heard)
    assert read.findings.problems == ()


@pytest.mark.parametrize("name", ["a2s", "fro-diff", "fro-omni"])
def test_our_configurations_have_the_published_figures(campaigns, reference_data, name):
    def published(file):
        return load_ros_yaml(reference_data / "suts" / name / f"{file}.yaml")[0].data

    common, local, global_ = (
        published(f"costmap_{n}_params") for n in ("common", "local", "global")
    )
    costmaps = {
        "local_costmap": common | local["local_costmap"],
        "global_costmap": common | global_["global_costmap"],
    }
    ours = parameters(campaigns, name)
    assert ours["amcl"] == published("amcl")
    assert ours["move_base"] == (
        published("move_base_params") | published("dwa_local_planner_params") | costmaps
    )


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
