"""What was recorded comes back; what cannot be trusted is said so, never half believed."""

import hashlib
import math
import os
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from daemon.model.spec import ENGINE_VERSION, SutReference
from daemon.model.sut import Cloud, Estimate, Odometry, Progress
from daemon.trace import (
    JointSamples,
    ProgressRecord,
    TraceError,
    TraceWriter,
    decode_path,
    encode_path,
    read_spec,
    read_trace,
)
from grammars.model.geometry import Pose2, Twist2
from grammars.text import codec
from grammars.text.diagnostics import InputError
from tests.engine.trace.recordings import (
    covariance_at,
    joints_at,
    odometry_at,
    pose_at,
    ranges_at,
    record,
    scene,
    specification,
    twist_at,
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


def test_joint_states_left_out_are_given_back_by_interpolation(recorded):
    joints = read_trace(recorded).joints
    assert len(joints.time) < 60
    every = np.arange(241) / 20
    for column in range(3):
        found = np.interp(every, joints.time, joints.position[:, column])
        expected = [joints_at(t, 3)[0][column] for t in every]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("parameters", "count"), [({}, 0), ({"repeatable": False}, 40)])
def test_only_a_system_that_is_not_repeatable_leaves_latencies(tmp_path, parameters, count):
    world, path = scene(), tmp_path / "run.mcap"
    spec = specification(world, sut=SutReference("mine", "mine", parameters))
    with TraceWriter(path, spec, world) as writer:
        for step in range(40):
            writer.ground_truth(step / 20, pose_at(step / 20), twist_at(step / 20))
            writer.latency(step / 20, 0.01)
        writer.close("limit")
    trace = read_trace(path)
    assert (trace.complete, len(trace.latency.time)) == (True, count)


@given(st.lists(st.sampled_from([0.0, 0.5, 1.0]), min_size=1, max_size=120))
def test_thinned_joint_states_interpolate_to_all_of_them(positions):
    samples = JointSamples(scene(1))
    for step, position in enumerate(positions):
        samples.add(step * 50_000_000, (np.array([position]), np.zeros(1)))
    samples.keep_last()
    times, columns = samples.drain()
    assert np.diff(times).max(initial=0) <= 1_000_000_000
    found = np.interp(np.arange(len(positions)) * 50_000_000, times, columns["position"][:, 0])
    np.testing.assert_array_equal(found, positions)


@given(st.lists(st.sampled_from([0.0, 0.5, 1.0]), min_size=1, max_size=120))
def test_joint_states_are_the_same_however_they_are_handed_over(positions):
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
    for found_times, found in others:
        np.testing.assert_array_equal(found_times, times)
        for name in ("position", "velocity"):
            np.testing.assert_array_equal(found[name], columns[name])


@given(st.floats(-math.pi, math.pi, exclude_min=True))
@RELAXED
def test_a_heading_comes_back_wrapped(tmp_path, yaw):
    trace = written(tmp_path, lambda w: w.ground_truth(0.0, Pose2(0.0, 0.0, yaw), Twist2()))
    found = trace.ground_truth.yaw[0]
    assert -math.pi < found <= math.pi
    assert math.remainder(found - yaw, math.tau) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    "progress",
    [
        Progress(0, 0, "active"),
        Progress(1, 1, "active"),
        Progress(2, 1, "active"),
        Progress(2, 2, "aborted"),
        Progress(3, 3, "active"),
        Progress(3, 3, "succeeded"),
        Progress(3, 3, "aborted"),
    ],
)
def test_progress_comes_back(tmp_path, progress):
    trace = written(tmp_path, lambda writer: writer.progress(0.0, progress))
    (found,) = trace.progress
    assert Progress(found.current, found.reached, found.state) == progress


def written(folder, fill):
    world = scene()
    path = folder / "run.mcap"
    with TraceWriter(path, specification(world), world) as writer:
        fill(writer)
        writer.close("limit")
    return read_trace(path)


def drive(writer, times, x=0.0):
    for time in times:
        writer.ground_truth(time, Pose2(x, 0.0, 0.0), Twist2())


@pytest.mark.parametrize(
    ("fill", "problem"),
    [
        (lambda w: w.event(1.0, "a", "b"), "there is no ground truth"),
        (lambda w: drive(w, [0.0, 0.4, 1.0]), "no ground truth from 0.4 s to 1 s"),
        (lambda w: drive(w, [0.6, 0.7]), "no ground truth from 0 s to 0.6 s"),
        (lambda w: (drive(w, [0.0]), w.clock(2.0)), "no ground truth from 0 s to 2 s"),
        (
            lambda w: drive(w, [0.0, 0.2, 0.1]),
            "the clock of the ground truth jumps back from 0.2 s to 0.1 s",
        ),
        (lambda w: drive(w, [0.0], math.nan), "the ground truth at 0 s is not a number"),
        (
            lambda w: w.ground_truth(0.0, Pose2(0.0, 0.0, math.inf), Twist2()),
            "the ground truth at 0 s is not a number",
        ),
        (
            lambda w: w.odometry(Odometry(0.0, Pose2(0.0, 0.0, math.inf), Twist2())),
            "the odometry at 0 s is not a number",
        ),
        (
            lambda w: (drive(w, [0.0]), w.joints(0.0, np.array([0, np.inf, 0]), np.zeros(3))),
            "the joint states at 0 s is not a number",
        ),
    ],
)
def test_a_doubtful_recording_says_what_is_wrong(tmp_path, fill, problem):
    assert problem in written(tmp_path, fill).problems


def test_what_cannot_be_a_number_is_doubtful_in_every_signal_that_is_judged(tmp_path):
    lost = Pose2(1.0, 2.0, math.inf)

    def fill(writer):
        drive(writer, [0.0])
        writer.estimate(Estimate(0.0, lost, np.eye(3)))
        writer.cloud(Cloud(0.0, 5, Pose2(), np.full((3, 3), np.nan)))
        writer.command(0.0, Twist2(math.nan, 0.0, 0.0))

    trace = written(tmp_path, fill)
    assert trace.problems == (
        "the command at 0 s is not a number",
        "the estimate at 0 s is not a number",
        "the particle cloud at 0 s is not a number",
    )
    assert np.isnan(trace.estimate.yaw).all()


def rewritten(source, target, **options):
    """The same messages in time order, by the mcap library: what other tools make of a trace."""
    with source.open("rb") as stream, target.open("wb") as out:
        reader = make_reader(stream)
        writer = Writer(out, **options)
        writer.start("ros2", "another tool")
        for attachment in reader.iter_attachments():
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        schemas = {}
        channels = {}
        for schema, channel, message in reader.iter_messages():
            if schema.name not in schemas:
                schemas[schema.name] = writer.register_schema(
                    schema.name, schema.encoding, schema.data
                )
            if channel.topic not in channels:
                channels[channel.topic] = writer.register_channel(
                    channel.topic, "cdr", schemas[schema.name]
                )
            writer.add_message(
                channels[channel.topic], message.log_time, message.data, message.publish_time
            )
        writer.finish()
    return target


@pytest.mark.parametrize(
    "options",
    [
        {"chunk_size": 50_000},
        {"compression": CompressionType.NONE},
        {"index_types": IndexType.NONE},
    ],
)
def test_a_trace_rewritten_by_other_tools_reads_the_same(recorded, tmp_path, options):
    one = read_trace(recorded, scans=True)
    other = read_trace(rewritten(recorded, tmp_path / "other.mcap", **options), scans=True)
    assert other.complete
    assert other.spec == one.spec
    assert (other.contacts, other.progress, other.events) == (
        one.contacts,
        one.progress,
        one.events,
    )
    np.testing.assert_array_equal(other.ground_truth.x, one.ground_truth.x)
    np.testing.assert_array_equal(other.joints.position, one.joints.position)
    np.testing.assert_array_equal(other.estimate.covariance, one.estimate.covariance)
    np.testing.assert_array_equal(other.scans[0].ranges, one.scans[0].ranges)


def test_plans_come_back_when_they_are_asked_for(recorded):
    assert read_trace(recorded).plans == ()
    plans = read_trace(recorded, views=True).plans
    assert [plan.time for plan in plans] == [0.0, *(float(t) for t in range(2, 13, 2))]
    for half, plan in enumerate(plans):
        np.testing.assert_array_equal(plan.points, [(0.0, 1.0), (2.0, 3.0), (half, 5.0)])


@pytest.mark.parametrize("count", [0, 1, 2, 57])
def test_paths_of_any_length_are_read_back(count):
    points = np.arange(2.0 * count).reshape(count, 2)
    payload = encode_path(3, points)
    np.testing.assert_array_equal(decode_path(payload), points)
    for wrong in (payload[:-1], payload + b"\0", b""):
        with pytest.raises(ValueError, match="another size"):
            decode_path(wrong)


def usable(path, data):
    """Read damaged bytes: a trace, or nothing but a :class:`TraceError`."""
    path.write_bytes(data)
    try:
        return read_trace(path, scans=True, views=True)
    except TraceError as error:
        assert str(path) in str(error)
        return None


@given(st.data())
@RELAXED
def test_a_file_cut_anywhere_yields_its_prefix_or_an_error(recorded, tmp_path, data):
    whole = recorded.read_bytes()
    at = data.draw(st.integers(0, len(whole) - 1))
    trace = usable(tmp_path / "cut.mcap", whole[:at])
    if trace is not None:
        assert not trace.complete
        assert trace.ended is None
        assert "cut" in trace.note or "missing" in trace.note
        n = len(trace.ground_truth.time)
        np.testing.assert_array_equal(trace.ground_truth.time, np.arange(n) / 20)
        assert n in (0, 176, 241)


@given(st.data())
@RELAXED
def test_damaged_bytes_never_escape_and_never_change_a_pose(recorded, tmp_path, data):
    damaged = bytearray(recorded.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] ^= data.draw(st.integers(1, 255))
    trace = usable(tmp_path / "damaged.mcap", bytes(damaged))
    if trace is not None:
        x = [pose_at(t).x for t in trace.ground_truth.time]
        np.testing.assert_array_equal(trace.ground_truth.x, x)


@pytest.fixture(scope="module")
def unprotected(recorded, tmp_path_factory):
    """A trace without compression and checksums: damage gets through to the messages."""
    path = tmp_path_factory.mktemp("unprotected") / "run.mcap"
    plain = {"compression": CompressionType.NONE, "enable_crcs": False}
    return rewritten(recorded, path, **plain).read_bytes()


@given(st.data())
@RELAXED
def test_damage_that_no_checksum_shows_never_escapes(unprotected, tmp_path, data):
    damaged = bytearray(unprotected)
    for _ in range(data.draw(st.integers(1, 20))):
        at = data.draw(st.integers(0, len(damaged) - 1))
        damaged[at] = data.draw(st.integers(0, 255))
    usable(tmp_path / "damaged.mcap", bytes(damaged))


@given(st.binary(max_size=300))
@example(b"")
@RELAXED
def test_foreign_bytes_are_an_error_that_names_the_file(tmp_path, data):
    for content in (data, b"\x89MCAP0\r\n" + data):
        assert usable(tmp_path / "foreign.mcap", content) is None


def test_errors_say_what_is_wrong_and_what_to_do(tmp_path):
    with pytest.raises(TraceError, match=r"missing\.mcap: cannot be read"):
        read_trace(tmp_path / "missing.mcap")
    (tmp_path / "empty.mcap").touch()
    with pytest.raises(TraceError, match="is empty"):
        read_trace(tmp_path / "empty.mcap")
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(TraceError, match="is not an MCAP file"):
        read_trace(tmp_path / "notes.txt")
    assert issubclass(TraceError, InputError)


def test_a_file_without_its_end_is_incomplete(recorded, tmp_path):
    trace = usable(tmp_path / "t.mcap", recorded.read_bytes()[:-3])
    assert not trace.complete
    assert "end of the file is missing" in trace.note


def mcap(*parts):
    return b"\x89MCAP0\r\n" + b"".join(parts)


def rec(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def chunk(data, *, size=None, method=b"zstd"):
    packed = zstandard.compress(data) if method == b"zstd" else data
    head = struct.pack("<QQQI", 0, 0, len(data) if size is None else size, zlib.crc32(data))
    named = struct.pack("<I", len(method)) + method
    return rec(6, head + named + struct.pack("<Q", len(packed)) + packed)


def prefix_of(path):
    """Everything of a trace before its first chunk."""
    data, at = path.read_bytes(), 8
    while data[at] != 6:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return data[:at]


def channel_records(topic, kind):
    def text(value):
        return struct.pack("<I", len(value)) + value.encode()

    schema = struct.pack("<H", 1) + text(kind) + text("ros2msg") + text("")
    channel = struct.pack("<HH", 1, 1) + text(topic) + text("cdr") + struct.pack("<I", 0)
    return rec(3, schema) + rec(4, channel)


def message(payload):
    return rec(5, struct.pack("<HIQQ", 1, 0, 0, 0) + payload)


HUGE = 0xFFFFFFFF
HOSTILE = {
    "a chunk that claims to be huge": chunk(b"x", size=1 << 60),
    "a chunk that grows": chunk(bytes(1 << 20), size=10),
    "an unknown compression": chunk(b"x", method=b"magic"),
    "a record longer than the chunk": chunk(struct.pack("<BQ", 5, 1 << 50)),
    "a message without a header": chunk(rec(5, b"\x01\x00")),
    "a message on no channel": chunk(message(b"abc")),
    "a channel of another type": chunk(channel_records("/odom", "std_msgs/msg/String")),
    "an attachment that claims to be huge": rec(9, struct.pack("<QQIIQ", 0, 0, 0, 0, 1 << 60)),
    "an attachment that claims to be endless": rec(9, bytes(24) + b"\xff" * 8),
    "metadata that claims to be huge": rec(12, struct.pack("<II", HUGE, HUGE)),
    "a record that claims to be huge": struct.pack("<BQ", 6, (1 << 64) - 1),
    "a short chunk": rec(6, b"abc"),
    "a chunk with a long name": rec(6, struct.pack("<QQQII", 0, 0, 1, 0, HUGE)),
    "a short index": chunk(b"") + rec(7, b"") + rec(15, b"\x00" * 4),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_records_end_the_readable_prefix(recorded, tmp_path, name):
    trace = usable(tmp_path / "hostile.mcap", prefix_of(recorded) + HOSTILE[name])
    if trace is not None:
        assert not trace.complete
        assert len(trace.ground_truth.time) == 0
    assert usable(tmp_path / "hostile.mcap", mcap(HOSTILE[name])) is None


@pytest.mark.parametrize(
    ("topic", "kind", "payload"),
    [
        ("/odom", "nav_msgs/msg/Odometry", b"short"),
        ("/contacts", "gazebo_msgs/msg/ContactsState", b"\x00\x01\x00\x00" + b"\xff" * 64),
        ("/contacts", "gazebo_msgs/msg/ContactsState", b""),
        ("/scan", "sensor_msgs/msg/LaserScan", b"\x00\x01\x00\x00" + b"\xff" * 64),
        ("/mission/status", "action_msgs/msg/GoalStatusArray", b"\x00\x01\x00\x00" + b"\xff" * 64),
        ("/mission/status", "action_msgs/msg/GoalStatusArray", b"\x00\x01\x00\x00" + bytes(4)),
        ("/events", "rcl_interfaces/msg/Log", b"\x00\x01\x00\x00" + b"\xff" * 64),
        ("/events", "rcl_interfaces/msg/Log", bytes(1 << 21)),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_hostile_messages_are_an_error(recorded, tmp_path, topic, kind, payload):
    body = chunk(channel_records(topic, kind) + message(payload))
    path = tmp_path / "hostile.mcap"
    path.write_bytes(prefix_of(recorded) + body)
    with pytest.raises(TraceError, match="damaged"):
        read_trace(path, scans=True)


@pytest.mark.parametrize(
    ("name", "limit", "words"),
    [
        ("STEP_LIMIT", 5, "more records than any run leaves"),
        ("TOTAL_LIMIT", 100_000, "MiB of messages"),
        ("FILE_LIMIT", 1000, "larger than"),
    ],
)
def test_files_and_contents_beyond_the_limits_are_refused(
    recorded, monkeypatch, name, limit, words
):
    # Files that really are too large would be of gigabytes: the limits are lowered instead.
    monkeypatch.setattr(f"daemon.trace._mcap_reader.{name}", limit)
    with pytest.raises(TraceError, match=words):
        read_trace(recorded)


def test_only_ordinary_files_are_read(tmp_path):
    """A pipe that nobody writes to never ends, nor does a device."""
    os.mkfifo(tmp_path / "pipe.mcap")
    for path in (tmp_path / "pipe.mcap", Path("/dev/zero"), tmp_path):
        with pytest.raises(TraceError, match="is no ordinary file"):
            read_trace(path)


def test_contacts_of_more_pairs_than_any_run_has_are_refused(recorded, tmp_path, monkeypatch):
    """A file of 50 kB with 30 000 pairs took 48 s to read."""
    monkeypatch.setattr("daemon.trace._mcap_reader.STEP_LIMIT", 1 << 16)
    with recorded.open("rb") as file:
        messages = make_reader(file).iter_messages(topics=["/contacts"])
        payload = next(message.data for _, _, message in messages)
    before, _, after = payload.partition(b"door-0/leaf")
    body = channel_records("/contacts", "gazebo_msgs/msg/ContactsState") + b"".join(
        message(before + b"%011d" % number + after) for number in range(500)
    )
    path = tmp_path / "hostile.mcap"
    path.write_bytes(prefix_of(recorded) + chunk(body))
    with pytest.raises(TraceError, match="more records than any run leaves"):
        read_trace(path)


def test_another_scene_or_another_specification_is_noticed(recorded, tmp_path):
    def attachment(name, data):
        named = struct.pack("<I", len(name)) + name.encode() + struct.pack("<I", 0)
        content = struct.pack("<QQ", 0, 0) + named + struct.pack("<Q", len(data)) + data
        return rec(9, content + bytes(4))

    path = tmp_path / "swapped.mcap"
    other = zstandard.compress(codec.to_json(scene(1)))
    path.write_bytes(prefix_of(recorded) + attachment("scene.json.zst", other))
    with pytest.raises(TraceError, match="not the one of the run"):
        read_trace(path)
    path.write_bytes(prefix_of(recorded) + attachment("scene.json.zst", b"rubbish"))
    with pytest.raises(TraceError, match="damaged"):
        read_trace(path)
    changed = codec.to_json(specification(scene(), seed=8))
    path.write_bytes(prefix_of(recorded) + attachment("spec.json", changed))
    with pytest.raises(TraceError, match="damaged"):
        read_trace(path)


def test_a_specification_of_another_version_is_an_error(tmp_path):
    path = tmp_path / "old.mcap"
    record(path, seconds=0.5)
    out = tmp_path / "new.mcap"
    with path.open("rb") as stream, out.open("wb") as target:
        reader = make_reader(stream)
        writer = Writer(target)
        writer.start("ros2")
        (spec, _) = list(reader.iter_attachments())
        data = spec.data.replace(b'"repeat":3', b'"again":3')
        writer.add_attachment(0, 0, "spec.json", "application/json", data)
        writer.add_metadata("run", {"digest": hashlib.sha256(data).hexdigest()})
        writer.finish()
    with pytest.raises(TraceError, match="another version"):
        read_trace(out)


def test_nothing_that_is_not_wanted_is_decompressed(recorded, monkeypatch):
    opened = []
    real = zstandard.ZstdDecompressor

    class Counting:
        """Counts what is decompressed."""

        def __init__(self):
            self._real = real()

        def stream_reader(self, data):
            opened.append(1)
            return self._real.stream_reader(data)

    monkeypatch.setattr(zstandard, "ZstdDecompressor", Counting)
    read_spec(recorded)
    assert opened == []


def test_an_index_that_leaves_messages_out_or_is_wrong_is_not_believed(recorded, tmp_path):
    whole, data = read_trace(recorded), bytearray(recorded.read_bytes())
    for wrong in (b"\x00" * 8, b"\xff" * 8, struct.pack("<q", 1 << 40)):
        at, changed = 8, bytearray(data)
        while changed[at] != 0x0F:
            (length,) = struct.unpack_from("<Q", changed, at + 1)
            if changed[at] == 7:
                changed[at + length + 1 : at + length + 9] = wrong
            at += 9 + length
        trace = usable(tmp_path / "wrong.mcap", bytes(changed))
        np.testing.assert_array_equal(trace.ground_truth.x, whole.ground_truth.x)
        assert trace.events == whole.events
        assert trace.contacts == whole.contacts
