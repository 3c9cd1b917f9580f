"""What was recorded comes back; what cannot be trusted is said so, never half believed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap.writer import CompressionType, IndexType

from daemon.model.spec import ENGINE_VERSION
from daemon.model.sut import Cloud, Estimate, Odometry, Progress
from daemon.trace import (
    JointSamples,
    MovingLinks,
    ProgressRecord,
    read_trace,
)
from grammars.model.geometry import Pose2, Twist2
from grammars.model.kinematics import cos_sin, link_tracks
from grammars.model.scene import Joint, Link, Scene, SceneObject
from tests.engine.trace.recordings import (
    covariance_at,
    differing,
    joints_at,
    odometry_at,
    pose_at,
    ranges_at,
    rewritten,
    scene,
    specification,
    twist_at,
    writing,
)

RELAXED = settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


def test_every_signal_comes_back_as_it_was_recorded(recorded):
    trace = read_trace(recorded, scans=True)
    time = trace.ground_truth.time
    np.testing.assert_array_equal(time, np.arange(241) / 20)
    for track, pose in (
        (trace.ground_truth, pose_at),
        (trace.odometry, lambda t: odometry_at(t).pose),
    ):
        poses = [pose(t) for t in time]
        np.testing.assert_array_equal(track.x, [p.x for p in poses])
        np.testing.assert_array_equal(track.y, [p.y for p in poses])
        np.testing.assert_allclose(track.yaw, [p.yaw for p in poses], rtol=0, atol=1e-15)
        twists = [twist_at(t) for t in time]
        np.testing.assert_array_equal(track.vx, [t.vx for t in twists])
        np.testing.assert_array_equal(track.vy, [t.vy for t in twists])
        np.testing.assert_array_equal(track.wz, [t.wz for t in twists])
    np.testing.assert_array_equal(trace.command.wz, [twist_at(t).wz for t in trace.command.time])
    for beliefs in (trace.estimate, trace.cloud):
        np.testing.assert_array_equal(beliefs.time, np.arange(25) / 2)
        np.testing.assert_array_equal(beliefs.covariance, [covariance_at(t) for t in beliefs.time])
        np.testing.assert_array_equal(beliefs.x, [pose_at(t).x for t in beliefs.time])
    np.testing.assert_array_equal(trace.cloud_count, 500 + np.arange(25) * 10)
    # Joint states that were left out lie between others.
    assert len(trace.joints.time) < 60
    found = [np.interp(time, trace.joints.time, column) for column in trace.joints.position.T]
    np.testing.assert_allclose(
        np.transpose(found), [joints_at(t, 3)[0] for t in time], rtol=0, atol=1e-12
    )
    (scans,) = trace.scans
    np.testing.assert_array_equal(scans.ranges, [ranges_at(t) for t in scans.time])
    assert (scans.ranges.dtype, scans.laser) == (np.float32, "")


def test_records_come_back_in_the_order_of_their_times(recorded):
    trace = read_trace(recorded)
    assert [(c.second, c.point, c.normal, c.depth) for c in trace.contacts] == [
        ("door-0/leaf", (1.0, 2.0), (0.0, -1.0), 0.003),
        ("door-0/leaf", (1.1, 2.1), (0.6, 0.8), 0.002),
        ("hall-wall-0", (4.0, 5.0), (1.0, 0.0), 0.001),
    ]
    assert trace.progress == (
        ProgressRecord(0.0, 0, 0, "active"),
        ProgressRecord(2.0, 1, 1, "active"),
        ProgressRecord(4.0, 2, 2, "active"),
        ProgressRecord(12.0, 3, 3, "succeeded"),
    )
    assert [(e.time, e.source, e.text) for e in trace.events[:2]] == [
        (0.0, "sut", "second 0 – ok"),
        (1.0, "sut", "second 1 – ok"),
    ]
    assert trace.events[-1].level == "warn"


def test_a_trace_says_what_was_run_and_how_it_ended(recorded):
    trace = read_trace(recorded)
    assert trace.scene == scene()
    assert trace.spec == specification(scene())
    assert (trace.ended, trace.note, trace.complete) == ("finished", "all waypoints reached", True)
    assert trace.valid_until == 12.0
    assert trace.problems == ()
    assert trace.versions == {"engine": ENGINE_VERSION, "numpy": "2"}
    assert trace.scans is None


@given(st.lists(st.sampled_from([0.0, 0.5, 1.0]), min_size=1, max_size=120))
def test_thinned_joint_states_interpolate_to_all_however_they_are_handed_over(positions):
    fresh, changed, kept = (JointSamples(scene(1)) for _ in range(3))
    velocity = np.zeros(1)
    buffer, arrays = np.zeros(1), {position: np.array([position]) for position in positions}
    for array in (velocity, *arrays.values()):
        array.flags.writeable = False
    for step, position in enumerate(positions):
        time = step * 50_000_000
        fresh.add(time, (np.array([position]), np.zeros(1)))
        buffer[:] = position
        changed.add(time, (buffer, velocity))
        kept.add(time, (arrays[position], velocity))
    for samples in (fresh, changed, kept):
        samples.keep_last()
    (times, columns), *others = (samples.drain() for samples in (fresh, changed, kept))
    assert np.diff(times).max(initial=0) <= 1_000_000_000
    found = np.interp(np.arange(len(positions)) * 50_000_000, times, columns["position"][:, 0])
    np.testing.assert_array_equal(found, positions)
    for found_times, found in others:
        np.testing.assert_array_equal(found_times, times)
        for name in ("position", "velocity"):
            np.testing.assert_array_equal(found[name], columns[name])


@given(st.lists(st.floats(-math.pi, math.pi, exclude_min=True), min_size=1, max_size=50))
@settings(RELAXED, max_examples=settings().max_examples // 5)
def test_a_heading_comes_back_wrapped(tmp_path, yaws):
    def fill(writer):
        for time, yaw in enumerate(yaws):
            writer.ground_truth(float(time), Pose2(0.0, 0.0, yaw), Twist2())

    for yaw, found in zip(yaws, written(tmp_path, fill).ground_truth.yaw, strict=True):
        assert -math.pi < found <= math.pi
        assert math.remainder(found - yaw, math.tau) == pytest.approx(0.0, abs=1e-15)


def test_progress_comes_back(tmp_path):
    told = [
        *(Progress(n, n, "active") for n in (0, 1, 3)),
        Progress(2, 1, "active"),
        Progress(2, 2, "aborted"),
        Progress(3, 3, "succeeded"),
        Progress(3, 3, "aborted"),
    ]

    def fill(writer):
        for time, progress in enumerate(told):
            writer.progress(float(time), progress)

    found = written(tmp_path, fill).progress
    assert [Progress(one.current, one.reached, one.state) for one in found] == told


def written(folder, fill):
    with writing(folder / "run.mcap") as writer:
        fill(writer)
    return read_trace(folder / "run.mcap")


def drive(writer, times, x=0.0):
    for time in times:
        writer.ground_truth(time, Pose2(x, 0.0, 0.0), Twist2())


LOST = Pose2(1.0, 2.0, math.inf)
DOUBTFUL = {
    "there is no ground truth": lambda w: w.event(1.0, "a", "b"),
    "no ground truth from 0.4 s to 1 s": lambda w: drive(w, [0.0, 0.4, 1.0]),
    "no ground truth from 0 s to 0.6 s": lambda w: drive(w, [0.6, 0.7]),
    "no ground truth from 0 s to 2 s": lambda w: (drive(w, [0.0]), w.clock(2.0)),
    "the clock of the ground truth jumps back from 0.2 s to 0.1 s": (
        lambda w: drive(w, [0.0, 0.2, 0.1])
    ),
    "the ground truth at 0 s is not a number": lambda w: drive(w, [0.0], math.nan),
    "the ground truth at 0.0 s is not a number": lambda w: w.ground_truth(0.0, LOST, Twist2()),
    "the odometry at 0 s is not a number": lambda w: w.odometry(Odometry(0.0, LOST, Twist2())),
    "the joint states at 0 s is not a number": (
        lambda w: w.joints(0.0, np.array([0, np.inf, 0]), np.zeros(3))
    ),
    "the command at 0 s is not a number": lambda w: w.command(0.0, Twist2(math.nan, 0.0, 0.0)),
    "the estimate at 0 s is not a number": lambda w: w.estimate(Estimate(0.0, LOST, np.eye(3))),
    "the particle cloud at 0 s is not a number": (
        lambda w: w.cloud(Cloud(0.0, 5, Pose2(), np.full((3, 3), np.nan)))
    ),
}


@pytest.mark.parametrize("problem", DOUBTFUL)
def test_a_doubtful_recording_says_what_is_wrong(tmp_path, problem):
    doubted = written(tmp_path, DOUBTFUL[problem]).problems
    assert set(doubted) - {"there is no ground truth"} <= {problem.replace("0.0 s", "0 s")}
    assert doubted


@pytest.mark.parametrize(
    "options",
    [
        {"chunk_size": 50_000},
        {"compression": CompressionType.NONE},
        {"compression": CompressionType.LZ4},
        {"use_chunking": False},
        {"index_types": IndexType.NONE},
    ],
)
def test_a_trace_rewritten_by_other_tools_reads_the_same(recorded, tmp_path, options):
    one = read_trace(recorded, scans=True)
    other = read_trace(rewritten(recorded, tmp_path / "other.mcap", **options), scans=True)
    assert other.complete
    assert differing(one, other) == []


def test_plans_come_back_when_they_are_asked_for(recorded):
    assert read_trace(recorded).plans == ()
    plans = read_trace(recorded, views=True).plans
    assert [plan.time for plan in plans] == [0.0, *(float(t) for t in range(2, 13, 2))]
    for half, plan in enumerate(plans):
        np.testing.assert_array_equal(plan.points, [(0.0, 1.0), (2.0, 3.0), (half, 5.0)])


# Poses of links that joints move.


def object_with(*joints):
    ring = ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1))
    links = tuple(Link(j.child, (ring,), 1.0, 0.0, 1.0) for j in joints)
    return SceneObject("item", "thing", Pose2(2.0, -1.0, 0.7), links, joints, (0.0,) * len(joints))


@given(
    arrays(
        np.float64,
        st.tuples(st.integers(0, 6), st.just(5)),
        elements=st.sampled_from([0.0, -0.0, 0.7, 1.1, 1e300, math.inf, -math.inf, math.nan]),
    )
)
@np.errstate(invalid="ignore")
def test_poses_have_the_bits_of_a_plain_calculation(positions):
    hinge = Joint("a", "revolute", "world", "leaf", (0.1, -0.3), (1.0, 0.0), -3.0, 3.0)
    slide = Joint("s", "prismatic", "world", "wing", (0.0, 0.0), (0.6, 0.8), -2.0, 2.0)
    lid = Joint("b", "revolute", "wing", "lid", (1.0, 0.2), (1.0, 0.0), -3.0, 3.0)
    posted = replace(hinge, parent="post")
    post = Link("post", (((0.0, 0.0), (0.1, 0.0), (0.1, 0.1)),), 0.0, 0.0, 1.0)
    on_post = object_with(posted)
    items = (
        # Its column is skipped over.
        replace(object_with(hinge), name="frozen", frozen=True),
        replace(on_post, links=(post, *on_post.links)),
        replace(object_with(slide, lid), name="drawer"),
        replace(object_with(hinge), name="other", pose=Pose2(-1.0, 4.0, -0.0)),
    )
    poses = MovingLinks.of(Scene("world", (), (), (), items)).poses(positions)
    tracks = [
        track
        for item, columns in zip(items[1:], ([1], [2, 3], [4]), strict=True)
        for link, track in link_tracks(item, positions[:, columns]).items()
        if link != "post"
    ]
    for i, track in enumerate(tracks):
        cosine, sine = cos_sin(track[:, 2] / 2)
        expected = np.column_stack((track[:, 0], track[:, 1], sine, cosine))
        assert poses[:, i].tobytes() == expected.tobytes()


def test_only_links_that_joints_move_are_listed_and_frozen_objects_are_not():
    assert MovingLinks.of(scene()).names == ("door-0/leaf", "door-1/leaf")
