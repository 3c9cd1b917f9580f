"""A worker is cut off from its daemon and comes back: nothing that is well is started over."""

import sqlite3
from contextlib import closing
from pathlib import Path

import psutil

from daemon.batch import bus
from daemon.model.run_state import RunState
from grammars.text.files import matching_paths
from tests.chaos.light import LightWorker
from tests.chaos.links import relay
from tests.make import make_submission
from tests.parts import (
    alive,
    daemon_at,
    eventually,
    finished,
    free_endpoint,
    worker_for,
)
from tests.turned_clock import TURNED, end_leases


def executions(log):
    """The ids of the processes that were started for runs, in order."""
    lines = log.read_text().splitlines() if log.exists() else []
    return [int(line.split()[1]) for line in lines]


def away(client):
    return [row.away for row in client.workers()]


def recorded(daemon):
    """Of each run: the attempt whose result counts, and its strikes."""
    with closing(sqlite3.connect(daemon.state / "ledger.db")) as db:
        return db.execute(
            "SELECT result.attempt, strikes FROM result JOIN run ON run.id = result.run"
        ).fetchall()


def test_three_cuts_shorter_than_the_lease_cost_a_run_nothing(tmp_path):
    log, gate = tmp_path / "log", tmp_path / "gate"
    elsewhere = ("--state", str(tmp_path / "elsewhere"))
    with (
        daemon_at(tmp_path / "state", listen=free_endpoint()) as daemon,
        daemon.client() as client,
        relay(daemon.endpoint) as cable,
        worker_for(daemon, 1, *elsewhere, connect=cable.endpoint),
        bus.open_client(cable.endpoint) as session,
    ):
        client.submit(make_submission("c", 1, until=str(gate), log=str(log)))
        process = psutil.Process(*eventually(lambda: executions(log)))
        LightWorker(session, cable.endpoint, "idle").renew()
        # Silent, as a cable that is pulled, until the daemon has given up who has no leases.
        cable.cut()
        eventually(lambda: [line["worker"] for line in daemon.noted("worker gone")] == ["idle"])
        for _ in range(3):
            eventually(lambda: away(client) == [True])
            assert (client.overview().running, client.overview().workers) == (1, 0)
            cable.mend()
            eventually(lambda: away(client) == [False])
            cable.sever()
        cable.mend()
        assert alive([process])
        gate.touch()
        eventually(lambda: finished(client, 1))
        row = client.run("c.0").row
        assert (row.state, row.attempt, row.reason) == (RunState.DONE, 1, "")
        assert (recorded(daemon), len(executions(log))) == ([(1, 0)], 1)


def test_after_cuts_longer_than_the_lease_work_goes_on_and_the_first_result_counts(tmp_path):
    log, gates = tmp_path / "log", tmp_path / "gate-{attempt}"
    elsewhere = ("--state", str(tmp_path / "elsewhere"))
    with (
        daemon_at(tmp_path / "state", listen=free_endpoint(), lease=30.0, **TURNED) as daemon,
        daemon.client() as client,
        relay(daemon.endpoint) as cable,
        worker_for(daemon, 1, *elsewhere, connect=cable.endpoint),
    ):
        client.submit(make_submission("c", 1, until=str(gates), log=str(log), size=300_000))
        first = psutil.Process(*eventually(lambda: executions(log)))
        cable.sever()
        end_leases(daemon)
        eventually(lambda: client.overview().queued == 1)
        assert client.run("c.0").row.reason == "the worker fell silent"
        cable.mend()
        eventually(lambda: client.overview().running == 1)  # back: nobody else is there
        assert (client.run("c.0").row.attempt, client.run("c.0").row.reason) == (1, "")
        cable.sever()
        end_leases(daemon)
        eventually(lambda: client.overview().queued == 1)
        with worker_for(daemon, 1):
            second = psutil.Process(eventually(lambda: executions(log)[1:])[0])
            cable.mend()
            eventually(lambda: away(client) == [False, False])
            assert alive([first, second]) == [first, second]
            # Its trace comes over the bus, while another one has the run.
            Path(str(gates).format(attempt=1)).touch()
            eventually(lambda: finished(client, 1))
            eventually(lambda: not alive([second]))
        trace = Path(client.run("c.0").row.trace)
        assert trace.stat().st_size > 300_000
        assert (recorded(daemon), len(executions(log))) == ([(1, 0)], 2)
        (received,) = daemon.noted("trace received")
        assert received["name"].startswith("c.0.")
        assert not list(matching_paths(tmp_path / "elsewhere", "work/*/spool/*/*/attempt-*"))
        assert not list(matching_paths(daemon.state / "spool", "*/*/attempt-*"))
