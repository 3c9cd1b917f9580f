"""The daemon's writing thread: large campaigns, renewals that wait, and what is refused."""

import signal
import sqlite3
import threading
from contextlib import closing, contextmanager, suppress
from dataclasses import replace

import pytest

from daemon.batch import bus
from daemon.batch.errors import DaemonError, Refused
from daemon.batch.paths import StatePaths
from daemon.batch.server._submissions import admit_submission
from daemon.model.submission import MOST_RUNS
from tests.chaos.light import LightWorker
from tests.make import make_spec, make_submission, submission_of
from tests.parts import daemon_at, eventually
from tests.turned_clock import TURNED, add_time

MANY = 20_000


def test_a_submission_that_is_killed_is_there_as_a_whole_or_not_at_all(tmp_path):
    large = make_submission("large", MANY)
    with daemon_at(tmp_path / "state") as daemon:
        with daemon.client() as client:

            def submit():
                with suppress(DaemonError):
                    client.submit(large)

            wal = StatePaths(daemon.state).ledger.with_name("ledger.db-wal")
            before = wal.stat().st_size
            sending = threading.Thread(target=submit)
            sending.start()
            # Its rows are being written, before they are committed.
            eventually(lambda: wal.stat().st_size > before)
            daemon.kill()
            sending.join()
        daemon.restart()
        with daemon.client() as client:
            assert [row.queued for row in client.campaigns()] in ([], [MANY])
            assert client.submit(large).runs == MANY
            assert client.campaigns()[0].queued == MANY
            assert client.cancel("large") == MANY
            (gone,) = client.delete(("large",))
            assert (gone.campaign, gone.runs) == ("large", MANY)
            assert client.campaigns() == ()


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
        over, lost = threading.Event(), []

        def renew():
            while not over.is_set():
                with suppress(DaemonError):
                    lost.append(worker.renew(leased))
                over.wait(0.2)

        renewing = threading.Thread(target=renew)
        renewing.start()
        eventually(lambda: len(lost) > 1)
        with stalled(daemon):
            add_time(daemon)
        lost.clear()
        eventually(lambda: len(lost) > 5)
        over.set()
        renewing.join()
        assert not any(lost)
        eventually(lambda: daemon.noted("stalled"))
        assert not daemon.noted("leases lapsed")
        assert client.run("c.0").row.attempt == 1


def test_all_that_is_wrong_with_a_submission_is_said_up_to_ten_times(tmp_path):
    places = StatePaths(tmp_path)
    places.make_folders()
    twice = submission_of("c", *[make_spec(i % 20) for i in range(40)])
    with pytest.raises(Refused) as found:
        admit_submission(twice, places)
    first, *_, last = str(found.value).splitlines()
    assert first.startswith("S1/pilot/0 is there twice")
    assert last == "and 10 more"


def test_a_campaign_of_too_many_runs_is_to_be_split(tmp_path):
    with daemon_at(tmp_path / "state") as daemon, daemon.client() as client:
        submission = make_submission("c", 1)
        words = f"has {MOST_RUNS + 1} runs, .* may have {MOST_RUNS}: split its scenarios"
        with pytest.raises(Refused, match=words):
            client.submit(replace(submission, runs=submission.runs * (MOST_RUNS + 1)))
        assert client.campaigns() == ()
