"""The whole ROS stack through the one road of a run, in rooms of a few metres."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from daemon.model.sut import Briefing, LaserScan, Observation, Odometry
from daemon.model.verdicts import Outcome
from daemon.stacks.registry import make_sut
from daemon.stacks.ros1.stack import common_step
from daemon.stacks.ros1.transforms import CostmapFrame, TransformBuffer
from daemon.trace import read_trace
from grammars.model.behaviour import KeyFrame, KeyFrames, Servo
from grammars.model.geometry import Pose2, Twist2
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Mount
from templates.occupancy import occupancy_grid
from tests.stacks.ros1.scenes import DOORWAY, ROBOT, configured, room, run, said

ACROSS = (Waypoint("across", 5.0, 2.0, 0.0),)


def test_it_drives_through_a_doorway_and_says_what_it_does(tmp_path):
    result, trace = run(tmp_path, room(*DOORWAY), (Waypoint("here", 1.6, 2.6), *ACROSS))
    assert (result.outcome, result.ended) == (Outcome.PASS, "finished")
    assert trace.contacts == ()
    assert [(p.reached, p.state) for p in trace.progress][-1] == (2, "succeeded")
    assert len(said(trace, "sent")) == 2
    assert said(trace, "waypoint 1 reached") == said(trace, "goal 2 sent")
    # What is recorded of its inside: a belief a second at least, clouds stamped as the scans.
    published = np.isin(trace.estimate.time, trace.cloud.time)
    assert published.sum() == len(trace.cloud.time) > 10
    assert np.diff(trace.estimate.time).max() <= 1.2
    assert set(np.round(trace.cloud.time / 0.1, 6) % 1.0) == {0.0}
    truth = np.interp(trace.estimate.time, trace.ground_truth.time, trace.ground_truth.x)
    assert np.abs(trace.estimate.x - truth).max() < 0.25


def test_what_a_check_says_of_parameters_is_no_event_of_a_run(tmp_path):
    doubtful = configured(amcl__nonsense=1.0, move_base__shutdown_costmaps=True)
    _, trace = run(tmp_path, room(), (Waypoint("there", 2.0, 2.3, 0.0),), doubtful)
    assert trace.events[0].text == "goal 1 sent: 2.00, 2.30, 0.00"


def test_the_same_seed_gives_the_same_run_and_another_one_another(tmp_path):
    scene, goal = room(), (Waypoint("there", 2.0, 2.3, 0.0),)
    runs = []
    for k, seed in enumerate((3, 3, 4)):
        folder = tmp_path / str(k)
        folder.mkdir()
        runs.append(run(folder, scene, goal, seed=seed)[0].trace.sha256)
    assert runs[0] == runs[1] != runs[2]


def test_a_goal_in_a_wall_is_aborted_and_the_verdict_is_fail(tmp_path):
    goals = (Waypoint("near", 1.6, 2.0), Waypoint("in the wall", -0.1, 2.0), *ACROSS)
    result, trace = run(
        tmp_path, room(), goals, configured(move_base__planner_patience=1.0), limit=120.0
    )
    assert (result.outcome, result.ended) == (Outcome.FAIL, "finished")
    assert (trace.progress[-1].reached, trace.progress[-1].state) == (1, "aborted")
    recoveries = [event.time for event in trace.events if event.text.startswith("recovery ")]
    assert len(recoveries) == 4
    assert said(trace, "conservative_reset finds no layer to clear") == recoveries[:1]
    assert len(said(trace, "goal aborted: no valid plan, even after recoveries")) == 1
    assert len(said(trace, "has turned once")) == 2
    turned = np.unwrap(trace.ground_truth.yaw).max()
    assert turned > 2.0 * math.pi, "the turn on the spot is a turn of the robot"


def test_a_door_that_shuts_in_the_only_doorway_stops_it(tmp_path):
    shut = KeyFrames("door.hinge", (KeyFrame(1.0, 0.0),), Servo(2.0, 60.0))
    result, trace = run(
        tmp_path, room(*DOORWAY, door=True), ACROSS,
        configured(move_base__planner_patience=2.0, move_base__clearing_rotation_allowed=False),
        behaviours=(shut,), limit=60.0,
    )  # fmt: skip
    assert result.outcome is Outcome.FAIL
    assert trace.progress[-1].state == "aborted"
    assert trace.ground_truth.x.max() + 0.35 < 3.0
    assert trace.contacts == ()


def test_blind_costmaps_drive_into_a_door_that_the_map_does_not_show(tmp_path):
    shut = KeyFrames("door.hinge", (KeyFrame(1.0, 0.0),), Servo(2.0, 200.0))
    blind = configured(topics={"scan": "/front", "amcl": "/front"})
    _, trace = run(
        tmp_path, room(*DOORWAY, door=True), ACROSS, blind, behaviours=(shut,), limit=20.0
    )
    assert len(trace.contacts) > 0


def test_amcl_weighs_by_the_lasers_on_its_topic(tmp_path):
    rear = replace(ROBOT.laser, name="rear", mount=Mount(-0.3, 0.0, math.pi), rays=91)
    robot = replace(ROBOT, laser=replace(ROBOT.laser, name="front"), other_lasers=(rear,))
    clouds = {}
    for front, back in (("/scan", "/scan"), ("/other", "/scan"), ("/other", "/back")):
        wired = configured(topics={"amcl": "/scan", "scan": {"front": front, "rear": back}})
        result, trace = run(
            tmp_path, room(), (Waypoint("there", 2.0, 2.0, 0.0),), wired, robot=robot
        )
        assert result.outcome is Outcome.PASS
        clouds[front, back] = len(trace.cloud.time)
    # Both weigh at every motion, and every second weighing is published.
    assert clouds["/scan", "/scan"] > clouds["/other", "/scan"] > clouds["/other", "/back"] == 0
    # Without scans it believes odometry, which is true for this robot.
    truth = np.interp(trace.estimate.time, trace.ground_truth.time, trace.ground_truth.x)
    assert np.abs(trace.estimate.x - truth).max() < 0.02


@pytest.mark.parametrize(
    ("frequencies", "step"),
    [((10.0, 20.0), 0.05), ((20.0, 20.0), 0.05), ((10.0, 10.0), 0.1), ((3.0, 20.0), 0.01),
     ((4.0, 10.0), 0.05), ((100.0, 20.0), 0.01)],
)  # fmt: skip
def test_its_step_fits_the_control_loop_and_the_turn(frequencies, step):
    assert common_step(*frequencies) == pytest.approx(step)


def test_bad_parameters_are_refused_before_anything_runs():
    with pytest.raises(ValueError, match="min_vel_trans"):
        make_sut("ros", configured(move_base__DWAPlannerROS__min_vel_trans=1.0))


def observe(time, *, odometry=True, scan=False):
    samples = (Odometry(time, Pose2(1.0, 2.0), Twist2()),) if odometry else ()
    ranges = np.full(ROBOT.laser.rays, 1.5, np.float32)
    scans = (LaserScan(time, ranges),) if scan else ()
    return Observation(time, samples, scans)


def test_a_scan_waits_for_the_odometry_at_its_stamp():
    stack = make_sut("ros", configured())
    grid = occupancy_grid(room(), laser_height=0.3)
    start = Pose2(1.0, 2.0)
    mission = Mission("m", start, ACROSS)
    stack.start(Briefing(ROBOT, grid, mission, start, np.random.SeedSequence(1)))
    assert stack.update(observe(0.0, odometry=False, scan=True)).estimate is None
    decision = stack.update(observe(0.05))
    assert decision.estimate.time == 0.0
    assert decision.cloud is not None
    assert len(decision.particles) <= 100


COSTMAPS = yaml.safe_load(Path(__file__).with_name("costmaps.yaml").read_text("utf-8"))


@pytest.mark.parametrize(
    ("wide", "near"), [("without map", "rolling in map"), ("over the map", "still")]
)
def test_it_drives_through_a_doorway_whatever_frames_its_costmaps_are_in(tmp_path, wide, near):
    parameters = configured(
        move_base__global_costmap=COSTMAPS[wide], move_base__local_costmap=COSTMAPS[near]
    )
    result, trace = run(tmp_path, room(*DOORWAY), ACROSS, parameters)
    assert (result.outcome, result.ended) == (Outcome.PASS, "finished")
    assert trace.contacts == ()
    plan = read_trace(tmp_path / "run.mcap", views=True).plans[0]
    assert np.hypot(*(plan.points[-1] - (5.0, 2.0))) < 0.2, "recorded in map"


def test_a_frame_knows_where_the_base_and_other_frames_are_in_it():
    """The base half a metre ahead in odom, which AMCL has put elsewhere in the map."""
    known = TransformBuffer(Pose2(1.0, 2.0), 0.0, delayed=False)
    known.move(Odometry(0.0, Pose2(), Twist2()))
    known.move(Odometry(1.0, Pose2(0.5, 0.0, 0.1), Twist2()))
    known.correct(1.0, Pose2(3.0, 2.0, 0.2))
    odom, world = CostmapFrame("odom", known), CostmapFrame("map", known)
    assert odom.base == Pose2(0.5, 0.0, 0.1)
    assert world.base == known.base_in_map()
    assert (odom.in_map, world.in_map) == (Pose2(3.0, 2.0, 0.2), Pose2())
    assert odom.pose_in(world) == odom.in_map
    assert world.pose_in(odom) == odom.in_map.inverse()
    assert odom.pose_in(odom) == world.pose_in(world) == Pose2()
    goal = Pose2(5.0, 1.0, 0.3)
    assert world.take(goal) == goal
    back = odom.in_map @ odom.take(goal)
    assert (back.x, back.y, back.yaw) == pytest.approx((goal.x, goal.y, goal.yaw))
