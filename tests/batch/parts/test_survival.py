"""Processes are killed, frozen, cut off: every run still ends in exactly one result."""

import fcntl
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from daemon.batch import launch
from daemon.batch.client import Client
from daemon.batch.errors import DaemonError, LaunchFailed
from daemon.batch.launch import (
    embedded_daemon,
    ensure_daemon,
    running_daemon,
    shared_daemon,
)
from daemon.batch.paths import StatePaths, is_locked
from daemon.batch.server._opening import hold_alone
from daemon.model.verdicts import RunState
from grammars.text.files import matching_paths
from tests.chaos.links import relay
from tests.chaos.torn import torn
from tests.make import make_spec, make_submission, submission_of
from tests.parts import (
    EXECUTOR,
    ROOT,
    alive,
    daemon_at,
    end,
    eventually,
    executions,
    family,
    finished,
    recorded,
    worker_for,
)
from tests.prepared_parts import start_as_launched
from tests.turned_clock import TURNED, end_leases


def check_ledger(state, runs):
    """The ledger is intact and holds one result per run."""
    with closing(sqlite3.connect(state / "ledger.db")) as db:
        assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        assert db.execute("PRAGMA foreign_key_check").fetchall() == []
        counts = db.execute("SELECT count(*), count(DISTINCT run) FROM result").fetchone()
        assert counts == (runs, runs)
        assert db.execute("SELECT count(*) FROM event WHERE kind = 'alarm'").fetchone() == (0,)


def local_worker(daemon):
    """The worker process of the daemon."""

    def find():
        children = psutil.Process(daemon.pid).children()
        return children[0] if children else None

    return eventually(find)


def answered(daemon, question):
    """Ask a daemon that may just have been killed; nothing comes of it then."""
    try:
        with Client.open(daemon.endpoint) as client:
            return question(client)
    except DaemonError:
        return None


def settle(daemon, runs):
    eventually(lambda: answered(daemon, lambda client: finished(client, runs)))


def test_kills_of_daemon_and_workers_amid_their_work_lose_nothing(tmp_path):
    gates = [tmp_path / f"gate-{number}" for number in range(40)]
    specs = [make_spec(number, until=str(gate)) for number, gate in enumerate(gates)]

    def waiting(client):
        """The gates at which runs stand."""
        running = [row for row in client.runs("c").rows if row.state is RunState.RUNNING]
        return [gates[row.repeat] for row in running if not gates[row.repeat].exists()]

    def let_through(client, count):
        for gate in waiting(client):
            gate.touch()
        return client.overview().done >= count

    with daemon_at(tmp_path / "state", 2, **TURNED, attempts=50) as daemon:
        with daemon.client() as client:
            client.submit(submission_of("c", *specs))
        workers = []
        for number, killed in enumerate(("daemon", "worker", "daemon")):
            # Two runs are under way, and cannot end.
            eventually(lambda: len(answered(daemon, waiting) or ()) >= 2)
            workers.append(local_worker(daemon))
            if killed == "daemon":
                daemon.kill()
                daemon.restart()
            else:
                workers[-1].kill()
            eventually(lambda n=number: answered(daemon, lambda c: let_through(c, 3 + 3 * n)))
        workers.append(local_worker(daemon))
        for gate in gates:
            gate.touch()
        end_leases(daemon)  # of what a killed worker was granted and never heard of
        settle(daemon, 40)
        check_ledger(tmp_path / "state", 40)
        with daemon.client() as client:
            rows = client.runs("c").rows
        assert all(Path(row.trace).is_file() for row in rows)
        eventually(lambda: len(alive(workers)) == 1)


def test_what_a_dead_worker_had_is_given_back_by_the_next(tmp_path):
    gate = tmp_path / "gate"
    with daemon_at(tmp_path / "state", **TURNED) as daemon, daemon.client() as client:
        with worker_for(daemon, 2) as first:
            client.submit(make_submission("c", 4, until=str(gate)))
            spool = daemon.state / "spool"
            eventually(lambda: len(list(matching_paths(spool, "*/*/attempt-1.*/grant.json"))) == 2)
            first.kill()
            eventually(lambda: [row.away for row in client.workers()] == [True])
            assert (client.overview().running, client.overview().workers) == (2, 0)
        with worker_for(daemon, 2):
            eventually(lambda: len(list(matching_paths(spool, "*/*/attempt-*/grant.json"))) == 2)
            gate.touch()
            eventually(lambda: finished(client, 4))
            end_leases(daemon)  # it is away for long; nothing keeps it on the list any more
            eventually(lambda: [row.away for row in client.workers()] == [False])
        assert sorted(recorded(daemon, ENDINGS)) == [(1, 0), (1, 0), (2, 0), (2, 0)]
        reasons = [line["reason"] for line in daemon.noted("released")]
        assert reasons == ["its worker died"] * 2
        check_ledger(daemon.state, 4)


def test_a_daemon_told_to_stop_lets_its_runs_finish(tmp_path):
    gate, log = tmp_path / "gate", tmp_path / "log"
    with daemon_at(tmp_path / "state", 2, patience=60.0) as daemon:
        with daemon.client() as client:
            client.submit(make_submission("c", 6, until=str(gate), log=str(log)))
            eventually(lambda: executions(log, 2))
        members = family(daemon.pid)
        daemon.signal(signal.SIGTERM)
        eventually(lambda: daemon.journal()[-1]["event"] == "leaving")
        gate.touch()
        assert daemon.wait() == 0
        assert alive(members) == []
        daemon.restart()
        with daemon.client() as client:
            assert client.overview().done >= 2
            assert max(row.attempt for row in client.runs("c").rows) == 1
        settle(daemon, 6)
        check_ledger(daemon.state, 6)


@pytest.mark.parametrize("at_once", [False, True])
def test_a_second_signal_gives_runs_back(tmp_path, at_once):
    with daemon_at(tmp_path / "state", 1, patience=3600.0, **TURNED) as daemon:
        with daemon.client() as client:
            client.submit(make_submission("c", 1, sleep=600.0))
            eventually(lambda: client.overview().running == 1)
        members = family(daemon.pid)
        if at_once:  # both before it gets to leaving, as on a machine that is busy
            daemon.freeze()
            daemon.signal(signal.SIGTERM)
            daemon.signal(signal.SIGINT)
            daemon.signal(signal.SIGCONT)
        else:
            daemon.signal(signal.SIGTERM)
            eventually(lambda: daemon.journal()[-1]["event"] == "leaving")
            daemon.signal(signal.SIGTERM)
        assert daemon.wait() == 0
        assert alive(members) == []
        assert daemon.noted("released")


@pytest.fixture
def launched(monkeypatch):
    """Daemons that are launched are forked as other parts are, and execute nothing."""
    start = partial(start_as_launched, root=ROOT)
    forking = SimpleNamespace(**vars(subprocess) | {"Popen": start})
    monkeypatch.setattr(launch, "subprocess", forking)
    monkeypatch.setattr(launch, "DEFAULT_EXECUTOR", EXECUTOR)


@pytest.mark.usefixtures("launched")
def test_an_embedded_daemon_is_gone_afterwards(tmp_path):
    state = tmp_path / "state"
    with embedded_daemon(state, slots=1) as endpoint:
        with Client.open(endpoint, timeout=30.0) as client:
            client.submit(make_submission("c", 3))
            eventually(lambda: finished(client, 3))
            client.submit(make_submission("d", 3, sleep=600.0))
            eventually(lambda: client.overview().running == 1)
        members = family(StatePaths(state).read_contact().pid)
        eventually(lambda: running_daemon(state) == endpoint)
    eventually(lambda: not alive(members))
    assert running_daemon(state) is None
    check_ledger(state, 3)


PARENT = """
import sys, time
from pathlib import Path
from daemon.batch import bus
from daemon.batch.client import Client
from daemon.batch import launch
from tests.make import make_submission
launch.DEFAULT_EXECUTOR = "{executor}"
with launch.embedded_daemon(Path(sys.argv[1]), slots=2) as endpoint:
    with Client.open(endpoint, timeout=30.0) as client:
        client.submit(make_submission("c", 4, sleep=600.0))
        while client.overview().running < 2:
            time.sleep(0.01)
        print("ready", flush=True)
        time.sleep(600)
"""


def test_nothing_of_an_embedded_daemon_outlives_a_killed_parent(tmp_path):
    code = PARENT.format(executor=EXECUTOR)
    command = [sys.executable, "-c", code, str(tmp_path / "state")]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        try:
            assert parent.stdout.readline() == b"ready\n"
            # The parent, its daemon, the worker and its zygote, two runs, a guardian of each.
            members = eventually(lambda: len(found := family(parent.pid)) >= 8 and found)
        finally:
            parent.kill()
    try:
        eventually(lambda: not alive(members))
    finally:
        end(members)
    assert running_daemon(tmp_path / "state") is None


SHARING = """
import sys
from pathlib import Path
from daemon.batch.launch import shared_daemon
with shared_daemon(Path(sys.argv[1]), trace_bytes=2**30) as endpoint:
    print(endpoint, flush=True)
    sys.stdin.read()
"""


@pytest.mark.usefixtures("launched")
def test_a_shared_daemon_ends_with_its_last_user(tmp_path):
    state = tmp_path / "state"
    command = [sys.executable, "-c", SHARING, str(state)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with shared_daemon(state, trace_bytes=2**30) as endpoint:
        with Client.open(endpoint, timeout=30.0) as client:
            client.submit(make_submission("c", 3, sleep=600.0))
        other = subprocess.Popen(command, cwd=ROOT, text=True, **pipes)
        assert other.stdout is not None
        assert other.stdout.readline().strip() == endpoint
    with other:
        eventually(lambda: running_daemon(state) == endpoint)
        other.kill()
    eventually(lambda: running_daemon(state) is None)
    # Nobody waits for what a killed process has left.
    with shared_daemon(state, trace_bytes=2**30) as endpoint, Client.open(endpoint) as client:
        assert {row.state for row in client.all_runs("c")} == {RunState.CANCELLED}
    eventually(lambda: running_daemon(state) is None)


def test_a_daemon_is_started_once_and_stays(tmp_path):
    state = tmp_path / "state"
    endpoint = ensure_daemon(state, slots=0)
    with Client.open(endpoint, timeout=30.0) as client:
        assert ensure_daemon(state, slots=0) == endpoint
        assert client.overview().state == str(state)
        client.shutdown()
    eventually(lambda: running_daemon(state) is None)
    eventually(lambda: not (state / "daemon.json").exists())


@pytest.mark.usefixtures("launched")
def test_a_daemon_that_does_not_come_up_shows_why(tmp_path):
    state = tmp_path / "state"
    state.mkdir()
    (state / "ledger.db").write_bytes(b"this is not a database at all" * 100)
    with pytest.raises(LaunchFailed, match=r"ledger\.db is not a usable ledger"):
        ensure_daemon(state, slots=0)
    with (
        pytest.raises(LaunchFailed, match=r"ledger\.db is not a usable ledger"),
        embedded_daemon(state, slots=0),
    ):
        pass


def test_a_state_directory_has_its_daemon_under_every_name(tmp_path):
    with daemon_at(tmp_path / "state") as daemon:
        daemon.client().close()
        (tmp_path / "other").symlink_to(daemon.state)
        endpoint = eventually(lambda: running_daemon(daemon.state))
        eventually(lambda: running_daemon(tmp_path / "other") == endpoint)


def test_who_looks_whether_there_is_a_daemon_keeps_none_from_starting(tmp_path, monkeypatch):
    paths = StatePaths(tmp_path)
    looking = paths.lock.open("a")
    fcntl.flock(looking, fcntl.LOCK_SH)
    monkeypatch.setattr("daemon.batch.server._opening.time.sleep", lambda _: looking.close())
    with hold_alone(paths):
        assert looking.closed
        assert is_locked(paths.lock)


# --- a worker is cut off and comes back: nothing that is well is started over


def away(client):
    return [row.away for row in client.workers()]


ENDINGS = "SELECT result.attempt, strikes FROM result JOIN run ON run.id = result.run"
"""Of each run: the attempt whose result counts, and its strikes."""


def test_a_run_goes_on_over_cuts_shorter_and_longer_than_its_lease(tmp_path):
    log, gate = tmp_path / "log", tmp_path / "gate"
    elsewhere = ("--state", str(tmp_path / "elsewhere"))
    with (
        daemon_at(tmp_path / "state", **TURNED) as daemon,
        daemon.client() as client,
        relay(daemon.endpoint) as cable,
        # With a slot to spare it asks for work each second, and finds out where it is.
        worker_for(daemon, 2, *elsewhere, connect=cable.endpoint) as worker,
    ):
        client.submit(make_submission("c", 1, until=str(gate), log=str(log)))
        process = psutil.Process(*eventually(lambda: executions(log, 1)))
        cable.sever()
        eventually(lambda: away(client) == [True])
        assert (client.overview().running, client.overview().workers) == (1, 0)
        cable.mend()
        eventually(lambda: away(client) == [False])
        noticed = worker.output.count("no daemon answers")
        cable.sever()
        eventually(lambda: worker.output.count("no daemon answers") > noticed)
        end_leases(daemon)
        eventually(lambda: client.overview().queued == 1)
        assert client.run("c.0").row.reason == "the worker fell silent"
        cable.mend()
        eventually(lambda: client.overview().running == 1)  # back: nobody else is there
        assert alive([process])
        gate.touch()
        eventually(lambda: finished(client, 1))
        row = client.run("c.0").row
        assert (row.state, row.attempt, row.reason) == (RunState.DONE, 1, "")
        assert (recorded(daemon, ENDINGS), len(executions(log))) == ([(1, 0)], 1)


def test_a_worker_begins_no_run_again_that_it_is_still_at(tmp_path):
    """Its lease has lapsed, and nothing told the worker."""
    log, gate, deaf = tmp_path / "log", tmp_path / "gate", {"module": "tests.batch.deaf_worker"}
    with daemon_at(tmp_path / "state", **TURNED) as daemon, daemon.client() as client:
        # With a slot to spare it asks for work each second.
        with worker_for(daemon, 2, **deaf):
            client.submit(make_submission("c", 1, until=str(gate), log=str(log)))
            eventually(lambda: executions(log, 1))
            end_leases(daemon)
            eventually(lambda: client.run("c.0").row.attempt == 2)
            eventually(lambda: client.run("c.0").row.reason == "")  # under its old lease
            gate.touch()
            eventually(lambda: finished(client, 1))
        (released,) = daemon.noted("released")
        assert released["reason"] == "its worker is still at it"
        assert (recorded(daemon, ENDINGS), len(executions(log))) == ([(1, 0)], 1)


# --- commits that are torn: a short version of ``make chaos``


def test_what_was_acknowledged_is_there_after_kills_in_commits(tmp_path):
    report = torn(tmp_path, runs=300, kills=1, tears=5)
    assert not report.violations, report.text()
