"""Where two recordings part."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.model.sut import Progress
from daemon.trace import TraceError, TraceWriter, first_difference
from grammars.model.geometry import Pose2, Twist2
from tests.analysis.old_runs import WORLD, drive, spec


def steps(path, *, turn_at=1e9, moved_at=1e9, silent_at=None, until=25.0):
    """Record a robot that is told to turn, or is elsewhere, from a moment on."""
    with TraceWriter(path, spec(), WORLD) as trace:
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
    one = drive(tmp_path / "a.mcap", spec())
    other = drive(tmp_path / "b.mcap", replace(spec(), seed=99))
    found = first_difference(one, other)
    assert found.topic == "" or found.time >= 0.0
    damaged = tmp_path / "c.mcap"
    damaged.write_bytes(one.read_bytes().replace(b"scenario", b"Scenario", 1))
    assert "the messages" in str(first_difference(one, damaged))


def test_what_is_no_trace_is_refused(tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"nothing")
    with pytest.raises(TraceError, match="not an MCAP file"):
        first_difference(tmp_path / "a.mcap", drive(tmp_path / "b.mcap", spec()))
