"""The file is what ROS tools expect, the same every time, and never half a file by its name."""

import hashlib
import json
import math
from collections import Counter
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from daemon.model.sut import Cloud, CostmapPicture, Estimate, Odometry, Progress
from daemon.trace import PARTIAL, TraceWriter, encode_path, read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot import Mount
from tests.engine.trace.mcap_checks import complaints
from tests.engine.trace.recordings import (
    GRID,
    ROBOT,
    odometry_at,
    pose_at,
    ranges_at,
    record,
    record_until,
    scene,
    specification,
    twist_at,
    writing,
)


def decoded(path):
    """All messages by the reference reader and decoder, checksums verified, in time order."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [
            (m.channel.topic, m.message.log_time / 1e9, m.decoded_message)
            for m in reader.iter_decoded_messages()
        ]


def on(path, topic):
    return [message for name, _, message in decoded(path) if name == topic]


def yaw(orientation):
    return 2.0 * math.atan2(orientation.z, orientation.w)


def test_rosbags_opens_the_file_as_a_ros2_bag(recorded):
    assert complaints(recorded) == []
    with AnyReader([recorded]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        found = Counter(connection.topic for connection, _, _ in reader.messages())
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            if stamp is not None:
                assert stamp.sec * 10**9 + stamp.nanosec == time
        latched = {
            c.topic
            for c in reader.connections
            if any(
                q.durability == QosDurability.TRANSIENT_LOCAL for q in c.ext.offered_qos_profiles
            )
        }
    assert counts == dict(found)
    assert latched == {
        "/map",
        "/footprint",
        "/scene",
        "/tf_static",
        "/mission/status",
        "/mission/goal",
    }


def shown(value, ids):
    """A decoded message in one line, without what is zero or empty; of long lists the ends."""
    if hasattr(value, "uuid"):
        return f"#{ids.setdefault(bytes(value.uuid), len(ids) + 1)}"
    if hasattr(value, "__slots__"):
        parts = [(name, shown(getattr(value, name), ids)) for name in value.__slots__]
        return f"({', '.join(f'{name} {text}' for name, text in parts if text)})".replace("()", "")
    if isinstance(value, (list, tuple, np.ndarray, bytes)):
        texts = [shown(item, ids) or "0" for item in value]
        if set(texts) <= {"0"}:
            return f"{len(texts)} × 0" if texts else ""
        ends = [*texts[:2], f"… {len(texts)} …", *texts[-4:]] if len(texts) > 8 else texts
        return f"[{' '.join(ends)}]"
    if isinstance(value, float):
        return f"{value:.6g}" if value else ""
    return str(value) if value else ""


def contents(path):
    """What the reference reader and decoder find in a file: of each topic the ends."""
    topics, ids = {}, {}
    for topic, time, message in decoded(path):
        topics.setdefault(topic, []).append((time, message))
    with path.open("rb") as stream:
        reader = make_reader(stream)
        header, statistics = reader.get_header(), reader.get_summary().statistics
        lines = [
            f"profile {header.profile}, library {header.library}",
            f"{statistics.message_count} messages",
            f"attachments {', '.join(a.name for a in reader.iter_attachments())}",
            f"metadata {', '.join(m.name for m in reader.iter_metadata())}",
        ]
    assert statistics.message_count == sum(map(len, topics.values()))
    for topic, messages in sorted(topics.items()):
        assert [time for time, _ in messages] == sorted(time for time, _ in messages)
        lines.append(f"== {topic}: {len(messages)}")
        for time, message in messages if len(messages) <= 4 else (messages[0], messages[-1]):
            lines.append(f"    {time:g} s {shown(message, ids)}".rstrip())
    return "\n".join([*lines, ""])


def test_the_reference_reader_finds_every_topic_as_viewers_expect_it(recorded, tmp_path, golden):
    golden("recorded.txt", contents(recorded))
    record_two_lasers(tmp_path / "run.mcap")
    golden("two_lasers.txt", contents(tmp_path / "run.mcap"))


@pytest.mark.parametrize(("steps", "chatter"), [(640, 0), (80, 32)])
def test_a_player_that_reads_a_pipe_gets_messages_in_order(tmp_path, steps, chatter):
    """Plans that wait, states that repeat and estimates that come late, over chunk boundaries,
    and beside a system that talks without end.
    """
    path, text = tmp_path / "run.mcap", "x" * 9_000
    with writing(path) as trace:
        trace.static(GRID)
        for step in range(steps):
            time = step / 20
            trace.clock(time)
            trace.ground_truth(time, pose_at(time), twist_at(time))
            trace.odometry(odometry_at(time))
            # Rests, but for a moment right before and after each ten seconds.
            trace.joints(time, np.full(3, 1.0 if time % 10 > 9.9 else 0.0), np.zeros(3))
            trace.plan(time, np.array([[0.0, 1.0], [time, 3.0]]))
            for _ in range(chatter):
                trace.event(time, "sut", text)
            if time >= 0.1:
                trace.estimate(Estimate(time - 0.1, pose_at(time), np.eye(3)))
    assert complaints(path) == []
    with path.open("rb") as stream:
        times = [r.log_time for r in StreamReader(stream).records if isinstance(r, Message)]
    assert len(times) > 2_900
    assert times == sorted(times)
    found = read_trace(path)
    assert (len(found.events), len(found.estimate.time)) == (steps * chatter, steps - 2)


def test_verdicts_lie_behind_the_recording_for_any_reader(tmp_path):
    world, path = scene(), tmp_path / "run.mcap"
    with TraceWriter(path, specification(world), world) as trace:
        record_until(trace, 3.0, 3)
        assert read_trace(trace.finish("finished")).complete
        assert not path.exists()
        trace.add_verdicts(b'{"outcome":"pass","verdicts":[]}')
        info = trace.publish()
    assert complaints(path) == []
    data = path.read_bytes()
    assert (info.sha256, info.size) == (hashlib.sha256(data).hexdigest(), len(data))
    assert info.messages == len(decoded(path))
    assert list(tmp_path.iterdir()) == [path]
    with path.open("rb") as stream:
        found = list(make_reader(stream, validate_crcs=True).iter_attachments())
    assert (found[-1].name, found[-1].media_type) == ("verdicts.json", "application/json")
    assert json.loads(found[-1].data) == {"outcome": "pass", "verdicts": []}
    assert read_trace(path).ended == "finished"


def test_transforms_put_the_estimate_where_the_estimator_said(recorded):
    frames = {}
    checked = 0
    for topic, time, message in decoded(recorded):
        if topic == "/tf":
            for item in message.transforms:
                t = item.transform
                pose = Pose2(t.translation.x, t.translation.y, yaw(t.rotation))
                frames[item.child_frame_id] = pose
        if {"odom", "base_link"} <= frames.keys() and topic == "/pose" and time > 0:
            pose = frames["odom"] @ odometry_at(time).pose
            assert pose.x == pytest.approx(message.pose.pose.position.x, abs=1e-9)
            assert pose.y == pytest.approx(message.pose.pose.position.y, abs=1e-9)
            checked += 1
    assert checked == 24
    assert frames.keys() == {"odom", "base_link", "door-0/leaf", "door-1/leaf"}
    assert frames["door-0/leaf"].yaw == pytest.approx(1.4)


def test_an_estimate_is_matched_with_the_odometry_of_its_own_time(tmp_path):
    with writing(tmp_path / "t.mcap") as trace:
        for time in (0.0, 0.1, 0.2):
            trace.odometry(Odometry(time, Pose2(time, 0.0, 0.0), Twist2()))
        trace.estimate(Estimate(0.1, Pose2(5.0, 1.0, 0.0), np.eye(3)))
    offsets = [
        (item.transform.translation.x, item.transform.translation.y)
        for message in on(tmp_path / "t.mcap", "/tf")
        for item in message.transforms
        if item.child_frame_id == "odom"
    ]
    assert offsets == [(1.0, 2.0), (pytest.approx(4.9), 1.0)]


def plans(path):
    """Time, number of points and x of the last point of every recorded plan."""
    return [
        (time, len(message.poses), message.poses[-1].pose.position.x)
        for topic, time, message in decoded(path)
        if topic == "/plan"
    ]


def test_a_goal_is_written_when_it_becomes_the_current_one(tmp_path):
    path = tmp_path / "run.mcap"
    with writing(path) as trace:
        for time, progress in enumerate([(0, 0), (1, 0), (1, 1), (1, 1), (2, 1)]):
            trace.progress(float(time), Progress(*progress, "active"))
    assert [time for topic, time, _ in decoded(path) if topic == "/mission/goal"] == [0.0, 1.0, 4.0]


def test_of_plans_that_change_all_the_time_the_latest_of_each_second_is_kept(tmp_path):
    path = tmp_path / "run.mcap"
    with writing(path) as trace:
        trace.static(GRID)
        for step in range(53):
            trace.clock(step / 10)
            if step % 2 == 0:
                trace.plan(step / 10, np.array([[0.0, 0.0], [step / 10, 1.0]]))
    expected = [0.0, 0.8, 1.8, 2.8, 3.8, 4.8, 5.2]
    assert [time for time, _, _ in plans(path)] == expected
    assert [x for _, _, x in plans(path)] == pytest.approx(expected, abs=1e-3)


def test_long_plans_are_thinned_between_their_ends(tmp_path):
    path = tmp_path / "run.mcap"
    points = np.stack([np.arange(2344) * 0.025, np.zeros(2344)], axis=1)
    with writing(path) as trace:
        trace.static(GRID)
        trace.plan(0.0, points)
    (message,) = on(path, "/plan")
    xs = [p.pose.position.x for p in message.poses]
    assert (xs[0], xs[-1]) == (0.0, pytest.approx(2343 * 0.025, abs=1e-3))
    assert max(np.diff(xs)) < 0.13
    assert 400 < len(xs) <= 501


def test_paths_of_any_length_are_written_as_one_by_one(tmp_path):
    path = tmp_path / "run.mcap"
    given = [np.arange(2.0 * n).reshape(n, 2) / 7 for n in (3, 0, 1, 12)]
    with writing(path) as trace:
        for step, points in enumerate(given):
            trace.local_plan(float(step), points)
            points *= 2.0  # it is the caller's again
    with path.open("rb") as stream:
        found = [m.data for _, c, m in make_reader(stream).iter_messages()]
    second = 1_000_000_000
    assert found == [encode_path(i * second, p / 2.0) for i, p in enumerate(given)]


def test_an_exception_leaves_a_readable_partial_file(tmp_path):
    def fail():
        with writing(tmp_path / "run.mcap") as trace:
            record_until(trace, 3.0, 3)
            raise RuntimeError("the engine broke")

    with pytest.raises(RuntimeError, match="the engine broke"):
        fail()
    assert [p.name for p in tmp_path.iterdir()] == ["run.mcap" + PARTIAL]
    trace = read_trace(tmp_path / ("run.mcap" + PARTIAL))
    assert (trace.complete, trace.ended, trace.valid_until) == (False, None, 3.0)
    assert trace.problems == ()


def test_a_new_writer_replaces_what_a_dead_one_left(tmp_path):
    (tmp_path / ("run.mcap" + PARTIAL)).write_bytes(b"rubbish")
    record(tmp_path / "run.mcap", seconds=1.0)
    assert read_trace(tmp_path / "run.mcap").complete


def test_two_writers_of_one_trace_do_not_pass_off_each_others_file(tmp_path):
    world = scene()
    path = tmp_path / "run.mcap"
    with (
        TraceWriter(path, specification(world), world) as first,
        TraceWriter(path, specification(world), world) as second,
    ):
        first.static(GRID)
        second.static(GRID)
        with pytest.raises(FileExistsError, match="another process"):
            first.close("limit")
        second.close("limit")
    assert read_trace(path).complete


def test_values_that_cannot_be_recorded_are_refused(tmp_path):
    flat = CostmapPicture(0.0, "map", 0.05, 0.0, 0.0, np.zeros(4, np.uint8))
    with writing(tmp_path / "run.mcap") as trace:
        for word, call, *values in (
            *(("time", trace.clock, time) for time in (-0.1, math.nan, math.inf, 2.0**31)),
            ("ranges", trace.scan, 0.0, np.zeros(7, np.float32)),
            ("ranges", trace.scan, 0.0, np.zeros(90)),
            ("joint states", trace.joints, 0.0, np.zeros(2), np.zeros(2)),
            ("covariance", trace.estimate, Estimate(0.0, Pose2(), np.zeros(9))),
            ("covariance", trace.cloud, Cloud(0.0, 1, Pose2(), np.zeros((6, 6)))),
            ("particles", trace.particles, 0.0, np.full((2, 3), math.nan)),
            ("costmap", trace.costmap, flat),
            ("level", partial(trace.event, level="loud"), 0.0, "a", "b"),
            ("mission", trace.progress, 0.0, Progress(0, 0, "lost")),
        ):
            with pytest.raises(ValueError, match=word):
                call(*values)
        for nothing in (None, "0.5"):
            with pytest.raises(TypeError):
                trace.command(0.0, Twist2(nothing, 0.0, 0.0))


def test_what_can_be_made_a_number_or_a_text_is(tmp_path):
    world = scene()
    with TraceWriter(tmp_path / "run.mcap", specification(world), world) as trace:
        trace.command(0.0, Twist2(np.float32(0.5), 1, 0.0))
        trace.event(0.0, "sut", "not text: \udc80")
        trace.event(0.0, "sut", "long" * 1_000_000)
        trace.close("limit", "\udcff")
    found = read_trace(tmp_path / "run.mcap")
    assert (found.command.vx.tolist(), found.command.vy.tolist()) == ([0.5], [1.0])
    assert [e.text[:17] for e in found.events] == ["not text: \\udc80", "longlonglonglongl"]
    assert len(found.events[1].text) == 10_000
    assert found.note == "\\udcff"


def test_a_scene_that_is_not_the_specified_one_is_refused(tmp_path):
    with pytest.raises(ValueError, match="specified"):
        TraceWriter(tmp_path / "run.mcap", specification(scene(1)), scene(2))
    assert list(tmp_path.iterdir()) == []


def test_a_world_without_objects_can_be_recorded(tmp_path):
    with writing(tmp_path / "run.mcap", scene(0)) as trace:
        trace.static(GRID)
        for step in range(10):
            trace.ground_truth(step / 20, pose_at(step / 20), twist_at(step / 20))
            trace.joints(step / 20, np.empty(0), np.empty(0))
    trace_read = read_trace(tmp_path / "run.mcap", scans=True)
    assert trace_read.problems == ()
    assert trace_read.joints.names == ()
    assert len(decoded(tmp_path / "run.mcap")) == 16


FRONT = replace(ROBOT.laser, name="front")
REAR = replace(ROBOT.laser, name="rear", mount=Mount(-0.2, 0.1, math.pi), z=0.4, rays=31)
TWO_LASERS = replace(ROBOT, laser=FRONT, other_lasers=(REAR,))


def record_two_lasers(path):
    with writing(path, robot=TWO_LASERS) as trace:
        trace.static(GRID)
        for step in range(30):
            now = step / 10
            trace.ground_truth(now, pose_at(now), twist_at(now))
            trace.scan(now, ranges_at(now), "front")
            if step % 2 == 0:
                trace.scan(now, np.full(31, 1.0 + now, np.float32), "rear")
        with pytest.raises(ValueError, match="box has no laser 'left'"):
            trace.scan(3.0, np.ones(31, np.float32), "left")
        with pytest.raises(ValueError, match=r"float32 of shape \(31,\)"):
            trace.scan(3.0, ranges_at(3.0), "rear")
