"""Traces go when space is wanted back: of finished campaigns, oldest first; results stay."""

import sqlite3
from collections import Counter
from dataclasses import replace

import pytest

from daemon.batch.errors import DaemonError
from daemon.batch.ledger import (
    LedgerReader,
    LedgerWriter,
    RetentionPolicy,
    SweepResult,
    connect,
    sweep_traces,
)
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, RetryRequest
from tests.make import make_result, make_spec, make_submission, submission_of

SIZE = 100


class Store:
    """A state directory with campaigns that finished at 10, 20 ... seconds."""

    def __init__(self, folder):
        self.places = StatePaths.find(folder)
        self.places.make_folders()
        self.db = connect(self.places.ledger)
        self.book = LedgerWriter(self.db)

    def work(self, campaign, at, count=100):
        for grant in self.book.lease("w", count, at):
            path = self.places.trace(grant.trace)
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(bytes(SIZE))
            done = ("w", grant.run, grant.attempt, grant.token, make_result(grant.spec))
            self.book.complete(Completion(*done), at)

    def finish(self, campaign, at):
        self.book.submit(make_submission(campaign, 3), at)
        self.work(campaign, at)

    def left(self):
        return dict(Counter(path.parent.name for path in self.places.traces.glob("*/*.mcap")))


@pytest.fixture
def store(tmp_path):
    store = Store(tmp_path)
    for i, name in enumerate(("a", "b", "c"), start=1):
        store.finish(name, 10.0 * i)
    yield store
    store.db.close()


def test_the_newest_campaigns_keep_their_traces(store):
    swept = sweep_traces(store.places, RetentionPolicy(newest=1), 100.0)
    assert [trace.campaign for trace in swept.gone] == ["a"] * 3 + ["b"] * 3
    assert (swept.freed, swept.kept) == (6 * SIZE, 3 * SIZE)
    assert store.left() == {"c": 3}
    assert sweep_traces(store.places, RetentionPolicy(newest=1), 100.0) == SweepResult((), 3 * SIZE)


def test_traces_of_campaigns_that_finished_long_ago_go(store):
    sweep_traces(store.places, RetentionPolicy(age=15.0), 30.0)
    assert store.left() == {"b": 3, "c": 3}


def test_the_oldest_go_until_the_rest_fits(store):
    swept = sweep_traces(store.places, RetentionPolicy(size=5 * SIZE), 100.0)
    assert (swept.freed, swept.kept) == (4 * SIZE, 5 * SIZE)
    assert store.left() == {"b": 2, "c": 3}


def test_a_dry_run_removes_nothing(store):
    assert len(sweep_traces(store.places, RetentionPolicy(newest=0), 100.0, dry=True).gone) == 9
    assert store.left() == {"a": 3, "b": 3, "c": 3}


def test_unfinished_campaigns_keep_theirs_and_those_they_took_results_from(store):
    shared = make_spec(0, scenario="shared")
    store.book.submit(submission_of("old", shared), 1.0)
    store.work("old", 1.0)
    others = (make_spec(repeat, scenario="other") for repeat in range(2))
    store.book.submit(replace(submission_of("new", shared, *others), fresh=False), 50.0)
    store.work("new", 50.0, count=1)
    store.book.retry(RetryRequest("a", ("all",)), 60.0)
    sweep_traces(store.places, RetentionPolicy(newest=0, age=0.0, size=0), 100.0)
    assert store.left() == {"a": 3, "new": 1, "old": 1}


def test_results_stay_and_say_that_the_trace_is_gone(store):
    sweep_traces(store.places, RetentionPolicy(newest=0), 100.0)
    with LedgerReader.open(store.places) as reader:
        row = reader.runs("a").rows[0]
        record = reader.runs("a", results=True).rows[0]
    assert (row.state, row.outcome, row.trace) == ("done", "pass", "")
    assert row.reason == record.note == "its trace is gone"
    assert record.verdicts


def test_a_campaign_that_starts_again_meanwhile_keeps_its_traces(store, monkeypatch):
    choose = RetentionPolicy.choose

    def choose_slowly(*arguments):
        chosen = choose(*arguments)
        store.book.retry(RetryRequest("b", ("all",)), 60.0)
        return chosen

    monkeypatch.setattr(RetentionPolicy, "choose", choose_slowly)
    swept = sweep_traces(store.places, RetentionPolicy(newest=0), 100.0)
    assert store.left() == {"b": 3}
    assert (len(swept.gone), swept.kept) == (6, 3 * SIZE)


def test_what_is_no_ledger_of_this_version_is_left_alone(tmp_path):
    with pytest.raises(DaemonError, match="nothing was ever run there"):
        sweep_traces(StatePaths(tmp_path), RetentionPolicy(), 0.0)
    (tmp_path / "ledger.db").write_bytes(b"no database at all" * 100)
    with pytest.raises(DaemonError, match="cannot be used"):
        sweep_traces(StatePaths(tmp_path), RetentionPolicy(), 0.0)
    (tmp_path / "ledger.db").unlink()
    sqlite3.connect(tmp_path / "ledger.db").executescript("PRAGMA user_version = 99").close()
    with pytest.raises(DaemonError, match="schema 99"):
        sweep_traces(StatePaths(tmp_path), RetentionPolicy(), 0.0)
