import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.stacks.ros1.amcl.node import Amcl
from daemon.stacks.ros1.quirks import FAST
from grammars.model.geometry import Pose2, wrap_angle
from grammars.model.robot import Mount
from tests.stacks.ros1.amcl import plain
from tests.stacks.ros1.amcl.world import LASER, PUBLISHED, a_room, map_of, see

WALLS = a_room(5.0, 4.0, 0.2)
WALLS.append((2.6, 2.9, 3.0, 3.3))
START = Pose2(1.2, 1.3, 0.3)
SAME = Pose2()
NOTHING = np.full(LASER.rays, np.inf, dtype=np.float32)


def an_amcl(p=PUBLISHED, walls=WALLS, start=START, seed=0):
    return Amcl(p, FAST, map_of(walls), (LASER,), start, np.random.SeedSequence(seed))


def drive(amcl, poses, walls=WALLS, odom=SAME, seed=0):
    """Take a noisy scan at every pose; return the true pose of everything published.

    ``odom`` is the pose of odom in map, which no odometry error moves.
    """
    random = np.random.default_rng(seed)
    published = []
    for k, pose in enumerate(poses):
        answer = amcl.scan(0.1 * k, see(walls, pose, random), odom.inverse() @ pose)
        if answer is not None:
            published.append((pose, answer))
    return published


def a_loop(steps):
    """A round trip through the room: an ellipse about its middle, heading along it."""
    turns = np.linspace(0.0, math.tau, steps, endpoint=False).tolist()
    points = [(2.8 + 1.6 * math.cos(t), 2.0 + 0.8 * math.sin(t)) for t in turns]
    return [
        Pose2(x, y, math.atan2(0.8 * math.cos(t), -1.6 * math.sin(t)))
        for (x, y), t in zip(points, turns, strict=True)
    ]


def off(pose, truth):
    return math.hypot(pose.x - truth.x, pose.y - truth.y)


@pytest.mark.parametrize(
    ("step", "moves"),
    [
        (Pose2(0.099, 0.099, 0.249), False),  # 0.14 m in all, but per axis
        (Pose2(0.101), True),
        (Pose2(0.0, -0.101), True),
        (Pose2(0.0, 0.0, -0.251), True),
    ],
)
def test_updates_are_due_per_axis_of_the_odom_frame(step, moves):
    amcl = an_amcl()
    odom = Pose2(3.0, -2.0, 3.1)
    amcl.scan(0.0, NOTHING, odom)
    before = amcl.particles.copy()
    after = Pose2(odom.x + step.x, odom.y + step.y, wrap_angle(odom.yaw + step.yaw))
    published = amcl.scan(0.1, NOTHING, after)
    assert (published is not None) is moves
    assert np.array_equal(amcl.particles, before) is not moves


def test_motion_adds_up_since_the_last_update_not_since_the_last_scan():
    amcl = an_amcl()
    published = [amcl.scan(0.1 * k, NOTHING, Pose2(0.04 * k)) for k in range(8)]
    # Updates at 0.12 and 0.24 m: every second one resamples, the first scan counts as one.
    assert [k for k, answer in enumerate(published) if answer is not None] == [0, 3]


def test_the_estimate_converges_and_stays():
    poses = a_loop(80)
    odom = Pose2(4.0, -1.0, 2.0)
    told = poses[0] @ Pose2(0.3, -0.2, 0.15)
    amcl = an_amcl(start=told)
    published = drive(amcl, poses, odom=odom)
    assert len(published) > 20
    later = published[10:]
    assert max(off(answer.pose, truth) for truth, answer in later) < 0.3
    assert np.mean([off(answer.pose, truth) for truth, answer in later]) < 0.15
    assert max(abs(wrap_angle(a.pose.yaw - t.yaw)) for t, a in later) < 0.25
    believed = amcl.map_to_odom @ (odom.inverse() @ later[-1][0])
    assert off(believed, later[-1][1].pose) < 1e-9
    assert all(PUBLISHED.min_particles <= a.count <= 2000 for _, a in published)


def test_random_particles_come_in_only_when_scans_stop_fitting_and_recovery_is_on():
    """The fast average of likelihoods falls below the slow one (Probabilistic Robotics, 8.3.3)."""
    poses = a_loop(80)
    spreads = {}
    for slow, fast in ((0.0, 0.0), (0.001, 0.5)):
        p = replace(PUBLISHED, recovery_alpha_slow=slow, recovery_alpha_fast=fast)
        amcl = an_amcl(p, start=poses[0])
        drive(amcl, poses[:30])
        elsewhere = a_room(1.0, 1.2, 0.2)
        published = [
            amcl.scan(0.0, see(elsewhere, Pose2(0.6, 0.6, pose.yaw)), pose) for pose in poses[30:60]
        ]
        sigmas = [math.sqrt(a.covariance[0, 0]) for a in published if a is not None]
        spreads[fast] = max(sigmas)
    assert spreads[0.0] < 0.6 < spreads[0.5]


FRONT = replace(LASER, name="front")
REAR = replace(LASER, name="rear", mount=Mount(-0.3, 0.1, math.pi), rays=90, range_max=4.0)
NO_RETURN = np.full(REAR.rays, np.inf, dtype=np.float32)


def two_lasers(p=PUBLISHED, seed=0):
    seeds = np.random.SeedSequence(seed)
    return Amcl(p, FAST, map_of(WALLS), (FRONT, REAR), START, seeds)


def test_each_laser_weighs_once_for_each_motion():
    p = replace(PUBLISHED, resample_interval=100)
    amcl = two_lasers(p)

    def weighs(laser, odom):
        before = amcl._filter.weights.copy()
        amcl.scan(0.0, see(WALLS, START @ odom, laser=laser), odom, laser.name)
        return not np.array_equal(before, amcl._filter.weights)

    # Its first scan counts for each, then none until the robot has moved.
    assert weighs(FRONT, Pose2())
    assert not weighs(FRONT, Pose2())
    assert weighs(REAR, Pose2())
    assert not weighs(REAR, Pose2(0.09))
    # Whichever laser sees the motion first, it is due for both, also when that is used up.
    assert weighs(REAR, Pose2(0.11))
    assert not weighs(REAR, Pose2(0.11))
    assert weighs(FRONT, Pose2(0.11))
    assert not weighs(FRONT, Pose2(0.2))
    # Motion counts from the last scan that weighed, of whatever laser.
    assert weighs(FRONT, Pose2(0.22))
    assert weighs(REAR, Pose2(0.31))
    assert not weighs(FRONT, Pose2(0.4))
    assert weighs(FRONT, Pose2(0.42))


def test_a_scan_has_as_many_rays_as_its_own_laser():
    amcl = two_lasers()
    amcl.scan(0.0, NOTHING, SAME, "front")
    amcl.scan(0.0, NO_RETURN, SAME, "rear")
    with pytest.raises(ValueError, match="the laser has 90 rays"):
        amcl.scan(0.1, NOTHING, SAME, "rear")


@pytest.mark.parametrize(
    ("model", "lasers"),
    [("omni-corrected", (LASER,)), ("diff-corrected", (LASER,)), ("omni", (FRONT, REAR))],
)
def test_updates_are_those_of_the_plain_version(model, lasers):
    p = replace(
        PUBLISHED, min_particles=50, max_particles=300, odom_model_type=model, resample_interval=3
    )
    grid, seeds = map_of(WALLS), np.random.SeedSequence(5)
    amcl = Amcl(p, FAST, grid, lasers, START, seeds)
    field = plain.brushfire(grid, p.laser_likelihood_max_dist)[0]
    reference = plain.PlainAmcl(p, grid, lasers[0], START, 5, field)
    expected = plain.summary(reference.poses, reference.weights)
    pose = START
    for k in range(10):
        laser = lasers[k % len(lasers)]
        ranges = see(WALLS, pose, laser=laser)
        published = amcl.scan(0.1 * k, ranges, pose, laser.name)
        resampled = reference.update(ranges, pose, laser)
        np.testing.assert_allclose(amcl.particles, reference.poses, atol=1e-9)
        np.testing.assert_allclose(amcl._filter.weights, reference.weights, rtol=1e-9)
        # The first one tells what it believed before.
        assert (published is not None) == (resampled or k == 0)
        if published is not None:
            if resampled:
                expected = plain.summary(reference.poses, reference.weights)
            assert (published.time, published.count) == (0.1 * k, len(reference.poses))
            for got, wanted in zip((published.pose, published.mean), expected, strict=False):
                np.testing.assert_allclose([got.x, got.y, got.yaw], wanted, atol=1e-9)
            np.testing.assert_allclose(published.covariance, expected[2], atol=1e-9)
        # A second laser sees the first half of the next way.
        pose = pose @ (Pose2(0.15, 0.02, 0.1) if laser is lasers[-1] else Pose2(0.02, 0.0, 0.01))
