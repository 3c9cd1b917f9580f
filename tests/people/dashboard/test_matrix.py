"""The matrix of a campaign: the dashboard judges as the command line does."""

import re
from dataclasses import replace

import pytest

from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from scenario_tui.dashboard.campaign_assessor import CampaignAssessor
from scenario_tui.dashboard.screens.matrix import MatrixScreen
from scenario_tui.dashboard.screens.runs import RunsScreen
from scenario_tui.dashboard.widgets.cell_table import CellTable
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.dashboard.judged_campaign import judged_campaign, judged_rows
from tests.people.fake import CAMPAIGN, OLD


@pytest.fixture
def judged():
    return judged_campaign()


def opened(fake, width=80, height=24):
    return make_dashboard(fake).run_test(size=(width, height))


def runs_of(scenario, sut):
    found = (row for row in judged_rows() if (row.scenario, row.sut) == (scenario, sut))
    return tuple(row.id for row in found)


def shown(pilot):
    return "\n".join(screen_text(pilot))


async def test_m_shows_the_campaign_judged(judged):
    async with opened(judged, 120, 40) as pilot:
        await settle(pilot)
        await press(pilot, "m")
        assert isinstance(pilot.app.screen, MatrixScreen)
        text = shown(pilot)
    for words in (
        "✗ 1 run unexpected  17/18 runs",
        "✗✗✗ a fail 0/3",  # an expected failure
        "▃✗▃ ! fail 2/3",  # a surprise
        "−0.0312 m no-contact",
        "▃▃▶ running 2/3",
        "a known: violated at the closed door",
        "▁ tight █ clear pass",
        "1 run not executed",
        "∅ lost  S3/a2s/2  worker bench-1 went away",
        "a2s detour  ✓ pass +0 s",
        f"scenario results {CAMPAIGN}",
    ):
        assert words in text


async def test_the_cell_under_the_cursor_is_told_oracle_by_oracle(judged):
    async with opened(judged) as pilot:
        await settle(pilot)
        await press(pilot, "m", "j", "l")
        text = shown(pilot)
        assert "✗ fail  no-contact  ! expected pass" in text
        assert "worst in repeat 1: −0.0312 m, at 512.2 s, door-1, front left corner" in text
        await press(pilot, "h")
        assert "✗ fail  no-contact  as expected (fail)" in shown(pilot)
        assert "known: violated at the closed door" in shown(pilot)


async def test_n_goes_to_what_is_not_as_expected_and_enter_lists_its_runs(judged):
    async with opened(judged) as pilot:
        await settle(pilot)
        await press(pilot, "m", "n")
        assert pilot.app.screen.query_one(CellTable).cell.runs == runs_of("S2", "a2s")
        await press(pilot, "enter")
        assert isinstance(pilot.app.screen, RunsScreen)
        text = shown(pilot)
        assert f"campaigns › {CAMPAIGN} › S2/a2s  1-3 of 3" in text
        assert "S2/a2s/1" in text
        assert "S2/pilot" not in text
        await press(pilot, "escape", "a")
        assert "1-18 of 18" in shown(pilot)
        await press(pilot, "m")
        assert isinstance(pilot.app.screen, MatrixScreen)


async def test_the_matrix_changes_while_runs_finish_and_the_cursor_stays(judged):
    async with opened(judged) as pilot:
        await settle(pilot)
        await press(pilot, "m", "j", "l")
        rows = list(judged.rows)
        rows[14] = replace(rows[14], state=RunState.DONE, outcome=Outcome.FAIL, margin=-2.0,
                           oracle="no-contact", unit="m")  # fmt: skip
        judged.rows = tuple(rows)
        await settle(pilot)
        assert "▃▃✗ b fail 2/3" in shown(pilot)
        assert pilot.app.screen.query_one(CellTable).cell.runs == runs_of("S2", "a2s")


@pytest.mark.parametrize("width", [80, 100, 120, 200])
async def test_three_systems_fit_without_scrolling_or_cut_numbers(judged, width):
    others = [row for row in judged.rows if row.sut == "a2s"]
    more = (replace(row, sut="a-planner-with-a-long-name") for row in others)
    rows = (*judged.rows, *more)
    judged.rows = tuple(replace(row, id=f"{CAMPAIGN}.{i}", index=i) for i, row in enumerate(rows))
    async with opened(judged, width, 40) as pilot:
        await settle(pilot)
        await press(pilot, "m")
        table = pilot.app.screen.query_one(CellTable)
        assert len(table.columns) == 3
        assert table.max_scroll_x == 0
        text = shown(pilot)
        numbers = re.findall(r"[−+]\d[\d.]* m\b", "\n".join(text.split("\n")[2:13]))
        assert numbers.count("−0.0312 m") >= 3
        assert "+0.2 m" in numbers
        assert "…" not in "\n".join(text.split("\n")[3:12])


async def test_a_campaign_with_nothing_unexpected_says_so(judged):
    async with opened(judged) as pilot:
        await settle(pilot)
        await press(pilot, "j", "m", "n")
        assert f"campaigns › {OLD} › matrix  ✓ as expected" in shown(pilot)
        assert "▂▂▂▂ pass 4/4" in shown(pilot)
        assert "no cell is unexpected" in " ".join(n.message for n in pilot.app._notifications)


async def test_a_campaign_without_runs_says_so(judged):
    judged.rows = ()
    async with opened(judged) as pilot:
        await settle(pilot)
        await press(pilot, "m")
        assert "This campaign has no runs" in shown(pilot)


class Clock:
    """Says the time it was told, and that every question takes ``took`` seconds."""

    def __init__(self, fake, took):
        self.now, self._took = 0.0, took
        fake.before = lambda _: self._pass()

    def _pass(self):
        self.now += self._took

    def __call__(self):
        return self.now


def judged_at(fake, took, moments, wanted):
    """Return at which moments a judge works on the first campaign, which changes all the time."""
    clock = Clock(fake, took)
    judge, rows = CampaignAssessor(clock=clock), fake._campaign_rows()[:1]
    found = []
    for moment in moments:
        clock.now = moment
        judge.touch(CAMPAIGN)
        found.append(bool(judge.step(fake, rows, wanted)))
    return found


def test_what_is_shown_is_judged_once_a_second_and_the_rest_less_often(judged):
    moments = (0.0, 0.5, 1.1, 1.5, 2.2, 7.5)
    assert judged_at(judged, 0.0, moments, CAMPAIGN) == [True, False, True, False, True, True]
    assert judged_at(judged, 0.0, moments, "") == [True, False, False, False, False, True]


def test_judging_large_campaigns_leaves_most_of_the_time_to_others(judged):
    # Three questions of 2 s each: after 6 s of work follow 18 s of rest.
    moments = (0.0, 8.0, 23.0, 25.0)
    assert judged_at(judged, 2.0, moments, CAMPAIGN) == [True, False, False, True]


def test_what_did_not_change_is_not_judged_again(judged):
    judge, rows = CampaignAssessor(clock=lambda: 0.0, every=0.0), judged._campaign_rows()
    assert [judge.step(judged, rows, "") for _ in range(3)] == [CAMPAIGN, OLD, ""]
    assert judge.step(judged, rows, CAMPAIGN)  # now everything about it is wanted
    assert not judge.step(judged, rows, CAMPAIGN)
    assert judge.conclusions[OLD].glyph_text == "✓ as expected"
    assert judge.conclusions[CAMPAIGN].glyph_text == "✗ 1 run unexpected"


def test_of_old_campaigns_those_are_judged_that_nobody_has_acknowledged(judged):
    judge, rows = CampaignAssessor(clock=lambda: 0.0, every=0.0), judged._campaign_rows()
    waiting = replace(rows[0], queued=10, running=0, done=0, lost=0)
    newer = [replace(waiting, id=f"newer-{number}") for number in range(100)]
    for number in range(100):
        assert judge.step(judged, [*newer, *rows], newer[number].id)
    assert judge.step(judged, [*newer, *rows], "")
    old = [replace(row, acknowledged=True) for row in rows[1:]]
    assert not judge.step(judged, [*newer, rows[0], *old, replace(waiting, id="old")], "")
    assert CAMPAIGN in judge.conclusions


def test_conclusions_of_deleted_campaigns_are_forgotten(judged):
    judge, rows = CampaignAssessor(clock=lambda: 0.0, every=0.0), judged._campaign_rows()
    for _ in rows:
        judge.step(judged, rows, CAMPAIGN)
    assert set(judge.conclusions) == {CAMPAIGN, OLD}
    judge.step(judged, [row for row in rows if row.id == OLD], "")
    assert set(judge.conclusions) == {OLD}
    assert not judge.results
