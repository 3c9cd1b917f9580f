"""A whole tree of ROS parameters: defaults, what is inherited, who hears, what cannot drive."""

from copy import deepcopy

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.findings import ParameterError
from daemon.stacks.ros1.configuration import RosParameters, read_ros
from daemon.stacks.ros1.costmap import InflationLayer, ObstacleLayer
from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.global_planner import GlobalPlannerParameters
from daemon.stacks.ros1.quirks import FAST, FIXED
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters
from daemon.stacks.ros1.wiring import Wiring
from grammars.text.documents import plain_message

ONE_LASER = ("",)
LASER = {"data_type": "LaserScan", "topic": "scan", "marking": True, "clearing": True}
BOX = [[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]


def costmap(**own):
    return {"observation_sources": "scan", "scan": dict(LASER), "footprint": BOX} | own


def tree(**sections):
    """Return a sound tree; ``DWAPlannerROS=...`` and the like are sections of move_base."""
    move_base = {
        "base_local_planner": "dwa_local_planner/DWAPlannerROS",
        "global_costmap": costmap(global_frame="map", static_map=True),
        "local_costmap": costmap(global_frame="odom", rolling_window=True),
    }
    own = sections.pop("move_base", {})
    nodes = ("amcl", "topics", "dispatcher", "quirks", "amlc", "planner")
    outer = {name: sections.pop(name) for name in nodes if name in sections}
    return outer | {"move_base": move_base | own | sections}


def fatal(given):
    with pytest.raises(ParameterError) as caught:
        read_ros(given)
    return [str(problem) for problem in caught.value.problems]


def problems(read):
    return [str(problem) for problem in read.findings.problems]


def test_names_that_nobody_reads_are_marked_whatever_is_said_of_them():
    given = tree(amlc={"a": 1}, amcl={"odom_alpa1": 0.1}, move_base={"TebLocalPlannerROS": {}})
    found = read_ros(given).findings.problems
    assert {finding.path for finding in found if finding.unread} == {
        ("amlc",),
        ("amcl", "odom_alpa1"),
        ("move_base", "TebLocalPlannerROS"),
    }


def test_a_sound_tree_has_nothing_to_say_about_it():
    read = read_ros(tree())
    assert problems(read) == []
    assert read.findings.without_effect == ()
    assert read.topics.heard(ONE_LASER) == Wiring(ONE_LASER, ONE_LASER, ONE_LASER)
    assert read.quirks == FAST


def test_what_is_not_given_has_the_defaults_of_ros():
    read = read_ros(tree(amcl={"odom_alpha1": 0.1}))
    assert (read.amcl.odom_alpha1, read.amcl.odom_alpha2) == (0.1, 0.2)
    assert (read.amcl.min_particles, read.amcl.max_particles) == (100, 5000)
    assert (read.local_planner.max_vel_trans, read.local_planner.sim_time) == (0.55, 1.7)
    obstacles, inflation = read.local_costmap.layers
    assert isinstance(obstacles, ObstacleLayer)
    assert isinstance(inflation, InflationLayer)
    assert (inflation.inflation_radius, obstacles.sources[0].obstacle_range) == (0.55, 2.5)
    assert read.global_planner.default_tolerance == 0.0
    assert read.rotate_recovery.max_vel_theta == 1.0
    assert set(read.resets) == {"conservative_reset", "aggressive_reset"}


@pytest.mark.parametrize(
    ("move_base", "dwa", "frequency"),
    [({}, {}, 20.0), ({"controller_frequency": 10.0}, {}, 10.0),
     ({"controller_frequency": 20.0}, {"controller_frequency": 10.0}, 10.0)],
)  # fmt: skip
def test_dwa_inherits_the_controller_frequency_of_move_base(move_base, dwa, frequency):
    read = read_ros(tree(move_base=move_base, DWAPlannerROS=dwa))
    assert read.local_planner.controller_frequency == frequency


def test_the_six_parameters_that_dwa_renamed_are_named_with_their_new_names():
    # husky_navigation, turtlebot_navigation and mir_navigation write them; Noetic only warns.
    old = {
        "max_trans_vel": "max_vel_trans", "min_trans_vel": "min_vel_trans",
        "max_rot_vel": "max_vel_theta", "min_rot_vel": "min_vel_theta",
        "rot_stopped_vel": "theta_stopped_vel",
    }  # fmt: skip
    read = read_ros(tree(DWAPlannerROS=dict.fromkeys((*old, "acc_limit_trans"), 0.3)))
    said = problems(read)
    for name, new in old.items():
        text = f"{name}: ROS Noetic calls it {new} and ignores {name}: {new} has its default"
        assert any(f"DWAPlannerROS/{text}; write {new}" in problem for problem in said)
    assert len(said) == len(old)
    (idle,) = read.findings.without_effect
    assert "ROS Noetic calls it acc_lim_trans" in idle.message
    assert isinstance(read.local_planner, DwaParameters)
    assert read.local_planner.max_vel_trans == 0.55
    both = read_ros(tree(DWAPlannerROS={"max_rot_vel": 0.3, "max_vel_theta": 1.5}))
    assert problems(both) == []


def test_without_a_name_the_local_planner_is_that_of_ros():
    given = tree(DWAPlannerROS={"max_vel_x": 0.3}, TrajectoryPlannerROS={"max_vel_x": 0.4})
    del given["move_base"]["base_local_planner"]
    read = read_ros(given)
    assert isinstance(read.local_planner, TrajectoryPlannerParameters)
    assert (read.local_planner.max_vel_x, read.local_planner.controller_frequency) == (0.4, 20.0)
    assert any("base_local_planner is not given: ROS takes" in text for text in problems(read))
    (idle,) = read.findings.without_effect
    assert str(idle) == (
        "move_base/DWAPlannerROS/max_vel_x: the planners are navfn/NavfnROS and "
        "base_local_planner/TrajectoryPlannerROS"
    )


def test_only_the_planners_that_are_chosen_are_read_strictly():
    read = read_ros(
        tree(
            move_base={"base_global_planner": "global_planner/GlobalPlanner"},
            GlobalPlanner={"use_dijkstra": True, "neutral_cost": 60},
            NavfnROS={"default_tolerance": "far"},
        )
    )
    assert read.global_planner == GlobalPlannerParameters(neutral_cost=60)
    assert [str(f.path[-1]) for f in read.findings.without_effect] == ["default_tolerance"]
    found = fatal(tree(move_base={"base_global_planner": "global_planner/GlobalPlanner"},
                       GlobalPlanner={"use_dijkstra": False}))  # fmt: skip
    assert found == [
        "move_base/GlobalPlanner/use_dijkstra: A* is not built in: write true (given: False)"
    ]


def test_of_two_names_of_a_limit_the_turn_on_the_spot_takes_the_newer_one():
    # tiago_2dnav writes both; nav_core loadParameterWithDeprecation.
    limits = {"acc_lim_theta": 1.0, "acc_lim_th": 2.0, "max_rotational_vel": 0.5}
    for written in (limits, dict(reversed(limits.items()))):
        turn = read_ros(tree(TrajectoryPlannerROS=written)).rotate_recovery
        assert (turn.acc_lim_theta, turn.max_vel_theta) == (1.0, 0.5)


def test_a_robot_that_can_never_start_is_warned_of():
    slow = {"acc_lim_x": 0.5, "acc_lim_theta": 1.0, "acc_lim_y": 0.0, "min_vel_theta": 0.4}
    read = read_ros(tree(DWAPlannerROS=slow))
    (said,) = problems(read)
    assert (
        "a standing robot never starts: within 0.05 s it reaches 0.025 m/s and 0.05 rad/s" in said
    )
    assert said.startswith("move_base/DWAPlannerROS/acc_lim_x")
    for enough in ({"min_vel_trans": 0.02}, {"min_vel_theta": 0.05}, {"controller_frequency": 5.0}):
        assert problems(read_ros(tree(DWAPlannerROS=slow | enough))) == []


def test_one_error_does_not_blame_the_defaults_in_its_place():
    # 600 is more than the default of max_particles would allow, which nobody asked for.
    found = fatal(tree(amcl={"max_particles": "many", "min_particles": 6000}))
    assert found == ["amcl/max_particles: must be a whole number (given: 'many')"]
    slow = {"max_vel_trans": "fast", "min_vel_trans": 0.7}
    assert len(fatal(tree(DWAPlannerROS=slow))) == 1


def test_an_error_has_the_words_it_has_for_every_other_system():
    (problem,) = fatal(tree(topics={"remap": 3}))
    assert problem == f"topics/remap: {plain_message({'type': 'dict_type', 'input': 3})} (given: 3)"


def test_names_without_effect_are_listed_with_the_reason():
    read = read_ros(tree(DWAPlannerROS={"stop_time_buffer": 1.0, "holonomic_robot": True}))
    assert problems(read) == []
    found = {str(f.path[-1]): f.message for f in read.findings.without_effect}
    assert set(found) == {"stop_time_buffer", "holonomic_robot"}
    assert "never reads it" in found["stop_time_buffer"]


def test_a_costmap_listens_to_each_of_its_sources():
    two = costmap(global_frame="odom", observation_sources="scan rear", rear=LASER | {"topic": "r"})
    read = read_ros(tree(local_costmap=two))
    (layer, _) = read.local_costmap.layers
    assert isinstance(layer, ObstacleLayer)
    assert [(source.name, source.topic) for source in layer.sources] == [
        ("scan", "/scan"),
        ("rear", "/r"),
    ]
    assert read.topics.local_costmap == ("/scan", "/r")
    deaf = read_ros(tree(topics={"scan": "/front", "amcl": "/front"}))
    assert deaf.topics.heard(ONE_LASER) == Wiring(ONE_LASER, (), ())


def test_the_turn_on_the_spot_reads_the_limits_of_a_planner_that_does_not_run():
    own = {"rotate_recovery": {"frequency": 10.0}, "DWAPlannerROS": {"max_vel_theta": 2.75}}
    other = {"TrajectoryPlannerROS": {"acc_lim_th": 2.0, "sim_time": 1.0}}
    read = read_ros(tree(**own, **other))
    turn = read.rotate_recovery
    assert (turn.frequency, turn.acc_lim_theta, turn.max_vel_theta) == (10.0, 2.0, 1.0)
    assert [f.path[-1] for f in read.findings.without_effect] == ["sim_time"]
    fixed = read_ros(tree(**own, **other, quirks="fixed"))
    assert fixed.quirks == FIXED
    assert fixed.rotate_recovery.max_vel_theta == 2.75


def test_recoveries_have_their_namespaces():
    listed = [
        {"name": "wide", "type": "clear_costmap_recovery/ClearCostmapRecovery"},
        {"name": "spin", "type": "rotate_recovery/RotateRecovery"},
    ]
    own = {
        "recovery_behaviors": listed,
        "wide": {"reset_distance": 7.0},
        "spin": {"frequency": 5.0},
    }
    read = read_ros(tree(move_base=own))
    assert problems(read) == []
    assert read.resets["wide"].reset_distance == 7.0
    assert read.rotate_recovery.frequency == 5.0


_JUNK = st.one_of(
    st.sampled_from(
        [0, -1, 1e9, 0.5, True, "", "x", "[[1, 2]]", [], [1], {}, {"a": 1}, "$(arg x)"]
    ),
    st.floats(),
    st.lists(st.dictionaries(st.sampled_from(["name", "type"]), st.text(max_size=3)), max_size=2),
    st.lists(
        st.fixed_dictionaries(
            {
                "name": st.sampled_from(["a", "scan", "static_map", "footprint"]),
                "type": st.sampled_from(
                    [f"costmap_2d::{kind}Layer" for kind in ("Static", "Obstacle", "Voxel", "X")]
                ),
            }
        ),
        max_size=3,
    ),
    st.sampled_from([{"enabled": False}, {"observation_sources": "a b"}, {"a": {"topic": 3}}]),
)
_PLACES = st.sampled_from(
    [("topics",), ("quirks",), ("dispatcher",), ("topics", "remap"), ("amcl", "kld_err")]
    + [("topics", name) for name in ("scan", "nodes", "maps")]
    + [("amcl", "odom_frame_id"), ("topics", "nodes", "amcl"), ("topics", "scan", "front")]
    + [
        ("move_base", name)
        for name in ("footprint", "robot_radius", "base_local_planner", "base_global_planner")
    ]
    + [
        ("move_base", "local_costmap", "obstacle_layer", name)
        for name in ("enabled", "observation_sources", "scan", "obstacle_range", "z_voxels")
    ]
    + [("move_base", "global_costmap", name) for name in ("static_map", "map_type", "map_topic")]
    + [("move_base", name) for name in ("recovery_behaviors", "conservative_reset", "scan", "x")]
    + [
        ("move_base", costmap, name)
        for costmap in ("global_costmap", "local_costmap")
        for name in (
            "footprint",
            "observation_sources",
            "scan",
            "plugins",
            "obstacle_layer",
            "width",
        )
    ]
    + [("move_base", space) for space in ("DWAPlannerROS", "NavfnROS", "TrajectoryPlannerROS")]
    + [("move_base", "DWAPlannerROS", name) for name in ("sim_time", "max_vel_trans", "vx_samples")]
)


@given(st.lists(st.tuples(_PLACES, _JUNK), min_size=1, max_size=3))
def test_whatever_is_written_is_read_or_refused_in_words(changes):
    given_tree = tree()
    for path, value in changes:
        node = given_tree
        for name in path[:-1]:
            node = node.setdefault(name, {}) if isinstance(node, dict) else {}
        if isinstance(node, dict):
            node[path[-1]] = deepcopy(value)  # a later path may lead into it
    try:
        assert isinstance(read_ros(given_tree), RosParameters)
    except ParameterError as error:
        assert error.problems
