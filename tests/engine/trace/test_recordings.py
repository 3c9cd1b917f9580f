"""Recordings read while they are written, compared, and what a stack reports in them."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.model import ros_messages as ros
from daemon.model.spec import SutReference
from daemon.model.stack_reports import REPORT_TOPICS, decode_tree_log, encode_tree_log
from daemon.model.sut import (
    BehaviorTreeLog,
    CollisionMonitorState,
    CostmapPicture,
    Progress,
    SpeedLimit,
    TreeChange,
)
from daemon.trace import TraceError, TraceWriter, first_difference, read_trace
from grammars.model.geometry import Pose2, Twist2
from tests.analysis.old_runs import WORLD, drive
from tests.analysis.old_runs import spec as short_spec
from tests.engine.trace.recordings import (
    differing,
    record,
    record_until,
    same,
    scene,
    specification,
    writing,
)


def record_looking(path, times):
    """Record as :func:`record` does, but read the trace again and again."""
    world, found, left = scene(), [], list(times)
    with TraceWriter(path, specification(world), world, versions={"numpy": "2"}) as trace:
        clock = trace.clock

        def look(time):
            while left and left[0] <= time:
                del left[0]
                found.append(trace.so_far())
            clock(time)

        trace.clock = look
        record_until(trace, 12.0, 3)
        trace.progress(12.0, Progress(3, 3, "succeeded"))
        trace.event(12.0, "run", "over", level="warn")
        found.append(trace.so_far("finished", "all waypoints reached"))
        return trace.close("finished", "all waypoints reached"), found


def test_the_last_look_says_what_the_file_says_and_changes_none_of_its_bytes(tmp_path):
    alone = record(tmp_path / "alone.mcap")
    watched, found = record_looking(tmp_path / "run.mcap", (0.0, 1.0, 2.6, 9.95, 10.0, 11.0))
    assert watched.sha256 == alone.sha256
    assert len(found) == 7
    assert found[-1].complete
    assert found[-1].ended == "finished"
    assert differing(found[-1], read_trace(tmp_path / "run.mcap")) == []


def test_a_look_in_between_sees_everything_until_then(tmp_path):
    looks = (1.0, 2.6, 10.0, 11.5)
    _, (*found, end) = record_looking(tmp_path / "run.mcap", looks)
    for at, seen in zip(looks, found, strict=True):
        assert not seen.complete
        assert seen.problems == ()
        for name in ("ground_truth", "odometry", "command", "estimate", "cloud"):
            track, whole = getattr(seen, name), getattr(end, name)
            assert track.time[-1] >= at - 0.55
            assert same(track.time, whole.time[: len(track.time)])
            values = "vx" if name == "command" else "x"
            assert same(getattr(track, values), getattr(whole, values)[: len(track.time)])
        assert seen.events == end.events[: len(seen.events)]
        moment = seen.ground_truth.time
        for column in range(3):
            ours, theirs = (
                np.interp(moment, track.time, track.position[:, column])
                for track in (seen.joints, end.joints)
            )
            assert np.array_equal(ours, theirs)


def test_what_another_has_written_there_is_refused(tmp_path):
    with TraceWriter(tmp_path / "run.mcap", specification(scene()), scene()) as trace:
        record_until(trace, 1.0, 3)
        (tmp_path / "run.mcap.partial").unlink()
        with pytest.raises(TraceError):
            trace.so_far()


def steps(path, *, turn_at=1e9, moved_at=1e9, silent_at=None, until=25.0):
    """Record a robot that is told to turn, or is elsewhere, from a moment on."""
    with TraceWriter(path, short_spec(), WORLD) as trace:
        for step in range(round(until * 20)):
            now = step * 0.05
            y = 2.0 if now >= moved_at else 1.0
            trace.ground_truth(now, Pose2(10.0, y), Twist2(0.5, 0.0, 0.0))
            trace.joints(now, np.array([0.4]), np.array([0.0]))
            if step != silent_at:
                trace.command(now, Twist2(0.5, 0.0, 0.1 if now >= turn_at else 0.0))
        trace.progress(until, Progress(1, 1, "succeeded"))
        trace.close("finished", "")
    return path


@pytest.mark.parametrize(
    ("changes", "topic", "time"),
    [
        *(({"turn_at": t, "moved_at": t + 1.0}, "/cmd_vel", t) for t in (0.0, 3.5, 12.0)),
        ({"silent_at": 70}, "/cmd_vel", 3.5),
        # Of one instant the cause.
        ({"turn_at": 2.0, "moved_at": 2.0}, "/ground_truth", 2.0),
        ({"until": 20.0}, "/ground_truth", 20.0),
    ],
)
def test_the_first_message_that_differs_or_is_missing_is_named(tmp_path, changes, topic, time):
    one, other = steps(tmp_path / "a.mcap"), steps(tmp_path / "b.mcap", **changes)
    for found in (first_difference(one, other), first_difference(other, one)):
        assert (found.topic, found.time) == (topic, pytest.approx(time))
        assert str(found) == f"on {topic} at {time:.2f} s"


def test_the_same_bytes_do_not_part(tmp_path):
    assert first_difference(steps(tmp_path / "a.mcap"), steps(tmp_path / "b.mcap")) is None


def test_what_differs_besides_the_messages_is_named(tmp_path):
    one = drive(tmp_path / "a.mcap", short_spec())
    other = drive(tmp_path / "b.mcap", replace(short_spec(), seed=99))
    found = first_difference(one, other)
    assert found.topic == "" or found.time >= 0.0
    damaged = tmp_path / "c.mcap"
    damaged.write_bytes(one.read_bytes().replace(b"scenario", b"Scenario", 1))
    assert "the messages" in str(first_difference(one, damaged))


def test_what_is_no_trace_is_refused(tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"nothing")
    with pytest.raises(TraceError, match="not an MCAP file"):
        first_difference(tmp_path / "a.mcap", drive(tmp_path / "b.mcap", short_spec()))


COSTS = np.array([[0, 1, 129], [253, 254, 255]], np.uint8)
LOG = BehaviorTreeLog(
    1.0,
    (
        TreeChange("FollowPath", 7, "IDLE", "RUNNING"),
        TreeChange("Goal", 65535, "SKIPPED", "SUCCESS"),
    ),
)
REPORTS = (
    LOG,
    CollisionMonitorState(1.5, "slowdown", "PolygonSlow"),
    SpeedLimit(2.0, 40.0, True),
)
COSTMAPS = (
    CostmapPicture(1.0, "odom", 0.05, -1.0, 2.0, COSTS),
    CostmapPicture(1.5, "map", 0.05, -1.0, 2.0, COSTS, "global"),
)


def asked(names):
    return SutReference("nav2", "ros2", {"repeatable": False, "record": list(names)})


def record_reports(path, reports, names, **changes):
    """Record ``reports`` of a system that is asked for those called ``names``."""
    with writing(path, sut=asked(names), **changes) as trace:
        for report in reports:
            trace.report(report)
    return path


def test_what_a_stack_reports_comes_back(tmp_path):
    path = record_reports(tmp_path / "run.mcap", (*REPORTS, *COSTMAPS), REPORT_TOPICS)
    assert read_trace(path).costmaps == ()
    trace = read_trace(path, views=True)
    assert trace.reports == REPORTS
    for found, expected in zip(trace.costmaps, COSTMAPS, strict=True):
        for name in ("time", "frame", "x", "y", "scope"):
            assert getattr(found, name) == getattr(expected, name)
        assert found.resolution == pytest.approx(0.05)
        # Costs of 1 to 252 are published as 1 to 98: the least that comes to the same is read.
        assert found.cells.tolist() == [[0, 1, 128], [253, 254, 255]]


def test_a_report_that_was_not_asked_for_is_refused(tmp_path):
    with pytest.raises(ValueError, match='does not ask to record "speed limit"'):
        record_reports(tmp_path / "run.mcap", REPORTS[2:], ["behavior tree"])


def test_large_costmaps_are_kept_less_often(tmp_path):
    """One of 2 MB in a run of 64 s: 64 MB hold 32 of them."""
    cells = np.zeros((1024, 2048), np.uint8)
    pictures = [CostmapPicture(t / 2, "map", 0.05, 0.0, 0.0, cells, "global") for t in range(17)]
    path = record_reports(tmp_path / "run.mcap", pictures, ["global costmap"], limit=64.0)
    assert [c.time for c in read_trace(path, views=True).costmaps] == [0.0, 2.5, 5.0, 7.5]


def test_logs_of_all_distributions_are_read():
    message = ros.deserialize(encode_tree_log(10**9 + 5, LOG), REPORT_TOPICS["behavior tree"][1])
    assert (message.timestamp.sec, message.timestamp.nanosec) == (1, 5)
    assert [event.uid for event in message.event_log] == [7, 65535]
    data = encode_tree_log(0, LOG)
    assert decode_tree_log(data, 1.0) == LOG
    old = bytearray(data[:16])
    for change in LOG.changes:
        old += bytes(-len(old) % 4 + 8)
        for text in (change.node, change.previous, change.current):
            old += bytes(-len(old) % 4)
            old += (len(text) + 1).to_bytes(4, "little") + text.encode() + b"\0"
    found = decode_tree_log(bytes(old), 1.0)
    assert found.changes == tuple(replace(change, uid=0) for change in LOG.changes)
    for size in range(0, len(data) - 4, 5):
        with pytest.raises(ValueError, match="not a log of a behaviour tree"):
            decode_tree_log(data[:size], 1.0)


def test_a_run_that_goes_on_is_judged_by_what_was_reported(tmp_path):
    with writing(tmp_path / "run.mcap", sut=asked(REPORT_TOPICS)) as trace:
        for count, report in enumerate(REPORTS, start=1):
            trace.report(report)
            assert trace.so_far().reports == REPORTS[:count]
        # The chunk of the first ten seconds is written now.
        trace.clock(12.0)
        assert trace.so_far().reports == REPORTS
