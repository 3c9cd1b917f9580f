"""Parameters, the velocity window, trajectories, the cells under the robot and the memories."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from daemon.stacks.findings import FindingCollector
from daemon.stacks.ros1.base_local_planner.map_grid import contains_cell, empty_set
from daemon.stacks.ros1.parameters import read_section
from daemon.stacks.ros1.quirks import FAST
from daemon.stacks.ros1.trajectory_planner import (
    TrajectoryPlannerParameters,
)
from daemon.stacks.ros1.trajectory_planner._distances import add_footprint_cells
from daemon.stacks.ros1.trajectory_planner._parameters import strafe_speeds
from daemon.stacks.ros1.trajectory_planner._rollout import (
    count_points,
    normalize_angle,
    simulate_trajectory,
)
from daemon.stacks.ros1.trajectory_planner._search import (
    NO_LEFT_STRAFE,
    NO_LEFT_TURN,
    NO_RIGHT_STRAFE,
    NO_RIGHT_TURN,
    list_arcs,
    velocity_window,
)
from daemon.stacks.ros1.trajectory_planner._settings import (
    longest_trajectory,
    settings_of,
)
from daemon.stacks.ros1.trajectory_planner.controller import EscapeMode, OscillationFlags
from grammars.model.geometry import wrap_angle
from tests.stacks.ros1.trajectory_planner import plain
from tests.stacks.ros1.trajectory_planner.helpers import ROBOTS, rectangle

DEFAULT = TrajectoryPlannerParameters()
HUSKY = ROBOTS["husky"].parameters


def settings(parameters=DEFAULT):
    return settings_of(parameters, FAST, 0.05, 0.1)


def state(*values):
    return np.array(values)


def test_defaults_are_those_of_dynamic_reconfigure():
    s = settings()
    assert (s.max_vel_x, s.min_vel_x, s.slowest_turn) == (0.55, 0.0, 0.4)
    assert (s.max_vel_theta, s.min_vel_theta) == (1.0, -1.0)
    assert (s.path_scale, s.goal_scale, s.occdist_scale) == (0.6, 0.8, 0.01)
    assert (s.sim_time, s.vx_samples, s.vtheta_samples, s.dwa) == (1.7, 20, 20, False)
    assert strafe_speeds(DEFAULT) == (-0.3, -0.1, 0.1, -0.3)
    assert asdict(DEFAULT) == dict.fromkeys(
        ("path_distance_bias", "pdist_scale", "goal_distance_bias", "gdist_scale",
         "min_in_place_vel_theta", "min_in_place_rotational_vel", "controller_frequency")
    ) | {
        "acc_lim_x": 2.5, "acc_lim_y": 2.5, "acc_lim_theta": 3.2, "max_vel_x": 0.55,
        "min_vel_x": 0.0, "max_vel_theta": 1.0, "min_vel_theta": -1.0, "max_rotational_vel": 1.0,
        "holonomic_robot": True, "y_vels": "-0.3,-0.1,0.1,-0.3", "escape_vel": -0.1,
        "yaw_goal_tolerance": 0.05, "xy_goal_tolerance": 0.1, "latch_xy_goal_tolerance": False,
        "prune_plan": True, "sim_time": 1.7, "sim_granularity": 0.025,
        "angular_sim_granularity": 0.025, "vx_samples": 20, "vtheta_samples": 20,
        "meter_scoring": False, "occdist_scale": 0.01, "heading_lookahead": 0.325,
        "heading_scoring": False, "heading_scoring_timestep": 0.1, "dwa": False,
        "simple_attractor": False, "oscillation_reset_dist": 0.05, "escape_reset_dist": 0.1,
        "escape_reset_theta": math.pi / 2.0,
    }  # fmt: skip


def test_weights_are_per_metre_when_asked_and_go_by_older_names():
    s = settings(HUSKY)
    assert (s.path_scale, s.goal_scale) == (0.75 * 0.05, 1.0 * 0.05)
    assert s.occdist_scale == 0.1
    both = replace(HUSKY, path_distance_bias=2.0, meter_scoring=False)
    assert settings(both).path_scale == 2.0
    assert settings(replace(DEFAULT, gdist_scale=9.0)).goal_scale == 5.0


def test_the_older_name_of_the_slowest_turn_is_heard_at_the_goal_only():
    from daemon.stacks.ros1.trajectory_planner._parameters import slowest_turn_at_goal

    older = replace(DEFAULT, min_in_place_rotational_vel=0.7)
    assert (settings(older).slowest_turn, slowest_turn_at_goal(older)) == (0.4, 0.7)
    both = replace(older, min_in_place_vel_theta=0.2)
    assert (settings(both).slowest_turn, slowest_turn_at_goal(both)) == (0.2, 0.2)


@pytest.mark.parametrize(
    ("text", "speeds"),
    [
        ("0.2, -0.2", (0.2, -0.2)),
        ("[-0.3, 1e-1]", (0.0, 0.1)),
        ("0.1 ,, x", (0.1, 0.0)),
        ("", (0.0,)),
    ],
)
def test_strafe_speeds_are_read_as_c_reads_numbers(text, speeds):
    assert strafe_speeds(replace(DEFAULT, y_vels=text)) == speeds


def contradictions(parameters):
    return tuple(each for each in parameters.rules() if each.fatal)


def doubts(parameters):
    return tuple(each for each in parameters.rules() if not each.fatal)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"min_vel_x": -0.2}, "min_vel_x -0.2 is beyond what the controller takes: 0 counts"),
        ({"min_vel_theta": 0.4}, "min_vel_theta 0.4"),
        ({"pdist_scale": 32.0}, "5 counts"),
        ({"vx_samples": 0}, "1 counts"),
        ({"y_vels": (-0.3, 0.3)}, "y_vels is a list"),
        ({"y_vels": "[-0.3, 0.3]"}, "not all numbers"),
        ({"meter_scoring": True}, "per metre"),
    ],
)
def test_what_may_not_be_taken_as_written_is_named(wrong, words):
    found = doubts(replace(DEFAULT, **wrong))
    assert [words in entry.text for entry in found] == [True]
    assert found[0].names == tuple(wrong)


@pytest.mark.parametrize(
    ("wrong", "names", "word"),
    [
        ({"max_vel_x": 0.0}, "max_vel_x", "never drive"),
        ({"min_vel_x": 0.7}, "min_vel_x max_vel_x", "no speed between"),
        ({"sim_time": 0.0}, "sim_time", "lead nowhere"),
        ({"vx_samples": 1}, "vx_samples min_vel_x", "only min_vel_x"),
        ({"vtheta_samples": 1}, "vtheta_samples", "cannot turn"),
        ({"acc_lim_x": 0.0}, "acc_lim_x", "no other speed"),
        ({"acc_lim_theta": 0.0}, "acc_lim_theta", "no other turning speed"),
        # The last of 28 points of a trajectory of 0.7 s is at 0.675 s.
        (
            {"heading_scoring": True, "heading_scoring_timestep": 0.676, "sim_time": 0.7},
            "heading_scoring_timestep sim_time",
            "path nor",
        ),
    ],
)
def test_each_contradiction_is_named_alone(wrong, names, word):
    (found,) = contradictions(replace(DEFAULT, **wrong))
    assert found.names == tuple(names.split())
    assert word in found.text


@pytest.mark.parametrize(
    "sound",
    [
        {},
        {"min_vel_x": 0.55},
        {"vx_samples": 2},
        {"vx_samples": 1, "min_vel_x": 0.1},
        {"vtheta_samples": 2},
        {"acc_lim_x": 0.0, "min_vel_x": 0.1},
        {"heading_scoring": True, "heading_scoring_timestep": 0.675, "sim_time": 0.7},
        {"heading_scoring_timestep": 0.8, "sim_time": 0.7},
    ],
)
def test_what_only_looks_like_a_contradiction_is_none(sound):
    assert contradictions(replace(DEFAULT, **sound)) == ()


def test_the_ends_of_a_range_are_taken_as_written():
    for name, low, high in (("sim_time", 0.0, 10.0), ("min_vel_theta", -20.0, 0.0)):
        for value, doubted in ((low, 0), (high, 0), (low - 0.1, 1), (high + 0.1, 1)):
            assert len(doubts(replace(DEFAULT, **{name: value}))) == doubted


def test_published_configurations_contradict_nothing_and_are_taken_as_written():
    assert doubts(DEFAULT) == ()
    for robot in ROBOTS.values():
        assert contradictions(robot.parameters) == ()
        assert [found.names for found in doubts(robot.parameters)] == [("meter_scoring",)]


PUBLISHED = (
    ("husky/husky_navigation/config/planner.yaml",),
    ("jackal/jackal_navigation/params/base_local_planner_params.yaml",),
    (
        "fetch/fetch_navigation/config/move_base.yaml",
        "fetch/fetch_navigation/config/fetch/move_base.yaml",
    ),
    ("mir/mir_navigation/config/base_local_planner_params.yaml",),
    ("robile_amr/config/base_local_planner_params.yaml",),
)


@pytest.mark.parametrize(("files", "name"), list(zip(PUBLISHED, ROBOTS, strict=True)))
def test_published_files_are_read(files, name, reference_data):
    given = {}
    for file in files:
        text = (reference_data / "robots" / file).read_text("utf-8")
        given |= yaml.safe_load(text)["TrajectoryPlannerROS"]
    report = FindingCollector()
    read = read_section(TrajectoryPlannerParameters, given, ("x",), report)
    assert (report.fatal, [each.path for each in report.problems]) == ([], [("x", "meter_scoring")])
    assert settings(read) == settings(ROBOTS[name].parameters)
    assert read.xy_goal_tolerance == ROBOTS[name].parameters.xy_goal_tolerance
    assert read.latch_xy_goal_tolerance == ROBOTS[name].parameters.latch_xy_goal_tolerance


def test_values_out_of_range_and_unknown_names_are_refused():
    for wrong in ({"sim_granularity": 0.0}, {"sim_time": math.nan}, {"backup_vel": -0.2}):
        with pytest.raises(ValidationError):
            TrajectoryPlannerParameters(**wrong)
    assert "backup_vel" in TrajectoryPlannerParameters.without_effect
    assert "escape_vel" not in TrajectoryPlannerParameters.without_effect


def window(parameters, vx, wz, way):
    out = np.zeros((2, 2))
    velocity_window(state(0, 0, 0, vx, 0, wz), way, settings(parameters), out)
    return out


def test_the_window_is_one_period_or_the_whole_simulation():
    np.testing.assert_allclose(window(HUSKY, 0.5, 0.1, 9.0), [[0.375, 0.625], [-0.06, 0.26]])
    np.testing.assert_allclose(
        window(replace(HUSKY, dwa=False), 0.5, 0.1, 9.0), [[0.0, 1.0], [-1.0, 1.0]]
    )


def test_near_the_end_of_the_plan_the_robot_slows_down_but_not_below_its_slowest():
    assert window(HUSKY, 0.2, 0.0, 0.5)[0, 1] == 0.25
    assert window(replace(HUSKY, min_vel_x=0.3), 0.2, 0.0, 0.5)[0].tolist() == [0.3, 0.3]


def test_arcs_are_straight_first_and_leave_the_highest_turn_out():
    few = replace(HUSKY, vx_samples=2, vtheta_samples=3)
    out = np.zeros((20, 3))
    edges = np.array([[0.2, 0.4], [-0.1, 0.3]])
    n = list_arcs(edges, settings(few), out)
    arcs = [(0.2, 0.0), (0.2, -0.1), (0.2, 0.1), (0.4, 0.0), (0.4, -0.1), (0.4, 0.1)]
    np.testing.assert_allclose(out[:n, [0, 2]], arcs, atol=1e-12)
    n = list_arcs(edges, settings(replace(few, holonomic_robot=True)), out)
    assert out[n - 2 : n].tolist() == [[0.1, 0.1, 0.0], [0.1, -0.1, 0.0]]


def test_numbers_of_points():
    s = settings(HUSKY)
    assert count_points(1.0, 0.0, 0.0, s) == 100
    assert count_points(0.0, 0.0, 0.0, s) == 1
    # Not times the two seconds of the simulation.
    assert count_points(0.0, 0.0, 1.0, s) == 50
    assert count_points(0.0, 0.0, 0.0, settings(ROBOTS["fetch"].parameters)) == 40


def test_trajectories_accelerate_and_leave_their_end_out():
    p = replace(HUSKY, sim_time=1.0, sim_granularity=0.25, acc_lim_x=2.0)
    points = np.zeros((10, 5))
    assert simulate_trajectory(state(1, 2, 0, 0, 0, 0), 1.0, 0.0, 0.0, settings(p), points) == 4
    np.testing.assert_allclose(points[:4, 0], [1.0, 1.125, 1.375, 1.625])
    assert points[:4, 1].tolist() == [2.0] * 4


def test_no_trajectory_is_longer_than_there_is_room():
    for robot in ROBOTS.values():
        p, s = robot.parameters, settings(robot.parameters)
        for vx, wz in ((0.0, 0.0), (0.9, 2.0), (-0.4, -3.0)):
            most = longest_trajectory(p, s, (vx, 0.0, wz))
            edges = window(p, vx, wz, 9.0)
            for sample in (*edges[1].tolist(), -s.slowest_turn, 1.0):
                for speed in (*edges[0].tolist(), s.escape_vel):
                    assert count_points(speed, 0.0, sample, s) <= most


def test_angles_are_wrapped_as_others_do_but_for_rounding():
    for angle in np.linspace(-9.0, 9.0, 181).tolist():
        assert normalize_angle(angle) == pytest.approx(wrap_angle(angle), abs=1e-14)
        assert normalize_angle(angle) == plain.between(0.0, angle)


@pytest.mark.parametrize("at", [(1.5, 1.5, 0.4), (0.1, 1.5, 2.0), (-0.5, 1.0, 0.0)])
@pytest.mark.parametrize("corners", [4, 3, 2])
def test_the_cells_under_the_robot(at, corners):
    outline, frame = rectangle(-0.4, 0.6, 0.3)[:corners], np.array((0.0, 0.0, 0.05))
    cells = np.zeros((60, 64), dtype=np.uint8)
    found, spans = empty_set(cells.shape), np.zeros((64, 2), dtype=np.int32)
    add_footprint_cells(np.array(at), outline, frame, cells.shape, spans, found)
    got = {(r, c) for r in range(60) for c in range(64) if contains_cell(found, r, c)}
    assert got == plain.under_robot(np.array(at), outline, cells, frame)


def test_without_a_footprint_the_robot_covers_its_cell():
    found, spans = empty_set((60, 60)), np.zeros((60, 2), dtype=np.int32)
    frame, none = np.array((0.0, 0.0, 0.05)), np.zeros((1, 2))
    for x, covers in ((1.51, True), (-1.0, False)):
        found[:] = 0
        add_footprint_cells(np.array((x, 0.77, 0.0)), none, frame, (60, 60), spans, found)
        assert contains_cell(found, 15, 30) is covers


def forbidden(*places):
    out = np.zeros(4, dtype=np.int32)
    out[list(places)] = 1
    return out


def test_the_second_turn_in_a_row_forbids_the_other_side_until_the_robot_has_moved():
    for wz, other in ((0.5, NO_RIGHT_TURN), (-0.5, NO_LEFT_TURN)):
        flags = OscillationFlags(0.05)
        flags.chosen((1.0, 1.0), 0.0, 0.0, wz)
        assert not flags.forbidden.any()
        flags.chosen((1.0, 1.0), 0.0, 0.0, wz)
        np.testing.assert_array_equal(flags.forbidden, forbidden(other))
        flags.chosen((1.04, 1.0), 0.3, 0.0, 0.2)
        assert flags.forbidden.any()
        flags.chosen((1.06, 1.0), 0.3, 0.0, 0.2)
        assert not flags.forbidden.any()


def test_a_strafe_forbids_going_back():
    for vy, back in ((0.1, NO_LEFT_STRAFE), (-0.1, NO_RIGHT_STRAFE)):
        flags = OscillationFlags(0.05)
        flags.chosen((0.0, 0.0), 0.0, vy, 0.0)
        assert not flags.forbidden.any()
        flags.chosen((0.0, 0.0), 0.0, -vy, 0.0)
        np.testing.assert_array_equal(flags.forbidden, forbidden(back))


def test_an_escape_ends_far_enough_from_where_it_began():
    escape = EscapeMode(0.1, 0.5)
    escape.begin(state(1, 1, 3.1, 0, 0, 0))
    escape.begin(state(1.09, 1, 3.1, 0, 0, 0))
    escape.release(state(1.09, 1, -3.1, 0, 0, 0))
    assert escape.active
    escape.release(state(1.11, 1, 3.1, 0, 0, 0))
    assert not escape.active
    escape.begin(state(0, 0, 0, 0, 0, 0))
    escape.release(state(0, 0, 0.51, 0, 0, 0))
    assert not escape.active
