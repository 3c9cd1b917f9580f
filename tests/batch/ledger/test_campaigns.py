"""Campaigns in the ledger: entered, listed, finished, acknowledged, cancelled, deleted."""

import re
import sqlite3
from contextlib import closing
from dataclasses import astuple, fields, replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.batch.errors import DaemonError, Refused
from daemon.batch.ledger import SCHEMA_VERSION, LedgerReader, LedgerWriter, connect
from daemon.batch.ledger.transitions import Cancelled, ExecutionState, Retried, advance
from daemon.batch.paths import StatePaths
from daemon.model.messages import RetryRequest
from daemon.model.spec import LARGEST_RESULT
from daemon.model.verdicts import Evidence, Outcome, RunState, Verdict
from grammars.text import codec
from tests.batch.conftest import NOW
from tests.make import make_result, make_spec, make_submission

RUNS = 600


def test_a_campaign_is_entered_once(ledger):
    assert not ledger.submit("c", 5).known
    assert ledger.submit("c", 5, at=NOW + 9).known
    row = ledger.row("c")
    assert (row.total, row.queued, row.submitted_at) == (5, 5, NOW)
    with pytest.raises(Refused, match="another campaign"):
        ledger.submit("c", 6)


def test_a_result_of_another_specification_or_of_too_many_bytes_is_refused(ledger):
    ledger.submit("c", 2)
    one, other = ledger.lease()
    with pytest.raises(Refused, match="specification differs"):
        ledger.complete(one, make_result(other.spec))
    with pytest.raises(Refused, match=f"the limit is {LARGEST_RESULT}"):
        ledger.complete(one, padded(make_result(one.spec), LARGEST_RESULT))
    assert ledger.reader.run(one.run).row.result is None


def padded(result, length, copies=1):
    verdict = replace(result.verdicts[0], evidence=Evidence(note="x" * length))
    return replace(result, verdicts=(verdict,) * copies)


def test_rows_show_the_deciding_oracle(ledger):
    ledger.submit("c", 2)
    tight = Verdict("near", "", Outcome.PASS, 0.1, 0.2, "m")
    measured = Verdict("speed", "", Outcome.MEASURE, None, None, "m/s", Evidence(value=0.3))
    failing = Verdict("hits", "", Outcome.FAIL, -2.0, -1.0, "m")

    def result_of(spec):
        made = make_result(spec, outcome=Outcome.FAIL if spec.repeat else Outcome.PASS)
        more = (tight, failing) if spec.repeat else (measured, *made.verdicts, tight)
        return replace(made, verdicts=more)

    for grant in ledger.lease():
        ledger.complete(grant, result_of(grant.spec))
    first, second = ledger.rows("c")
    assert (first.oracle, first.margin, first.unit) == ("near", 0.1, "m")
    assert (second.oracle, second.margin, second.outcome) == ("hits", -1.0, Outcome.FAIL)
    assert (second.trace, second.reason) == ("", "its trace is gone")
    assert ledger.reader.run("c.1").row.result == result_of(make_spec(1))


def test_pages_filter_sort_and_count(ledger):
    ledger.submit("c", 12)
    for grant in ledger.lease(10):
        number = grant.spec.repeat
        outcome = Outcome.FAIL if number % 2 else Outcome.PASS
        ledger.complete(grant, make_result(grant.spec, margin=-float(number), outcome=outcome))
    ledger.submit("d", 3)
    page = ledger.reader.runs("c", outcome="fail", sort="margin", offset=1, limit=2)
    assert (page.total, [row.index for row in page.rows]) == (5, [7, 5])
    assert [row.index for row in ledger.rows("c", sort="margin")][-2:] == [10, 11]
    down = ledger.rows("c", sort="index", descending=True, limit=1)
    assert down[0].index == 11
    for total, query in (
        (2, {"campaign": "c", "state": "queued"}),
        (1, {"text": "PILOT/11"}),
        (0, {"text": "100%_'"}),
        (12, {"campaign": "c", "scenario": "S1", "sut": "pilot"}),
        (0, {"campaign": "c", "scenario": "S1", "sut": "pil"}),
        (15, {}),
    ):
        assert ledger.reader.runs(**query).total == total, query


def test_the_worst_outcome_comes_first(ledger):
    ledger.submit("c", 4)
    outcomes = (Outcome.PASS, Outcome.INCONCLUSIVE, Outcome.FAIL, Outcome.ERROR)
    ledger.work(lambda spec: make_result(spec, outcome=outcomes[spec.repeat]))
    ledger.submit("d", make_spec(9))
    worst_first = [Outcome.FAIL, Outcome.ERROR, Outcome.INCONCLUSIVE, Outcome.PASS]
    rows = ledger.reader.runs(sort="outcome").rows
    assert [row.outcome for row in rows] == [*worst_first, None]


def test_unknown_words_in_questions_come_back_with_a_hint(ledger):
    for field, word, meant in (("sort", "margn", "margin"), ("state", "qeued", "queued")):
        with pytest.raises(Refused, match=f'did you mean "{meant}"'):
            ledger.reader.runs(**{field: word})


def test_a_client_goes_on_after_a_page_that_ends_at_its_bytes(ledger):
    ledger.submit("c", 24)
    ledger.work(lambda spec: padded(make_result(spec), 150, 700))
    assert 0 < len(ledger.rows("c", limit=1000, results=True)) < 24
    records = ledger.reader.all_runs("c", results=True)
    assert [record.id for record in records] == [f"c.{number}" for number in range(24)]


def test_campaigns_come_in_pages(ledger):
    for i in range(5):
        ledger.submit(f"c{i}", 1, name="odd" if i % 2 else "even")
    ledger.book.cancel("c4", NOW)
    for ids, query in (
        ("c4 c3 c2 c1 c0", {}),
        ("c3 c2", {"offset": 1, "limit": 2}),
        ("c2", {"id": "c2"}),
        ("c3 c1", {"name": "odd"}),
        ("c1", {"name": "odd", "unfinished": True, "beginning": "c1"}),
        ("c3", {"unfinished": True, "limit": 1}),
        ("", {"beginning": "d"}),
        ("", {"id": "%"}),
    ):
        assert [row.id for row in ledger.reader.campaign_page(**query)] == ids.split(), query
    assert [row.queued for row in ledger.reader.campaigns()] == [0, 1, 1, 1, 1]


def test_a_finished_campaign_says_so_once(ledger):
    ledger.submit("c", 2)
    ledger.book.events.clear()
    ledger.work()
    kinds = [(event.kind, event.state) for event in ledger.book.events]
    assert kinds[-2:] == [("run", "done"), ("campaign", "finished")]
    assert [event.seq for event in ledger.book.events] == list(range(2, 2 + len(kinds)))
    assert ledger.row("c").finished_at == NOW


def test_the_rate_is_runs_per_minute_lately(ledger):
    ledger.submit("c", 7)
    for i, grant in enumerate(ledger.lease()):
        ledger.complete(grant, at=NOW + 10 * i)
    assert ledger.reader.rate(NOW + 60) == pytest.approx(6.0)
    assert ledger.reader.rate(NOW + 9999) == 0.0


# --- news: the state machine holds runs that are lost, failed, executed again


def test_a_campaign_is_acknowledged_until_a_run_of_it_settles_badly(ledger):
    ledger.submit("c", 4)
    with pytest.raises(Refused, match="there is no campaign x"):
        ledger.book.acknowledge("x", NOW)
    settled = (Outcome.FAIL, Outcome.PASS, Outcome.INCONCLUSIVE, Outcome.ERROR)
    for bad, outcome in zip((1, 1, 2, 3), settled, strict=True):
        ledger.work(lambda spec, outcome=outcome: make_result(spec, outcome=outcome), count=1)
        assert ledger.row("c").acknowledged == (outcome is Outcome.PASS)
        assert ledger.book.acknowledge("c", NOW) == bad
    assert ledger.book.events[-1].state == "acknowledged"


def test_failures_of_searches_count_apart(ledger):
    def failing(spec):
        error = spec.repeat or spec.sut.parameters.get("number") == 2
        return make_result(spec, outcome=Outcome.ERROR if error else Outcome.FAIL)

    ledger.submit("c", 2)
    ledger.search("s", 3)
    ledger.work(failing)
    counts = ledger.reader.counts()[1]
    assert (counts["failed"], counts["searched"], counts["errors"]) == (1, 2, 2)
    assert ledger.row("s").failed == 2


# --- many runs at a time

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


def test_a_deleted_campaign_is_gone_with_all_that_only_it_needs(ledger):
    specs = [make_spec(i, scenario=f"S{i % 2}") for i in range(RUNS)]
    ledger.submit("old", *specs, reserve=[make_spec(9, scenario="R")])
    ledger.submit("kept", make_spec(1))
    with pytest.raises(Refused, match="`scenario cancel kept`"):
        ledger.book.delete(("kept", "old"), NOW)
    assert len(ledger.reader.campaigns()) == 2
    ledger.book.cancel("old", NOW)
    ledger.work()
    assert ledger.book.deletable(("old",)) == (RUNS,)
    with ledger.book.transaction():
        ledger.book.delete(("old",), NOW)
    assert [row.id for row in ledger.reader.campaigns()] == ["kept"]
    with pytest.raises(Refused, match="there is no run"):
        ledger.reader.run("old.0")
    assert {ledger.count(table) for table in ("campaign", "run", "cell", "script")} == {1}
    assert ledger.count("event WHERE campaign = 'old'") == 1
    assert ledger.reader.run("kept.0").spec == make_spec(1)
    assert ledger.db.execute("PRAGMA freelist_count").fetchone() == (0,)
    ledger.assert_sound()


def test_a_trace_that_another_campaign_uses_is_handed_over(ledger):
    specs = [make_spec(i) for i in range(3)]
    ledger.submit("old", *specs)
    ledger.work()
    for name in ("second", "third"):
        ledger.submit(name, *specs[:2])
    assert ledger.reader.run("third.1").row.cached == "old.1"
    contents = [Path(row.trace).read_bytes() for row in ledger.rows("old")[:2]]
    with ledger.book.transaction():
        ledger.book.delete(("old",), NOW)
    assert not (ledger.places.traces / "old").exists()
    rows = {name: ledger.rows(name) for name in ("second", "third")}
    assert [row.cached for row in rows["second"]] == ["", ""]
    assert [row.cached for row in rows["third"]] == ["second.0", "second.1"]
    for name in rows:
        assert [Path(row.trace).read_bytes() for row in rows[name]] == contents
        assert {row.state for row in rows[name]} == {RunState.DONE}
    ledger.assert_sound()


def test_traces_stay_when_the_deletion_is_undone(ledger):
    def delete_and_fail(book):
        book.delete(("old",), NOW)
        raise ZeroDivisionError

    ledger.submit("old", make_spec())
    ledger.work()
    with ledger.book.transaction():
        assert isinstance(ledger.book.attempt(delete_and_fail), ZeroDivisionError)
    assert ledger.traces() == {"old": 1}
    with ledger.book.transaction():
        ledger.book.delete(("old",), NOW)
        ledger.submit("old", make_spec(2))
    # They are of a campaign that is there again.
    assert ledger.traces() == {"old": 1}


# --- files


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
