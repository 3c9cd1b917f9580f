"""The mover of traces: a trace leaves the state directory once the ledger says where it lies."""

import hashlib
from contextlib import contextmanager

import pytest

from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._threads import WriterThread
from daemon.batch.server._trace_mover import TraceMover
from daemon.batch.stores import local_copy, trace_reference
from daemon.model.messages import Completion
from daemon.model.spec import TraceInfo
from tests.make import make_result, make_submission
from tests.parts import eventually

TRACE = b"a trace"
NOW = 1_000_000.0


@pytest.fixture
def places(tmp_path):
    """A state directory where a run has ended, with the trace of another attempt in its place."""
    places = StatePaths(tmp_path / "state")
    places.make_folders()
    with LedgerWriter.open(places) as book:
        book.submit(make_submission("c", 1), NOW)
        (lease,) = book.lease("w", 1, NOW)
        info = TraceInfo(hashlib.sha256(TRACE).hexdigest(), len(TRACE), 1)
        result = make_result(lease.spec, trace=info)
        book.complete(Completion("w", lease.run, lease.attempt, lease.token, result), NOW)
    trace = places.trace(lease.trace)
    trace.parent.mkdir()
    trace.write_bytes(b"another")
    return places


@contextmanager
def mover(places, store):
    log = EventLog(places.log)
    with LedgerWriter.open(places) as book:
        writer = WriterThread(book, lambda _: None, lambda _: None)
        moving = TraceMover(places, log, store, writer)
        moving.start()
        yield
        moving.close()
        writer.finish()
    log.close()


def trace_of(places):
    with LedgerReader.open(places) as reader:
        return trace_reference(reader.run("c.0").row)


def test_traces_of_results_move(places, tmp_path):
    (trace,) = places.traces.rglob("*.mcap")
    with mover(places, (tmp_path / "store").as_uri()):
        other = places.traces / "c" / "unknown.mcap"
        other.touch()
        trace.write_bytes(TRACE)
        eventually(lambda: not trace.exists())
        assert other.exists()
    reference = trace_of(places)
    assert reference.location.startswith((tmp_path / "store").as_uri())
    assert local_copy(reference, cache=tmp_path / "cache").read_bytes() == TRACE


def test_a_store_that_cannot_be_written_leaves_traces_where_they_are(places, tmp_path):
    (trace,) = places.traces.rglob("*.mcap")
    trace.write_bytes(TRACE)
    (tmp_path / "store").touch()
    with mover(places, (tmp_path / "store").as_uri()):
        eventually(lambda: places.log.exists() and "traces not moved" in places.log.read_text())
    assert trace.read_bytes() == TRACE
    assert trace_of(places).location == str(trace)


def test_the_trace_of_another_attempt_stays(places, tmp_path):
    (trace,) = places.traces.rglob("*.mcap")
    with LedgerWriter.open(places) as book:
        writer = WriterThread(book, lambda _: None, lambda _: None)
        moving = TraceMover(places, EventLog(places.log), (tmp_path / "store").as_uri(), writer)
        moving._move_all()
    assert trace.read_bytes() == b"another"
    assert not (tmp_path / "store").exists()
