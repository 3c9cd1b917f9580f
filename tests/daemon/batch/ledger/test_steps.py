"""What takes long is done in steps: what others see, and may do, between any two of them."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from daemon.batch.errors import Refused
from daemon.batch.ledger import (
    LedgerReader,
    LedgerWriter,
    check_integrity,
    names,
    stage_submission,
)
from daemon.batch.paths import StatePaths
from daemon.model.messages import (
    CampaignQuery,
    Completion,
    LedgerAnswer,
    RecordQuery,
    RetryRequest,
    RunQuery,
)
from daemon.model.packed_submission import pack_submission
from daemon.model.run_state import RunState
from tests.daemon.batch.ledger_rules import broken_rules
from tests.daemon.batch.samples import make_result, make_spec, make_submission, submission_of

NOW = 1_000_000.0
RUNS = 600
"""Three steps."""


@dataclass
class Ledger:
    """A ledger with both its sides, and the state directory around it."""

    book: LedgerWriter
    reader: LedgerReader
    places: StatePaths

    def entering(self, submission):
        staged = self.places.incoming / f"{submission.campaign}.db"
        staged.unlink(missing_ok=True)
        stage_submission(pack_submission(submission), staged)
        return self.book.submit_in_steps(staged, NOW)

    def leased(self, count=1):
        with self.book.transaction():
            return [lease.run for lease in self.book.lease("w", count, NOW)]

    def work(self):
        """Execute what is queued, each run with a trace."""
        with self.book.transaction():
            for lease in self.book.lease("w", 1000, NOW):
                path = self.places.trace(lease.trace)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(lease.run)
                done = (lease.run, lease.attempt, lease.token, make_result(lease.spec))
                assert self.book.complete(Completion("w", *done), NOW) is LedgerAnswer.RECORDED

    def rows(self, table):
        with closing(sqlite3.connect(self.places.ledger)) as db:
            return int(db.execute(f"SELECT count(*) FROM {table}").fetchone()[0])

    def sound(self):
        assert check_integrity(self.places.ledger).damage == ()
        assert broken_rules(self.places.ledger) == []


@pytest.fixture
def ledger(tmp_path):
    places = StatePaths(tmp_path)
    places.make_folders()
    with LedgerWriter.open(places) as book, LedgerReader.open(places) as reader:
        yield Ledger(book, reader, places)


def do(book, steps, count=10_000):
    """Do steps, a transaction each; returns the value when they are over."""
    for _ in range(count):
        with book.transaction():
            try:
                next(steps)
            except StopIteration as done:
                return done.value
    return None


def test_of_a_submission_nothing_is_seen_before_it_is_whole(ledger):
    book, reader = ledger.book, ledger.reader
    ledger.book.submit(make_submission("other", 1), NOW)
    steps = ledger.entering(make_submission("c", RUNS))
    assert do(book, steps, 3) is None
    assert ledger.rows("run") > 1
    assert [row.id for row in reader.campaigns()] == ["other"]
    assert reader.counts()[0] == 1
    assert reader.counts()[1]["queued"] == 1
    assert [row.campaign for row in reader.runs(RunQuery()).rows] == ["other"]
    assert reader.runs(RunQuery("c")).rows == ()
    assert reader.campaign_ids() == {"other"}
    for ask in (
        lambda: reader.run("c.0"),
        lambda: reader.declared("c"),
        lambda: reader.records(RecordQuery("c")),
        lambda: reader.trace_reference("c.0"),
        lambda: book.cancel("c", NOW),
        lambda: book.pause("c", NOW, paused=True),
        lambda: book.deletable(("c",)),
    ):
        with pytest.raises(Refused, match="there is no"):
            ask()
    assert [name.id for name in names.campaigns(ledger.places.ledger)] == ["other"]
    assert [name.name for name in names.runs(ledger.places.ledger, "c")] == []
    assert ledger.leased(5) == ["other.0"]
    ledger.sound()
    receipt = do(book, steps)
    assert (receipt.runs, receipt.known) == (RUNS, False)
    assert reader.counts()[1]["queued"] == RUNS
    assert ledger.leased() == ["c.0"]
    ledger.sound()


def test_what_was_given_up_in_the_middle_is_removed_or_begun_anew(ledger):
    book = ledger.book
    submission = make_submission("c", RUNS)
    for removing in (0, 2):
        given_up = ledger.entering(submission)
        do(book, given_up, removing + 3)
        given_up.close()
        assert ledger.rows("run") == 250
    assert book.hides_anything
    assert do(book, book.remove_hidden_in_steps()) == 1
    assert not book.hides_anything
    assert {ledger.rows(table) for table in ("campaign", "run", "spec", "part", "tally")} == {0}
    assert do(book, ledger.entering(submission)).runs == RUNS
    assert do(book, ledger.entering(submission)).known
    other = make_submission("c", RUNS + 1)
    with pytest.raises(Refused, match="taken"):
        do(book, ledger.entering(other))
    ledger.sound()


def test_what_is_being_cancelled_is_not_leased_meanwhile(ledger):
    book = ledger.book
    book.submit(make_submission("c", RUNS), NOW)
    steps = book.cancel_in_steps("c", NOW)
    do(book, steps, 1)
    assert ledger.reader.counts()[1]["queued"] == RUNS - 250
    assert ledger.leased() == []
    with pytest.raises(Refused, match="wait or run"):
        book.deletable(("c",))
    assert do(book, steps) == RUNS
    assert ledger.reader.campaigns()[0].cancelled == RUNS
    ledger.sound()


def test_a_campaign_that_is_retried_does_not_end_in_the_middle(ledger):
    book = ledger.book
    book.submit(make_submission("c", RUNS), NOW)
    book.cancel("c", NOW)
    steps = book.retry_in_steps(RetryRequest("c", ("cancelled",)), NOW)
    do(book, steps, 1)
    assert ledger.leased() == []
    assert ledger.reader.campaigns()[0].finished_at is None
    assert do(book, steps) == RUNS
    assert ledger.leased() == ["c.0"]
    ledger.sound()


def test_what_is_given_up_holds_nothing_back(ledger):
    ledger.book.submit(make_submission("c", RUNS), NOW)
    steps = ledger.book.cancel_in_steps("c", NOW)
    do(ledger.book, steps, 1)
    steps.close()
    assert ledger.leased() == ["c.250"]


def test_a_deleted_campaign_is_gone_at_once_and_its_rows_soon(ledger):
    book, reader = ledger.book, ledger.reader
    specs = [make_spec(i, scenario=f"S{i % 2}") for i in range(RUNS)]
    book.submit(replace(submission_of("old", *specs), reserve=(make_spec(9, scenario="R"),)), NOW)
    book.submit(submission_of("kept", make_spec(1)), NOW)
    with pytest.raises(Refused, match="`scenario cancel kept`"):
        book.delete(("kept", "old"), NOW)
    assert len(reader.campaigns()) == 2
    book.cancel("old", NOW)
    ledger.work()
    assert book.deletable(("old",)) == (RUNS,)
    with book.transaction():
        book.delete(("old",), NOW)
    assert [row.id for row in reader.campaigns()] == ["kept"]
    with pytest.raises(Refused, match="there is no run"):
        reader.run("old.0")
    ledger.sound()
    steps = book.remove_hidden_in_steps()
    do(book, steps, 2)
    ledger.sound()
    steps.close()
    assert do(book, book.remove_hidden_in_steps()) == 1
    counted = {table: ledger.rows(table) for table in ("campaign", "run", "spec", "reserve")}
    assert counted == {"campaign": 1, "run": 1, "spec": 1, "reserve": 0}
    assert ledger.rows("part") == 2
    assert ledger.rows("event WHERE campaign = 'old'") == 1
    assert reader.run("kept.0").spec == make_spec(1)
    with closing(sqlite3.connect(ledger.places.ledger)) as db:
        assert db.execute("PRAGMA freelist_count").fetchone() == (0,)
    ledger.sound()


def test_a_trace_that_another_campaign_uses_is_handed_over(ledger):
    book, reader, places = ledger.book, ledger.reader, ledger.places
    specs = [make_spec(i) for i in range(3)]
    book.submit(submission_of("old", *specs), NOW)
    ledger.work()
    for name in ("second", "third"):
        book.submit(replace(submission_of(name, *specs[:2]), fresh=False), NOW)
    assert reader.run("third.1").row.cached == "old.1"
    with book.transaction():
        book.delete(("old",), NOW)
    do(book, book.remove_hidden_in_steps())
    assert not (places.traces / "old").exists()
    rows = {name: reader.runs(RunQuery(name)).rows for name in ("second", "third")}
    assert [row.cached for row in rows["second"]] == ["", ""]
    assert [row.cached for row in rows["third"]] == ["second.0", "second.1"]
    for name in rows:
        assert [Path(row.trace).read_text() for row in rows[name]] == ["old.0", "old.1"]
        assert {row.state for row in rows[name]} == {RunState.DONE}
    ledger.sound()


def test_nothing_is_reused_of_what_is_being_removed(ledger):
    book = ledger.book
    book.submit(submission_of("old", make_spec()), NOW)
    ledger.work()
    with book.transaction():
        book.delete(("old",), NOW)
    receipt = book.submit(replace(submission_of("new", make_spec()), fresh=False), NOW)
    assert receipt.cached == 0


def test_campaigns_come_in_pages(ledger):
    for i in range(5):
        one = make_submission(f"c{i}", 1)
        ledger.book.submit(replace(one, name="odd" if i % 2 else "even"), NOW)
    ledger.book.cancel("c4", NOW)

    def ids(**fields):
        return [row.id for row in ledger.reader.campaigns(CampaignQuery(**fields))]

    assert ids() == ["c4", "c3", "c2", "c1", "c0"]
    assert ids(offset=1, limit=2) == ["c3", "c2"]
    assert ids(id="c2") == ["c2"]
    assert ids(name="odd") == ["c3", "c1"]
    assert ids(name="odd", unfinished=True, beginning="c1") == ["c1"]
    assert ids(unfinished=True, limit=1) == ["c3"]
    assert ids(beginning="d") == ids(id="%") == []
    assert [row.queued for row in ledger.reader.campaigns()] == [0, 1, 1, 1, 1]
