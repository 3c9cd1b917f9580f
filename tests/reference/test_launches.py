"""Launch files of published robots come to the parameters that their packages hold."""

import pytest

from grammars.text.ros_yaml import load_ros_yaml
from tests.languages.launched import launch, node, parameters, remaps

TIAGO = tuple(f"tiago/tiago_2dnav/launch/{n}.launch" for n in ("move_base", "localization_amcl"))
MIR = tuple(f"mir/mir_navigation/launch/{n}.launch" for n in ("start_planner", "amcl"))
TURTLEBOT3 = "turtlebot3/turtlebot3_navigation/launch/turtlebot3_navigation.launch"
ROBOTS = {
    "turtlebot3": ((TURTLEBOT3,), {"env": {"TURTLEBOT3_MODEL": "waffle"}}),
    "husky": (("husky/husky_navigation/launch/amcl_demo.launch",), {}),
    "jackal": (("jackal/jackal_navigation/launch/amcl_demo.launch",), {}),
    "fetch": (("fetch/fetch_navigation/launch/fetch_nav.launch",), {}),
    "freight": (("fetch/fetch_navigation/launch/freight_nav.launch",), {}),
    "mir": (MIR, {"args": {"local_planner": "dwa"}}),
    "mir2": (MIR, {"args": {"local_planner": "dwa", "prefix": "m2/", "namespace": "m2"}}),
    "tiago": (TIAGO, {"args": {"local_planner": "dwa"}, "skip": (".pal/pose.yaml",)}),
    "turtlebot2": (
        ("turtlebot2/turtlebot_navigation/launch/amcl_demo.launch",),
        {"env": {"TURTLEBOT_3D_SENSOR": "kinect"}},
    ),
    "robile": (("robile_amr/launch/navigation.launch",), {}),
}
"""Launch files of each robot, and the settings they need."""


def load(reference_data, name):
    files, settings = ROBOTS[name]
    return launch(*(reference_data / "robots" / file for file in files), **settings)


def yaml(reference_data, file):
    return load_ros_yaml(reference_data / "robots" / file)[0].data


def flat(tree, above=""):
    actual = {}
    for name, value in tree.items():
        actual |= (
            flat(value, f"{above}{name}/") if isinstance(value, dict) else {above + name: value}
        )
    return actual


@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_starts_one_move_base_and_one_amcl_that_lack_nothing(reference_data, name):
    loaded = load(reference_data, name)
    kinds = [one.package for one in loaded.nodes]
    assert (kinds.count("move_base"), kinds.count("amcl")) == (1, 1)
    lacking = [p.missing for one in loaded.nodes for p in one.parameters.values() if p.missing]
    assert lacking == []
    here = str(reference_data / "robots")
    assert all(str(p.where).startswith(here) for one in loaded.nodes for p in
               one.parameters.values())  # fmt: skip


@pytest.mark.parametrize("model", ["burger", "waffle", "waffle_pi"])
def test_turtlebot3_has_the_files_of_its_model(reference_data, model):
    loaded = launch(reference_data / "robots" / TURTLEBOT3, args={"model": model})
    param = "turtlebot3/turtlebot3_navigation/param"
    common = yaml(reference_data, f"{param}/costmap_common_params_{model}.yaml")
    expected = {"base_local_planner": "dwa_local_planner/DWAPlannerROS"}
    for costmap in ("global_costmap", "local_costmap"):
        expected |= flat({costmap: common})
    for part in ("local_costmap_params", "global_costmap_params", "move_base_params",
                 f"dwa_local_planner_params_{model}"):  # fmt: skip
        expected |= flat(yaml(reference_data, f"{param}/{part}.yaml"))
    assert parameters(loaded, "/move_base") == expected
    amcl = parameters(loaded, "/amcl")
    assert len(amcl) == 30
    assert amcl["update_min_d"] == 0.2
    assert amcl["initial_pose_x"] == 0.0
    assert amcl["laser_model_type"] == "likelihood_field"


def test_husky_sets_the_size_of_its_local_costmap_in_the_launch_file(reference_data):
    loaded = load(reference_data, "husky")
    actual = parameters(loaded, "/move_base")
    assert (actual["local_costmap/width"], actual["local_costmap/height"]) == (10.0, 10.0)
    assert actual["base_global_planner"] == "navfn/NavfnROS"
    assert actual["base_local_planner"] == "dwa_local_planner/DWAPlannerROS"
    assert remaps(loaded, "/amcl") == {"/scan": "/front/scan"}
    assert parameters(loaded, "/amcl")["use_map_topic"] is True
    place = node(loaded, "/move_base").parameters["base_local_planner",].where
    assert place.file.endswith("husky_navigation/launch/move_base.launch")
    assert place.line == 37


def test_mir_fills_in_its_files_and_calls_its_node_otherwise(reference_data):
    loaded = load(reference_data, "mir")
    actual = parameters(loaded, "/move_base_node")
    assert actual["local_costmap/global_frame"] == "odom_comb"
    assert remaps(loaded, "/move_base_node")["/odom"] == "/odom_comb"
    assert actual["SBPLLatticePlanner/primitive_filename"] == (
        "$(find mir_navigation)/mprim/unicycle_highcost_5cm.mprim"
    )
    second = load(reference_data, "mir2")
    assert parameters(second, "/m2/move_base_node")["local_costmap/global_frame"] == (
        "m2/odom_comb"
    )
    assert remaps(second, "/m2/move_base_node")["/m2/map"] == "/map"
    servers = [one for one in loaded.nodes if one.package == "map_server"]
    assert len({one.arguments for one in servers}) == 1


def test_turtlebot2_goes_through_links_that_became_text(reference_data):
    loaded = load(reference_data, "turtlebot2")
    links = [str(one) for one in loaded.warnings if "symbolic link" in one.message]
    assert len(links) == 2
    actual = parameters(loaded, "/move_base")
    # What the launch file says last holds, not what the files before it say.
    assert actual["local_costmap/global_frame"] == "odom"
    assert actual["global_costmap/robot_base_frame"] == "base_footprint"
    assert parameters(loaded, "/amcl")["laser_max_beams"] == 60
    assert loaded.left_out == ("$(find turtlebot_bringup)/launch/3dsensor.launch",)


def test_robile_has_a_package_name_other_than_its_folder(reference_data):
    loaded = load(reference_data, "robile")
    assert parameters(loaded, "/amcl") == {
        "use_map_topic": True, "initial_pose_x": 0.0, "initial_pose_y": 0.0,
    }  # fmt: skip
    assert remaps(loaded, "/amcl") == {"/scan": "/scan_front"}
    actual = parameters(loaded, "/move_base")
    assert actual["base_local_planner"] == "base_local_planner/TrajectoryPlannerROS"
    assert actual["controller_frequency"] == 5.0
