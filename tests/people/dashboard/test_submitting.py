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
from scenario_tui.library.submission import SubmissionPlan, Workload, check_file, plan_text
from tests.people.dashboard.dash import InlineChildren

DEMO = Path(__file__).parents[3] / "campaigns"


@pytest.fixture(scope="module")
def campaigns_here(tmp_path_factory):
    """The campaigns that come with us, and what is passed by."""
    folder = tmp_path_factory.mktemp("submitting")
    for name in ("demo", "robots", "suts"):
        shutil.copytree(DEMO / name, folder / name)
    (folder / ".old").mkdir()
    (folder / ".old" / "old.yaml").write_text("campaign: old\n")
    return folder


CHECKED = {}
RUN = InlineChildren.run


def check_once(children, function, *arguments, **options):
    """Check a file that did not change once: it takes a second."""
    if function is not check_file:
        return RUN(children, function, *arguments, **options)
    path = Path(arguments[0]).resolve()
    key = (Path.cwd(), path, path.stat().st_mtime_ns, *sorted(options.items()))
    if key not in CHECKED:
        CHECKED[key] = function(*arguments, **options)
    return CHECKED[key]


@pytest.fixture
def folder(campaigns_here, monkeypatch):
    """The same, with a broken one that is older."""
    monkeypatch.setattr(InlineChildren, "run", check_once)
    broken = campaigns_here / "broken.yaml"
    broken.write_text("campaign: broken\nscenarois: {}\n")
    os.utime(broken, (1.0, 1.0))
    monkeypatch.chdir(campaigns_here)
    return campaigns_here


def about(dash):
    return str(dash.one("#about", Static).render())


async def opened_at(dash, file):
    await dash.settle()
    await dash.press("s")
    assert isinstance(dash.screen, SubmitScreen)
    dash.one(Input).value = file
    await dash.until(lambda: any(file in line for line in dash.lines[3:8]))


async def test_a_campaign_is_checked_beside_its_name_and_submitted(dashboard, fake, folder):
    dash = await dashboard(fake)
    await opened_at(dash, "demo/camp")
    await dash.until(lambda: "✓" in about(dash))
    assert "3 scenarios, 15 runs" in about(dash)
    assert "3 cells × 5 repeats = 15 runs\n" in about(dash)  # no ledger is here to ask
    searches = "doors-in-time is a search: start it with `scenario search demo/campaign.yaml`"
    assert searches in about(dash)
    assert "same as: scenario submit demo/campaign.yaml" in about(dash)
    await dash.press("ctrl+r")
    assert "demo/campaign.yaml --fresh" in about(dash)
    await dash.press("enter")
    await dash.until(lambda: fake.told("submit"))
    await dash.settle()
    assert isinstance(dash.screen, CampaignsScreen)
    assert ": 15 runs" in dash.notices


async def test_the_cursor_goes_to_what_was_submitted(dashboard, fake, folder):
    dash = await dashboard(fake, size=(120, 30))
    rows = fake.campaigns()
    table = dash.one(KeyedTable)
    assert table.key == rows[0].id != rows[1].id
    dash.app.remember(folder / "demo" / "campaign.yaml", rows[1].id)
    await dash.until(lambda: table.key == rows[1].id)


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


async def test_what_is_wrong_is_said_with_its_line_and_not_submitted(dashboard, fake, folder):
    dash = await dashboard(fake)
    await opened_at(dash, "broken")
    await dash.until(lambda: "✗" in about(dash))
    assert "broken.yaml:2:1: error:" in about(dash)
    assert "scenarios" in about(dash)
    await dash.press("enter")
    await dash.until(lambda: "not submitted: " in dash.notices)
    assert isinstance(dash.screen, SubmitScreen)
    (folder / "broken.yaml").write_text("campaign: broken\nsenarios: {}\n")
    await dash.press("enter")
    await dash.until(lambda: "senarios" in about(dash))
    await dash.press("escape")
    assert dash.one(Input).value == ""
    await dash.press("escape")
    assert isinstance(dash.screen, CampaignsScreen)
    assert not fake.told("submit")


async def test_a_submission_that_the_daemon_did_not_take_stays_with_its_reason(
    dashboard, fake, folder
):
    dash = await dashboard(fake)
    await opened_at(dash, "demo/camp")
    fake.reachable = False
    await dash.press("enter")
    await dash.until(lambda: "not submitted: no daemon answers" in about(dash))
    assert isinstance(dash.screen, SubmitScreen)
    fake.reachable = True
    await dash.press("enter")
    await dash.until(lambda: fake.told("submit"))
    await dash.settle()
    assert isinstance(dash.screen, CampaignsScreen)


async def test_who_leaves_is_told_of_a_submission_that_was_cut_off(
    dashboard, fake, folder, monkeypatch
):
    dash = await dashboard(fake)
    await opened_at(dash, "demo/camp")
    check, go_on = dash.app.check_file, threading.Event()

    def hold(path, submit=False, **more):
        return (not submit or go_on.wait()) and check(path, submit=submit, **more)

    monkeypatch.setattr(dash.app, "check_file", hold)
    await dash.pilot.press("enter")
    assert "the submission of demo/campaign.yaml was cut off" in dash.app.farewell()
    go_on.set()
    await dash.until(lambda: ": 15 runs" in dash.notices)
    assert "cut off" not in dash.app.farewell()


async def test_a_name_typed_before_the_files_are_listed_chooses_ones_own_file(
    dashboard, fake, folder
):
    dash = await dashboard(fake)
    # The demo that ships fits as well.
    await dash.press("s", *"demo")
    await dash.until(lambda: "scenario submit" in about(dash) and "✓" in about(dash))
    files = dash.one(OptionList)
    assert (files.highlighted, files.option_count) == (0, 2)
    assert "scenario submit demo/campaign.yaml" in about(dash)


async def test_somebody_new_is_offered_the_demo(dashboard, fake, folder, monkeypatch):
    monkeypatch.chdir(folder / "robots")
    dash = await dashboard(fake)
    await dash.press("s")
    await dash.until(lambda: "✓" in about(dash))
    assert dash.lines[3].strip() == "the demo that comes with scenario"
    assert "3 scenarios, 15 runs" in about(dash)


async def test_what_was_submitted_last_is_offered_first_among_ones_own(dashboard, fake, folder):
    dash = await dashboard(fake)
    for first in (["demo/campaign.yaml", "broken.yaml"], ["broken.yaml", "demo/campaign.yaml"]):
        await dash.press("s")
        await dash.until(lambda: "broken.yaml" in dash.lines[4] + dash.lines[3])
        assert [line.strip() for line in dash.lines[3:5]] == first
        assert f"scenario submit {first[0]}" in about(dash)
        await dash.press("escape")
        dash.app.remember(folder / "broken.yaml", "")


async def test_a_click_chooses_a_file(dashboard, fake, folder):
    dash = await dashboard(fake)
    await dash.press("s")
    await dash.until(lambda: "broken.yaml" in dash.lines[4])
    await dash.pilot.click(offset=(5, 4))
    await dash.until(lambda: "✗" in about(dash))
    assert not dash.notices


def test_campaigns_near_are_found_those_changed_last_first(folder):
    found = find_files(folder, is_campaign)
    assert found == (folder / "demo" / "campaign.yaml", folder / "broken.yaml")


def test_letters_in_order_are_enough_to_find_a_file():
    names = ("ortega2024/campaign.yaml", "demo/campaign.yaml")
    assert fuzzy_matches(names, "dcamp") == ("demo/campaign.yaml",)
    assert fuzzy_matches(names, "") == names
    assert fuzzy_matches(names, "xyz") == ()
