"""How long the ledger says that runs will take."""

from dataclasses import replace

import pytest

from daemon.batch.ledger import RunPace, TimeLeft
from daemon.model.spec import SutReference
from tests.batch.conftest import NOW
from tests.make import make_result, make_search, make_spec, submission_of


@pytest.fixture
def submit(ledger):
    """Enter a campaign; with ``seconds`` its one run is executed, which takes so long."""

    def submit(campaign, runs=1, scenario="S1", sut="pilot", seconds=None):
        reference = SutReference(sut, "pilot", {})
        specs = (replace(make_spec(n, scenario=scenario), sut=reference) for n in range(runs))
        ledger.submit(campaign, *specs, fresh=True)
        if seconds is not None:
            ledger.work(lambda spec: make_result(spec, wall=seconds))

    return submit


@pytest.fixture
def left(ledger):
    def left(slots=1, now=NOW, paces=None, preparing=()):
        return ledger.reader.time_left(now, slots, paces or {}, preparing)

    return left


def test_nothing_is_said_before_anything_was_executed_or_without_workers(ledger, submit, left):
    submit("c", 4)
    assert left().all is None
    ledger.book.cancel("c", NOW)
    submit("first", seconds=3.0)
    assert (left().all, left().campaigns) == (None, {})
    submit("d", 4)
    assert left(0).all is None
    assert left(2).all == pytest.approx(6.0)


def test_a_run_takes_as_long_as_its_cell_else_as_its_system_by_their_limits(ledger, submit, left):
    submit("a", seconds=2.0)
    submit("b", seconds=4.0, scenario="S2")
    submit("c", seconds=12.0, sut="other")
    # All have a limit of 10 s; of a system that nobody has executed nothing is known.
    cells = (
        ("S2", "pilot", 10.0, 4.0),
        ("S3", "pilot", 30.0, 9.0),
        ("S3", "stranger", 10.0, None),
    )
    planned = [
        replace(make_spec(scenario=scenario), sut=SutReference(sut, "pilot", {}), limit=limit)
        for scenario, sut, limit, _ in cells
    ]
    told = ledger.reader.forecast(submission_of("planned", *planned)).seconds
    assert told == tuple(pytest.approx(one) for *_, one in cells)
    submit("known", 1, "S2")
    assert left().all == pytest.approx(4.0)
    submit("unknown", 1, "S3", "stranger")
    assert left().all is None


def test_a_run_under_way_ends_as_its_cell_or_when_it_is_over_that_at_its_limit(
    ledger, submit, left
):
    submit("first", seconds=20.0)
    submit("second", seconds=40.0)
    submit("c")
    (grant,) = ledger.lease()
    for elapsed, seconds in (
        (5.0, 25.0),
        (-500.0, 30.0),  # the clock was set
        (35.0, 5.0),  # longer than the mean
        (45.0, None),  # longer than the longest; nobody knows its speed
    ):
        assert left(now=NOW + elapsed).all == (seconds and pytest.approx(seconds))
    # It has a limit of 10 simulated seconds.
    assert left(paces={grant.run: RunPace(elapsed=45.0, speed=0.1)}).all == pytest.approx(55.0)
    assert left(paces={grant.run: RunPace(101.0, 0.1)}).all is None


def test_where_no_repeat_has_finished_the_speed_of_those_under_way_tells(ledger, submit, left):
    submit("c", 3)
    (grant,) = ledger.lease(1)
    assert left(now=NOW + 5.0).all is None
    assert left(paces={grant.run: RunPace(1.0, 0.0)}).all is None
    told = left(paces={grant.run: RunPace(2.0, 2.0)})
    assert told.all == told.campaigns["c"] == pytest.approx(3.0 + 2 * 5.0)


def test_nobody_knows_how_long_kernels_are_compiled(ledger, submit, left):
    submit("first", seconds=20.0)
    submit("c")
    (grant,) = ledger.lease()
    assert left(preparing={"w"}).all is None
    assert left(preparing={"other"}).all == pytest.approx(20.0)
    begun = {grant.run: RunPace(5.0, 1.0)}
    assert left(paces=begun, preparing={"w"}).all == pytest.approx(15.0)


def test_it_counts_down_between_two_estimates():
    left = TimeLeft(10.0, {"a": 4.0, "b": 10.0})
    assert left.after(3.0) == TimeLeft(7.0, {"a": 1.0, "b": 7.0})
    assert left.after(5.0) == TimeLeft(5.0, {"b": 5.0})
    assert left.after(10.0) == TimeLeft()


def test_the_last_run_takes_no_less_time_on_many_slots(submit, left):
    submit("first", seconds=20.0)
    submit("c", 3)
    assert left(8).campaigns == {"c": pytest.approx(20.0)}


def test_what_waits_begins_when_a_run_that_holds_a_slot_ends(ledger, submit, left):
    submit("first", seconds=3000.0, sut="slow")
    submit("second", seconds=8.0)
    submit("slow", 2, sut="slow")
    ledger.lease(2)
    submit("quick")
    assert left(2, now=NOW + 1000.0).campaigns["quick"] == 2008.0
    assert left(3, now=NOW + 1000.0).campaigns["quick"] == 8.0


def test_campaigns_take_turns_and_those_of_higher_priority_go_before(ledger, submit, left):
    submit("first", seconds=1.0)
    for campaign, runs in (("small", 2), ("large", 6), ("paused", 50)):
        submit(campaign, runs)
    ledger.steer("paused", paused=True)
    assert left().campaigns == {"small": 4.0, "large": 8.0}
    ledger.steer("large", priority=1)
    assert left().campaigns == {"small": 8.0, "large": 6.0}
    assert left().all == 8.0


def test_runs_that_a_search_will_propose_count_as_those_it_has(ledger, submit, left):
    submit("first", seconds=1.0)
    ledger.search("s", 2)
    assert left().campaigns == {"s": pytest.approx(make_search("s").task.runs)}


def test_what_lacks_something_is_not_waited_for(ledger, submit, left):
    submit("first", seconds=1.0)
    submit("held", 5)
    ledger.lease(1, missing=lambda _: "scene 0123")
    assert left() == TimeLeft()
