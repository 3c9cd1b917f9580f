"""Traces of workers that do not share the daemon's file system: real processes, killed on the way.

Such a worker is one whose ``--state`` is a folder of its own.
"""

import hashlib
import json
import signal
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import pytest

from daemon.batch.client import Client
from daemon.batch.errors import DaemonError, Refused, TraceUnavailable, WorkerBroken
from daemon.batch.paths import StatePaths
from daemon.batch.stores import (
    TraceReference,
    copy_trace,
    local_copy,
    trace_reference,
    write_marker,
)
from daemon.batch.worker._connection import WorkerPaths, choose_paths
from daemon.model import verbs
from daemon.model.messages import (
    FilePart,
    GetRequest,
    LeaseRef,
    PutRequest,
    WelcomeReply,
    WorkerInfo,
)
from daemon.model.run_state import RunState
from grammars.text.files import matching_paths
from tests.batch.test_survival import check_ledger
from tests.chaos.links import relay
from tests.make import make_submission
from tests.parts import daemon_at, eventually, finished, worker_for

LARGE = 12 * 2**20
"""Bytes of a trace that is interrupted on its way, twice."""


def parts(daemon):
    """Uploads under way of which something has arrived."""
    return [p for p in (daemon.state / "incoming").glob("*.part") if p.stat().st_size]


def whole(client, run):
    """The trace where the daemon says it lies, checked."""
    detail = client.run(run)
    assert detail.row.result is not None
    path = Path(detail.row.trace)
    assert hashlib.sha256(path.read_bytes()).hexdigest() == detail.row.result.trace.sha256
    return path


def done(daemon, runs):
    try:
        with Client.open(daemon.endpoint) as client:
            return finished(client, runs)
    except DaemonError:
        return False


def test_a_trace_survives_the_death_of_daemon_and_worker_on_its_way(tmp_path):
    elsewhere = tmp_path / "elsewhere"
    with daemon_at(tmp_path / "state") as daemon, relay(daemon.endpoint) as cable:
        with daemon.client() as client:
            client.submit(make_submission("c", 1, size=LARGE))
        cable.cut_after(LARGE // 3)
        away = ("--state", str(elsewhere))
        with worker_for(daemon, 1, *away, connect=cable.endpoint) as worker:
            eventually(lambda: cable.is_cut)
            (part,) = eventually(lambda: parts(daemon))
            daemon.kill()
            after_first = part.stat().st_size
            assert after_first < LARGE
            daemon.restart()
            cable.cut_after(LARGE // 3)
            cable.mend()
            eventually(lambda: part.stat().st_size > after_first)
            worker.kill()
        after_second = part.stat().st_size
        number = part.stat().st_ino
        with worker_for(daemon, 1, "--state", str(elsewhere)), daemon.client() as client:
            eventually(lambda: finished(client, 1))
            trace = whole(client, "c.0")
            row = client.run("c.0").row
        assert (row.state, row.attempt) == (RunState.DONE, 1)
        # The file is the one that was there: nothing was sent again from the beginning.
        assert after_second > after_first
        assert (trace.stat().st_ino, trace.stat().st_size > LARGE) == (number, True)
        assert trace == daemon.state / "traces" / "c" / trace.name
        received = [line for line in daemon.journal() if line["event"] == "trace received"]
        assert [line["bytes"] for line in received] == [trace.stat().st_size]
        assert list((daemon.state / "incoming").iterdir()) == []
        assert not list(matching_paths(daemon.state / "spool", "*/*/attempt-*"))
        check_ledger(daemon.state, 1)


@pytest.fixture(scope="module")
def remote(tmp_path_factory):
    """A daemon whose only worker does not share its file system, with five runs done."""
    base = tmp_path_factory.mktemp("transport")
    with daemon_at(base / "state") as daemon, daemon.client() as client:
        client.submit(make_submission("c", 5, size=1_500_000))
        with worker_for(daemon, 2, "--state", str(base / "elsewhere")) as worker:
            eventually(lambda: finished(client, 5))
            worker.signal(signal.SIGTERM)
            assert worker.wait() == 0
            assert "bytes sent in" in worker.output
        yield daemon


@pytest.fixture
def client(remote):
    with remote.client() as connected:
        yield connected


def test_a_worker_elsewhere_leaves_nothing_in_the_state_directory_but_traces(remote, client):
    assert [whole(client, f"c.{i}").parent.name for i in range(5)] == ["c"] * 5
    assert list(StatePaths(remote.state).spool.iterdir()) == []
    (own,) = (remote.state.parent / "elsewhere" / "work").iterdir()
    assert own.name == json.loads((remote.state / "marker.json").read_text())["identity"]
    assert [path.stem for path in (own / "scenes").iterdir()] == [client.run("c.0").spec.scene]
    assert list((own / "spool").iterdir()) == []
    check_ledger(remote.state, 5)


def test_a_worker_uses_the_directory_only_where_it_is_that_of_the_daemon(tmp_path):
    places = StatePaths(tmp_path / "state")
    places.make_folders()
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


def test_hostile_uploads_are_refused_and_leave_nothing(remote, client):
    me = WorkerInfo("w", "host", 1, version("scenario-tui"), 1, 0)
    era = client.ask(verbs.WELCOME, me).era
    hostile = [
        ("0" * 64, 10, "c.0", 1_000_000),
        ("0" * 64, 10, "c.77", 1),
        ("0" * 64, 10, "../../etc/passwd", 1),
        ("0" * 64, 10, "c.0/../c.1", 1),
        ("../" * 21 + "a", 10, "c.0", 1),
        ("0" * 64, 2**62, "c.0", 1),
    ]
    for sha256, size, run, token in hostile:
        request = PutRequest(sha256, size, lease=LeaseRef(run, token), era=era)
        with pytest.raises(Refused):
            client.ask(verbs.PUT, request)
    assert list((remote.state / "incoming").iterdir()) == []
    assert client.overview().done == 5


def test_traces_come_over_the_bus_into_the_cache_and_are_verified(remote, client, tmp_path):
    trace = trace_reference(client.run("c.1").row)
    assert local_copy(trace, client) == Path(trace.location)  # it lies here
    there = TraceReference(trace.run, "/nowhere/" + trace.location, trace.sha256, trace.size)
    seen = []
    copy = local_copy(there, client, cache=tmp_path, progress=seen.append)
    assert copy.read_bytes() == Path(trace.location).read_bytes()
    assert sum(seen) == trace.size
    assert len(seen) > 2
    assert local_copy(there, None, cache=tmp_path) == copy
    copy.write_bytes(b"damaged since")
    assert local_copy(there, client, cache=tmp_path).stat().st_size == trace.size


def test_an_interrupted_download_goes_on_where_it_was(client, tmp_path):
    trace = trace_reference(client.run("c.2").row)
    data = Path(trace.location).read_bytes()
    (tmp_path / f".{trace.sha256}.part").write_bytes(data[:1_400_000])
    asked = []

    class Watched:
        def get(self, sha256, offset, run):
            asked.append(offset)
            return client.get(sha256, offset, run)

    copy_trace(trace, Watched(), tmp_path / "t.mcap")
    assert asked == [1_400_000]
    assert (tmp_path / "t.mcap").read_bytes() == data
    assert [path.name for path in tmp_path.iterdir()] == ["t.mcap"]


def test_what_arrives_damaged_is_never_a_trace(client, tmp_path):
    trace = trace_reference(client.run("c.3").row)

    class Noise:
        def get(self, sha256, offset, run):
            part = client.get(sha256, offset, run)
            return FilePart(part.size, b"AAAA" + part.data[4:])

    class Silence:
        def get(self, sha256, offset, run):
            return FilePart(trace.size, b"")

    for source, problem in ((Noise(), "not what was recorded"), (Silence(), "only 0 of")):
        with pytest.raises(TraceUnavailable, match=problem):
            copy_trace(trace, source, tmp_path / "t.mcap")
    (tmp_path / f".{trace.sha256}.part").write_bytes(b"x" * 1000)
    with pytest.raises(TraceUnavailable, match="not what was recorded"):
        copy_trace(trace, client, tmp_path / "t.mcap")
    assert not (tmp_path / "t.mcap").exists()
    copy_trace(trace, client, tmp_path / "t.mcap")


def test_a_download_names_a_run_or_a_digest_and_never_a_path(client):
    sha256 = trace_reference(client.run("c.0").row).sha256
    for run in ("../../ledger.db", "c", "/etc/passwd", "c.99"):
        with pytest.raises(Refused):
            client.get(sha256, 0, run)
    with pytest.raises(Refused, match="has another trace now"):
        client.get("0" * 64, 0, "c.0")
    with pytest.raises(Refused, match="cannot be read"):
        client.get(sha256)
    with pytest.raises(Refused, match="malformed"):
        client.ask(verbs.GET, GetRequest(sha256, -1))
    assert client.get(sha256, 2**31, "c.0").data == b""


def test_traces_go_into_a_store_and_the_ledger_knows_where_each_lies(tmp_path):
    store = (tmp_path / "shared" / "traces").as_uri()
    with daemon_at(tmp_path / "state", traces=store) as daemon, daemon.client() as client:
        client.submit(make_submission("c", 2, size=1000))
        with worker_for(daemon, 2, "--state", str(tmp_path / "elsewhere")):
            eventually(lambda: finished(client, 2))
        eventually(lambda: not list(matching_paths(daemon.state / "traces", "*/*.mcap")))
        for run in ("c.0", "c.1"):
            trace = trace_reference(client.run(run).row)
            assert trace.location.startswith(f"{store}/c/S1.pilot.{run[-1]}.{trace.sha256[:16]}")
            copy = local_copy(trace, cache=tmp_path / "cache")
            assert hashlib.sha256(copy.read_bytes()).hexdigest() == trace.sha256
            with pytest.raises(Refused, match="get it there"):
                client.get(trace.sha256, 0, run)
        assert len(list((tmp_path / "shared" / "traces" / "c").iterdir())) == 2
        check_ledger(daemon.state, 2)
