"""Campaigns that are entered, cancelled, retried and deleted, many runs at a time."""

from __future__ import annotations

import sqlite3
from contextlib import closing, suppress
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.batch.errors import Refused
from daemon.batch.ledger import (
    LedgerReader,
    LedgerWriter,
    check_integrity,
    connect,
)
from daemon.batch.ledger.transitions import Cancelled, ExecutionState, Retried, advance
from daemon.batch.paths import StatePaths
from daemon.model.messages import (
    Completion,
    LedgerAnswer,
    RetryRequest,
)
from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from grammars.text import codec
from tests.batch.ledger_rules import broken_rules
from tests.make import make_result, make_spec, make_submission, submission_of

NOW = 1_000_000.0
RUNS = 600


@dataclass
class Ledger:
    """A ledger with both its sides, and the state directory around it."""

    book: LedgerWriter
    reader: LedgerReader
    places: StatePaths

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


STATES = st.builds(
    ExecutionState,
    state=st.sampled_from(RunState),
    attempt=st.integers(0, 9),
    strikes=st.integers(0, 2),
    worker=st.just("w"),
    token=st.integers(0, 9),
    result=st.sampled_from(["", "a" * 64]),
    reason=st.just("why"),
    repeatable=st.booleans(),
    granted=st.integers(0, 9),
    outdated=st.integers(0, 9),
    lapses=st.integers(0, 9),
    nondeterministic=st.booleans(),
)
FIELDS = tuple(field.name for field in fields(ExecutionState))


@given(state=STATES, stopped=st.booleans())
def test_what_is_done_to_all_runs_at_once_is_what_is_done_to_one(state, stopped):
    """Cancelling and retrying a campaign is what the pure function says of each of its runs."""
    if state.state is RunState.DONE:
        state = replace(state, result="a" * 64)
    elif state.state in (RunState.LOST, RunState.CANCELLED):
        state = replace(state, result="")
    for event, act in (
        (Cancelled(), lambda book: book.cancel("c", NOW)),
        (Retried(stopped), lambda book: book.retry(RetryRequest("c", ("all",)), NOW)),
    ):
        db = connect(Path(":memory:"))
        book = LedgerWriter(db)
        book.submit(make_submission("c", 1), NOW)
        values = ", ".join(f"{name} = ?" for name in FIELDS)
        db.execute(f"UPDATE run SET {values}", astuple(state))
        if state.result:
            body = codec.to_json(replace(make_result(make_spec()), stopped=stopped))
            outcome = Outcome.ERROR if stopped else Outcome.FAIL
            db.execute("UPDATE run SET outcome = ?", (outcome,))
            db.execute("INSERT INTO result VALUES ('c.0', 1, 'w', ?, 0, ?)", (state.result, body))
        act(book)
        row = db.execute(f"SELECT {', '.join(FIELDS)} FROM run").fetchone()
        expected = advance(state, event, attempts=3).run
        assert ExecutionState(*row) == expected
        assert db.execute("SELECT count(*) FROM result").fetchone() == (bool(expected.result),)
        db.close()


def test_a_campaign_is_entered_once(ledger):
    book = ledger.book
    assert not book.submit(make_submission("c", RUNS), NOW).known
    assert book.submit(make_submission("c", RUNS), NOW).known
    with pytest.raises(Refused, match="taken"):
        book.submit(make_submission("c", RUNS + 1), NOW)
    ledger.sound()


def test_a_submission_that_is_undone_leaves_nothing(ledger):
    with suppress(ZeroDivisionError), ledger.book.transaction():
        ledger.book.submit(make_submission("c", RUNS), NOW)
        raise ZeroDivisionError
    assert {ledger.rows(table) for table in ("campaign", "run", "cell", "script", "tally")} == {0}


def test_a_deleted_campaign_is_gone_with_all_that_only_it_needs(ledger):
    book, reader = ledger.book, ledger.reader
    specs = [make_spec(i, scenario=f"S{i % 2}") for i in range(RUNS)]
    book.submit(submission_of("old", *specs, reserve=[make_spec(9, scenario="R")]), NOW)
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
    assert {ledger.rows(table) for table in ("campaign", "run", "cell", "script")} == {1}
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
    assert not (places.traces / "old").exists()
    rows = {name: reader.runs(name).rows for name in ("second", "third")}
    assert [row.cached for row in rows["second"]] == ["", ""]
    assert [row.cached for row in rows["third"]] == ["second.0", "second.1"]
    for name in rows:
        assert [Path(row.trace).read_text() for row in rows[name]] == ["old.0", "old.1"]
        assert {row.state for row in rows[name]} == {RunState.DONE}
    ledger.sound()


def test_traces_stay_when_the_deletion_is_undone(ledger):
    book, places = ledger.book, ledger.places
    book.submit(submission_of("old", make_spec()), NOW)
    ledger.work()
    with book.transaction():
        problem = book.attempt(lambda _: delete_and_fail(book))
    assert isinstance(problem, ZeroDivisionError)
    assert len(list((places.traces / "old").iterdir())) == 1
    with book.transaction():
        book.delete(("old",), NOW)
        book.submit(submission_of("old", make_spec(2)), NOW)
    # They are of a campaign that is there again.
    assert len(list((places.traces / "old").iterdir())) == 1


def delete_and_fail(book):
    book.delete(("old",), NOW)
    raise ZeroDivisionError


def test_campaigns_come_in_pages(ledger):
    for i in range(5):
        one = make_submission(f"c{i}", 1)
        ledger.book.submit(replace(one, name="odd" if i % 2 else "even"), NOW)
    ledger.book.cancel("c4", NOW)

    def ids(**fields):
        return [row.id for row in ledger.reader.campaign_page(**fields)]

    assert ids() == ["c4", "c3", "c2", "c1", "c0"]
    assert ids(offset=1, limit=2) == ["c3", "c2"]
    assert ids(id="c2") == ["c2"]
    assert ids(name="odd") == ["c3", "c1"]
    assert ids(name="odd", unfinished=True, beginning="c1") == ["c1"]
    assert ids(unfinished=True, limit=1) == ["c3"]
    assert ids(beginning="d") == ids(id="%") == []
    assert [row.queued for row in ledger.reader.campaigns()] == [0, 1, 1, 1, 1]
