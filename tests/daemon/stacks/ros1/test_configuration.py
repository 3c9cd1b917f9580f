"""A whole tree of ROS parameters: defaults, what is inherited, who hears, what cannot drive."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daemon.stacks.findings import ParameterError
from daemon.stacks.ros1.configuration import RosParameters, read_ros
from daemon.stacks.ros1.quirks import FIXED, ORIGINAL
from daemon.stacks.ros1.topics import ONE_LASER, Wiring

LASER = {"data_type": "LaserScan", "topic": "scan", "marking": True, "clearing": True}
BOX = [[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]


def costmap(**own: Any) -> dict[str, Any]:
    return {"observation_sources": "scan", "scan": dict(LASER), "footprint": BOX} | own


def tree(**sections: dict[str, Any]) -> dict[str, Any]:
    """Return a sound tree; ``DWAPlannerROS=...`` and the like are sections of move_base."""
    move_base = {
        "base_local_planner": "dwa_local_planner/DWAPlannerROS",
        "global_costmap": costmap(global_frame="map", static_map=True),
        "local_costmap": costmap(global_frame="odom", rolling_window=True),
    }
    own = sections.pop("move_base", {})
    nodes = ("amcl", "topics", "dispatcher", "quirks", "amlc")
    outer = {name: sections.pop(name) for name in nodes if name in sections}
    return outer | {"move_base": move_base | own | sections}


def fatal(given: dict[str, Any]) -> list[str]:
    with pytest.raises(ParameterError) as caught:
        read_ros(given)
    return [str(problem) for problem in caught.value.problems]


def problems(read: RosParameters) -> list[str]:
    return [str(problem) for problem in read.findings.problems]


def test_a_sound_tree_has_nothing_to_say_about_it() -> None:
    read = read_ros(tree())
    assert problems(read) == []
    assert read.findings.without_effect == ()
    assert read.wiring == Wiring(amcl=ONE_LASER, global_costmap=ONE_LASER, local_costmap=ONE_LASER)
    assert read.quirks == ORIGINAL


def test_what_is_not_given_has_the_defaults_of_ros() -> None:
    read = read_ros(tree(amcl={"odom_alpha1": 0.1}))
    assert (read.amcl.odom_alpha1, read.amcl.odom_alpha2) == (0.1, 0.2)
    assert (read.amcl.min_particles, read.amcl.max_particles) == (100, 5000)
    assert (read.dwa.max_vel_trans, read.dwa.sim_time) == (0.55, 1.7)
    assert (read.local_costmap.inflation_radius, read.local_costmap.obstacle_range) == (0.55, 2.5)
    assert read.navfn.default_tolerance == 0.0
    assert read.rotate_recovery.max_vel_theta == 1.0
    assert set(read.resets) == {"conservative_reset", "aggressive_reset"}


@pytest.mark.parametrize(
    ("move_base", "dwa", "frequency"),
    [({}, {}, 20.0), ({"controller_frequency": 10.0}, {}, 10.0),
     ({"controller_frequency": 20.0}, {"controller_frequency": 10.0}, 10.0)],
)  # fmt: skip
def test_dwa_inherits_the_controller_frequency_of_move_base(
    move_base: dict[str, Any], dwa: dict[str, Any], frequency: float
) -> None:
    read = read_ros(tree(move_base=move_base, DWAPlannerROS=dwa))
    assert read.dwa.controller_frequency == frequency


@pytest.mark.parametrize(
    ("sections", "expected"),
    [
        (
            {"DWAPlannerROS": {"min_vel_trans": 0.3, "max_vel_trans": 0.22}},
            "move_base/DWAPlannerROS/min_vel_trans: min_vel_trans 0.3 is above max_vel_trans 0.22",
        ),
        (
            {"global_costmap": costmap(footprint=[[0.1, 0.1], [0.2, 0.2]])},
            "move_base/global_costmap/footprint: a polygon needs at least three points",
        ),
        (
            {"local_costmap": costmap(global_frame="odom", inflation_radius=-0.5)},
            "move_base/local_costmap/inflation_radius: must be greater than or equal to 0",
        ),
        ({"amcl": {"odom_model_type": "tracked"}}, "amcl/odom_model_type: must be 'diff', 'omni'"),
        ({"amcl": {"min_particles": 9000}}, "amcl: min_particles (9000) is more than"),
        ({"move_base": {"base_local_planner": "teb/Teb"}}, "must be 'dwa_local_planner"),
        ({"local_costmap": costmap(global_frame="map")}, "global_frame: must be odom"),
        ({"topics": {"scann": "/scan"}}, 'topics/scann: nothing reads a parameter "scann"'),
        ({"topics": {"scan": "a scan"}}, "topics/scan: must be a name such as /scan"),
        ({"topics": {"remap": {"/a": "b c"}}}, "topics/remap//a: must be a name such as /scan"),
        ({"topics": {"remap": {"a b": "/c"}}}, "topics/remap/a b: must be a name such as /scan"),
        ({"dispatcher": {"rat": 2.0}}, 'did you mean "rate"?'),
        ({"quirks": {"perimeter": False}}, 'did you mean "perimeter_only"?'),
        ({"amcl": 3}, "amcl: must be names with values"),
        ({"DWAPlannerROS": 3}, "move_base/DWAPlannerROS: must be names with values"),
    ],
)
def test_what_cannot_drive_is_an_error(sections: dict[str, Any], expected: str) -> None:
    found = fatal(tree(**sections))
    assert any(expected in problem for problem in found), found


def test_all_errors_are_reported_together() -> None:
    given = tree(amcl={"kld_err": -1.0}, DWAPlannerROS={"sim_time": "long"})
    assert len(fatal(given)) == 2


@pytest.mark.parametrize(
    ("sections", "expected"),
    [
        ({"amcl": {"odom_alpa1": 0.1}}, 'amcl/odom_alpa1: nothing reads a parameter "odom_alpa1"'),
        ({"DWAPlannerROS": {"max_trans_vel": 0.1}}, 'did you mean "max_vel_trans"?'),
        (
            {"move_base": {"TebLocalPlannerROS": {}}},
            'nothing reads a namespace "TebLocalPlannerROS"',
        ),
        ({"move_base": {"DWAPlanerROS": {}}}, 'did you mean "DWAPlannerROS"?'),
        ({"amlc": {}}, 'did you mean "amcl"?'),
        ({"topics": {"amcl": "/other"}}, "amcl listens to /other, the scan comes on /scan"),
        ({"topics": {"scan": "/x"}}, "the local costmap listens to /scan, the scan comes on /x"),
        (
            {"local_costmap": {"global_frame": "odom"}},
            "the local costmap has no source of type LaserScan",
        ),
    ],
)
def test_what_is_probably_a_slip_is_a_warning(sections: dict[str, Any], expected: str) -> None:
    found = problems(read_ros(tree(**sections)))
    assert any(expected in problem for problem in found), found


def test_names_without_effect_are_listed_with_the_reason() -> None:
    read = read_ros(tree(DWAPlannerROS={"stop_time_buffer": 1.0, "holonomic_robot": True}))
    assert problems(read) == []
    found = {str(f.path[-1]): f.message for f in read.findings.without_effect}
    assert set(found) == {"stop_time_buffer", "holonomic_robot"}
    assert "never reads it" in found["stop_time_buffer"]


def test_a_costmap_keeps_only_the_sources_that_hear_the_scan() -> None:
    two = costmap(global_frame="odom", observation_sources="scan rear", rear=LASER | {"topic": "r"})
    read = read_ros(tree(local_costmap=two))
    assert [source.name for source in read.local_costmap.sources] == ["scan"]
    assert read.topics.local_costmap == ("/scan", "/r")
    deaf = read_ros(tree(topics={"scan": "/front", "amcl": "/front"}))
    assert deaf.local_costmap.sources == ()
    assert deaf.wiring == Wiring(amcl=ONE_LASER, global_costmap=(), local_costmap=())


def test_the_turn_on_the_spot_reads_the_limits_of_a_planner_that_does_not_run() -> None:
    own = {"rotate_recovery": {"frequency": 10.0}, "DWAPlannerROS": {"max_vel_theta": 2.75}}
    other = {"TrajectoryPlannerROS": {"acc_lim_th": 2.0, "sim_time": 1.0}}
    read = read_ros(tree(**own, **other))
    turn = read.rotate_recovery
    assert (turn.frequency, turn.acc_lim_theta, turn.max_vel_theta) == (10.0, 2.0, 1.0)
    assert [f.path[-1] for f in read.findings.without_effect] == ["sim_time"]
    fixed = read_ros(tree(**own, **other, quirks="fixed"))
    assert fixed.quirks == FIXED
    assert fixed.rotate_recovery.max_vel_theta == 2.75


def test_recoveries_have_their_namespaces() -> None:
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
)
_PLACES = st.sampled_from(
    [("topics",), ("quirks",), ("dispatcher",), ("topics", "remap"), ("amcl", "kld_err")]
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
@settings(max_examples=150)
def test_whatever_is_written_is_read_or_refused_in_words(
    changes: list[tuple[tuple[str, ...], Any]],
) -> None:
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
