"""A search in the dashboard: seen while it runs, what it found, what is asked of the daemon."""

import re
from dataclasses import replace

import numpy as np
import pytest

from daemon.model.search import OracleScale
from daemon.model.trials import read_trial
from scenario_tui.dashboard import searches
from scenario_tui.dashboard.searches import SearchTrials, TrialReader
from scenario_tui.dashboard.state import DashboardState, search_rows
from scenario_tui.dashboard.widgets.search_curve import SearchGraph, value_limits
from scenario_tui.terminal.capabilities import TerminalLimits
from scenario_tui.text.search_text import range_bar
from tests.people.dashboard.dash import make_dashboard
from tests.people.dashboard.searching import (
    SEARCH,
    TASK,
    WRITTEN,
    SearchingDaemon,
    make_proposals,
    make_search,
    proposal_row,
)


def search_runs(rows, state="running", **changes):
    row = make_search(rows, state, **changes)
    return SearchTrials(row, tuple(read_trial(row.task, one) for one in rows))


async def test_without_colours_and_in_ascii_it_says_the_same(dashboard):
    app = make_dashboard(SearchingDaemon.finished())
    app.apply_limits(TerminalLimits("none", ascii_only=True))
    dash = await dashboard(app)
    await dash.press("enter", "tab")
    update = dash.screen._compositor.render_update(full=True)
    text = update.render_segments(dash.app.console)
    assert text.isascii()
    assert "38;" not in text
    plain = re.sub(r"\x1b\[[^A-Za-z]*[A-Za-z]", "", text)
    assert "# swing" in plain  # not as written
    assert "x fails" in plain


def asked(fake):
    """Campaign, offset and limit of the questions for runs with what they gave."""
    return [(call[1], call[7], call[8]) for call in fake.calls if call[0] == "runs" and call[-1]]


def look_for_searches(fake, last):
    """Return the state after one more look at all campaigns."""
    campaigns = fake.campaign_page(limit=10)
    searches = search_rows(fake, campaigns, last)
    return replace(last, campaigns=campaigns, searches=searches)


def test_only_new_runs_and_those_that_were_not_over_are_asked_for():
    fake, reader = SearchingDaemon.running(20), TrialReader()

    def look():
        return reader.read(fake, look_for_searches(fake, DashboardState()).searches[SEARCH])

    first = look()
    assert len(first.trials) == 24
    assert look() is first
    assert asked(fake) == [(SEARCH, 0, 500)]
    fake.go_on(30)
    assert len(look().trials) == 34
    assert asked(fake)[1:] == [(SEARCH, 20, 500)]
    # Runs that were over are queued again: fewer are finished.
    fake.go_on(25)
    look()
    assert asked(fake)[2:] == [(SEARCH, 0, 500)]
    # In the end all of it, once: an event may have been lost.
    fake.found = (replace(fake.found[0], state="finished"),)
    look()
    assert asked(fake)[3:] == [(SEARCH, 0, 500)]


def test_many_runs_come_in_pages(monkeypatch):
    monkeypatch.setattr(searches, "_PAGE", 25)
    fake = SearchingDaemon.finished()
    (row,) = look_for_searches(fake, DashboardState()).searches.values()
    assert len(TrialReader().read(fake, row).trials) == 61
    assert [call[1] for call in asked(fake)] == [0, 25, 50]


def test_searches_are_asked_for_while_they_go_on_and_forgotten_when_they_are_gone():
    fake, state = SearchingDaemon.running(), DashboardState()
    ended = (replace(fake.found[0], state="finished"),)
    looks = []
    for found in (fake.found, fake.found, ended, ended, ()):
        fake.found = found
        state = look_for_searches(fake, state)
        looks.append((list(state.searches), sum(call[0] == "searches" for call in fake.calls)))
    assert looks == [([SEARCH], 1), ([SEARCH], 2), ([SEARCH], 3), ([SEARCH], 3), ([], 3)]


def graph_of(rows, state="running", columns=78, **changes):
    return SearchGraph(search_runs(rows, state, **changes), columns, 10)


def lines_of(graph):
    return ["".join(map(chr, row)).rstrip() for row in graph.codes]


def test_the_curve_is_the_best_so_far_and_says_what_has_no_margin():
    graph = graph_of(make_proposals(), "finished")
    assert len(graph.at) == 59  # one is inconclusive
    assert lines_of(graph)[-1].count("?") == 1
    assert np.all(np.diff(graph.best) <= 0.0)
    assert graph.best[-1] == graph.value.min()
    low, high = value_limits(graph.value)
    assert low < 0.0 < high


def test_repeats_and_what_is_done_with_a_failure_are_no_part_of_the_best():
    graph = graph_of((*make_proposals(20), proposal_row(20, WRITTEN, -1.0, phase="confirm")))
    assert graph.value.min() == -1.0
    assert np.nanmin(graph.best) > -1.0
    assert "│confirm" in lines_of(graph)[-1]


def test_limits_leave_out_a_few_runs_far_away_but_never_nought():
    low, high = value_limits(np.array([0.1 + i / 1000 for i in range(30)] + [900.0]))
    assert low < 0.0
    assert high < 1.0


def test_a_graph_of_many_shows_the_worst_failure_of_each_column():
    lines = lines_of(graph_of(make_proposals(500), "finished", columns=40))
    assert lines[-1].endswith("499")
    assert sum(line.count("✗") for line in lines) <= 29  # one a column


def test_marks_of_runs_without_a_margin_leave_the_numbers_of_the_axis_as_they_are():
    rows = list(make_proposals(64))
    for place in (0, 30, 62, 63):
        rows[place] = proposal_row(place, WRITTEN, None)
    axis = lines_of(graph_of(rows, "finished"))[-1]
    assert axis.endswith("?63")
    assert "run  0?" in axis
    assert axis.count("?") == 4  # the last two share a cell, run 23 has none either


def test_the_budget_makes_room_step_by_step():
    def room(known, budget):
        return graph_of(make_proposals(known), task=replace(TASK, runs=budget)).room

    assert room(5, 60) == 60
    assert room(70, 200) == 120
    assert room(130, 200) == 200
    assert room(5, 20) == 20


def test_of_several_oracles_what_is_compared_has_no_unit():
    scales = (*TASK.scales, OracleScale("reached", 0.3, "m"))
    graph = graph_of(make_proposals(10), task=replace(TASK, minimise="any", scales=scales))
    assert graph.unit == ""
    assert graph.value[0] == pytest.approx(0.105 / 0.25)


def test_a_parameter_has_its_place_in_its_range():
    opens, noise, leading = TASK.parameters[2], TASK.parameters[6], TASK.parameters[7]
    assert range_bar(opens, 8.9) == "─────│────●"
    assert range_bar(opens, 8.0) == "─────●─────"
    assert range_bar(noise, 0.05) == "│─────────●"
    assert range_bar(leading, "kitchen_door") == "│─────────●"
    assert range_bar(replace(opens, written=99.0), 7.1) == "●─────────>"
    assert range_bar(replace(opens, written=None), 7.1) == "●──────────"
