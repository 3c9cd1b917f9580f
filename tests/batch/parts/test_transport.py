"""Files and traces between daemons and workers that share no file system, over the bus.

Such a worker is one whose ``--state`` is a folder of its own.
"""

import hashlib
import json
import signal
from pathlib import Path

import pytest

from daemon.batch.errors import Refused, TraceUnavailable
from daemon.batch.paths import StatePaths
from daemon.batch.stores import TraceReference, copy_trace, local_copy, trace_reference
from daemon.model import verbs
from daemon.model.messages import FilePart, GetRequest
from daemon.model.verdicts import RunState
from grammars.text.files import matching_paths
from tests.batch.parts.test_survival import check_ledger
from tests.chaos.links import relay
from tests.make import make_submission
from tests.parts import daemon_at, eventually, finished, worker_for

LARGE = 12 * 2**20
"""Bytes of a trace that is interrupted on its way, twice."""


def whole(client, run):
    """The trace where the daemon says it lies, checked."""
    row = client.run(run).row
    path = Path(row.trace)
    assert hashlib.sha256(path.read_bytes()).hexdigest() == row.result.trace.sha256
    return path


def test_a_trace_survives_the_death_of_daemon_and_worker_on_its_way(tmp_path):
    away = ("--state", str(tmp_path / "elsewhere"))
    with daemon_at(tmp_path / "state") as daemon, relay(daemon.endpoint) as cable:
        with daemon.client() as client:
            client.submit(make_submission("c", 1, size=LARGE))

        def arrived():
            """Uploads under way of which something is there."""
            return [p for p in (daemon.state / "incoming").glob("*.part") if p.stat().st_size]

        cable.cut_after(LARGE // 3)
        with worker_for(daemon, 1, *away, connect=cable.endpoint) as worker:
            eventually(lambda: cable.is_cut)
            (part,) = eventually(arrived)
            daemon.kill()
            after_first = part.stat().st_size
            assert after_first < LARGE
            daemon.restart()
            cable.cut_after(LARGE // 3)
            cable.mend()
            eventually(lambda: part.stat().st_size > after_first)
            worker.kill()
        number = part.stat().st_ino
        with worker_for(daemon, 1, *away), daemon.client() as client:
            eventually(lambda: finished(client, 1))
            trace = whole(client, "c.0")
            row = client.run("c.0").row
        assert (row.state, row.attempt) == (RunState.DONE, 1)
        # The file is the one that was there: nothing was sent again from the beginning.
        assert (trace.stat().st_ino, trace.stat().st_size > LARGE) == (number, True)
        assert trace == daemon.state / "traces" / "c" / trace.name
        assert [line["bytes"] for line in daemon.noted("trace received")] == [trace.stat().st_size]
        assert list((daemon.state / "incoming").iterdir()) == []
        assert not list(matching_paths(daemon.state / "spool", "*/*/attempt-*"))
        check_ledger(daemon.state, 1)


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
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


def test_a_worker_elsewhere_leaves_nothing_in_the_state_directory_but_traces(shared, client):
    assert [whole(client, f"c.{i}").parent.name for i in range(5)] == ["c"] * 5
    assert list(StatePaths(shared.state).spool.iterdir()) == []
    (own,) = (shared.state.parent / "elsewhere" / "work").iterdir()
    assert own.name == json.loads((shared.state / "marker.json").read_text())["identity"]
    assert [path.stem for path in (own / "scenes").iterdir()] == [client.run("c.0").spec.scene]
    assert list((own / "spool").iterdir()) == []
    check_ledger(shared.state, 5)


# --- downloads


def test_traces_come_over_the_bus_into_the_cache_and_are_verified(client, tmp_path):
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


class Source:
    """A client whose answers are changed; remembers what it was asked for."""

    def __init__(self, client, change=lambda part: part):
        self.client, self.change, self.offsets = client, change, []

    def get(self, sha256, offset, run):
        self.offsets.append(offset)
        return self.change(self.client.get(sha256, offset, run))


def test_an_interrupted_download_goes_on_where_it_was(client, tmp_path):
    trace = trace_reference(client.run("c.2").row)
    data, source = Path(trace.location).read_bytes(), Source(client)
    (tmp_path / f".{trace.sha256}.part").write_bytes(data[:1_400_000])
    copy_trace(trace, source, tmp_path / "t.mcap")
    assert source.offsets == [1_400_000]
    assert (tmp_path / "t.mcap").read_bytes() == data
    assert [path.name for path in tmp_path.iterdir()] == ["t.mcap"]


def test_what_arrives_damaged_is_never_a_trace(client, tmp_path):
    trace = trace_reference(client.run("c.3").row)
    noise = Source(client, lambda part: FilePart(part.size, b"AAAA" + part.data[4:]))
    silence = Source(client, lambda part: FilePart(part.size, b""))
    for source, problem in ((noise, "differs from the recorded trace"), (silence, "only 0 of")):
        with pytest.raises(TraceUnavailable, match=problem):
            copy_trace(trace, source, tmp_path / "t.mcap")
    (tmp_path / f".{trace.sha256}.part").write_bytes(b"x" * 1000)
    with pytest.raises(TraceUnavailable, match="differs from the recorded trace"):
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


# --- inputs
