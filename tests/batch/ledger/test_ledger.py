import re
import sqlite3
from contextlib import closing

import pytest

from daemon.batch.errors import DaemonError, Refused
from daemon.batch.ledger import SCHEMA_VERSION, LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, LeaseRef
from daemon.model.spec import RunResult
from daemon.model.verdicts import Evidence, Outcome, Verdict
from tests.make import make_result, make_submission

NOW = 1_000_000.0


@pytest.fixture
def ledger(tmp_path):
    writing = connect(tmp_path / "ledger.db")
    with LedgerReader.open(StatePaths(tmp_path)) as reader:
        yield LedgerWriter(writing), reader, writing
    writing.close()


def finish(book, result_of=None):
    for grant in book.lease("w", 100, NOW):
        result = (result_of or {}).get(grant.spec.repeat) or make_result(grant.spec)
        book.complete(Completion("w", grant.run, grant.attempt, grant.token, result), NOW)


def test_submitting_twice_changes_nothing(ledger):
    book, reader, _ = ledger
    submission = make_submission("c", 5)
    assert not book.submit(submission, NOW).known
    assert book.submit(submission, NOW + 9).known
    (row,) = reader.campaigns()
    assert (row.total, row.queued, row.submitted_at) == (5, 5, NOW)


def test_another_campaign_cannot_take_a_known_id(ledger):
    book, _, _ = ledger
    book.submit(make_submission("c", 5), NOW)
    with pytest.raises(Refused, match="taken"):
        book.submit(make_submission("c", 6), NOW)


def test_a_result_of_another_specification_is_refused(ledger):
    book, _, _ = ledger
    book.submit(make_submission("c", 2), NOW)
    one, other = book.lease("w", 2, NOW)
    with pytest.raises(Refused, match="specification differs"):
        book.complete(Completion("w", one.run, 1, one.token, make_result(other.spec)), NOW)


def test_rows_show_the_deciding_oracle(ledger):
    book, reader, _ = ledger
    submission = make_submission("c", 2)
    book.submit(submission, NOW)
    passing = make_result(submission.specs[0])
    tight = Verdict("near", "", Outcome.PASS, 0.1, 0.2, "m")
    measured = Verdict("speed", "", Outcome.MEASURE, None, None, "m/s", Evidence(value=0.3))
    failing = Verdict("hits", "", Outcome.FAIL, -2.0, -1.0, "m")
    results = {
        0: _with(passing, (measured, *passing.verdicts, tight), Outcome.PASS),
        1: _with(make_result(submission.specs[1]), (tight, failing), Outcome.FAIL),
    }
    finish(book, results)
    first, second = reader.runs("c").rows
    assert (first.oracle, first.margin, first.unit) == ("near", 0.1, "m")
    assert (second.oracle, second.margin, second.outcome) == ("hits", -1.0, Outcome.FAIL)
    assert (second.trace, second.reason) == ("", "its trace is gone")
    assert reader.run("c.1").row.result == results[1]


def _with(result, verdicts, outcome):
    trace, timing = result.trace, result.timing
    return RunResult(result.spec, outcome, verdicts, result.ended, trace, timing)


def test_pages_filter_sort_and_count(ledger):
    book, reader, _ = ledger
    submission = make_submission("c", 12)
    book.submit(submission, NOW)
    results = {
        i: make_result(run, margin=-float(i), outcome=Outcome.FAIL if i % 2 else Outcome.PASS)
        for i, run in enumerate(submission.specs)
    }
    for grant in book.lease("w", 10, NOW):
        result = results[grant.spec.repeat]
        book.complete(Completion("w", grant.run, grant.attempt, grant.token, result), NOW)
    book.submit(make_submission("d", 3), NOW)
    page = reader.runs("c", outcome="fail", sort="margin", offset=1, limit=2)
    assert page.total == 5
    assert [row.index for row in page.rows] == [7, 5]
    assert [row.index for row in reader.runs("c", sort="margin").rows][-2:] == [10, 11]
    assert reader.runs("c", state="queued").total == 2
    assert reader.runs(text="PILOT/11").total == 1
    assert reader.runs(text="100%_'").total == 0
    assert reader.runs("c").total == 12
    assert reader.runs("c", scenario="S1", sut="pilot").total == 12
    assert reader.runs("c", scenario="S1", sut="pil").total == 0
    assert reader.runs().total == 15
    down = reader.runs("c", sort="index", descending=True, limit=1)
    assert down.rows[0].index == 11


def test_the_worst_outcome_comes_first(ledger):
    book, reader, _ = ledger
    submission = make_submission("c", 4)
    book.submit(submission, NOW)
    outcomes = (Outcome.PASS, Outcome.INCONCLUSIVE, Outcome.FAIL, Outcome.ERROR)
    pairs = zip(submission.specs, outcomes, strict=True)
    finish(book, {i: make_result(run, outcome=o) for i, (run, o) in enumerate(pairs)})
    book.submit(make_submission("d", 1), NOW)
    rows = reader.runs(sort="outcome").rows
    worst_first = [Outcome.FAIL, Outcome.ERROR, Outcome.INCONCLUSIVE, Outcome.PASS]
    assert [row.outcome for row in rows] == [*worst_first, None]


def test_unknown_words_in_questions_come_back_with_a_hint(ledger):
    _, reader, _ = ledger
    with pytest.raises(Refused, match='did you mean "margin"'):
        reader.runs(sort="margn")
    with pytest.raises(Refused, match='did you mean "queued"'):
        reader.runs(state="qeued")
    with pytest.raises(Refused, match="no run"):
        reader.run("c.0")


def test_a_finished_campaign_says_so_once(ledger):
    book, reader, _ = ledger
    book.submit(make_submission("c", 2), NOW)
    book.events.clear()
    finish(book)
    kinds = [(event.kind, event.state) for event in book.events]
    assert kinds[-2:] == [("run", "done"), ("campaign", "finished")]
    assert [event.seq for event in book.events] == list(range(2, 2 + len(kinds)))
    assert reader.campaigns()[0].finished_at == NOW


def test_the_rate_is_runs_per_minute_lately(ledger):
    book, reader, _ = ledger
    book.submit(make_submission("c", 7), NOW)
    for i, grant in enumerate(book.lease("w", 7, NOW)):
        done = Completion("w", grant.run, grant.attempt, grant.token, make_result(grant.spec))
        book.complete(done, NOW + 10 * i)
    assert reader.rate(NOW + 60) == pytest.approx(6.0)
    assert reader.rate(NOW + 9999) == 0.0


def test_counting_does_not_read_the_runs(ledger, tmp_path):
    book, _, db = ledger
    book.submit(make_submission("c", 1), NOW)
    db.execute("BEGIN")
    db.execute(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 100000)"
        " INSERT INTO run (id, campaign, position, cell, script, scenario, sut, repeat,"
        " time_limit, digest, trace_name)"
        " SELECT 'c.' || i, 'c', i, 0, 0, 'S', 's', i, 9, 'd', 'c/' || i FROM n"
    )
    db.execute("UPDATE tally SET runs = runs + 100000")
    db.execute("COMMIT")
    reader, thousands = LedgerReader(db, StatePaths(tmp_path)), []
    db.set_progress_handler(lambda: thousands.append(1), 1000)
    assert reader.counts()[1]["queued"] == 100_001
    assert reader.campaigns()[0].queued == 100_001
    assert len(reader.runs(sort="index", offset=500, limit=50).rows) == 50
    # Steps of SQLite's machine; reading every run takes several for each of the 100 000.
    assert len(thousands) < 50


def test_a_ledger_of_another_version_is_left_alone(tmp_path):
    path = tmp_path / "ledger.db"
    connect(path).close()
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA user_version = 99")
    db.close()
    with pytest.raises(DaemonError, match="schema 99"):
        connect(path)


def test_a_damaged_ledger_is_named(tmp_path):
    path = tmp_path / "ledger.db"
    path.write_bytes(b"not a database, but long enough to be looked at" * 100)
    with pytest.raises(DaemonError, match=r"ledger\.db is not a usable ledger"):
        connect(path)


def test_everything_is_still_there_after_reopening(tmp_path):
    path = tmp_path / "ledger.db"
    db = connect(path)
    LedgerWriter(db).submit(make_submission("c", 2), NOW)
    (granted,) = LedgerWriter(db).lease("w", 1, NOW)
    db.close()
    again = connect(path)
    book = LedgerWriter(again)
    assert book.leases() == (LeaseRef(granted.run, granted.token),)
    assert book.lease("w", 1, NOW)[0].token > granted.token
    again.close()


@pytest.mark.parametrize("version", [1, SCHEMA_VERSION - 1, SCHEMA_VERSION + 1])
def test_a_ledger_of_another_schema_is_refused(tmp_path, version):
    places = StatePaths(tmp_path)
    connect(places.ledger).close()
    with closing(sqlite3.connect(places.ledger)) as db:
        db.execute(f"PRAGMA user_version = {version}")
    words = (
        f"{places.ledger} has schema {version}, this version reads and writes schema"
        f" {SCHEMA_VERSION}: use the version that made it, or name another state directory"
    )
    for opening in (LedgerWriter.open(places), LedgerReader.open(places)):
        with pytest.raises(DaemonError, match=re.escape(words)), opening:
            pass
