"""Searches in the ledger: runs added by position, ended by whoever proposes or by people."""

from dataclasses import replace

import pytest

from daemon.batch.errors import Refused
from daemon.batch.server._submissions import read_extension
from daemon.model.messages import LedgerAnswer
from daemon.model.search_answer import SearchAnswer, SearchProgress
from daemon.model.spec import LeadingMargin
from daemon.model.verdicts import Outcome, RunState
from grammars.text import codec
from tests.batch.conftest import NOW
from tests.make import make_extension, make_result

ANSWER = SearchAnswer("budget", 3, 3, 0, 1, 0, 0, 3, 1, sentences=("three runs",))
PLAIN = [make_extension("x", n).runs.cells[0] for n in range(2)]


@pytest.fixture
def searches(ledger):
    """A ledger with a search ``s``."""
    ledger.search("s")
    return ledger


def add(ledger, request):
    staged = read_extension(codec.to_json(request), ledger.places)
    with ledger.book.transaction():
        return ledger.book.extend(staged.proposals, staged.runs, NOW)


def extend(ledger, first, count=1, name="s", **parameters):
    return add(ledger, make_extension(name, first, count, **parameters))


def work(ledger):
    def make(spec):
        lead = LeadingMargin("arrives", 0.25, "s", "door")
        return replace(make_result(spec, outcome=Outcome.FAIL, margin=-0.5), leads=(lead,))

    answers = ledger.work(make)
    assert set(answers) <= {LedgerAnswer.RECORDED, LedgerAnswer.KNOWN}
    return len(answers)


def rows(ledger, offset=0, limit=500, name="s"):
    return ledger.rows(name, offset=offset, limit=limit, results=True)


def say(ledger, **changes):
    ledger.book.note_progress(replace(SearchProgress("s", "lab", "explore"), **changes), NOW)


def test_runs_are_added_by_position_and_only_once(searches):
    assert extend(searches, 0, 3) == 3
    assert extend(searches, 0, 3) == 0
    assert extend(searches, 2, 2) == 1
    found = rows(searches)
    assert [(r.id, r.proposal.position, r.label) for r in found] == [
        (f"s.{n}", n, f"doors.{n}/pilot/0") for n in range(4)
    ]
    assert [row.proposal.values for row in found] == [(40.0 + n,) for n in range(4)]
    assert {row.state for row in found} == {RunState.QUEUED}
    assert (searches.row("s").total, searches.row("s").queued) == (4, 4)
    with pytest.raises(Refused, match="has 4 runs of at most 12000: 1 cannot be added at 5"):
        extend(searches, 5)
    with pytest.raises(Refused, match="the runs of s from 3 on differ from those proposed"):
        extend(searches, 3, 2, speed=2)
    assert searches.row("s").total == 4


def test_runs_are_those_of_their_proposals(searches):
    good = make_extension("s", 0, 2)
    wrong = replace(good.proposals[0], values=(1.0, 2.0))
    with pytest.raises(Refused, match="the runs do not have the 1 parameters of s"):
        add(searches, replace(good, proposals=(wrong, good.proposals[1])))
    extend(searches, 0)
    again = replace(good.proposals[0], position=1)
    same = replace(good.runs, runs=good.runs.runs[:1])
    with pytest.raises(Refused, match="s has a run of that scenario and repeat"):
        add(searches, replace(good, proposals=(again,), runs=same))
    assert searches.row("s").total == 1


def test_pages_of_proposals_begin_at_a_position(searches):
    extend(searches, 0, 300)
    extend(searches, 300, 300)
    assert [row.proposal.position for row in rows(searches, 298, 4)] == [298, 299, 300, 301]
    assert rows(searches, 600) == rows(searches, name="other") == ()


def test_runs_of_a_search_are_leased_with_the_wish_for_leading_margins(searches):
    extend(searches, 0)
    searches.submit("plain", *PLAIN)
    leads = {lease.campaign: lease.leads for lease in searches.lease()}
    assert leads == {"s": True, "plain": False}


def test_a_search_stays_open_until_it_is_said_to_be_over(searches):
    extend(searches, 0, 2)
    assert work(searches) == 2
    row = searches.row("s")
    assert (row.finished_at, row.finished, row.search) == (None, False, "waiting")
    say(searches, note="so far", answer=ANSWER)
    (found,) = searches.reader.searches("s")
    assert (found.state, found.note, found.answer) == ("waiting", "so far", ANSWER)
    assert (found.proposed, found.finished, found.task.name) == (2, 2, "doors")
    say(searches, state="finished", phase="shrink", answer=ANSWER)
    (found,) = searches.reader.searches()
    assert (found.state, found.phase, found.answer) == ("finished", "shrink", ANSWER)
    assert searches.reader.searches(unfinished=True) == ()
    row = searches.row("s")
    assert (row.finished_at, row.finished, row.search) == (NOW, True, "finished")
    for late in (lambda: extend(searches, 2), lambda: say(searches)):
        with pytest.raises(Refused, match="the search s is finished"):
            late()
    # It is run again as any campaign.
    assert searches.retry("s", "all") == 2
    assert searches.row("s").finished_at is None
    assert work(searches) == 2
    assert searches.row("s").finished_at == NOW


def test_runs_under_way_at_the_end_of_a_search_are_finished(searches):
    extend(searches, 0, 2)
    say(searches, state="finished")
    assert searches.row("s").finished_at is None
    assert work(searches) == 2
    assert searches.row("s").finished_at == NOW
    first = rows(searches)[0]
    trace = str(searches.places.trace("s/doors%2E0.pilot.0.mcap"))
    assert (first.outcome, first.leads[0].margin, first.trace) == (Outcome.FAIL, 0.25, trace)


@pytest.mark.parametrize("runs", [0, 3])
def test_a_cancelled_search_goes_on_when_it_is_begun_again(searches, runs):
    for position in range(runs):
        extend(searches, position)
    assert searches.book.cancel("s", NOW) == runs
    row = searches.row("s")
    assert (row.search, row.finished_at, row.cancelled) == ("cancelled", NOW, runs)
    with pytest.raises(Refused, match="the search s is cancelled"):
        extend(searches, runs)
    say(searches, state="cancelled", answer=ANSWER)  # the last word of its client
    assert searches.reader.searches("s")[0].answer == ANSWER
    again = "s is a search: `scenario search campaign.yaml s` goes on with it"
    with pytest.raises(Refused, match=again):
        searches.retry("s", "lost", "cancelled")
    searches.search("s")
    row = searches.row("s")
    assert (row.search, row.finished_at, row.queued) == ("waiting", None, runs)
    with pytest.raises(Refused, match="the search s goes on"):
        say(searches, state="cancelled")
    assert extend(searches, runs) == 1
    assert work(searches) == runs + 1


def test_results_are_used_again_among_searches_only(searches):
    searches.submit("plain", *PLAIN)
    work(searches)
    extend(searches, 0, 2)
    assert {row.state for row in rows(searches)} == {RunState.QUEUED}
    work(searches)
    searches.search("again")
    assert extend(searches, 0, 3, name="again") == 3
    again = rows(searches, name="again")
    assert [bool(row.cached) for row in again] == [True, True, False]
    assert again[0].leads == rows(searches)[0].leads
    assert searches.row("again").cached == 2
    assert searches.submit("last", *PLAIN).cached == 2


def test_an_id_of_another_campaign_is_refused(searches):
    with pytest.raises(Refused, match="s has other options"):
        searches.search("s", runs=7)
    searches.submit("plain", *PLAIN)
    with pytest.raises(Refused, match="belongs to another campaign"):
        searches.search("plain")
    with pytest.raises(Refused, match="there is no search plain"):
        extend(searches, 0, name="plain")


def test_a_search_is_deleted_with_all_that_it_has(searches):
    extend(searches, 0, 2)
    work(searches)
    with pytest.raises(Refused, match="is an unfinished search: cancel it first"):
        searches.book.delete(("s",), NOW)
    searches.book.cancel("s", NOW)
    with searches.book.transaction():
        searches.book.delete(("s",), NOW)
    assert searches.reader.searches() == rows(searches) == ()
    searches.assert_sound()
    searches.search("s")
    searches.assert_sound()


def test_the_answers_of_many_searches_fit_into_a_page(searches):
    long = replace(ANSWER, sentences=("x" * 3 * 2**20,))
    for name in ("s", "t", "u"):
        searches.search(name)
        searches.book.note_progress(SearchProgress(name, "lab", "explore", answer=long), NOW)
    found = [(row.campaign, row.answer is not None) for row in searches.reader.searches()]
    assert found == [("u", True), ("t", True), ("s", False)]
    assert searches.reader.searches("s")[0].answer == long
