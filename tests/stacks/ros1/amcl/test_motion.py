import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.amcl.motion_model import motion_between, move_particles
from daemon.stacks.ros1.amcl.resampling import Particles
from grammars.model.geometry import Pose2
from tests.stacks.ros1.amcl.plain import moved
from tests.stacks.ros1.amcl.world import PUBLISHED

MODELS = ("diff", "omni", "diff-corrected", "omni-corrected")


def compiled(
    p, poses, before, after, normals,
    *, full_turns=True):  # fmt: skip
    columns = np.ascontiguousarray(poses.T)
    directions = np.array([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    move_particles(
        p, motion_between(before, after), Particles(columns, directions, np.ones(len(poses))),
        len(poses), normals.ravel(), full_turns=full_turns,
    )  # fmt: skip
    np.testing.assert_array_equal(directions, [np.cos(columns[2]), np.sin(columns[2])])
    return columns.T


def spread(model, **alphas):
    """Standard deviation of x, y, yaw after 0.1 m straight ahead, from one point."""
    p = replace(PUBLISHED, odom_model_type=model, **alphas)
    poses = np.zeros((20_000, 3))
    normals = np.random.default_rng(3).standard_normal((3, len(poses)))
    after = compiled(p, poses, Pose2(2.0, 1.0, 0.7), Pose2(2.0, 1.0, 0.7) @ Pose2(0.1), normals)
    np.testing.assert_allclose(after.mean(axis=0), [0.1, 0.0, 0.0], atol=2e-3)
    return after.std(axis=0)


def test_spreads_of_a_straight_step_are_those_the_original_shows():
    np.testing.assert_allclose(spread("omni-corrected"), [0.032, 0.045, 0.032], rtol=0.03)
    np.testing.assert_allclose(spread("diff-corrected"), [0.032, 0.003, 0.045], rtol=0.1)


def test_models_not_corrected_take_variances_for_standard_deviations():
    np.testing.assert_allclose(spread("omni"), [0.001, 0.002, 0.001], rtol=0.03)
    np.testing.assert_allclose(spread("diff")[[0, 2]], [0.001, 0.001 * math.sqrt(2.0)], rtol=0.03)


@given(
    model=st.sampled_from(MODELS),
    x=st.floats(-0.4, 0.4),
    y=st.floats(-0.4, 0.4),
    before=st.floats(-3.1, 3.1),
    after=st.floats(-3.1, 3.1),
    seed=st.integers(0, 1000),
)
def test_particles_move_as_in_the_plain_version(model, x, y, before, after, seed):
    random = np.random.default_rng(seed)
    p = replace(PUBLISHED, odom_model_type=model, odom_alpha1=0.11, odom_alpha3=0.3)
    poses = random.uniform(-5.0, 5.0, (50, 3))
    normals = random.standard_normal((3, 50))
    start, end = Pose2(1.0, 2.0, before), Pose2(1.0 + x, 2.0 + y, after)
    got, wanted = compiled(p, poses, start, end, normals), moved(p, poses, start, end, normals)
    np.testing.assert_allclose(got[:, :2], wanted[:, :2], atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * got[:, 2]), np.exp(1j * wanted[:, 2]), atol=1e-9)


@pytest.mark.parametrize("model", ["diff-corrected", "omni-corrected"])
def test_without_noise_particles_follow_odometry(model):
    odom = Pose2(3.0, 4.0, 2.9)
    step = Pose2(-0.2, 0.1, 0.5)
    particle = Pose2(-1.0, 2.0, -1.2)
    poses = np.array([[particle.x, particle.y, particle.yaw]])
    p = replace(PUBLISHED, odom_model_type=model)
    after = compiled(p, poses, odom, odom @ step, np.zeros((3, 1)))[0]
    expected = particle @ step
    np.testing.assert_allclose(after, [expected.x, expected.y, expected.yaw], atol=1e-12)


def test_turning_on_the_spot_gives_a_differential_robot_no_sideways_spread():
    p = replace(PUBLISHED, odom_model_type="diff-corrected", odom_alpha4=0.0)
    normals = np.random.default_rng(0).standard_normal((3, 1000))
    after = compiled(p, np.zeros((1000, 3)), Pose2(), Pose2(0.0, 0.0, 0.5), normals)
    assert np.abs(after[:, :2]).max() == 0.0
    assert after[:, 2].std() == pytest.approx(math.sqrt(0.1) * 0.5, rel=0.1)


def test_driving_backwards_spreads_as_driving_forwards():
    p = replace(PUBLISHED, odom_model_type="diff-corrected")
    normals = np.random.default_rng(0).standard_normal((3, 4000))
    ahead, back = (
        compiled(p, np.zeros((4000, 3)), Pose2(), Pose2(x), normals) for x in (0.3, -0.3)
    )
    np.testing.assert_allclose(ahead.std(axis=0)[:2], back.std(axis=0)[:2], rtol=0.05)
    near = np.angle(np.exp(1j * back[:, 2]))
    assert near.std() == pytest.approx(ahead[:, 2].std(), rel=0.05)


def test_driving_backwards_leaves_headings_a_full_turn_apart():
    """Two half turns add up to nothing or to a full turn, and nobody wraps them: an oddity."""
    p = replace(PUBLISHED, odom_model_type="diff-corrected")
    normals = np.random.default_rng(0).standard_normal((3, 400))
    back = compiled(p, np.zeros((400, 3)), Pose2(), Pose2(-0.3), normals)
    assert set(np.round(back[:, 2] / math.tau)) == {-1.0, 0.0, 1.0}
    fixed = compiled(p, np.zeros((400, 3)), Pose2(), Pose2(-0.3), normals, full_turns=False)
    np.testing.assert_array_equal(fixed[:, :2], back[:, :2])
    assert set(np.round(fixed[:, 2] / math.tau)) == {0.0}
