"""How long what is left takes: by cell, from repeats that have finished, without jumps."""

import heapq
import itertools
from dataclasses import dataclass, field

import numpy as np
import pytest

from daemon.batch.time_left import (
    CampaignWork,
    CellWork,
    ExecutedRuns,
    RunInProgress,
    TimeLeft,
    estimate_time_left,
    follow_time_left,
)

LIMIT = 600.0
SLOTS = 3


def cell(sut, queued, took=0.0, runs=0, scenario="S1"):
    done = ExecutedRuns(runs, took * runs, 10 * took * runs, LIMIT * runs)
    return CellWork(scenario, sut, queued, LIMIT, done)


def work(*cells, **more):
    return CampaignWork("c", cells, **more)


def test_each_cell_counts_with_the_time_its_repeats_took():
    left = estimate_time_left([work(cell("slow", 4, 20.0, 1), cell("fast", 4, 2.0, 1))], 2)
    assert left.all == pytest.approx(44.0)


def test_the_last_run_of_a_queue_is_not_shared_by_all_slots():
    assert estimate_time_left([work(cell("slow", 1, 20.0, 1))], 8).all == pytest.approx(20.0)


def test_a_cell_without_a_finished_run_takes_as_long_as_others_of_its_system():
    known, unknown = cell("pilot", 0, 8.0, 2), cell("pilot", 3, scenario="S2")
    left = estimate_time_left([work(known, unknown, cell("other", 0, 80.0, 2))], 1)
    assert left.all == pytest.approx(24.0)


def test_the_campaign_before_tells_until_a_run_has_finished():
    before = ExecutedRuns(4, 20.0, 200.0, 4 * LIMIT)
    left = estimate_time_left([work(CellWork("S1", "pilot", 6, LIMIT, earlier=before))], 2)
    assert left.all == pytest.approx(15.0)


def test_before_any_run_has_finished_the_speed_of_those_that_run_tells_with_their_limit():
    running = RunInProgress("S1", "ros", LIMIT, elapsed=30.0, simulated=60.0)
    left = estimate_time_left([work(cell("ros", 1), running=(running,))], 1)
    assert left.all == pytest.approx(270.0 + 300.0)


def test_systems_of_which_nothing_runs_yet_count_with_the_speed_of_those_that_run():
    running = RunInProgress("S1", "ros", LIMIT, elapsed=30.0, simulated=60.0)
    first = work(cell("ros", 1), cell("other", 2), running=(running,))
    assert estimate_time_left([first], 1).all == pytest.approx(270.0 + 3 * 300.0)
    # Also of another campaign.
    second = CampaignWork("d", (cell("pilot", 1),))
    left = estimate_time_left([work(running=(running,)), second], 1)
    assert left.campaigns["d"] == pytest.approx(270.0 + 300.0)


def test_a_run_that_has_hardly_begun_tells_no_speed():
    # Most of its time went into starting: by that speed the queue would take hours.
    running = RunInProgress("S1", "ros", LIMIT, elapsed=12.0, simulated=1.0)
    assert estimate_time_left([work(cell("ros", 1), running=(running,))], 1).all is None


def test_nothing_is_said_while_nothing_is_known():
    running = RunInProgress("S1", "ros", LIMIT, elapsed=30.0)
    assert estimate_time_left([work(cell("ros", 1), running=(running,))], 1).all is None
    assert estimate_time_left([work(cell("ros", 1, 2.0, 1))], 0).all is None


def test_a_run_in_progress_counts_by_what_it_has_simulated_not_by_the_clock():
    # Leased a minute ago, and half done: it waited for machine code before it began.
    running = RunInProgress("S1", "pilot", LIMIT, elapsed=60.0, simulated=100.0)
    left = estimate_time_left([work(cell("pilot", 0, 20.0, 3), running=(running,))], 1)
    assert left.all == pytest.approx(10.0)


def test_a_paused_campaign_has_no_time_left_and_keeps_no_other_from_its_own():
    paused = CampaignWork("p", (cell("pilot", 90, 10.0, 1),), paused=True)
    left = estimate_time_left([paused, work(cell("pilot", 4, 10.0, 1))], 2)
    assert left.all == pytest.approx(20.0)
    assert left.campaigns == {"c": pytest.approx(20.0)}
    assert not estimate_time_left([paused], 2).all


def test_campaigns_of_one_priority_take_turns_and_higher_ones_go_first():
    def of(name, priority):
        return CampaignWork(name, (cell("pilot", 4, 5.0, 1),), priority=priority)

    turns = estimate_time_left([of("a", 0), of("b", 0)], 1).campaigns
    assert turns == {"a": pytest.approx(35.0), "b": pytest.approx(40.0)}
    first = estimate_time_left([of("a", 0), of("b", 1)], 1).campaigns
    assert first == {"a": pytest.approx(40.0), "b": pytest.approx(20.0)}


def test_runs_that_a_search_will_propose_count():
    assert estimate_time_left([work(cell("pilot", 1, 3.0, 5), more=9)], 1).all == pytest.approx(
        30.0
    )


def test_a_hundred_thousand_runs_are_laid_in_parts():
    left = estimate_time_left([work(cell("pilot", 100_000, 2.0, 10))], 40)
    assert left.all == pytest.approx(5000.0, rel=0.03)


@dataclass
class SimulatedQueue:
    """A campaign of a fast and a slow system on a few slots, with times that are known."""

    times: list[tuple[str, str, float]]
    finished: dict[tuple[str, str], list[float]] = field(default_factory=dict)
    over: float = 0.0

    def looks(self):
        """Yield how it stands every half a second, as the daemon sees it; workers renew their
        leases, and tell how far runs are, every ten seconds.
        """
        waiting = list(reversed(self.times))
        events = []
        order = itertools.count()
        now = 0.0
        while waiting or events:
            while waiting and len(events) < SLOTS:
                run = waiting.pop()
                heapq.heappush(events, (now + run[2], next(order), run, now))
            end = events[0][0]
            look = np.floor(now / 0.5) * 0.5 + 0.5
            while look < end:
                yield look, self._seen(look, waiting, events)
                look += 0.5
            now, _, (scenario, sut, took), _ = heapq.heappop(events)
            self.finished.setdefault((scenario, sut), []).append(took)
        self.over = now

    def _seen(self, now, waiting, events):
        cells = []
        for key in dict.fromkeys((run[0], run[1]) for run in self.times):
            took = self.finished.get(key, [])
            n = len(took)
            done = ExecutedRuns(n, sum(took), 10 * sum(took), LIMIT * n)
            queued = sum((run[0], run[1]) == key for run in waiting)
            cells.append(CellWork(*key, queued, LIMIT, done))
        told = np.floor(now / 10.0) * 10.0
        running = tuple(
            RunInProgress(
                *run[:2], LIMIT, now - begun, 10 * max(0.0, told - begun), now - max(told, begun)
            )
            for _, _, run, begun in events
        )
        return CampaignWork("c", tuple(cells), running)


@pytest.mark.parametrize("by", ["cells", "repeats"])
@pytest.mark.parametrize("seed", range(4))
def test_the_time_left_is_near_the_truth_and_never_jumps_up(seed, by):
    random = np.random.default_rng(seed)
    cells = (("S1", "fast", 3.0), ("S1", "slow", 30.0), ("S2", "fast", 4.0), ("S2", "slow", 40.0))
    each = [one for one in cells for _ in range(12)]
    times = [(name, sut, mean * random.uniform(0.85, 1.15)) for name, sut, mean in each]
    if by == "repeats":
        times = [times[12 * c + repeat] for repeat in range(12) for c in range(4)]
    queue = SimulatedQueue(times)
    told = [
        (now, estimate_time_left([seen], SLOTS).all, all(one.executed.runs for one in seen.cells))
        for now, seen in queue.looks()
    ]
    # In the last seconds one of them is a large share of what is left.
    late = [(queue.over - now, left) for now, left, known in told if known]
    late = [(true, left) for true, left in late if true > 30.0]
    assert len(late) > 100
    for true, left in late:
        assert left == pytest.approx(true, rel=0.3)
    for (_, one), (_, other) in itertools.pairwise(late):
        assert one is not None
        assert other is not None
        assert other <= 1.2 * one


def test_what_is_said_follows_what_is_known_in_a_few_seconds():
    said = follow_time_left(TimeLeft(100.0, {"c": 100.0}), 2.0, TimeLeft(200.0, {"c": 200.0}))
    assert said.all == pytest.approx(131.6, abs=0.1)
    assert said.campaigns == {"c": said.all}
    for _ in range(15):
        said = follow_time_left(said, 1.0, TimeLeft(200.0, {"c": 200.0}))
    assert said.all == pytest.approx(200.0, rel=0.1)
    assert follow_time_left(said, 1.0, TimeLeft(None)).all is None
    assert follow_time_left(TimeLeft(None), 1.0, TimeLeft(50.0)).all == 50.0
