"""A trace read while it is written: what it says is what the file will say."""

import numpy as np
import pytest

from daemon.model.sut import Progress
from daemon.trace import TraceError, TraceWriter, read_trace
from tests.engine.trace.recordings import (
    differing,
    record,
    record_until,
    same,
    scene,
    specification,
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


@pytest.mark.parametrize("at", [1.0, 2.6, 10.0, 11.5])
def test_a_look_in_between_sees_everything_until_then(tmp_path, at):
    _, (seen, end) = record_looking(tmp_path / "run.mcap", (at,))
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
