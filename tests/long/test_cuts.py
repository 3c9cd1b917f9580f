"""A worker that is cut off for longer than its lease, while another one has its run."""

from pathlib import Path

import psutil

from grammars.text.files import matching_paths
from tests.batch.parts.test_survival import ENDINGS, away
from tests.chaos.links import relay
from tests.make import make_submission
from tests.parts import (
    alive,
    daemon_at,
    eventually,
    executions,
    finished,
    recorded,
    worker_for,
)
from tests.turned_clock import TURNED, end_leases


def test_work_goes_on_beside_another_worker_and_the_first_result_counts(tmp_path):
    log, gates = tmp_path / "log", tmp_path / "gate-{attempt}"
    elsewhere = ("--state", str(tmp_path / "elsewhere"))
    with (
        daemon_at(tmp_path / "state", **TURNED) as daemon,
        daemon.client() as client,
        relay(daemon.endpoint) as cable,
        # With a slot to spare it asks for work each second, and finds out where it is.
        worker_for(daemon, 2, *elsewhere, connect=cable.endpoint),
    ):
        client.submit(make_submission("c", 1, until=str(gates), log=str(log), size=300_000))
        first = psutil.Process(*eventually(lambda: executions(log, 1)))
        cable.cut()  # silent, as one that is pulled
        eventually(lambda: away(client) == [True])
        end_leases(daemon)
        eventually(lambda: client.overview().queued == 1)
        with worker_for(daemon, 1):
            second = psutil.Process(eventually(lambda: executions(log, 2))[1])
            cable.mend()
            eventually(lambda: away(client) == [False, False])
            assert alive([first, second]) == [first, second]
            # Its trace comes over the bus, while another one has the run.
            Path(str(gates).format(attempt=1)).touch()
            eventually(lambda: finished(client, 1))
            eventually(lambda: not alive([second]))
        trace = Path(client.run("c.0").row.trace)
        assert trace.stat().st_size > 300_000
        assert (recorded(daemon, ENDINGS), len(executions(log))) == ([(1, 0)], 2)
        (received,) = daemon.noted("trace received")
        assert received["name"].startswith("c.0.")
        assert not list(matching_paths(tmp_path / "elsewhere", "work/*/spool/*/*/attempt-*"))
        assert not list(matching_paths(daemon.state / "spool", "*/*/attempt-*"))
