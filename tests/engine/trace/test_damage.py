"""What cannot be trusted is said so, never half believed: cut, damaged and hostile files."""

import hashlib
import os
import re
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType

from daemon.trace import TraceError, read_trace
from grammars.text import codec
from tests.engine.trace.recordings import pose_at, rewritten, scene, specification

RELAXED = settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


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


def text(value):
    return struct.pack("<I", len(value)) + value.encode()


def channel_records(topic, kind):
    schema = struct.pack("<H", 1) + text(kind) + text("ros2msg") + text("")
    channel = struct.pack("<HH", 1, 1) + text(topic) + text("cdr") + struct.pack("<I", 0)
    return rec(3, schema) + rec(4, channel)


def message(payload):
    return rec(5, struct.pack("<HIQQ", 1, 0, 0, 0) + payload)


def attachment(name, data):
    content = struct.pack("<QQ", 0, 0) + text(name) + text("") + struct.pack("<Q", len(data)) + data
    return rec(9, content + bytes(4))


def on(topic, kind, payload):
    return chunk(channel_records(topic, kind) + message(payload))


def run_of(spec):
    """A run with this specification, as far as a file says so."""
    digest = text("digest") + text(hashlib.sha256(spec).hexdigest())
    metadata = text("run") + struct.pack("<I", len(digest)) + digest
    return attachment("spec.json", spec) + rec(12, metadata)


HUGE, GARBAGE = 0xFFFFFFFF, b"\x00\x01\x00\x00" + b"\xff" * 64
CONTACTS = "/contacts", "gazebo_msgs/msg/ContactsState"
STATUS = "/mission/status", "action_msgs/msg/GoalStatusArray"
LOG = "/events", "rcl_interfaces/msg/Log"
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
    "a short message": on("/odom", "nav_msgs/msg/Odometry", b"short"),
    "contacts of nothing": on(*CONTACTS, b""),
    "contacts of garbage": on(*CONTACTS, GARBAGE),
    "a scan of garbage": on("/scan", "sensor_msgs/msg/LaserScan", GARBAGE),
    "a status of garbage": on(*STATUS, GARBAGE),
    "a status of nothing": on(*STATUS, b"\x00\x01\x00\x00" + bytes(4)),
    "a log of garbage": on(*LOG, GARBAGE),
    "a long log": on(*LOG, bytes(1 << 21)),
    "another scene": attachment("scene.json.zst", zstandard.compress(codec.to_json(scene(1)))),
    "a scene of garbage": attachment("scene.json.zst", b"rubbish"),
    "another version": run_of(
        codec.to_json(specification(scene())).replace(b'"repeat":3', b'"again":3')
    ),
    "another specification": attachment(
        "spec.json", codec.to_json(specification(scene(), seed=8))
    ),
}  # fmt: skip


def test_hostile_records_are_an_error_or_end_the_readable_prefix(recorded, tmp_path, golden):
    path, prefix = tmp_path / "run.mcap", prefix_of(recorded)
    files = {name: prefix + record for name, record in HOSTILE.items()}
    files |= {f"{name}, alone": mcap(record) for name, record in HOSTILE.items()}
    files |= {"no end": recorded.read_bytes()[:-3], "empty": b"", "a text": b"hello"}
    lines = []
    for name, data in files.items():
        path.write_bytes(data)
        try:
            trace = read_trace(path, scans=True, views=True)
            assert not trace.complete
            lines.append(f"{name}: {len(trace.ground_truth.time)} poses, {trace.note}")
        except TraceError as error:
            lines.append(f"{name}: {error}".replace(f"{tmp_path}/", ""))
    golden("hostile.txt", re.sub(r"byte \d+ of \d+", "byte …", "\n".join([*lines, ""])))
    with pytest.raises(TraceError, match=r"missing\.mcap: cannot be read"):
        read_trace(tmp_path / "missing.mcap")


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
        with pytest.raises(TraceError, match="is not an ordinary file"):
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
