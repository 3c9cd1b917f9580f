"""Choosing a campaign file, what the check says of it, and handing it over."""

import os
import shutil
import threading
from pathlib import Path

import pytest
from textual.widgets import Input, OptionList, Static

from scenario_tui.campaign_files import find_files, fuzzy_matches, is_campaign
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.submit import SubmitScreen
from scenario_tui.dashboard.widgets.tables import KeyedTable
from scenario_tui.library.submission import SubmissionPlan, Workload, plan_text
from tests.people.dashboard.driven import SteeredDaemon, notices, until
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle

DEMO = Path(__file__).parents[3] / "campaigns"


@pytest.fixture
def fake():
    return SteeredDaemon()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The campaigns that come with us, a broken one, and what is passed by."""
    for name in ("demo", "robots", "suts"):
        shutil.copytree(DEMO / name, tmp_path / name)
    (tmp_path / "broken.yaml").write_text("campaign: broken\nscenarois: {}\n")
    hidden = tmp_path / ".old"
    hidden.mkdir()
    (hidden / "old.yaml").write_text("campaign: old\n")
    os.utime(tmp_path / "broken.yaml", (1.0, 1.0))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def about(pilot):
    return str(pilot.app.screen.query_one("#about", Static).render())


async def opened_at(pilot, file):
    await settle(pilot)
    await press(pilot, "s")
    assert isinstance(pilot.app.screen, SubmitScreen)
    pilot.app.screen.query_one(Input).value = file
    await until(pilot, lambda: any(file in line for line in screen_text(pilot)[3:8]))


async def test_a_campaign_is_checked_beside_its_name_and_submitted(fake, folder):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await opened_at(pilot, "demo/camp")
        await until(pilot, lambda: "✓" in about(pilot))
        assert "3 scenarios, 15 runs" in about(pilot)
        assert "same as: scenario submit demo/campaign.yaml" in about(pilot)
        await pilot.press("ctrl+r")
        assert "demo/campaign.yaml --fresh" in about(pilot)
        await pilot.press("enter")
        await until(pilot, lambda: fake.told("submit"))
        await settle(pilot)
        assert isinstance(pilot.app.screen, CampaignsScreen)
        assert ": 15 runs" in notices(pilot)


async def test_the_cursor_goes_to_what_was_submitted(fake, folder):
    async with make_dashboard(fake).run_test(size=(120, 30)) as pilot:
        await settle(pilot)
        rows = fake.campaigns()
        table = pilot.app.screen.query_one(KeyedTable)
        assert table.key == rows[0].id != rows[1].id
        pilot.app.remember(folder / "demo" / "campaign.yaml", rows[1].id)
        await until(pilot, lambda: table.key == rows[1].id)


async def test_what_would_be_executed_is_said_before(fake, folder):
    async with make_dashboard(fake).run_test(size=(120, 30)) as pilot:
        await opened_at(pilot, "demo/camp")
        await until(pilot, lambda: "✓" in about(pilot))
        assert "3 cells × 5 repeats = 15 runs\n" in about(pilot)  # no ledger is here to ask
        searches = "doors-in-time is a search: start it with `scenario search demo/campaign.yaml`"
        assert searches in about(pilot)


@pytest.mark.parametrize(
    ("plan", "fresh", "said"),
    [
        ((None, None), False, ""),
        (((15, 0.0, 15), None), False, "; how long they take is unknown: no run of these yet"),
        (((15, 480.0, 0), None), False, "; about 4 min 00 s on 2 slots"),
        (((3, 90.0, 0), None), False, ", 12 cached; about 45 s on 2 slots"),
        (((1, 90.0, 0), None), False, ", 14 cached; about 1 min 30 s on 1 slot"),
        (((15, 90.0, 5), None), False, "; at least 45 s on 2 slots, 5 of them unknown"),
        (((0, 0.0, 0), None), False, ", all cached: nothing is executed"),
        (((0, 0.0, 0), (15, 30.0, 0)), True, "; about 15 s on 2 slots"),
    ],
)
def test_a_plan_says_what_is_cached_and_how_long_the_rest_takes(plan, fresh, said):
    plan = SubmissionPlan(3, 5, 15, *(work and Workload(*work) for work in plan))
    assert plan_text(plan, 2, fresh=fresh) == f"3 cells × 5 repeats = 15 runs{said}"


async def test_what_is_wrong_is_said_with_its_line_and_not_submitted(fake, folder):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await opened_at(pilot, "broken")
        await until(pilot, lambda: "✗" in about(pilot))
        assert "broken.yaml:2:1: error:" in about(pilot)
        assert "scenarios" in about(pilot)
        await pilot.press("enter")
        await until(pilot, lambda: "not submitted: " in notices(pilot))
        assert isinstance(pilot.app.screen, SubmitScreen)
        (folder / "broken.yaml").write_text("campaign: broken\nsenarios: {}\n")
        await press(pilot, "enter")
        await until(pilot, lambda: "senarios" in about(pilot))
        await press(pilot, "escape")
        assert pilot.app.screen.query_one(Input).value == ""
        await press(pilot, "escape")
        assert isinstance(pilot.app.screen, CampaignsScreen)
    assert not fake.told("submit")


async def test_a_submission_that_the_daemon_did_not_take_stays_with_its_reason(fake, folder):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await opened_at(pilot, "demo/camp")
        fake.reachable = False
        await pilot.press("enter")
        await until(pilot, lambda: "not submitted: no daemon answers" in about(pilot))
        assert isinstance(pilot.app.screen, SubmitScreen)
        fake.reachable = True
        await pilot.press("enter")
        await until(pilot, lambda: fake.told("submit"))
        await settle(pilot)
        assert isinstance(pilot.app.screen, CampaignsScreen)


async def test_who_leaves_is_told_of_a_submission_that_was_cut_off(fake, folder, monkeypatch):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await opened_at(pilot, "demo/camp")
        check, go_on = pilot.app.check_file, threading.Event()

        def hold(path, submit=False, **more):
            return (not submit or go_on.wait()) and check(path, submit=submit, **more)

        monkeypatch.setattr(pilot.app, "check_file", hold)
        await pilot.press("enter")
        assert "the submission of demo/campaign.yaml was cut off" in pilot.app.farewell()
        go_on.set()
        await until(pilot, lambda: ": 15 runs" in notices(pilot))
        assert "cut off" not in pilot.app.farewell()


async def test_a_name_typed_before_the_files_are_listed_chooses_ones_own_file(fake, folder):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        # The demo that ships fits as well.
        await pilot.press("s", *"demo")
        await until(pilot, lambda: "scenario submit" in about(pilot) and "✓" in about(pilot))
        files = pilot.app.screen.query_one(OptionList)
        assert (files.highlighted, files.option_count) == (0, 2)
        assert "scenario submit demo/campaign.yaml" in about(pilot)


async def test_somebody_new_is_offered_the_demo(fake, folder, monkeypatch):
    monkeypatch.chdir(folder / "robots")
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await press(pilot, "s")
        await until(pilot, lambda: "✓" in about(pilot))
        assert screen_text(pilot)[3].strip() == "the demo that comes with scenario"
        assert "3 scenarios, 15 runs" in about(pilot)


async def test_what_was_submitted_last_is_offered_first_among_ones_own(fake, folder):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        for first in (["demo/campaign.yaml", "broken.yaml"], ["broken.yaml", "demo/campaign.yaml"]):
            await press(pilot, "s")
            await until(
                pilot, lambda: "broken.yaml" in screen_text(pilot)[4] + screen_text(pilot)[3]
            )
            assert [line.strip() for line in screen_text(pilot)[3:5]] == first
            assert f"scenario submit {first[0]}" in about(pilot)
            await press(pilot, "escape")
            pilot.app.remember(folder / "broken.yaml", "")


async def test_a_click_chooses_a_file(fake, folder):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await press(pilot, "s")
        await until(pilot, lambda: "broken.yaml" in screen_text(pilot)[4])
        await pilot.click(offset=(5, 4))
        await until(pilot, lambda: "✗" in about(pilot))
        assert not notices(pilot)


def test_campaigns_near_are_found_those_changed_last_first(folder):
    found = find_files(folder, is_campaign)
    assert found == (folder / "demo" / "campaign.yaml", folder / "broken.yaml")


def test_letters_in_order_are_enough_to_find_a_file():
    names = ("ortega2024/campaign.yaml", "demo/campaign.yaml")
    assert fuzzy_matches(names, "dcamp") == ("demo/campaign.yaml",)
    assert fuzzy_matches(names, "") == names
    assert fuzzy_matches(names, "xyz") == ()
