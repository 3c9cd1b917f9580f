"""Which parts of its space a search has tried."""

import math
from dataclasses import replace

import pytest

from daemon.model.run_state import RunState
from daemon.model.search import SearchParameter
from daemon.model.search_answer import SearchRow
from daemon.search.exercised import PARTS, exercised_space
from daemon.search.points import position_in_range
from daemon.search.program import run_search
from tests.daemon.search.pretended import PretendedCase, make_task, seconds

LEADING = SearchParameter("doors.leading", "behaviours", 0, "leading", choices=("a", "b", "c"))


def test_each_point_counts_once_in_the_part_of_its_value():
    task = make_task(seconds("doors.opens"), LEADING, runs=16, confirm=3, then=("nearest",))
    case = PretendedCase(task, lambda point, _: 0.5 - 0.1 * float(point[0]))
    runs = case.runs()
    run_search(case, runs)
    rows = [runs.result(position) for position in range(len(runs.proposals))]
    row = SearchRow("demo-s-1", "demo-s", 0.0, task, "finished")
    found = exercised_space(row, rows)
    values = {one.proposal.values for one in rows if one.proposal.phase == "explore"}
    assert len(values) == 16 < len(rows)
    failing = [point for point in values if float(point[0]) > 5.0]
    assert (found.points, found.failed) == (len(values), len(failing))
    opens, leading = found.parameters
    assert sum(opens.counts) == sum(leading.counts) == len(values)
    assert opens.failed[: PARTS // 2] == (0,) * (PARTS // 2)
    assert sum(opens.failed) == len(failing)
    assert (opens.range, opens.met) == ("0 .. 10 s", PARTS)
    assert (leading.range, len(leading.counts)) == ("a, b, c", 3)


def test_what_is_outside_of_the_range_or_not_run_is_in_no_part():
    task = make_task(seconds("doors.opens", written=12.0), runs=4, confirm=0, then=())
    case = PretendedCase(task, lambda point, _: 1.0)
    runs = case.runs()
    run_search(case, runs)
    rows = [runs.result(position) for position in range(4)]
    row = SearchRow("demo-s-1", "demo-s", 0.0, task, "finished")
    assert rows[0].proposal.values == (12.0,)
    (opens,) = exercised_space(row, rows).parameters
    assert sum(opens.counts) == 3
    waiting = [replace(one, state=RunState.QUEUED) for one in rows]
    assert exercised_space(row, waiting).points == 0


def test_positions_of_logarithmic_ranges_have_equal_ratios():
    noise = SearchParameter("robot.noise", "robot", 0, "noise", "m", 0.01, 0.04, log=True)
    assert position_in_range(noise, 0.02) == pytest.approx(0.5)
    assert position_in_range(replace(noise, log=False), 0.025) == pytest.approx(0.5)
    for written in (0.0, -0.01):
        assert position_in_range(noise, written) == -math.inf
