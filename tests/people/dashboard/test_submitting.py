"""Choosing a campaign file, what the check says of it, and handing it over."""

import os
import shutil
import threading
from pathlib import Path

import pytest
from textual.widgets import Input

from scenario_tui.campaign_files import find_campaigns, fuzzy_matches
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.widgets.tables import KeyedTable
from scenario_tui.library.submission import SubmissionPlan, Workload, check_file, plan_text
from tests.people.dashboard.dash import InlineChildren
from tests.people.dashboard.journeys import clicked, follow, has

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
        (
            ((15, 0.0, 15), None),
            False,
            "; their duration is unknown: no similar run yet",
        ),
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


async def test_who_leaves_is_told_of_a_submission_that_was_cut_off(
    dashboard, fake, folder, monkeypatch
):
    dash = await dashboard(fake)
    await dash.press("s")
    dash.one(Input).value = "demo/camp"
    await dash.until(lambda: "demo/campaign.yaml" in dash.text)
    check, go_on = dash.app.check_file, threading.Event()

    def hold(path, submit=False, **more):
        return (not submit or go_on.wait()) and check(path, submit=submit, **more)

    monkeypatch.setattr(dash.app, "check_file", hold)
    await dash.pilot.press("enter")
    assert "the submission of demo/campaign.yaml was cut off" in dash.app.farewell()
    go_on.set()
    await dash.until(lambda: ": 15 runs" in dash.notices)
    assert "cut off" not in dash.app.farewell()
    assert fake.told("submit")
    assert isinstance(dash.screen, CampaignsScreen)


def misspelt(dash):
    Path("broken.yaml").write_text("campaign: broken\nsenarios: {}\n")


def remembered(dash):
    dash.app.remember(Path("broken.yaml").resolve(), "")


JOURNEYS = {
    "wrong": ["s", "b r o k e n", "enter", ("another mistake", misspelt), "enter", "escape escape"],
    "last-first": [
        "s", "escape", ("broken.yaml is submitted", remembered), "s", clicked("demo/campaign.yaml")
    ],
    # The demo that ships fits as well.
    "not-taken": ["!s d e m o", "ctrl+r", has(reachable=False), "enter"],
}  # fmt: skip


@pytest.mark.parametrize("name", [*JOURNEYS, "of-somebody-new"])
async def test_files_are_offered_and_checked_as_they_were(
    dashboard, golden, folder, monkeypatch, name
):
    if name not in JOURNEYS:
        monkeypatch.chdir(folder / "robots")
    # As wide as the path of any folder: it is not cut anywhere.
    text = await follow(await dashboard(size=(200, 24)), JOURNEYS.get(name, ["s"]))
    text = text.replace(str(folder), "HERE").replace(str(DEMO.parent), "PROJECT")
    golden(f"journeys/submission-{name}.txt", text)


def test_campaigns_near_are_found_those_changed_last_first(folder):
    found = find_campaigns(folder)
    assert found == (folder / "demo" / "campaign.yaml", folder / "broken.yaml")


def test_letters_in_order_are_enough_to_find_a_file():
    names = ("ortega2024/campaign.yaml", "demo/campaign.yaml")
    assert fuzzy_matches(names, "dcamp") == ("demo/campaign.yaml",)
    assert fuzzy_matches(names, "") == names
    assert fuzzy_matches(names, "xyz") == ()
