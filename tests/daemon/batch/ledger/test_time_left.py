"""How long the ledger says that runs will take."""

from dataclasses import replace

import pytest

from daemon.batch.ledger import LedgerReader, LedgerWriter, PlannedRun, connect
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion, SteerRequest
from daemon.model.spec import SutReference
from tests.daemon.batch.samples import (
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

    def left(self, slots=1, now=NOW):
        return self.reader.time_left(now, slots)


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


def test_a_run_takes_as_long_as_its_cell_else_its_system_else_any(ledger):
    for campaign, seconds, scenario, sut in (
        ("a", 2.0, "S1", "pilot"),
        ("b", 4.0, "S2", "pilot"),
        ("c", 12.0, "S1", "other"),
    ):
        ledger.executed(campaign, seconds, scenario=scenario, sut=sut)
    cells = (("S2", "pilot", 4.0), ("S3", "pilot", 3.0), ("S3", "stranger", 6.0))
    planned = [PlannedRun("", scenario, sut) for scenario, sut, _ in cells]
    assert ledger.reader.forecast(planned).seconds == tuple(seconds for *_, seconds in cells)
    for number, (scenario, sut, _) in enumerate(cells):
        ledger.submit(f"next-{number}", 1, scenario, sut)
    assert ledger.left().all == pytest.approx(13.0)


def test_a_run_under_way_counts_with_its_rest(ledger):
    ledger.executed("first", 20.0)
    ledger.submit("c", 2)
    ledger.book.lease("w", 1, NOW)
    assert ledger.left(1, NOW + 5.0).all == pytest.approx(35.0)
    assert ledger.left(1, NOW + 500.0).all == pytest.approx(21.0)  # it may end any moment
    assert ledger.left(1, NOW - 500.0).all == pytest.approx(40.0)  # the clock was set


def test_the_last_run_takes_no_less_time_on_many_slots(ledger):
    ledger.executed("first", 20.0)
    ledger.submit("c", 3)
    assert ledger.left(8).campaigns == {"c": pytest.approx(20.0)}


def test_campaigns_take_turns_and_those_of_higher_priority_go_before(ledger):
    ledger.executed("first", 1.0)
    for campaign, runs in (("small", 2), ("large", 6), ("paused", 50)):
        ledger.submit(campaign, runs)
    ledger.book.steer(SteerRequest("paused", paused=True), NOW)
    assert ledger.left().campaigns == {"small": 4.0, "large": 8.0}
    ledger.book.steer(SteerRequest("large", priority=1), NOW)
    assert ledger.left().campaigns == {"small": 8.0, "large": 6.0}
    assert ledger.left().all == 8.0


def test_runs_that_a_search_will_propose_count_as_any(ledger):
    ledger.executed("first", 1.0)
    ledger.book.begin_search(make_search("s"), NOW)
    more = make_extension("s", 0, 2)
    ledger.book.extend(more.proposals, more.runs, NOW)
    assert ledger.left().campaigns == {"s": pytest.approx(make_search("s").task.runs)}
