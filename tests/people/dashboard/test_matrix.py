"""The matrix of a campaign: the dashboard judges as the command line does."""

import re
from dataclasses import replace

import pytest

from daemon.analysis.results import read_results
from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from scenario_tui.dashboard.campaign_assessor import CampaignAssessor
from scenario_tui.dashboard.screens.matrix import MatrixScreen
from scenario_tui.dashboard.screens.runs import RunsScreen
from scenario_tui.dashboard.widgets.cell_table import CellTable
from tests.people.dashboard.daemons import judged_campaign, judged_rows
from tests.people.fake import CAMPAIGN, OLD


@pytest.fixture
def judged():
    return judged_campaign()


def runs_of(scenario, sut):
    found = (row for row in judged_rows() if (row.scenario, row.sut) == (scenario, sut))
    return tuple(row.id for row in found)


async def test_the_cell_under_the_cursor_is_told_oracle_by_oracle(dashboard, judged):
    dash = await dashboard(judged)
    await dash.press("m", "j")
    assert "✗ fail  no-contact  as expected (fail)" in dash.text
    assert "known: violated at the closed door" in dash.text


async def test_n_goes_to_what_is_not_as_expected_and_enter_lists_its_runs(dashboard, judged):
    dash = await dashboard(judged)
    await dash.press("m", "n")
    assert dash.one(CellTable).cell.runs == runs_of("S2", "a2s")
    await dash.press("enter")
    assert isinstance(dash.screen, RunsScreen)
    assert f"campaigns › {CAMPAIGN} › S2/a2s  1-3 of 3" in dash.text
    assert "S2/a2s/1" in dash.text
    assert "S2/pilot" not in dash.text
    await dash.press("escape", "a")
    assert "1-18 of 18" in dash.text
    await dash.press("m")
    assert isinstance(dash.screen, MatrixScreen)


async def test_the_matrix_changes_while_runs_finish_and_the_cursor_stays(dashboard, judged):
    dash = await dashboard(judged)
    await dash.press("m", "j", "l")
    rows = list(judged.rows)
    rows[14] = replace(rows[14], state=RunState.DONE, outcome=Outcome.FAIL, margin=-2.0,
                       oracle="no-contact", unit="m")  # fmt: skip
    judged.rows = tuple(rows)
    await dash.settle()
    assert "▃▃✗ b fail 2/3" in dash.text
    assert dash.one(CellTable).cell.runs == runs_of("S2", "a2s")


async def test_three_systems_fit_without_scrolling_or_cut_numbers(dashboard, judged):
    others = [row for row in judged.rows if row.sut == "a2s"]
    more = (replace(row, sut="a-planner-with-a-long-name") for row in others)
    rows = (*judged.rows, *more)
    judged.rows = tuple(replace(row, id=f"{CAMPAIGN}.{i}", index=i) for i, row in enumerate(rows))
    dash = await dashboard(judged)
    await dash.press("m")
    for width in (80, 120):
        await dash.resize(width, 40)
        table = dash.one(CellTable)
        assert len(table.columns) == 3
        assert table.max_scroll_x == 0
        numbers = re.findall(r"[−+]\d[\d.]* m\b", "\n".join(dash.lines[2:13]))
        assert numbers.count("−0.0312 m") >= 3
        assert "+0.2 m" in numbers
        assert "…" not in "\n".join(dash.lines[3:12])


async def test_a_campaign_with_nothing_unexpected_says_so(dashboard, judged):
    dash = await dashboard(judged)
    await dash.press("j", "m", "n")
    assert f"campaigns › {OLD} › matrix  ✓ as expected" in dash.text
    assert "▂▂▂▂ pass 4/4" in dash.text
    assert "no cell is unexpected" in dash.notices


async def test_a_campaign_without_runs_says_so(dashboard, judged):
    judged.rows = ()
    dash = await dashboard(judged)
    await dash.press("m")
    assert "This campaign has no runs" in dash.text


def judged_at(fake, took, moments, about):
    """Return at which moments a judge works on a campaign that changes all the time.

    Every question takes ``took`` seconds.
    """
    now = [0.0]
    rows = fake.campaigns()[:1]
    fake.before = lambda _: now.__setitem__(0, now[0] + took)
    judge = CampaignAssessor(clock=lambda: now[0])
    worked = []
    for now[0] in moments:
        judge.touch(CAMPAIGN)
        worked.append(bool(judge.step(fake, rows, about)))
    return worked


@pytest.mark.parametrize(
    ("took", "about", "moments", "works"),
    [
        # Once a second for the screen in front, less often else.
        (0.0, CAMPAIGN, (0.0, 0.5, 1.1, 1.5, 2.2, 7.5), "+-+-++"),
        (0.0, "", (0.0, 0.5, 1.1, 1.5, 2.2, 7.5), "+----+"),
        # Three questions of 2 s each: after 6 s of work follow 18 s of rest.
        (2.0, CAMPAIGN, (0.0, 8.0, 23.0, 25.0), "+--+"),
    ],
)
def test_judging_leaves_most_of_the_time_to_others(judged, took, about, moments, works):
    assert judged_at(judged, took, moments, about) == [sign == "+" for sign in works]


def test_what_did_not_change_is_not_judged_again(judged):
    judge, rows = CampaignAssessor(clock=lambda: 0.0, every=0.0), judged.campaigns()
    assert [judge.step(judged, rows, "") for _ in range(3)] == [CAMPAIGN, OLD, ""]
    assert judge.step(judged, rows, CAMPAIGN)  # now everything about it is wanted
    assert not judge.step(judged, rows, CAMPAIGN)
    assert judge.conclusions[OLD].glyph_text == "✓ as expected"
    assert judge.conclusions[CAMPAIGN].glyph_text == "✗ 1 run unexpected"


def test_of_old_campaigns_those_are_judged_that_nobody_has_acknowledged(judged, monkeypatch):
    judge, rows = CampaignAssessor(clock=lambda: 0.0, every=0.0), judged.campaigns()
    results = read_results(judged, rows[0])
    monkeypatch.setattr("daemon.analysis.results.read_results", lambda *_: results)
    waiting = replace(rows[0], queued=10, running=0, done=0, lost=0)
    newer = [replace(waiting, id=f"newer-{number}") for number in range(100)]
    for number in range(100):
        assert judge.step(judged, [*newer, *rows], newer[number].id)
    assert judge.step(judged, [*newer, *rows], "")
    old = [replace(row, acknowledged=True) for row in rows[1:]]
    assert not judge.step(judged, [*newer, rows[0], *old, replace(waiting, id="old")], "")
    assert CAMPAIGN in judge.conclusions


def test_conclusions_of_deleted_campaigns_are_forgotten(judged):
    judge, rows = CampaignAssessor(clock=lambda: 0.0, every=0.0), judged.campaigns()
    for _ in rows:
        judge.step(judged, rows, CAMPAIGN)
    assert set(judge.conclusions) == {CAMPAIGN, OLD}
    judge.step(judged, [row for row in rows if row.id == OLD], "")
    assert set(judge.conclusions) == {OLD}
    assert not judge.results
