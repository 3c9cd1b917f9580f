"""Systems under test in layers: like another, on ROS files, every complaint where it belongs."""

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
from grammars.text.diagnostics import InputError, Severity, Where
from grammars.text.ros_yaml import load_ros_yaml
from tests.campaign.findings import findings_of

ONE_LASER = ("",)
COMMON = """\
# a robot's body and laser
footprint: [[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]
observation_sources: scan
scan: {data_type: LaserScan, topic: scan, marking: true, clearing: true}
inflation_radius: 0.5
"""
FILES = {
    "amcl.yaml": "odom_alpha1: 0.1\n",
    "costmap_common_params.yaml": COMMON,
    "costmap_global_params.yaml": "global_costmap:\n  global_frame: map\n  static_map: true\n",
    "costmap_local_params.yaml": (
        "local_costmap:\n  global_frame: odom\n  rolling_window: true\n  inflation_radius: 0.4\n"
    ),
    "dwa_local_planner_params.yaml": (
        "base_local_planner: dwa_local_planner/DWAPlannerROS\n"
        "DWAPlannerROS:\n  max_vel_trans: 0.5\n  min_vel_trans: 0.1\n"
    ),
    "move_base_params.yaml": "controller_frequency: 10.0\n",
}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "robot").mkdir()
    for name, text in FILES.items():
        (tmp_path / "robot" / name).write_text(text)
    write(tmp_path, "robot", "kind: ros\nros: robot\n")
    return tmp_path


def write(folder, name, text):
    (folder / f"{name}.yaml").write_text(f"sut: {name}\n{text}")


def load(folder, name):
    library = LayerLibrary(folder)
    sut = library.sut(LayerReference(name, {}, Where("campaign.yaml", 1, 1)))
    assert all(w.severity is Severity.WARNING for w in library.warnings)
    return sut, [str(w).replace(f"{folder}/", "") for w in library.warnings]


def pilot(folder, name):
    return load(folder, name)[0].parameters


def test_a_system_like_another_is_the_same_except_for_what_it_says(tmp_path):
    write(tmp_path, "base", "kind: pilot\nparameters: {max_speed: 0.4, max_turn: 0.8}\n")
    write(tmp_path, "slow", "like: base\nparameters: {max_speed: 0.2}\n")
    write(tmp_path, "free", "like: slow\nparameters: {max_turn: null, patience: 30.0}\n")
    assert pilot(tmp_path, "slow") == {"max_speed": 0.2, "max_turn": 0.8}
    assert pilot(tmp_path, "free") == {"max_speed": 0.2, "patience": 30.0}
    sut, _ = load(tmp_path, "free")
    assert (sut.name, sut.kind) == ("free", "pilot")


def test_what_a_system_is_like_is_also_found_beside_the_campaign(tmp_path):
    (tmp_path / "suts").mkdir()
    (tmp_path / "mine" / "suts").mkdir(parents=True)
    write(tmp_path / "suts", "base", "kind: pilot\nparameters: {max_speed: 0.4}\n")
    write(tmp_path / "mine" / "suts", "slow", "like: base\n")
    assert pilot(tmp_path / "mine", "slow") == {"max_speed": 0.4}


def test_a_long_chain_of_files_is_refused_at_its_line(tmp_path):
    write(tmp_path, "s0", "kind: pilot\n")
    for number in range(1, 60):
        write(tmp_path, f"s{number}", f"like: s{number - 1}\n")
    assert pilot(tmp_path, "s50") == {}
    with pytest.raises(InputError, match="s9.yaml:2:1: like: more than 50 files"):
        load(tmp_path, "s59")


def test_a_folder_of_ros_files_is_loaded_as_launch_files_load_it(folder):
    sut, warnings = load(folder, "robot")
    assert warnings == []
    move_base = sut.parameters["move_base"]
    assert sut.parameters["amcl"] == {"odom_alpha1": 0.1}
    assert move_base["controller_frequency"] == 10.0
    assert move_base["DWAPlannerROS"]["max_vel_trans"] == 0.5
    assert move_base["global_costmap"]["inflation_radius"] == 0.5
    assert move_base["local_costmap"]["inflation_radius"] == 0.4
    assert len(move_base["local_costmap"]["footprint"]) == 4


def test_files_named_one_by_one_and_overrides_give_the_same_tree(folder):
    listed = {
        "amcl": "robot/amcl.yaml",
        "costmap_common": "robot/costmap_common_params.yaml",
        "move_base": "[robot/costmap_global_params.yaml, robot/costmap_local_params.yaml,\n"
        "    robot/dwa_local_planner_params.yaml, robot/move_base_params.yaml]",
    }
    files = "".join(f"  {namespace}: {names}\n" for namespace, names in listed.items())
    write(folder, "listed", f"kind: ros\nfiles:\n{files}")
    listed_one, whole = (load(folder, name)[0].parameters for name in ("listed", "robot"))
    assert codec.digest(listed_one) == codec.digest(whole)
    assert listed_one == whole


def test_a_file_about_one_section_may_leave_its_name_out(folder):
    before = load(folder, "robot")[0].parameters
    lines = FILES["costmap_local_params.yaml"].splitlines()[1:]
    (folder / "robot" / "costmap_local_params.yaml").unlink()
    (folder / "robot" / "local_costmap_params.yaml").write_text("\n".join(lines).replace("  ", ""))
    assert load(folder, "robot")[0].parameters == before


def test_a_name_with_slashes_means_levels_and_a_leading_one_leaves_the_namespace(folder):
    text = "DWAPlannerROS/sim_time: 1.5\n/amcl/odom_alpha2: 0.3\n"
    (folder / "robot" / "move_base_params.yaml").write_text(text)
    parameters = load(folder, "robot")[0].parameters
    assert parameters["move_base"]["DWAPlannerROS"]["sim_time"] == 1.5
    assert parameters["amcl"]["odom_alpha2"] == 0.3


def test_what_both_costmaps_share_is_overridden_in_one_line(folder):
    text = "like: robot\nparameters: {costmap_common: {inflation_radius: 0.9, scan: {topic: s}}}\n"
    write(folder, "mine", text)
    sut, _ = load(folder, "mine")
    move_base = sut.parameters["move_base"]
    assert move_base["global_costmap"]["inflation_radius"] == 0.9
    assert move_base["local_costmap"]["inflation_radius"] == 0.4
    assert move_base["local_costmap"]["scan"]["data_type"] == "LaserScan"
    assert read_ros(sut.parameters).topics.local_costmap == ("/s",)


def test_a_usual_file_that_is_missing_is_worth_a_warning(folder):
    (folder / "robot" / "amcl.yaml").unlink()
    _, warnings = load(folder, "robot")
    (warning,) = (w for w in warnings if "ROS defaults apply" in w)
    assert warning.startswith("robot.yaml:3:1: warning: no amcl.yaml or amcl_params.yaml in robot")
    write(folder, "mine", "like: robot\nros: robot\n")
    assert sum("ROS defaults apply" in w for w in load(folder, "mine")[1]) == 1


def test_of_two_names_for_a_file_the_usual_one_is_read(folder):
    (folder / "robot" / "amcl_params.yaml").write_text("odom_alpha1: 0.7\n")
    sut, warnings = load(folder, "robot")
    assert sut.parameters["amcl"] == {"odom_alpha1": 0.1}
    assert any("not read in robot: amcl_params.yaml" in w for w in warnings)
    (folder / "robot" / "amcl.yaml").unlink()
    sut, warnings = load(folder, "robot")
    assert sut.parameters["amcl"] == {"odom_alpha1": 0.7}
    assert not any("not read" in w for w in warnings)


def test_a_kind_named_without_a_file_tells_what_its_defaults_lack(tmp_path):
    sut, warnings = load(tmp_path, "ros")
    assert (sut.kind, sut.parameters) == ("ros", {})
    assert any("the local costmap has no source" in w for w in warnings)


def test_a_kind_named_without_a_file_says_which_of_its_values_change_nothing(tmp_path):
    library = LayerLibrary(tmp_path)
    where = Where("campaign.yaml", 3, 1)
    values = {"amcl.gui_publish_rate": 2.0, "amcl.laser_max_beams": 60}
    sut = library.loaded_sut(LayerReference("ros", values, where))
    assert sut.reference.parameters == {"amcl": {"gui_publish_rate": 2.0, "laser_max_beams": 60}}
    (idle,) = sut.idle
    assert (idle.message, idle.hint) == ("without effect here: amcl/gui_publish_rate", "")


_trees = st.recursive(
    st.integers() | st.booleans() | st.lists(st.integers(), max_size=2),
    lambda inner: st.dictionaries(st.sampled_from("abc"), inner, min_size=1, max_size=3),
    max_leaves=8,
)


@given(
    st.dictionaries(st.sampled_from("abc"), _trees), st.dictionaries(st.sampled_from("abc"), _trees)
)
def test_a_later_layer_changes_what_it_names_and_leaves_the_rest(base, over):
    here = Where("f")
    one, other = (flatten_parameters(tree, lambda _: here) for tree in (base, over))
    assert parameter_tree(one) == base
    assert parameter_tree(merge_parameters(one, other)) == plainly_merged(base, over)


def plainly_merged(base, over):
    if not isinstance(base, dict) or not isinstance(over, dict):
        return over
    return base | {name: plainly_merged(base.get(name), value) for name, value in over.items()}


LAYERED = {
    "costmap_common_params.yaml": (
        "footprint: [[0.2, 0.2], [0.2, -0.2], [-0.2, -0.2], [-0.2, 0.2]]\n"
        "static: {enabled: true}\n"
        "laser_layer:\n"
        "  observation_sources: laser\n"
        "  laser: {data_type: LaserScan, topic: scan, marking: true, clearing: true}\n"
        "inflation: {inflation_radius: 1.0}\n"
    ),
    "costmap_global_params.yaml": (
        "global_frame: map\n"
        "plugins:\n"
        "- {name: static, type: 'costmap_2d::StaticLayer'}\n"
        "- {name: laser_layer, type: 'costmap_2d::ObstacleLayer'}\n"
        "- {name: inflation, type: 'costmap_2d::InflationLayer'}\n"
    ),
    "costmap_local_params.yaml": (
        "global_frame: odom\n"
        "rolling_window: true\n"
        "plugins:\n"
        "- {name: laser_layer, type: 'costmap_2d::ObstacleLayer'}\n"
        "- {name: inflation, type: 'costmap_2d::InflationLayer'}\n"
    ),
}


def test_files_with_plugins_one_section_each_and_no_section_names_are_understood(folder):
    for name, text in LAYERED.items():
        (folder / "robot" / name).write_text(text)
    sut, warnings = load(folder, "robot")
    assert [w for w in warnings if "without effect here: local_costmap/static" not in w] == []
    read = read_ros(sut.parameters)
    assert read.topics.heard(ONE_LASER) == Wiring(ONE_LASER, ONE_LASER, ONE_LASER)
    names = [layer.name for layer in read.global_costmap.layers]
    assert names == ["static", "laser_layer", "inflation"]
    assert [layer.name for layer in read.local_costmap.layers] == ["laser_layer", "inflation"]
    assert read.local_costmap.layers[1] == InflationLayer("inflation", inflation_radius=1.0)


def test_the_three_mistakes_of_the_paper_are_three_lines(campaigns):
    wrong, right = (load(campaigns, name)[0].parameters for name in ("a2s", "fro-diff"))
    assert differences(wrong, right) == {
        "amcl/odom_model_type",
        "move_base/global_costmap/footprint",
        "move_base/global_costmap/scan/topic",
        "move_base/local_costmap/footprint",
        "move_base/local_costmap/scan/topic",
    }
    text = (campaigns / "suts" / "a2s.yaml").read_text()
    lines = text.partition("parameters:\n")[2].splitlines()
    assert len([line for line in lines if line.strip() != "costmap_common:"]) == 3


def differences(one, other, path=""):
    if not isinstance(one, dict) or not isinstance(other, dict):
        return set() if one == other else {path}
    return {
        found
        for name in one.keys() | other.keys()
        for found in differences(one.get(name), other.get(name), f"{path}/{name}".lstrip("/"))
    }


@pytest.mark.parametrize(
    ("name", "hears"), [("a2s", True), ("fro-diff", True), ("fro-omni", True), ("a2s-blind", False)]
)
def test_only_the_blind_costmaps_do_not_hear_the_scan(campaigns, name, hears):
    read = read_ros(load(campaigns, name)[0].parameters)
    heard = ONE_LASER if hears else ()
    assert read.topics.heard(ONE_LASER) == Wiring(ONE_LASER, heard, heard)
    assert read.findings.problems == ()


@pytest.mark.parametrize("name", ["a2s", "fro-diff", "fro-omni"])
def test_our_configurations_have_the_published_figures(campaigns, reference_data, name):
    published = reference_data / "suts" / name
    common, local, global_, dwa, base, amcl = (
        load_ros_yaml(published / f"{file}.yaml")[0].data
        for file in (
            "costmap_common_params", "costmap_local_params", "costmap_global_params",
            "dwa_local_planner_params", "move_base_params", "amcl",
        )
    )  # fmt: skip
    costmaps = {
        "local_costmap": common | local["local_costmap"],
        "global_costmap": common | global_["global_costmap"],
    }
    ours = load(campaigns, name)[0].parameters
    assert ours["amcl"] == amcl
    assert ours["move_base"] == base | dwa | costmaps


def test_a_campaign_reports_every_bad_ros_file_at_once(tmp_path, campaigns):
    shutil.copytree(campaigns / "suts", tmp_path / "suts")
    shutil.copytree(campaigns / "robots", tmp_path / "robots")
    shutil.copytree(campaigns / "demo", tmp_path / "demo")
    files = tmp_path / "suts" / "fro-diff"
    for name, old, new in (
        ("costmap_common_params.yaml", "inflation_radius: 0.5", "inflation_radius: -0.5"),
        ("dwa_local_planner_params.yaml", "min_vel_trans: 0.11", "min_vel_trans: 0.3"),
    ):
        path = files / name
        path.write_text(path.read_text().replace(old, new))
    path = tmp_path / "demo" / "campaign.yaml"
    path.write_text(path.read_text().replace("sut: [pilot]", "sut: [a2s, fro-omni, pilot]"))
    bad = {str(d).replace(f"{tmp_path}/", "") for d in findings_of(path)}
    assert {message.partition(": ")[0] for message in bad} == {
        "demo/../suts/fro-diff/costmap_common_params.yaml:10:19",
        "demo/../suts/fro-diff/dwa_local_planner_params.yaml:9:18",
    }
