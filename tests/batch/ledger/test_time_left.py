"""How long the ledger says that runs will take."""

from dataclasses import replace

import pytest

from daemon.batch.ledger import LedgerReader, LedgerWriter, PlannedRun, RunPace, TimeLeft, connect
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, SteerRequest
from daemon.model.spec import SutReference
from tests.make import (
    make_extension,
    make_result,
    make_search,
    make_spec,
    submission_of,
)

NOW = 1_000_000.0


class Ledger:
    """A ledger that is written and read."""

    def __init__(self, writing, reader):
        self.book = LedgerWriter(writing)
        self.reader = reader

    def submit(self, campaign, runs, scenario="S1", sut="pilot"):
        specs = (
            replace(make_spec(n, scenario=scenario), sut=SutReference(sut, "pilot", {}))
            for n in range(runs)
        )
        self.book.submit(submission_of(campaign, *specs), NOW)

    def executed(self, campaign, seconds, **of):
        """Let a campaign of one run be executed, which takes so long."""
        self.submit(campaign, 1, **of)
        (grant,) = self.book.lease("w", 1, NOW)
        result = make_result(grant.spec, wall=seconds)
        done = Completion("w", grant.run, grant.attempt, grant.token, result)
        self.book.complete(done, NOW)

    def left(self, slots=1, now=NOW, paces=None, preparing=()):
        return self.reader.time_left(now, slots, paces or {}, preparing)


@pytest.fixture
def ledger(tmp_path):
    writing = connect(tmp_path / "ledger.db")
    with LedgerReader.open(StatePaths(tmp_path)) as reader:
        yield Ledger(writing, reader)
    writing.close()


def test_nothing_is_said_before_anything_was_executed_or_without_workers(ledger):
    ledger.submit("c", 4)
    assert ledger.left().all is None
    ledger.book.cancel("c", NOW)
    ledger.executed("first", 3.0)
    assert (ledger.left().all, ledger.left().campaigns) == (None, {})
    ledger.submit("d", 4)
    assert ledger.left(0).all is None
    assert ledger.left(2).all == pytest.approx(6.0)


def test_a_run_takes_as_long_as_its_cell_else_as_its_system_by_their_limits(ledger):
    for campaign, seconds, scenario, sut in (
        ("a", 2.0, "S1", "pilot"),
        ("b", 4.0, "S2", "pilot"),
        ("c", 12.0, "S1", "other"),
    ):
        ledger.executed(campaign, seconds, scenario=scenario, sut=sut)
    # All have a limit of 10 s; of a system that nobody has executed nothing is known.
    cells = (
        ("S2", "pilot", 10.0, 4.0),
        ("S3", "pilot", 30.0, 9.0),
        ("S3", "stranger", 10.0, None),
    )
    planned = [PlannedRun("", scenario, sut, limit) for scenario, sut, limit, _ in cells]
    assert ledger.reader.forecast(planned).seconds == tuple(pytest.approx(one) for *_, one in cells)
    ledger.submit("known", 1, "S2", "pilot")
    assert ledger.left().all == pytest.approx(4.0)
    ledger.submit("unknown", 1, "S3", "stranger")
    assert ledger.left().all is None


def test_a_run_under_way_ends_as_its_cell_or_when_it_is_over_that_at_its_limit(ledger):
    ledger.executed("first", 20.0)
    ledger.executed("second", 40.0)
    ledger.submit("c", 1)
    (grant,) = ledger.book.lease("w", 1, NOW)
    assert ledger.left(now=NOW + 5.0).all == pytest.approx(25.0)
    assert ledger.left(now=NOW - 500.0).all == pytest.approx(30.0)  # the clock was set
    # Longer than the mean, then than the longest; nobody knows its speed.
    assert ledger.left(now=NOW + 35.0).all == pytest.approx(5.0)
    assert ledger.left(now=NOW + 45.0).all is None
    # It has a limit of 10 simulated seconds.
    paces = {grant.run: RunPace(elapsed=45.0, speed=0.1)}
    assert ledger.left(paces=paces).all == pytest.approx(55.0)
    assert ledger.left(paces={grant.run: RunPace(101.0, 0.1)}).all is None


def test_where_no_repeat_has_finished_the_speed_of_those_under_way_tells(ledger):
    ledger.submit("c", 3)
    (grant,) = ledger.book.lease("w", 1, NOW)
    assert ledger.left(now=NOW + 5.0).all is None
    assert ledger.left(paces={grant.run: RunPace(1.0, 0.0)}).all is None
    left = ledger.left(paces={grant.run: RunPace(2.0, 2.0)})
    assert left.all == left.campaigns["c"] == pytest.approx(3.0 + 2 * 5.0)


def test_nobody_knows_how_long_kernels_are_compiled(ledger):
    ledger.executed("first", 20.0)
    ledger.submit("c", 1)
    (grant,) = ledger.book.lease("w", 1, NOW)
    assert ledger.left(preparing={"w"}).all is None
    assert ledger.left(preparing={"other"}).all == pytest.approx(20.0)
    begun = {grant.run: RunPace(5.0, 1.0)}
    assert ledger.left(paces=begun, preparing={"w"}).all == pytest.approx(15.0)


def test_it_counts_down_between_two_estimates():
    left = TimeLeft(10.0, {"a": 4.0, "b": 10.0})
    assert left.after(3.0) == TimeLeft(7.0, {"a": 1.0, "b": 7.0})
    assert left.after(5.0) == TimeLeft(5.0, {"b": 5.0})
    assert left.after(10.0) == TimeLeft()


def test_the_last_run_takes_no_less_time_on_many_slots(ledger):
    ledger.executed("first", 20.0)
    ledger.submit("c", 3)
    assert ledger.left(8).campaigns == {"c": pytest.approx(20.0)}


def test_what_waits_begins_when_a_run_that_holds_a_slot_ends(ledger):
    ledger.executed("first", 3000.0, sut="slow")
    ledger.executed("second", 8.0)
    ledger.submit("slow", 2, sut="slow")
    ledger.book.lease("w", 2, NOW)
    ledger.submit("quick", 1)
    assert ledger.left(2, now=NOW + 1000.0).campaigns["quick"] == 2008.0
    assert ledger.left(3, now=NOW + 1000.0).campaigns["quick"] == 8.0


def test_campaigns_take_turns_and_those_of_higher_priority_go_before(ledger):
    ledger.executed("first", 1.0)
    for campaign, runs in (("small", 2), ("large", 6), ("paused", 50)):
        ledger.submit(campaign, runs)
    ledger.book.steer(SteerRequest("paused", paused=True), NOW)
    assert ledger.left().campaigns == {"small": 4.0, "large": 8.0}
    ledger.book.steer(SteerRequest("large", priority=1), NOW)
    assert ledger.left().campaigns == {"small": 8.0, "large": 6.0}
    assert ledger.left().all == 8.0


def test_runs_that_a_search_will_propose_count_as_those_it_has(ledger):
    ledger.executed("first", 1.0)
    ledger.book.begin_search(make_search("s"), NOW)
    more = make_extension("s", 0, 2)
    ledger.book.extend(more.proposals, more.runs, NOW)
    assert ledger.left().campaigns == {"s": pytest.approx(make_search("s").task.runs)}


def test_what_lacks_something_is_not_waited_for(ledger):
    ledger.executed("first", 1.0)
    ledger.submit("held", 5)
    ledger.book.lease("w", 1, NOW, missing=lambda _: "scene 0123")
    assert ledger.left() == TimeLeft()
