import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros1.amcl.particle_filter import summarise
from daemon.stacks.ros1.amcl.resampling import Particles, fill_bins, label_clusters, new_bins
from tests.stacks.ros1.amcl import plain


def labelled(poses):
    count = len(poses)
    bins = new_bins(count)
    fill_bins(bins, np.ascontiguousarray(poses.T), count)
    labels, stack = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
    clusters = label_clusters(bins, labels, stack)
    return bins, labels, clusters


def summarised(poses, weights):
    bins, labels, clusters = labelled(poses)
    columns = np.ascontiguousarray(poses.T)
    directions = np.array([np.cos(columns[2]), np.sin(columns[2])])
    result = np.empty(10)
    cloud = Particles(columns, directions, weights)
    summarise(cloud, len(poses), bins, labels, clusters, np.empty((len(poses), 5)), result)
    return result


def a_cloud(count, spread, seed):
    random = np.random.default_rng(seed)
    centres = random.uniform(-4.0, 4.0, (3, 3))
    return centres[random.integers(3, size=count)] + spread * random.standard_normal((count, 3))


@given(count=st.integers(1, 200), spread=st.floats(0.01, 2.0), seed=st.integers(0, 2**32 - 1))
def test_clusters_are_those_of_a_flood_over_neighbouring_bins(count, spread, seed):
    poses = a_cloud(count, spread, seed)
    bins, labels, clusters = labelled(poses)
    expected = plain.clusters(poses)
    assert labels[bins.of].tolist() == expected
    assert clusters == max(expected) + 1


@given(count=st.integers(1, 200), spread=st.floats(0.01, 1.0), seed=st.integers(0, 2**32 - 1))
def test_estimate_and_spread_are_those_of_numpy(count, spread, seed):
    poses = a_cloud(count, spread, seed)
    weights = np.random.default_rng(seed).random(count) + 0.01
    weights /= weights.sum()
    result = summarised(poses, weights)
    pose, mean, covariance = plain.summary(poses, weights)
    np.testing.assert_allclose(result[:3], pose, atol=1e-9)
    np.testing.assert_allclose(result[3:6], mean, atol=1e-9)
    xx, xy, yy, yaw = result[6:]
    np.testing.assert_allclose([[xx, xy], [xy, yy]], covariance[:2, :2], atol=1e-10)
    np.testing.assert_allclose(yaw, covariance[2, 2], atol=1e-10)


def test_the_heaviest_cluster_counts_not_the_largest():
    poses = np.array([[0.1, 0.1, 0.1]] * 5 + [[3.0, 0.1, 0.1]] * 2)
    result = summarised(poses, np.array([0.05] * 5 + [0.375] * 2))
    np.testing.assert_allclose(result[:3], [3.0, 0.1, 0.1])
    np.testing.assert_allclose(result[3], 0.25 * 0.1 + 0.75 * 3.0)


def test_equal_headings_have_no_variance_and_opposite_ones_a_mean_across_the_seam():
    same = summarised(np.full((7, 3), 0.7), np.full(7, 1.0 / 7.0))
    assert 0.0 <= same[9] < 1e-12
    seam = np.array([[0.0, 0.0, 3.1], [0.0, 0.0, 3.1 - 2.0 * np.pi + 0.1]])
    across = summarised(seam, np.array([0.5, 0.5]))
    assert abs(across[5]) > 3.0
