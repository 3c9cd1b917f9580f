"""Large campaigns and the leases of others: nothing lapses, nothing half is ever seen."""

import queue
import sqlite3
import threading
from contextlib import closing, contextmanager, suppress

import pytest

from daemon.batch import bus
from daemon.batch.errors import DaemonError, Refused, Unavailable
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server import LedgerJob, StallMeter, WriterThread
from daemon.batch.server import _submissions as submissions
from daemon.batch.server import _threads as threads
from daemon.model.packed_submission import pack_submission
from grammars.text import codec
from tests.chaos.light import LightWorker
from tests.daemon.batch.harness import daemon_at, eventually
from tests.daemon.batch.samples import make_spec, make_submission, submission_of

MANY = 20_000


class NoCheckpoints:
    patience = None

    def note_changes(self):
        """Nothing is idle here."""

    act = note_changes


def entered(daemon):
    """How many campaigns are hidden in the ledger, and how many runs they have."""
    with closing(sqlite3.connect(StatePaths(daemon.state).ledger)) as db:
        hidden = db.execute("SELECT count(*) FROM campaign WHERE visible = 0").fetchone()[0]
        runs = db.execute(
            "SELECT count(*) FROM run JOIN campaign ON campaign.id = campaign WHERE visible = 0"
        ).fetchone()[0]
    return hidden, runs


def test_a_submission_that_is_killed_in_the_middle_leaves_nothing(tmp_path):
    large = make_submission("large", MANY)
    with daemon_at(tmp_path / "state") as daemon:
        with daemon.client() as client:

            def submit():
                with suppress(DaemonError):
                    client.submit(large)

            sending = threading.Thread(target=submit)
            sending.start()
            eventually(lambda: entered(daemon)[1])
            daemon.kill()
            sending.join()
        hidden, runs = entered(daemon)
        assert hidden == 1
        assert 0 < runs < MANY
        daemon.restart()
        with daemon.client() as client:
            assert client.campaigns() == ()
            assert client.overview().queued == 0
            eventually(lambda: entered(daemon) == (0, 0))
            assert list(StatePaths(daemon.state).incoming.iterdir()) == []
            receipt = client.submit(large)
            assert (receipt.runs, receipt.known) == (MANY, False)
            assert client.campaigns()[0].queued == MANY
            assert client.cancel("large") == MANY
            (gone,) = client.delete(("large",))
            assert (gone.campaign, gone.runs) == ("large", MANY)
            assert client.campaigns() == ()


def test_no_lease_lapses_while_its_renewal_waits_for_the_writer(tmp_path):
    with (
        daemon_at(tmp_path / "state", lease=3.0) as daemon,
        daemon.client() as client,
        bus.open_client(daemon.endpoint) as session,
        closing(sqlite3.connect(tmp_path / "state" / "ledger.db", isolation_level=None)) as lock,
    ):
        client.submit(make_submission("c", 1))
        worker = LightWorker(session, daemon.endpoint, "w", 1)
        leased = worker.lease()
        over, lost = threading.Event(), []

        def renew():
            while not over.is_set():
                with suppress(DaemonError):  # the writer is held up
                    lost.append(worker.renew(leased))
                over.wait(0.2)

        renewing = threading.Thread(target=renew)
        renewing.start()
        eventually(lambda: len(lost) > 1)
        lock.execute("BEGIN IMMEDIATE")  # as a long transaction would
        threading.Event().wait(4.5)  # longer than a lease lasts
        lock.execute("ROLLBACK")
        lost.clear()
        eventually(lambda: len(lost) > 5)
        over.set()
        renewing.join()
        assert not any(lost)
        assert daemon.noted("stalled")
        assert not daemon.noted("leases lapsed")
        assert client.run("c.0").row.attempt == 1


def test_between_two_slices_others_have_their_turn(tmp_path, monkeypatch):
    monkeypatch.setattr(threads, "_SLICE", 0.0)
    told = []
    waiting, go_on = threading.Event(), threading.Event()

    def long(name):
        for i in range(3):
            told.append(f"{name}{i}")
            waiting.set()
            assert go_on.wait(60.0)
            yield
        return name

    def failing():
        yield
        raise Refused("no")

    with LedgerWriter.open(StatePaths(tmp_path)) as ledger:
        writer = WriterThread(ledger, lambda _: None, NoCheckpoints())
        writer.start()
        done = told.append
        for act in (lambda _: long("a"), lambda _: failing(), lambda _: long("b")):
            writer.put(LedgerJob(act, done))
        assert waiting.wait(60.0)
        writer.put(LedgerJob(lambda _: "short", done, renews=True))
        assert writer.renewals_wait
        go_on.set()
        eventually(lambda: "b" in told)
        assert not writer.renewals_wait
        assert told.index("short") == 1 or told.index("short") == 2
        assert [str(x) for x in told if x != "short"] == [
            "a0", "a1", "a2", "a", "no", "b0", "b1", "b2", "b",
        ]  # fmt: skip
        go_on.clear()
        waiting.clear()
        writer.put(LedgerJob(lambda _: long("c"), done))
        assert waiting.wait(60.0)
        go_on.set()
        writer.finish()
        assert told[-1] == "c" or isinstance(told[-1], Unavailable)


def test_a_renewal_that_could_not_be_written_holds_up_no_lapse(tmp_path, monkeypatch):
    answers = queue.SimpleQueue()

    @contextmanager
    def full_disk():
        raise Unavailable("the ledger cannot be written: database or disk is full")
        yield

    with LedgerWriter.open(StatePaths(tmp_path)) as ledger:
        monkeypatch.setattr(ledger, "transaction", full_disk)
        writer = WriterThread(ledger, lambda _: None, NoCheckpoints())
        writer.start()
        writer.offer(LedgerJob(lambda _: "renewed", answers.put, renews=True))
        assert isinstance(answers.get(timeout=60.0), Unavailable)
        monkeypatch.undo()
        assert not writer.renewals_wait  # else no lease would ever lapse again
        writer.offer(LedgerJob(lambda _: writer.renewals_wait, answers.put, renews=True))
        assert answers.get(timeout=60.0) is False
        assert not writer.renewals_wait
        writer.finish()


def test_a_tick_that_comes_late_is_a_stall():
    meter = StallMeter(0.5)
    assert [meter.measure(at) for at in (10.0, 10.5, 11.2)] == [0.0, 0.0, 0.0]
    assert meter.measure(15.0) == pytest.approx(3.3)
    assert meter.measure(15.0) == 0.0


def test_a_process_of_its_own_says_what_is_wrong_with_a_submission(tmp_path, monkeypatch):
    monkeypatch.setattr(submissions, "LARGE_REQUEST", 0)
    places = StatePaths(tmp_path)
    places.make_folders()
    twice = submission_of("c", *[make_spec(i % 20) for i in range(40)])
    with pytest.raises(Refused) as found:
        submissions.stage_request(codec.to_json(pack_submission(twice)), places)
    first, *_, last = str(found.value).splitlines()
    assert first.startswith("S1/pilot/0 is there twice")
    assert last == "and 10 more"
    with pytest.raises(Refused, match="the request is malformed"):
        submissions.stage_request(b"{}", places)
    assert list(places.incoming.iterdir()) == []
