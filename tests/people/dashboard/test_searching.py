"""A search in the dashboard: seen while it runs, what it found, what is asked of the daemon."""

import re
from dataclasses import replace

import numpy as np
import pytest

from daemon.model.search import OracleScale
from daemon.model.status import ChangeEvent
from daemon.model.trials import read_trial
from scenario_tui.dashboard import searches
from scenario_tui.dashboard.searches import KnownSearches, SearchTrials, TrialReader
from scenario_tui.dashboard.widgets.search_curve import (
    SearchGraph,
    search_curve,
    value_limits,
)
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
from tests.people.fake import CAMPAIGN


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


def test_only_new_runs_and_those_that_were_not_over_are_asked_for():
    fake, watch, reader = SearchingDaemon.running(20), KnownSearches(), TrialReader()

    def look():
        watch.update_rows(fake, fake.campaign_page(limit=10))
        return reader.read(fake, watch.rows[SEARCH])

    first = look()
    assert len(first.trials) == 24
    assert look() is first
    assert asked(fake) == [(SEARCH, 0, 500)]
    assert sum(call[0] == "searches" for call in fake.calls) == 1
    fake.go_on(30)
    assert len(look().trials) == 34
    assert asked(fake)[1:] == [(SEARCH, 20, 500)]
    # Runs that were over are queued again: fewer are finished.
    fake.go_on(25)
    look()
    assert asked(fake)[2:] == [(SEARCH, 0, 500)]
    watch.touch(ChangeEvent(2, "run", f"{CAMPAIGN}.3", CAMPAIGN))
    look()
    assert len(asked(fake)) == 3
    # In the end all of it, once: an event may have been lost.
    fake.found = (replace(fake.found[0], state="finished"),)
    look()
    assert asked(fake)[3:] == [(SEARCH, 0, 500)]


def test_many_runs_come_in_pages(monkeypatch):
    monkeypatch.setattr(searches, "_PAGE", 25)
    fake, watch = SearchingDaemon.finished(), KnownSearches()
    watch.update_rows(fake, fake.campaign_page(limit=10))
    assert len(TrialReader().read(fake, watch.rows[SEARCH]).trials) == 61
    assert [call[1] for call in asked(fake)] == [0, 25, 50]


def test_a_search_that_is_gone_is_forgotten():
    fake, watch = SearchingDaemon.finished(), KnownSearches()
    watch.update_rows(fake, fake.campaign_page(limit=10))
    assert SEARCH in watch.rows
    fake.found = ()
    watch.update_rows(fake, fake.campaign_page(limit=10))
    assert not watch.rows


def test_the_curve_is_the_best_so_far_and_says_what_has_no_margin():
    curve = search_curve(search_runs(make_proposals(), "finished"))
    assert len(curve.at) == 59  # one is inconclusive
    assert curve.unknown == ((23, "?"),)
    assert np.all(np.diff(curve.best) <= 0.0)
    assert curve.best[-1] == curve.value.min()
    low, high = value_limits(curve)
    assert low < 0.0 < high


def test_repeats_and_what_is_done_with_a_failure_are_no_part_of_the_best():
    rows = (*make_proposals(20), proposal_row(20, WRITTEN, -1.0, phase="confirm"))
    curve = search_curve(search_runs(rows))
    assert curve.value.min() == -1.0
    assert np.nanmin(curve.best) > -1.0
    assert curve.phases == ((20, "confirm"),)


def test_limits_leave_out_a_few_runs_far_away_but_never_nought():
    rows = [proposal_row(i, WRITTEN, 0.1 + i / 1000) for i in range(30)]
    rows.append(proposal_row(30, WRITTEN, 900.0))
    low, high = value_limits(search_curve(search_runs(rows)))
    assert low < 0.0
    assert high < 1.0


def drawn(curve, columns=78, rows=10):
    return ["".join(map(chr, row)).rstrip() for row in SearchGraph(curve, columns, rows).codes]


def test_a_graph_of_many_shows_the_worst_failure_of_each_column():
    lines = drawn(search_curve(search_runs(make_proposals(500), "finished")), columns=40)
    assert lines[-1].endswith("499")
    assert sum(line.count("✗") for line in lines) <= 29  # one a column


def test_marks_of_runs_without_a_margin_leave_the_numbers_of_the_axis_as_they_are():
    curve = search_curve(search_runs(make_proposals(64), "finished"))
    lost = replace(curve, unknown=((0, "‼"), (30, "‼"), (62, "‼"), (63, "‼")))
    axis = drawn(lost)[-1]
    assert axis.endswith("‼63")
    assert "run  0‼" in axis
    assert axis.count("‼") == 3


def test_the_budget_makes_room_step_by_step():
    def room(known, budget):
        rows = make_proposals(known)
        task = replace(TASK, runs=budget)
        return search_curve(search_runs(rows, task=task)).room

    assert room(5, 60) == 60
    assert room(70, 200) == 120
    assert room(130, 200) == 200
    assert room(5, 20) == 20


def test_of_several_oracles_what_is_compared_has_no_unit():
    scales = (*TASK.scales, OracleScale("reached", 0.3, "m"))
    task = replace(TASK, minimise="any", scales=scales)
    curve = search_curve(search_runs(make_proposals(10), task=task))
    assert curve.unit == ""
    assert curve.value[0] == pytest.approx(0.105 / 0.25)


def test_a_parameter_has_its_place_in_its_range():
    opens, noise, leading = TASK.parameters[2], TASK.parameters[6], TASK.parameters[7]
    assert range_bar(opens, 8.9) == "─────│────●"
    assert range_bar(opens, 8.0) == "─────●─────"
    assert range_bar(noise, 0.05) == "│─────────●"
    assert range_bar(leading, "kitchen_door") == "│─────────●"
    assert range_bar(replace(opens, written=99.0), 7.1) == "●─────────>"
    assert range_bar(replace(opens, written=None), 7.1) == "●──────────"
