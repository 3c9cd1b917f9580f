"""A copy of a trace says when its run began, and can have all its stamps by that clock."""

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from daemon.trace import TraceError, copy_with_wall_clock, read_trace
from tests.daemon.trace.mcap_checks import complaints

BEGUN = 1_760_000_000.25
FIRST = round(BEGUN * 1e9)


def contents(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages()]


def metadata(path):
    with path.open("rb") as stream:
        return {each.name: each.metadata for each in make_reader(stream).iter_metadata()}


def stamps(message):
    """All times in a decoded message, in nanoseconds."""
    if hasattr(message, "nanosec") and "Time" in type(message).__name__:
        return [message.sec * 10**9 + message.nanosec]
    if isinstance(message, list | tuple):
        return [stamp for each in message for stamp in stamps(each)]
    names = getattr(message, "__slots__", ())
    return [stamp for name in names for stamp in stamps(getattr(message, name))]


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
            "started_ns": str(FIRST),
            "worker": "host-1",
            "stamps": "simulated",
        },
    }
    one, other = read_trace(recorded), read_trace(copy)
    assert (other.spec, other.events, other.complete) == (one.spec, one.events, True)
    np.testing.assert_array_equal(other.ground_truth.x, one.ground_truth.x)


def test_stamps_by_the_wall_clock_are_those_of_every_message(recorded, tmp_path):
    copy = tmp_path / "run.wall.mcap"
    copy_with_wall_clock(recorded, copy, BEGUN, stamps=True)
    assert complaints(copy) == []
    assert metadata(copy)["wall_clock"]["stamps"] == "wall clock"
    topics = []
    with recorded.open("rb") as before, copy.open("rb") as after:
        pairs = zip(
            make_reader(before, decoder_factories=[DecoderFactory()]).iter_decoded_messages(),
            make_reader(after, decoder_factories=[DecoderFactory()]).iter_decoded_messages(),
            strict=True,
        )
        for one, other in pairs:
            assert other.channel.topic == one.channel.topic
            assert other.message.log_time == one.message.log_time + FIRST
            assert other.message.publish_time == other.message.log_time
            there = stamps(one.decoded_message)
            assert stamps(other.decoded_message) == [stamp + FIRST for stamp in there]
            topics += [one.channel.topic] * bool(there)
    assert {"/tf", "/tf_static", "/odom", "/scan", "/plan", "/events", "/clock"} < set(topics)


def test_a_copy_with_other_stamps_is_not_judged(recorded, tmp_path):
    copy = tmp_path / "run.wall.mcap"
    copy_with_wall_clock(recorded, copy, BEGUN, stamps=True)
    with pytest.raises(TraceError, match="a copy for players"):
        read_trace(copy)
