"""Searches in the ledger: runs added by position, ended by whoever proposes or by people."""

import sqlite3
from dataclasses import replace

import pytest

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.batch.server._search_handlers import read_extension
from daemon.model.messages import Completion, LedgerAnswer, RetryRequest
from daemon.model.run_state import RunState
from daemon.model.search_answer import SearchAnswer, SearchProgress
from daemon.model.spec import LeadingMargin
from daemon.model.verdicts import Outcome
from grammars.text import codec
from tests.batch.ledger_rules import broken_rules
from tests.make import (
    make_extension,
    make_result,
    make_search,
    submission_of,
)

NOW = 1_000_000.0
ANSWER = SearchAnswer("budget", 3, 3, 0, 1, 0, 0, 3, 1, sentences=("three runs",))


def led(spec):
    lead = LeadingMargin("arrives", 0.25, "s", "door")
    return replace(make_result(spec, outcome=Outcome.FAIL, margin=-0.5), leads=(lead,))


class Searches:
    """A ledger with a search ``s``."""

    def __init__(self, places, book, reader):
        self.places, self.book, self.reader = places, book, reader
        self.begin("s")

    def begin(self, name, **changes):
        self.book.begin_search(make_search(name, **changes), NOW)

    def extend(self, first, count=1, name="s", **parameters):
        return self.add(make_extension(name, first, count, **parameters))

    def add(self, request):
        staged = read_extension(codec.to_json(request), self.places)
        with self.book.transaction():
            return self.book.extend(staged.proposals, staged.runs, NOW)

    def work(self):
        done = 0
        while grants := self.book.lease("w", 100, NOW):
            for grant in grants:
                path = self.places.trace(grant.trace)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(b"trace")
                done_by = ("w", grant.run, grant.attempt, grant.token)
                answer = self.book.complete(Completion(*done_by, led(grant.spec)), NOW)
                assert answer in (LedgerAnswer.RECORDED, LedgerAnswer.KNOWN)
            done += len(grants)
        return done

    def rows(self, offset=0, limit=500, name="s"):
        return self.reader.runs(name, offset=offset, limit=limit, results=True).rows

    def campaign(self, name="s"):
        return next(row for row in self.reader.campaigns() if row.id == name)

    def say(self, **changes):
        self.book.note_progress(replace(SearchProgress("s", "lab", "explore"), **changes), NOW)


@pytest.fixture
def searches(tmp_path):
    places = StatePaths(tmp_path)
    places.make_folders()
    writing = connect(places.ledger)
    writing.execute("PRAGMA synchronous = OFF")  # power cuts are tested elsewhere
    with LedgerReader.open(places) as reader:
        yield Searches(places, LedgerWriter(writing, paths=places), reader)
    writing.close()


def test_runs_are_added_by_position_and_only_once(searches):
    assert searches.extend(0, 3) == 3
    assert searches.extend(0, 3) == 0
    assert searches.extend(2, 2) == 1
    rows = searches.rows()
    assert [(r.id, r.proposal.position, r.label) for r in rows] == [
        (f"s.{n}", n, f"doors.{n}/pilot/0") for n in range(4)
    ]
    assert [row.proposal.values for row in rows] == [(40.0 + n,) for n in range(4)]
    assert {row.state for row in rows} == {RunState.QUEUED}
    assert (searches.campaign().total, searches.campaign().queued) == (4, 4)
    with pytest.raises(Refused, match="has 4 runs of at most 12000: 1 cannot be added at 5"):
        searches.extend(5)
    with pytest.raises(Refused, match="the runs of s from 3 on differ from those proposed"):
        searches.extend(3, 2, speed=2)
    assert searches.campaign().total == 4


def test_runs_are_those_of_their_proposals(searches):
    good = make_extension("s", 0, 2)
    wrong = replace(good.proposals[0], values=(1.0, 2.0))
    with pytest.raises(Refused, match="s has 1 parameters, its runs others"):
        searches.add(replace(good, proposals=(wrong, good.proposals[1])))
    searches.extend(0)
    again = replace(good.proposals[0], position=1)
    same = replace(good.runs, runs=good.runs.runs[:1])
    with pytest.raises(Refused, match="s has a run of that scenario and repeat"):
        searches.add(replace(good, proposals=(again,), runs=same))
    assert searches.campaign().total == 1


def test_pages_of_proposals_begin_at_a_position(searches):
    searches.extend(0, 300)
    searches.extend(300, 300)
    assert [row.proposal.position for row in searches.rows(298, 4)] == [298, 299, 300, 301]
    assert searches.rows(600) == ()
    assert searches.rows(name="other") == ()


def test_runs_of_a_search_are_leased_with_the_wish_for_leading_margins(searches):
    searches.extend(0)
    searches.book.submit(submission_of("plain", make_extension("x", 9).runs.cells[0]), NOW)
    assert {lease.campaign: lease.leads for lease in searches.book.lease("w", 9, NOW)} == {
        "s": True,
        "plain": False,
    }


def test_a_search_stays_open_until_it_is_said_to_be_over(searches):
    searches.extend(0, 2)
    assert searches.work() == 2
    row = searches.campaign()
    assert (row.finished_at, row.finished, row.search) == (None, False, "waiting")
    searches.say(note="so far", answer=ANSWER)
    (found,) = searches.reader.searches("s")
    assert (found.state, found.note, found.answer) == ("waiting", "so far", ANSWER)
    assert (found.proposed, found.finished, found.task.name) == (2, 2, "doors")
    searches.say(state="finished", phase="shrink", answer=ANSWER)
    (found,) = searches.reader.searches()
    assert (found.state, found.phase, found.answer) == ("finished", "shrink", ANSWER)
    assert searches.reader.searches(unfinished=True) == ()
    row = searches.campaign()
    assert (row.finished_at, row.finished, row.search) == (NOW, True, "finished")
    with pytest.raises(Refused, match="the search s is finished"):
        searches.extend(2)
    with pytest.raises(Refused, match="the search s is finished"):
        searches.say()


def test_runs_under_way_at_the_end_of_a_search_are_finished(searches):
    searches.extend(0, 2)
    searches.say(state="finished")
    assert searches.campaign().finished_at is None
    assert searches.work() == 2
    assert searches.campaign().finished_at == NOW
    first = searches.rows()[0]
    assert (first.outcome, first.leads[0].margin, first.trace) == (
        Outcome.FAIL,
        0.25,
        str(searches.places.trace("s/doors%2E0.pilot.0.mcap")),
    )


@pytest.mark.parametrize("runs", [0, 3])
def test_a_cancelled_search_goes_on_when_it_is_begun_again(searches, runs):
    for position in range(runs):
        searches.extend(position)
    assert searches.book.cancel("s", NOW) == runs
    row = searches.campaign()
    assert (row.search, row.finished_at, row.cancelled) == ("cancelled", NOW, runs)
    with pytest.raises(Refused, match="the search s is cancelled"):
        searches.extend(runs)
    searches.say(state="cancelled", answer=ANSWER)  # the last word of its client
    (found,) = searches.reader.searches("s")
    assert found.answer == ANSWER
    again = "s is a search: `scenario search campaign.yaml s` goes on with it"
    with pytest.raises(Refused, match=again):
        searches.book.retry(RetryRequest("s", ("lost", "cancelled")), NOW)
    searches.begin("s")
    row = searches.campaign()
    assert (row.search, row.finished_at, row.queued) == ("waiting", None, runs)
    with pytest.raises(Refused, match="the search s goes on"):
        searches.say(state="cancelled")
    assert searches.extend(runs) == 1
    assert searches.work() == runs + 1


def test_a_finished_search_is_run_again_as_any_campaign(searches):
    searches.extend(0)
    searches.work()
    searches.say(state="finished")
    assert searches.book.retry(RetryRequest("s", ("all",)), NOW) == 1
    assert searches.campaign().finished_at is None
    assert searches.work() == 1
    assert searches.campaign().finished_at == NOW


def test_results_are_used_again_among_searches_only(searches):
    plain = [make_extension("x", n).runs.cells[0] for n in range(2)]
    searches.book.submit(submission_of("plain", *plain), NOW)
    searches.work()
    searches.extend(0, 2)
    assert {row.state for row in searches.rows()} == {RunState.QUEUED}
    searches.work()
    searches.begin("again")
    assert searches.extend(0, 3, name="again") == 3
    rows = searches.rows(name="again")
    assert [bool(row.cached) for row in rows] == [True, True, False]
    assert rows[0].leads == searches.rows()[0].leads
    assert searches.campaign("again").cached == 2
    receipt = searches.book.submit(replace(submission_of("last", *plain), fresh=False), NOW)
    assert receipt.cached == 2


def test_an_id_of_another_campaign_is_refused(searches):
    with pytest.raises(Refused, match="s was asked for otherwise"):
        searches.begin("s", runs=7)
    searches.book.submit(submission_of("plain", make_extension("x", 9).runs.cells[0]), NOW)
    with pytest.raises(Refused, match="taken by another campaign"):
        searches.begin("plain")
    with pytest.raises(Refused, match="there is no search plain"):
        searches.extend(0, name="plain")


def test_a_search_is_deleted_with_all_that_it_has(searches):
    searches.extend(0, 2)
    searches.work()
    with pytest.raises(Refused, match="is a search that goes on: cancel it first"):
        searches.book.delete(("s",), NOW)
    searches.book.cancel("s", NOW)
    with searches.book.transaction():
        searches.book.delete(("s",), NOW)
    assert searches.reader.searches() == ()
    assert searches.rows() == ()
    assert broken_rules(searches.places.ledger) == []
    searches.begin("s")
    assert broken_rules(searches.places.ledger) == []


def test_the_answers_of_many_searches_fit_into_a_page(searches):
    long = replace(ANSWER, sentences=("x" * 3 * 2**20,))
    for name in ("s", "t", "u"):
        if name != "s":
            searches.begin(name)
        searches.book.note_progress(SearchProgress(name, "lab", "explore", answer=long), NOW)
    rows = searches.reader.searches()
    assert [(row.campaign, row.answer is not None) for row in rows] == [
        ("u", True),
        ("t", True),
        ("s", False),
    ]
    assert searches.reader.searches("s")[0].answer == long


def test_rules_see_a_search_that_is_not_whole(searches):
    searches.extend(0, 2)
    db = sqlite3.connect(searches.places.ledger, isolation_level=None)
    db.execute("INSERT INTO proposal VALUES ('s.7', x'7b7d')")
    db.execute("UPDATE campaign SET finished_at = 1.0")
    db.close()
    assert set(broken_rules(searches.places.ledger)) >= {
        "1 runs are proposed and not there",
        "1 searches wait in campaigns that are closed",
    }
