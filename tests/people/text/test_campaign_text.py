"""A campaign in a row, in a few lines, and its matrix as a heat map."""

from dataclasses import replace

import pytest
from rich.text import Text

from daemon.analysis.results import read_results
from daemon.model.verdicts import Outcome
from scenario_tui.text.campaign_text import (
    campaign_text,
    failure_lines,
    history_text,
    judged_text,
    margin_marks,
    outcome_bar,
    progress_text,
    when_text,
)
from scenario_tui.text.heat_text import Heat, heat_lines, heat_marks
from scenario_tui.text.results import Conclusion, conclude
from tests.people.dashboard.judged_campaign import judged_campaign
from tests.people.fake import CAMPAIGN, NOW, OLD, FakeDaemon, make_row

FAKE = FakeDaemon()
ROW, NIGHTLY = FAKE.campaigns()
OVER = replace(ROW, queued=0, running=0, finished_at=NOW)


@pytest.mark.parametrize("width", range(8, 30))
def test_every_outcome_that_there_is_shows_in_a_bar_of_the_width(width):
    bar = outcome_bar(ROW, width, "fail").plain
    assert len(bar) == width
    assert set(bar) == set("━█▒░╌·")


def test_failures_are_told_from_passes_without_colours():
    assert outcome_bar(NIGHTLY, 10, "fail").plain == "━" * 10
    most = replace(ROW, passed=7, failed=3, lost=0, inconclusive=0, running=0, queued=0)
    assert outcome_bar(most, 10, "fail").plain == "━" * 7 + "█" * 3
    assert outcome_bar(replace(most, passed=0, failed=0), 10, "fail").plain == ""


def test_progress_is_a_bar_until_the_campaign_is_finished():
    assert progress_text(ROW, 10, 12).plain == "━━━━━━─ 8/10"
    assert progress_text(OVER, 10, 12).plain == "10/10"
    large = replace(ROW, total=120_000, done=0, queued=120_000)
    assert progress_text(large, 120_000, 12).plain.endswith("/120,000")


def test_the_time_left_stands_in_place_of_the_age():
    assert when_text(replace(ROW, seconds_left=7380.0), NOW).plain == "2 h left"
    assert when_text(replace(ROW, seconds_left=7380.0, paused=True), NOW).plain == "4 min ago"


def test_neighbours_share_a_mark_where_there_are_more_cells_than_columns():
    conclusion = Conclusion("fail", "1 unexpected", 1, margins=(0.9, None, -0.1, 0.9, 0.05, 0.95))
    assert margin_marks(conclusion, 16).plain == "█·✗█▁█"
    assert margin_marks(conclusion, 3).plain == "█✗▁"
    assert margin_marks(None, 16).plain == ""


def test_an_acknowledged_campaign_is_quiet():
    conclusion = Conclusion("fail", "1 unexpected", 1)
    assert judged_text(ROW, conclusion).style == "fail"
    assert judged_text(replace(ROW, acknowledged=True), conclusion).style == "quiet"


def test_the_history_draws_the_pass_rates_of_campaigns_of_the_same_name():
    rates = [(2, 8), (6, 4), (10, 0)]
    rows = [
        replace(NIGHTLY, id=f"n-{i}", passed=p, failed=f, done=p + f, submitted_at=NOW - 100 + i)
        for i, (p, f) in enumerate(rates)
    ]
    assert history_text(rows[-1], [ROW, *rows]).plain == "▂▅█  20 % → 100 % passed, 3 campaigns"
    assert history_text(rows[1], rows).plain == "▂▅  20 % → 60 % passed, 2 campaigns"
    assert not history_text(rows[0], rows)


def test_the_last_failures_stand_with_their_sentence_news_first():
    results = read_results(FAKE, ROW)
    lines = [line.plain for line in failure_lines(results, 60)]
    assert lines[0].split() == ["✗", "S2/pilot/1", "!"]
    assert lines[1] == "  no-contact: −0.12 m at 512.2 s, door-1, front left corner"
    assert lines[4].split() == ["∅", "S2/pilot/4"]
    assert lines[5] == "  worker bench-1 went away"
    assert all(line.cell_len <= 20 for line in failure_lines(results, 20))


def test_a_campaign_in_words_has_all_that_its_row_leaves_out():
    results = read_results(FAKE, ROW)
    row = replace(ROW, seconds_left=7380.0, acknowledged=True)
    text = campaign_text(row, conclude(results), (ROW, NIGHTLY), NOW, Text("MATRIX")).plain
    for words in ("first  ✗ 2 unexpected  acknowledged", "✗ 2 fail", "MATRIX", "10 runs, submitted",
                  "2 h 03 min left", f"scenario results {row.id}"):  # fmt: skip
        assert words in text
    assert OLD not in text


@pytest.fixture
def results():
    return judged_results(judged_campaign())


def judged_results(fake):
    return read_results(fake, fake.campaign(CAMPAIGN))


@pytest.mark.parametrize(
    ("run", "mark"),
    [
        (Heat("pass", 1.0), ("█", "pass")),
        (Heat("pass", 0.3), ("▃", "pass")),
        (Heat("pass", 0.0), ("▁", "inconclusive")),
        (Heat("pass", None), ("✓", "pass")),
        (Heat("fail", -0.01), ("✗", "fail")),
        (Heat("fail", -1.0), ("✗", "fail.far")),
        (Heat("fail", -0.01, known=True), ("✗", "known")),
        (Heat("inconclusive", -0.5), ("?", "inconclusive")),
        (Heat("running", None), ("▶", "running")),
    ],
)
def test_a_mark_says_the_verdict_and_its_colour_the_margin(run, mark):
    assert run.mark() == mark


def test_more_repeats_than_fit_are_counted_with_the_mark_of_the_worst(results):
    cells = {(cell.scenario, cell.sut): cell for cell in results.assessment.cells}
    assert heat_marks([cells["S2", "a2s"]], results, 3).plain == "▃✗▃"
    text = heat_marks([cells["S2", "a2s"]], results, 2)
    assert text.plain == "✗…"
    text = heat_marks([cell for cell in cells.values() if cell.sut == "a2s"], results, 8)
    assert text.plain == "✗1 ∅1 ✓7"
    assert str(text.spans[0].style) == "fail"
    assert heat_marks([cells["S1", "pilot"], cells["S1", "a2s"]], results, 5).plain == "✓▂6"


def test_scenarios_by_systems_with_a_mark_for_each_repeat(results):
    lines = [line.plain for line in heat_lines(results, 60, 20)]
    assert [line.split() for line in lines[:4]] == [
        ["pilot", "a2s"],
        ["S1", "▂▂▂", "▂▂▃"],
        ["S2", "✗✗✗", "a", "▃✗▃", "!"],
        ["S3", "▃▃▶", "▃▃∅"],
    ]
    assert lines[4] == "▁ tight █ clear pass  ! unexpected  a known"


def test_what_does_not_fit_is_summed_and_the_unexpected_stays(results):
    lines = [line.plain for line in heat_lines(results, 24, 3)]
    assert lines == ["        all 2", "S2      ✗✗✗▃✗▃ !a", "2 more  ▂▂▂▂▂▃▃▃▶▃▃∅"]
    rows = tuple(
        make_row(i, scenario=f"S{i}", sut="pilot", repeat=0, outcome=Outcome.PASS)
        for i in range(30)
    )
    rows = (*rows[:20], replace(rows[20], outcome=Outcome.FAIL, margin=-0.5), *rows[21:])
    fake = replace(judged_campaign(), rows=rows)
    lines = [line.plain for line in heat_lines(judged_results(fake), 40, 6)]
    assert [line.split()[0] for line in lines[1:]] == ["S0", "S1", "S2", "S20", "26"]
    assert lines[4].split() == ["S20", "✗", "!"]
    assert lines[5].startswith("26 more  ▂▂▃▃")
    assert len(lines) == 6


def test_no_line_is_wider_or_more_than_there_is_room_for(results):
    for width, height in ((12, 2), (20, 3), (40, 8), (120, 30)):
        lines = heat_lines(results, width, height)
        assert len(lines) <= height
        assert all(line.cell_len <= width for line in lines)
