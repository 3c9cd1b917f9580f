"""A real daemon: where it listens, what it admits and keeps, how it starts, waits and leaves."""

import json
import os
import signal
import socket
import sqlite3
import stat
import subprocess
import sys
import time
from contextlib import closing, contextmanager
from dataclasses import replace

import psutil
import pytest

from daemon.batch import bus
from daemon.batch.doctor import examine
from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import Endpoint, StatePaths
from daemon.model.messages import ASK, OWNER
from daemon.model.spec import ENGINE_VERSION
from grammars.text import codec
from tests.chaos.disk import fill, may_mount, small_disk
from tests.chaos.light import LightWorker
from tests.make import SCENE, make_spec, make_submission, submission_of
from tests.parts import daemon_at, eventually
from tests.turned_clock import TURNED, add_time


def test_the_daemon_listens_once_and_on_loopback_only(shared, client):
    sockets = psutil.Process(shared.pid).net_connections("inet")
    listening = [s for s in sockets if s.status == psutil.CONN_LISTEN]
    assert [s.laddr.ip for s in listening] == ["127.0.0.1"]
    assert [s for s in sockets if s.type == socket.SOCK_DGRAM] == []
    assert client.overview().workers == 0


def test_a_submission_is_in_the_ledger_when_the_receipt_comes(client):
    submission = make_submission("whole", 4)
    receipt = client.submit(submission)
    assert (receipt.runs, receipt.known) == (4, False)
    assert client.submit(submission).known
    assert client.runs("whole").total == 4
    assert client.run("whole.2").spec == submission.specs[2]
    assert client.scene(SCENE.digest) == SCENE
    with pytest.raises(Refused):
        client.scene("0" * 64)


def test_strange_traffic_and_requests_that_nobody_waits_for_do_no_harm(shared, client):
    with bus.open_client(shared.endpoint) as session:
        handler = session.get(f"{ASK}/{OWNER}/overview", payload=b"{}", timeout=1.0)
        del handler
        session.put("scenario/v1/event", b"not json")
        session.put("scenario/v1/ask/run", b"not a question")
        session.liveliness().declare_token("scenario/v1/alive/ghost").undeclare()
    assert (client.overview().state, client.overview().workers) == (str(shared.state), 0)


@pytest.mark.parametrize("way", ["shutdown", "SIGTERM", "SIGINT"])
def test_a_daemon_leaves_cleanly(tmp_path, way):
    with daemon_at(tmp_path / "state") as daemon:
        with daemon.client() as client:
            if way == "shutdown":
                client.shutdown()
            else:
                daemon.signal(signal.Signals[way])
            assert daemon.wait() == 0
        assert not StatePaths(daemon.state).contact_file.exists()
        assert daemon.journal()[-1]["event"] == "stopped"
        assert daemon.output == ""


# --- where it starts


def served(state, **more):
    """Start a daemon that is expected to refuse; returns its code and its words."""
    order = json.dumps({"state": str(state), "slots": 0, **more})
    command = [sys.executable, "-m", "daemon", "serve", order]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert "Traceback" not in done.stderr
    return done.returncode, done.stderr


def test_a_second_daemon_on_the_directory_or_the_port_is_refused(shared, tmp_path):
    code, words = served(shared.state, listen="tcp/127.0.0.1:1")
    assert code == 4
    assert "a daemon already keeps" in words
    assert f"process {shared.pid}" in words
    code, words = served(tmp_path / "other", listen=shared.endpoint)
    assert code == 3
    assert "cannot listen at " in words
    assert shared.endpoint in words


def test_a_daemon_that_cannot_work_there_says_why_and_leaves(tmp_path):
    state = tmp_path / "state"
    state.touch()
    code, words = served(state)
    assert code == 3
    assert str(state) in words


@pytest.mark.skipif(not may_mount(), reason="mounting a small file system needs root")
def test_a_daemon_on_a_full_disk_says_so_and_leaves(tmp_path):
    with small_disk(tmp_path / "disk") as disk, daemon_at(disk / "state") as daemon:
        with daemon.client() as client:
            client.submit(make_submission("early", 1))
        daemon.kill()
        fill(disk / "ballast")
        code, words = served(daemon.state)
        assert code == 3
        assert "No space left on device" in words or "is full" in words
        (disk / "ballast").unlink()
        daemon.restart()
        with daemon.client() as client:
            assert client.overview().queued == 1


def test_others_may_neither_write_nor_read_there(tmp_path):
    state = tmp_path / "state"
    state.mkdir()
    state.chmod(0o770)
    code, words = served(state)
    assert code == 3
    assert words.startswith(f"others can write in {state}, and so decide")
    state.chmod(0o755)
    before = os.umask(0)
    try:
        with daemon_at(state) as daemon, daemon.client() as client:
            client.submit(make_submission("c", 1))
            assert daemon.noted("closed to others")[0]["paths"] == [str(state)]
            modes = {path: stat.S_IMODE(path.stat().st_mode) for path in (state, *state.iterdir())}
    finally:
        os.umask(before)
    assert {mode for path, mode in modes.items() if path.is_dir()} == {0o700}
    files = {path.name: mode for path, mode in modes.items() if not path.is_dir()}
    assert set(files.values()) == {0o600}
    assert {"ledger.db-wal", "ledger.db-shm", "daemon.log", "daemon.json"} <= set(files)


def stored_scene(state):
    """The places of a daemon that has the scene of runs and was never started."""
    places = StatePaths(state)
    places.make_folders()
    places.scene(SCENE.digest).write_bytes(codec.to_json(SCENE))
    return places


def test_runs_of_another_engine_wait_and_the_daemon_says_so_from_its_start(tmp_path):
    places = stored_scene(tmp_path / "state")
    with LedgerWriter.open(places) as ledger:
        old = replace(make_spec(0), engine="4")
        ledger.submit(submission_of("old", old, replace(old, repeat=1)), 1.0)
    words = f"runs of engine 4 wait, this version has engine {ENGINE_VERSION}"
    offline = [one.message for one in examine(places, Endpoint("tcp/127.0.0.1:1", "default"))]
    assert words in offline
    with daemon_at(places.state, slots=1) as daemon, daemon.client() as client:
        assert words in daemon.noted("held")[0]["why"]
        (trouble,) = client.overview().troubles
        assert trouble.words.startswith(words)
        client.submit(make_submission("new", 1))
        eventually(lambda: client.overview().done == 1)
        assert (client.campaign("old").queued, client.runs("old").rows[0].attempt) == (2, 0)
        client.cancel("old")
        assert client.overview().troubles == ()
        # Retried, they wait again: at the latest when one is asked for.
        client.retry("old")
        eventually(lambda: any(words in said.words for said in client.overview().troubles))


# --- the ledger's thread


@contextmanager
def locked_ledger(daemon):
    """The writer waits, as for a long transaction."""
    ledger = StatePaths(daemon.state).ledger
    with closing(sqlite3.connect(ledger, isolation_level=None)) as lock:
        lock.execute("BEGIN IMMEDIATE")
        yield
        lock.execute("ROLLBACK")


@contextmanager
def frozen(daemon):
    """The process is stopped, as with a machine that swaps."""
    daemon.freeze()
    yield
    daemon.signal(signal.SIGCONT)


@pytest.mark.parametrize("stalled", [locked_ledger, frozen])
def test_no_lease_lapses_while_the_daemon_is_held_up(tmp_path, stalled):
    with (
        daemon_at(tmp_path / "state", **TURNED) as daemon,
        daemon.client() as client,
        bus.open_client(daemon.endpoint) as session,
    ):
        client.submit(make_submission("c", 1))
        worker = LightWorker(session, daemon.endpoint, "w", 1)
        leased = worker.lease()
        assert not worker.renew(leased)
        with stalled(daemon):
            add_time(daemon)
        eventually(lambda: daemon.noted("stalled"))
        assert not worker.renew(leased)
        assert not daemon.noted("leases lapsed")
        assert client.run("c.0").row.attempt == 1


# --- what it says of the time left


def test_the_speed_of_a_run_under_way_tells_how_long_it_takes_at_most(tmp_path):
    # One of two slots is free: the worker asks for work each second, and says how far the run is.
    with daemon_at(tmp_path / "state", slots=2) as part, part.client() as client:
        # Far from its limit, however late it is asked for.
        client.submit(submission_of("c", replace(make_spec(sleep=600.0), limit=10_000.0)))
        # It simulates a second in each; nothing else is known of it.
        first = eventually(lambda: client.campaign("c").seconds_left)
        eventually(lambda: 0.0 < client.campaign("c").seconds_left < first)
        assert client.overview().seconds_left is not None
        client.steer("c", paused=True)
        client.cancel("c")
        eventually(lambda: client.overview().seconds_left is None)


# --- what it keeps stays bounded

SIZE = 40_000


def traces(daemon, campaign):
    return len(list((daemon.state / "traces" / campaign).glob("*.mcap")))


def test_runs_wait_when_unfinished_campaigns_alone_take_too_much(tmp_path):
    with daemon_at(tmp_path / "state", 1, quota="100kB") as daemon, daemon.client() as client:
        gates = ["", "", "", *[str(tmp_path / "gate")] * 3]
        specs = (make_spec(number, size=SIZE, until=gate) for number, gate in enumerate(gates))
        client.submit(submission_of("big", *specs))
        trouble = eventually(lambda: client.overview().trouble)
        (tmp_path / "gate").touch()
        assert "the quota is 97.7 KiB: no more runs start" in trouble
        assert "--quota, or cancel" in trouble
        eventually(lambda: client.overview().running == 0)
        there = traces(daemon, "big")
        assert there == client.overview().done < len(gates)
        assert client.disk().quota == 100_000
        client.cancel("big")
        eventually(lambda: not client.overview().trouble)
        assert traces(daemon, "big") < there
        client.submit(make_submission("next", 1))
        eventually(lambda: client.campaign("next").finished)


def test_the_log_of_a_worker_that_stays_is_put_aside_when_it_has_grown(tmp_path):
    with daemon_at(tmp_path / "state", 1) as daemon, daemon.client() as client:
        eventually(client.workers)
        log = daemon.state / "worker.log"
        with log.open("ab") as file:
            file.write(b"many words\n" * 500_000)
        eventually(lambda: log.with_suffix(".log.1").exists() and log.stat().st_size < 1000)
        client.submit(make_submission("raises", 1, **{"raise": "in the new log"}))
        eventually(lambda: client.campaign("raises").finished)
        assert "in the new log" in log.read_text()
        assert len(client.workers()) == 1


def test_a_daemon_keeps_house_by_itself(tmp_path):
    places = stored_scene(tmp_path / "state")
    stray, kept = places.scene("e" * 64), places.scene(SCENE.digest)
    with LedgerWriter.open(places) as ledger:
        ledger.submit(make_submission("known", 1), time.time())
    stray.touch()
    for path in (stray, kept):
        os.utime(path, (0.0, 0.0))
    with daemon_at(places.state) as daemon, daemon.client():
        (noted,) = eventually(lambda: daemon.noted("strays removed"))
    assert noted["files"] == {"scene of no campaign": 1}
    assert (stray.exists(), kept.exists()) == (False, True)
