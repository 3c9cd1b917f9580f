"""Traces go when space is wanted back: of finished campaigns, oldest first; results stay."""

import sqlite3
from contextlib import closing

import pytest

from daemon.batch.errors import DaemonError
from daemon.batch.ledger import RetentionPolicy, sweep_traces
from daemon.batch.ledger._disk_space import SweepResult
from daemon.batch.paths import StatePaths
from tests.make import make_spec

SIZE = 100


@pytest.fixture
def store(ledger):
    """A state directory with campaigns that finished at 10, 20 and 30 seconds."""
    for i, name in enumerate(("a", "b", "c"), start=1):
        ledger.submit(name, 3, fresh=True, at=10.0 * i)
        ledger.work(at=10.0 * i, trace=bytes(SIZE))
    return ledger


def sweep(store, now=100.0, dry=False, **policy):
    return sweep_traces(store.places, RetentionPolicy(**policy), now, dry=dry)


def test_the_newest_campaigns_keep_their_traces(store):
    swept = sweep(store, newest=1)
    assert [trace.campaign for trace in swept.traces] == ["a"] * 3 + ["b"] * 3
    assert (swept.freed, swept.rest) == (6 * SIZE, 3 * SIZE)
    assert store.traces() == {"c": 3}
    assert sweep(store, newest=1) == SweepResult((), 3 * SIZE)


@pytest.mark.parametrize(
    ("policy", "gone", "left"),
    [
        ({"now": 25.0, "age": 15.0}, 0, {"a": 3, "b": 3, "c": 3}),
        ({"now": 30.0, "age": 15.0}, 3, {"b": 3, "c": 3}),
        ({"size": 5 * SIZE}, 4, {"b": 2, "c": 3}),  # the oldest go until the rest fits
        ({"newest": 0, "dry": True}, 9, {"a": 3, "b": 3, "c": 3}),
    ],
)
def test_traces_go_by_age_and_size_and_none_in_a_dry_run(store, policy, gone, left):
    swept = sweep(store, **policy)
    assert (len(swept.traces), swept.freed, swept.rest) == (gone, gone * SIZE, (9 - gone) * SIZE)
    assert store.traces() == left


def test_unfinished_campaigns_keep_theirs_and_those_they_took_results_from(store):
    shared = make_spec(0, scenario="shared")
    store.submit("old", shared, at=1.0)
    store.work(at=1.0)
    others = (make_spec(repeat, scenario="other") for repeat in range(2))
    store.submit("new", shared, *others, at=50.0)
    store.work(at=50.0, count=1)
    store.retry("a", "all", at=60.0)
    sweep(store, newest=0, age=0.0, size=0)
    assert store.traces() == {"a": 3, "new": 1, "old": 1}


def test_a_campaign_that_starts_again_meanwhile_keeps_its_traces(store, monkeypatch):
    choose = RetentionPolicy.choose

    def choose_slowly(*arguments):
        chosen = choose(*arguments)
        store.retry("b", "all", at=60.0)
        return chosen

    monkeypatch.setattr(RetentionPolicy, "choose", choose_slowly)
    swept = sweep(store, newest=0)
    assert store.traces() == {"b": 3}
    assert (len(swept.traces), swept.rest) == (6, 3 * SIZE)


def test_what_is_no_ledger_of_this_version_is_left_alone(tmp_path):
    ledger = tmp_path / "ledger.db"

    def other_version():
        ledger.unlink()
        with closing(sqlite3.connect(ledger)) as db:
            db.execute("PRAGMA user_version = 99")

    for spoil, words in (
        (lambda: None, "no daemon has run there yet"),
        (lambda: ledger.write_bytes(b"no database at all" * 100), "cannot be used"),
        (other_version, "schema 99"),
    ):
        spoil()
        with pytest.raises(DaemonError, match=words):
            sweep_traces(StatePaths(tmp_path), RetentionPolicy(), 0.0)
