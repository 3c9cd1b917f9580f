"""Costmaps in other frames than usual, and of other layers, through whole runs."""

import numpy as np
import pytest

from daemon.model.sut import Odometry
from daemon.model.verdicts import Outcome
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.telemetry import CostmapRecorder, PlanRecorder
from daemon.stacks.ros1.transforms import CostmapFrame, TransformBuffer
from daemon.trace import read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.mission import Waypoint
from tests.stacks.ros1.scenes import DOORWAY, configured, room, run

ACROSS = (Waypoint("across", 5.0, 2.0, 0.0),)
_SEEN = {
    "observation_sources": "scan",
    "scan": {
        "data_type": "LaserScan", "topic": "scan", "marking": True, "clearing": True,
        "obstacle_range": 3.0, "raytrace_range": 3.5,
    },
}  # fmt: skip
_INFLATION = {"inflation_radius": 0.5, "cost_scaling_factor": 4.0}
_FOOTPRINT = [[0.35, 0.233], [0.35, -0.233], [-0.35, -0.233], [-0.35, 0.233]]


def layered(*layers, **values):
    """A costmap with ``plugins``; layers are named after their types."""
    own = {"ObstacleLayer": _SEEN, "VoxelLayer": _SEEN, "InflationLayer": _INFLATION}
    return {
        "plugins": [{"name": name, "type": f"costmap_2d::{kind}"} for name, kind in layers],
        "footprint": _FOOTPRINT,
        "update_frequency": 5.0,
        **{name: own[kind] for name, kind in layers if kind in own},
        **values,
    }


WITHOUT_MAP = layered(
    ("obstacles", "ObstacleLayer"), ("inflater", "InflationLayer"),
    global_frame="odom", rolling_window=True, width=12.0, height=12.0,
)  # fmt: skip
"""The global costmap of a robot without a map, as Husky has one."""
OVER_THE_MAP = layered(
    ("static_map", "StaticLayer"), ("obstacles", "VoxelLayer"), ("inflater", "InflationLayer"),
    global_frame="odom", rolling_window=True, width=12.0, height=12.0,
)  # fmt: skip
IN_MAP = layered(
    ("obstacles", "VoxelLayer"), ("inflater", "InflationLayer"),
    global_frame="map", rolling_window=True, width=3.0, height=3.0, publish_frequency=1.0,
)  # fmt: skip
STILL = layered(
    ("static_map", "StaticLayer"), ("obstacles", "ObstacleLayer"), ("inflater", "InflationLayer"),
    global_frame="map", rolling_window=False,
)  # fmt: skip


@pytest.mark.parametrize(
    ("wide", "near"), [(WITHOUT_MAP, IN_MAP), (OVER_THE_MAP, None), (None, STILL)]
)
def test_it_drives_through_a_doorway_whatever_frames_its_costmaps_are_in(tmp_path, wide, near):
    given = {"move_base__global_costmap": wide, "move_base__local_costmap": near}
    parameters = configured(**{name: value for name, value in given.items() if value is not None})
    result, trace = run(tmp_path, room(*DOORWAY), ACROSS, parameters)
    assert (result.outcome, result.ended) == (Outcome.PASS, "finished")
    assert trace.contacts == ()
    plan = read_trace(tmp_path / "run.mcap", views=True).plans[0]
    assert np.hypot(*(plan.points[-1] - (5.0, 2.0))) < 0.2, "recorded in map"


def transforms():
    """The base half a metre ahead in odom, which AMCL has put elsewhere in the map."""
    buffer = TransformBuffer(Pose2(1.0, 2.0), 0.0, delayed=False)
    buffer.move(Odometry(0.0, Pose2(), Twist2()))
    buffer.move(Odometry(1.0, Pose2(0.5, 0.0, 0.1), Twist2()))
    buffer.correct(1.0, Pose2(3.0, 2.0, 0.2))
    return buffer


def test_a_frame_knows_where_the_base_and_other_frames_are_in_it():
    known = transforms()
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


def test_what_is_recorded_says_the_frame_or_is_in_map():
    grid = CostGrid(0.05, 0.0, 0.0, np.zeros((2, 2), np.uint8))
    picture = CostmapRecorder(1.0, "map").take(0.0, grid)
    assert picture is not None
    assert picture.frame == "map"
    plan = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    points = PlanRecorder().take(0.0, plan, Pose2(2.0, 1.0, np.pi / 2))
    assert points is not None
    np.testing.assert_allclose(points[[0, -1]], [(2.0, 1.0), (2.0, 2.0)], atol=1e-12)
