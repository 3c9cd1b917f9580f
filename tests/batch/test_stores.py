"""Stores by URL: refusals, and traces that go there and come back."""

import os
import uuid

import pytest

from daemon.batch.errors import TraceUnavailable
from daemon.batch.stores import (
    TraceReference,
    check_store_url,
    copy_between,
    file_sha256,
    local_copy,
)


@pytest.fixture(params=["file", "memory"])
def store(request, tmp_path):
    if request.param == "file":
        return (tmp_path / "a store").as_uri()
    return f"memory://{uuid.uuid4().hex}/traces"


@pytest.mark.parametrize(
    ("url", "complaint"),
    [
        ("/mnt/traces", "is no store"),
        ("s4://bucket", "is no store"),
        ("file://host/traces", "no absolute path"),
        ("s3://key:secret@bucket/traces", "has credentials"),
        ("s3://bucket/traces?secret=1", "has credentials"),
    ],
)
def test_what_is_no_store_is_refused(url, complaint):
    with pytest.raises(ValueError, match=complaint) as caught:
        check_store_url(url)
    assert "secret" not in str(caught.value)


def test_usual_stores_are_taken():
    assert check_store_url("s3://bucket/traces/") == "s3://bucket/traces"
    assert check_store_url("file:///mnt/traces") == "file:///mnt/traces"
    assert check_store_url("sftp://me@host/traces") == "sftp://me@host/traces"


def test_a_trace_goes_there_and_back(store, tmp_path):
    source = tmp_path / "trace.mcap"
    source.write_bytes(os.urandom(1000))
    url = f"{store}/c/S1.pilot.0.mcap"
    copy_between(str(source), url)
    copy_between(str(source), url)  # twice is once
    trace = TraceReference("c.0", url, file_sha256(source), 1000)
    assert local_copy(trace, cache=tmp_path / "cache").read_bytes() == source.read_bytes()
    with pytest.raises(TraceUnavailable, match="cannot be used from here"):
        local_copy(TraceReference("c.0", f"{url}.other", "0" * 64, 1000), cache=tmp_path / "cache")


def test_a_store_without_its_library_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "s3fs", None)
    with pytest.raises(OSError, match="Install s3fs"):
        copy_between("s3://bucket/traces/t.mcap", str(tmp_path / "t.mcap"))


def test_a_damaged_trace_in_a_store_is_said_to_be(store, tmp_path):
    source = tmp_path / "trace.mcap"
    source.write_bytes(b"x" * 1000)
    copy_between(str(source), f"{store}/t.mcap")
    with pytest.raises(TraceUnavailable, match="not what was recorded"):
        local_copy(
            TraceReference("c.0", f"{store}/t.mcap", "0" * 64, 1000), cache=tmp_path / "cache"
        )


def test_a_trace_of_another_machine_needs_its_daemon(tmp_path):
    trace = TraceReference("c.0", "/nowhere/t.mcap", "0" * 64, 1000)
    with pytest.raises(TraceUnavailable, match="name its daemon with --connect"):
        local_copy(trace, cache=tmp_path)


def test_a_file_of_the_same_name_and_size_is_not_mistaken(tmp_path):
    there = tmp_path / "t.mcap"
    there.write_bytes(b"x" * 1000)
    with pytest.raises(TraceUnavailable):
        local_copy(TraceReference("c.0", str(there), "0" * 64, 1000), cache=tmp_path / "cache")


def test_the_cache_is_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr("daemon.batch.stores._LARGEST_CACHE", 2500)
    cache = tmp_path / "cache"
    for number in range(4):
        source = tmp_path / f"{number}.mcap"
        source.write_bytes(bytes([number]) * 1000)
        trace = TraceReference("c.0", source.as_uri(), file_sha256(source), 1000)
        os.utime(local_copy(trace, cache=cache), (number, number))
    assert sorted(path.read_bytes()[0] for path in cache.iterdir()) == [2, 3]
