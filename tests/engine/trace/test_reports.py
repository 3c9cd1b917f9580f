"""Reports of a navigation stack: recorded when asked for, read back, and kept within bounds."""

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
    SpeedLimit,
    TreeChange,
)
from daemon.trace import read_trace
from tests.engine.trace.recordings import writing

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


def record(path, reports, names, **changes):
    """Record ``reports`` of a system that is asked for those called ``names``."""
    with writing(path, sut=asked(names), **changes) as trace:
        for report in reports:
            trace.report(report)
    return path


def test_what_a_stack_reports_comes_back(tmp_path):
    path = record(tmp_path / "run.mcap", (*REPORTS, *COSTMAPS), REPORT_TOPICS)
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
        record(tmp_path / "run.mcap", REPORTS[2:], ["behavior tree"])


def test_large_costmaps_are_kept_less_often(tmp_path):
    """One of 2 MB in a run of 64 s: 64 MB hold 32 of them."""
    cells = np.zeros((1024, 2048), np.uint8)
    pictures = [CostmapPicture(t / 2, "map", 0.05, 0.0, 0.0, cells, "global") for t in range(17)]
    path = record(tmp_path / "run.mcap", pictures, ["global costmap"], limit=64.0)
    assert [c.time for c in read_trace(path, views=True).costmaps] == [0.0, 2.5, 5.0, 7.5]


def test_logs_of_distributions_without_uids_are_read():
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
        with pytest.raises(ValueError, match="no log of a behaviour tree"):
            decode_tree_log(data[:size], 1.0)


def test_the_log_is_what_rosbags_reads():
    message = ros.deserialize(
        encode_tree_log(1_500_000_000, LOG), REPORT_TOPICS["behavior tree"][1]
    )
    assert (message.timestamp.sec, message.timestamp.nanosec) == (1, 500_000_000)
    assert [event.uid for event in message.event_log] == [7, 65535]


def test_a_run_that_goes_on_is_judged_by_what_was_reported(tmp_path):
    with writing(tmp_path / "run.mcap", sut=asked(REPORT_TOPICS)) as trace:
        for count, report in enumerate(REPORTS, start=1):
            trace.report(report)
            assert trace.so_far().reports == REPORTS[:count]
        # The chunk of the first ten seconds is written now.
        trace.clock(12.0)
        assert trace.so_far().reports == REPORTS
