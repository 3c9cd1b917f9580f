"""What of the stack's inside is recorded, and how often."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.amcl.node import AmclPose
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.telemetry import StackRecorder, thin_plan
from grammars.model.geometry import Pose2


def a_log(rate=0.0):
    """Return a record that begins with a spread of 1, of a local costmap in odom."""
    return StackRecorder(np.eye(3), rate, "odom")


def line(start, end=10.0, y=0.0):
    """A plan along x with a pose every 2.5 cm, the last one at the end."""
    x = end - 0.025 * np.arange(round((end - start) / 0.025) + 1)[::-1]
    return np.column_stack((x, np.full_like(x, y), np.zeros_like(x)))


def test_a_plan_that_only_lost_its_beginning_is_not_recorded_again():
    log = a_log()
    log.plan(0.0, line(0.0))
    for k in range(1, 50):
        # A little shorter every time, as rounding makes it.
        assert log.plan(1.0 * k, line(0.2 * k, y=0.001 * k) * (1.0 - 1e-5)) is None


def test_another_way_is_recorded_at_most_once_a_second():
    log = a_log()
    log.plan(0.0, line(0.0))
    assert log.plan(0.6, line(0.1, y=0.5)) is None
    assert log.plan(1.0, line(0.2, y=0.5)) is not None
    assert log.plan(2.0, line(0.3, end=11.0)) is not None


@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=1, max_size=40),
    st.floats(2.0, 4.0),
)
def test_thinning_takes_the_points_the_plain_version_takes(steps, spacing):
    plan = np.zeros((len(steps), 3))
    plan[:, :2] = np.cumsum(np.array(steps), axis=0)
    back = plan[::-1, :2]
    way = np.concatenate(((0.0,), np.cumsum(np.hypot(*np.diff(back, axis=0).T))))
    marks = np.arange(0.0, way[-1] - 1e-9, spacing) if way[-1] > 0.0 else np.zeros(1)
    wanted = np.column_stack([np.interp(marks, way, back[:, axis]) for axis in (0, 1)])
    found = thin_plan(plan, spacing)
    assert found[0].tolist() == back[0].tolist()
    assert found[-1].tolist() == back[-1].tolist()
    assert found[: len(wanted)] == pytest.approx(wanted, abs=1e-6)
    assert len(found) <= len(wanted) + 2


def test_a_plan_of_another_frame_is_recorded_in_map():
    plan = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    points = a_log().plan(0.0, plan, Pose2(2.0, 1.0, np.pi / 2))
    np.testing.assert_allclose(points[[0, -1]], [(2.0, 1.0), (2.0, 2.0)], atol=1e-12)


def test_trajectories_are_recorded_in_the_map_frame_five_times_a_second():
    log = a_log()
    odom = Pose2(1.0, 2.0, math.pi / 2)
    points = log.local_plan(0.0, np.array([(0.0, 0.0), (1.0, 0.5)]), odom)
    assert points == pytest.approx(np.array([(1.0, 2.0), (0.5, 3.0)]))
    assert log.local_plan(0.1, np.zeros((2, 2)), odom) is None
    assert log.local_plan(0.2, np.zeros((0, 2)), odom) is None
    assert log.local_plan(0.3, np.zeros((2, 2)), odom) is not None


def test_beliefs_fill_the_time_between_two_publications():
    log = a_log()
    before = log.dead_reckoned(0.0, Pose2(), Pose2())
    assert before.covariance.tolist() == np.eye(3).tolist()
    estimate, cloud = log.published(AmclPose(0.5, Pose2(1.0), 2.0 * np.eye(3), Pose2(1.1), 700))
    assert (estimate.time, cloud.count, cloud.mean) == (0.5, 700, Pose2(1.1))
    assert log.dead_reckoned(1.4, Pose2(), Pose2()) is None
    later = log.dead_reckoned(1.55, Pose2(3.0), Pose2(1.0))
    assert later.pose.x == 4.0
    assert later.covariance[0, 0] == 2.0, "the spread last published"


def test_at_most_a_hundred_particles_once_a_second():
    log = a_log()
    for count in (1, 99, 100, 101, 1999):
        poses = a_log().particles(0.0, np.arange(3.0 * count).reshape(count, 3))
        assert min(count, 50) <= len(poses) <= 100
    assert log.particles(0.0, np.zeros((5, 3))) is not None
    assert log.particles(0.9, np.zeros((5, 3))) is None


def test_the_local_costmap_is_shown_at_its_publish_frequency_and_once_a_second_at_most():
    grid = CostGrid(0.05, 1.0, 2.0, np.zeros((4, 5), np.uint8))
    picture = a_log(0.5).costmap(0.0, grid)
    assert (picture.frame, picture.x, picture.y) == ("odom", 1.0, 2.0)
    grid.cells[:] = 254
    assert picture.cells.max() == 0, "a copy"
    for rate, count in ((0.0, 0), (0.5, 3), (1.0, 5), (5.0, 5)):
        log = a_log(rate)
        shown = [log.costmap(0.1 * k, grid) for k in range(50)]
        assert len(shown) - shown.count(None) == count
