"""A campaign in a row and in a few lines: outcomes, margins, failures, history."""

from dataclasses import replace

import pytest
from rich.text import Text

from daemon.analysis.results import read_results
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
from scenario_tui.text.results import Conclusion, conclude
from tests.people.fake import NOW, OLD, FakeDaemon

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
