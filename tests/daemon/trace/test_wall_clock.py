"""A copy of a trace says when its run began."""

import numpy as np
from mcap.reader import make_reader

from daemon.trace import copy_with_wall_clock, read_trace
from tests.daemon.trace.mcap_checks import complaints

BEGUN = 1_760_000_000.25


def contents(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages()]


def metadata(path):
    with path.open("rb") as stream:
        return {each.name: each.metadata for each in make_reader(stream).iter_metadata()}


def test_a_copy_is_the_trace_and_when_it_was_recorded(recorded, tmp_path):
    copy = tmp_path / "deep" / "run.wall.mcap"
    copy_with_wall_clock(recorded, copy, BEGUN, worker="host-1")
    assert [path.name for path in copy.parent.iterdir()] == ["run.wall.mcap"]
    assert complaints(copy) == []
    assert contents(copy) == contents(recorded)
    assert metadata(copy) == {
        **metadata(recorded),
        "wall_clock": {
            "started": "2025-10-09T08:53:20.250+00:00",
            "started_ns": str(round(BEGUN * 1e9)),
            "worker": "host-1",
        },
    }
    one, other = read_trace(recorded), read_trace(copy)
    assert (other.spec, other.events, other.complete) == (one.spec, one.events, True)
    np.testing.assert_array_equal(other.ground_truth.x, one.ground_truth.x)
