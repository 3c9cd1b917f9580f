"""Files by digest: those of systems under test, and traces, here, in caches and in stores."""

import hashlib
import os
import sys
import uuid
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from daemon.batch.errors import TraceUnavailable, WorkerBroken
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server._housekeeping import TraceMover
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._threads import WriterThread
from daemon.batch.stores import (
    TraceReference,
    check_store_url,
    copy_between,
    file_sha256,
    local_copy,
    trace_reference,
    write_marker,
)
from daemon.batch.worker._connection import InputCache, WorkerPaths, choose_paths
from daemon.campaign import LayerLibrary
from daemon.model import attachments
from daemon.model.attachments import SutMissing, attach_files
from daemon.model.messages import FilePart, WelcomeReply
from daemon.model.spec import SutReference, TraceInfo
from daemon.stacks import registry
from daemon.stacks.registry import make_sut
from grammars.text.diagnostics import InputError
from tests.make import make_result, make_spec
from tests.parts import eventually

MODEL = b"weights" * 100_000
TRACE = b"a trace"


# --- files of systems under test


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a SUT file's file; plug-ins of the kind ``learned``, and their parameters."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "policy.onnx").write_bytes(MODEL)
    seen = []
    sut = SimpleNamespace(period=0.1, needs_ground_truth=False, start=print, update=print)
    factory = lambda parameters: seen.append(parameters) or sut  # noqa: E731
    entry = SimpleNamespace(name="learned", dist=None, value="learned:make", load=lambda: factory)
    monkeypatch.setattr(registry, "installed", lambda group: {"learned": entry})
    return tmp_path, seen


def sut_file(folder, text):
    path = folder / "mine.sut.yaml"
    path.write_text(f"sut: mine\n{text}")
    return LayerLibrary(folder).sut_file(path).reference


def test_a_sut_file_names_files_and_the_specification_their_digests(here):
    folder, seen = here
    text = "kind: learned\nfiles:\n  model: policy.onnx\nparameters:\n  speed: 0.5\n"
    sut = sut_file(folder, text)
    digest = hashlib.sha256(MODEL).hexdigest()
    assert sut == SutReference("mine", "learned", {"speed": 0.5}, {"model": digest})
    # What was checked in another process is made here, as a run makes it.
    make_sut("learned", sut.local_parameters)
    assert seen[-1]["speed"] == 0.5
    model = Path(seen[-1]["files"]["model"])
    assert model.read_bytes() == MODEL
    assert model.stat().st_mode & 0o222 == 0  # for reading only


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("kind: learned\nfiles:\n  model: gone.onnx\n", "no file .*gone.onnx"),
        ("kind: learned\nfiles:\n  model: [policy.onnx, policy.onnx]\n", "one file, not several"),
        ("kind: learned\nfiles:\n  ../model: policy.onnx\n", "is not a valid name"),
        ("kind: pilot\nfiles:\n  model: policy.onnx\n", "pilot needs none"),
    ],
)
def test_what_is_wrong_with_files_stands_where_it_was_written(here, text, complaint):
    with pytest.raises(InputError, match=complaint):
        sut_file(here[0], text)


def test_files_are_bounded(here, monkeypatch):
    file = here[0] / "policy.onnx"
    monkeypatch.setattr(attachments, "LARGEST_FILE", 2**19)
    for files, words in (
        ({"model": file}, "the limit is 0 MiB"),
        ({"model": Path("/dev/zero")}, "model is not an ordinary file"),
        ({f"f{i}": file for i in range(17)}, "17 are too many"),
    ):
        with pytest.raises(ValueError, match=words):
            attach_files(files)


def test_a_file_that_is_not_here_is_nothing_to_blame_a_run_for(here):
    sut = SutReference("mine", "learned", {}, {"model": "0" * 64})
    with pytest.raises(SutMissing, match='the file "model" of the system under test is missing'):
        _ = sut.local_parameters


def test_a_worker_never_keeps_what_another_digest_names(places):
    liar = SimpleNamespace(ask=lambda verb, request: FilePart(5, b"other"))
    with pytest.raises(ValueError, match="another file"):
        InputCache(liar, WorkerPaths(places, shared=False)).fetch(make_spec())
    assert list(places.scenes.iterdir()) == []


def test_a_worker_uses_the_directory_only_where_it_is_that_of_the_daemon(places):
    old, marker = write_marker(places, "first"), write_marker(places, "second")
    assert old.identity == marker.identity
    welcome = WelcomeReply(str(places.state), 1.0, marker.identity, marker.era)
    assert choose_paths(None, welcome) == WorkerPaths(places, shared=True)
    # The same path on another machine: a copy from a backup, say, has the marker of another start.
    moved = replace(welcome, era=old.era)
    own = StatePaths(places.state / "work" / marker.identity)
    assert choose_paths(places.state, moved) == WorkerPaths(own, shared=False)
    with pytest.raises(WorkerBroken, match="which state directory"):
        choose_paths(places.state, replace(moved, identity="../../somewhere"))
    with pytest.raises(WorkerBroken, match="name one with --state"):
        choose_paths(places.marker, moved)


# --- traces in stores


@pytest.fixture(params=["file", "memory"])
def store(request, tmp_path):
    if request.param == "file":
        return (tmp_path / "a store").as_uri()
    return f"memory://{uuid.uuid4().hex}/traces"


@pytest.mark.parametrize(
    ("url", "complaint"),
    [
        ("/mnt/traces", "is not a store"),
        ("s4://bucket", "is not a store"),
        ("file://host/traces", "no absolute path"),
        ("s3://key:secret@bucket/traces", "contains credentials"),
        ("s3://bucket/traces?secret=1", "contains credentials"),
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


def test_a_trace_goes_there_and_back_or_is_said_to_be_damaged(store, tmp_path):
    source, cache = tmp_path / "trace.mcap", tmp_path / "cache"
    source.write_bytes(os.urandom(1000))
    url = f"{store}/c/S1.pilot.0.mcap"
    copy_between(str(source), url)
    copy_between(str(source), url)  # twice is once
    trace = TraceReference("c.0", url, file_sha256(source), 1000)
    assert local_copy(trace, cache=cache).read_bytes() == source.read_bytes()
    with pytest.raises(TraceUnavailable, match="cannot be used from here"):
        local_copy(TraceReference("c.0", f"{url}.other", "0" * 64, 1000), cache=cache)
    with pytest.raises(TraceUnavailable, match="differs from the recorded"):
        local_copy(TraceReference("c.0", url, "0" * 64, 1000), cache=cache)


def test_a_store_without_its_library_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "s3fs", None)
    with pytest.raises(OSError, match="Install s3fs"):
        copy_between("s3://bucket/traces/t.mcap", str(tmp_path / "t.mcap"))


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
    monkeypatch.setattr("daemon.batch.stores._LARGEST_CACHE", 3500)
    cache = tmp_path / "cache"
    for number in range(5):
        source = tmp_path / f"{number}.mcap"
        source.write_bytes(bytes([number]) * 1000)
        trace = TraceReference("c.0", source.as_uri(), file_sha256(source), 1000)
        os.utime(local_copy(trace, cache=cache), (number, number))
    assert sorted(path.read_bytes()[0] for path in cache.iterdir()) == [2, 3, 4]


# --- a trace leaves the state directory once the ledger says where it lies


@pytest.fixture
def trace(ledger):
    """The place of a run's trace, with the trace of another attempt in it."""
    ledger.submit("c", 1)
    (lease,) = ledger.lease()
    info = TraceInfo(hashlib.sha256(TRACE).hexdigest(), len(TRACE), 1)
    ledger.complete(lease, make_result(lease.spec, trace=info))
    path = ledger.places.trace(lease.trace)
    path.parent.mkdir()
    path.write_bytes(b"another")
    return path


@contextmanager
def mover(places, store):
    log = EventLog(places.log)
    with LedgerWriter.open(places) as book:
        writer = WriterThread(book, lambda _: None, lambda _: None)
        moving = TraceMover(places, log, store.as_uri(), writer)
        yield moving
        writer.finish()
    log.close()


def test_a_store_that_cannot_be_written_leaves_traces_where_they_are(ledger, trace, tmp_path):
    trace.write_bytes(TRACE)
    (tmp_path / "store").touch()
    log = ledger.places.log
    with mover(ledger.places, tmp_path / "store") as moving:
        moving.start()
        eventually(lambda: log.exists() and "traces not moved" in log.read_text())
        moving.close()
    assert trace.read_bytes() == TRACE
    assert trace_reference(ledger.reader.run("c.0").row).location == str(trace)


def test_a_trace_that_is_not_that_of_the_result_stays(ledger, trace, tmp_path):
    trace.with_name("unknown.mcap").touch()
    with mover(ledger.places, tmp_path / "store") as moving:
        moving._move_all()
    assert {path.name for path in trace.parent.iterdir()} == {trace.name, "unknown.mcap"}
    assert not (tmp_path / "store").exists()
