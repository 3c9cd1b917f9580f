"""The matrix as a heat map: marks, sums of many repeats, what does not fit."""

from dataclasses import replace

import pytest

from daemon.analysis.results import read_results
from daemon.model.verdicts import Outcome
from scenario_tui.text.heat_text import Heat, heat_lines, heat_marks
from tests.people.dashboard.daemons import judged_campaign
from tests.people.fake import CAMPAIGN, make_row


@pytest.fixture
def results():
    return judged_results(judged_campaign())


def judged_results(fake):
    return read_results(fake, fake.campaign(CAMPAIGN))


def plain(lines):
    return [line.plain for line in lines]


@pytest.mark.parametrize(
    ("run", "mark"),
    [
        (Heat("pass", 1.0), ("█", "pass")),
        (Heat("pass", 0.3), ("▃", "pass")),
        (Heat("pass", 0.0), ("▁", "inconclusive")),
        (Heat("pass", None), ("✓", "pass")),
        (Heat("fail", -0.01), ("✗", "fail")),
        (Heat("fail", -1.0), ("✗", "fail.far")),
        (Heat("fail", -0.01, is_known=True), ("✗", "known")),
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
    lines = plain(heat_lines(results, 60, 20))
    assert [line.split() for line in lines[:4]] == [
        ["pilot", "a2s"],
        ["S1", "▂▂▂", "▂▂▃"],
        ["S2", "✗✗✗", "a", "▃✗▃", "!"],
        ["S3", "▃▃▶", "▃▃∅"],
    ]
    assert lines[4] == "▁ tight █ clear pass  ! unexpected  a known"


def test_what_does_not_fit_is_summed_and_the_unexpected_stays(results):
    lines = plain(heat_lines(results, 24, 3))
    assert lines == ["        all 2", "S2      ✗✗✗▃✗▃ !a", "2 more  ▂▂▂▂▂▃▃▃▶▃▃∅"]
    rows = tuple(
        make_row(i, scenario=f"S{i}", sut="pilot", repeat=0, outcome=Outcome.PASS)
        for i in range(30)
    )
    rows = (*rows[:20], replace(rows[20], outcome=Outcome.FAIL, margin=-0.5), *rows[21:])
    fake = replace(judged_campaign(), rows=rows)
    lines = plain(heat_lines(judged_results(fake), 40, 6))
    assert [line.split()[0] for line in lines[1:]] == ["S0", "S1", "S2", "S20", "26"]
    assert lines[4].split() == ["S20", "✗", "!"]
    assert lines[5].startswith("26 more  ▂▂▃▃")
    assert len(lines) == 6


def test_no_line_is_wider_or_more_than_there_is_room_for(results):
    for width, height in ((12, 2), (20, 3), (40, 8), (120, 30)):
        lines = heat_lines(results, width, height)
        assert len(lines) <= height
        assert all(line.cell_len <= width for line in lines)
