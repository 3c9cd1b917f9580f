"""Driving a real daemon, and asking real commands: what the fake ones stand for."""

import shutil
from pathlib import Path

import pytest
from textual.widgets import Input

from daemon.analysis.rejudge import Rejudgement
from daemon.batch.client import Client
from daemon.batch.errors import DaemonError
from grammars.text.codec import from_plain
from scenario_tui.dashboard.app import Dashboard
from scenario_tui.dashboard.feed import Feed
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.steering import run_command
from scenario_tui.dashboard.screens.submit import SubmitScreen
from tests.make import make_submission
from tests.parts import daemon_at
from tests.people.dashboard.dash import InlineChildren, eventually
from tests.people.recorded import record_run

CAMPAIGNS = Path(__file__).parents[4] / "campaigns"


async def test_a_campaign_is_steered_to_its_end(tmp_path):
    with daemon_at(tmp_path / "state", slots=1) as part, part.client() as client:
        # None of its runs ends before the test lets them: whatever is pressed finds it under way.
        gate = tmp_path / "gate"
        client.submit(make_submission("long", runs=6, until=str(gate)))

        def row():
            return client.campaigns()[0]

        app = Dashboard(Feed(lambda: Client.open(part.endpoint)))
        async with app.run_test(size=(80, 24)) as pilot:
            await eventually(lambda: app.state.campaigns)
            await pilot.press("P")
            await eventually(lambda: row().paused)
            await eventually(lambda: app.state.campaigns[0].paused)
            await pilot.press("number_sign", "home", "ctrl+k", "7", "enter")
            await eventually(lambda: row().priority == 7)
            await pilot.press("P")
            await eventually(lambda: not row().paused)
            await pilot.press("c", "y")
            await eventually(lambda: row().cancelled)
            await eventually(lambda: app.state.campaigns[0].cancelled)
            gate.touch()
            await pilot.press("r", "l")
            await eventually(lambda: not row().cancelled)
            await eventually(lambda: row().passed == 6)


async def test_a_campaign_chosen_by_its_name_is_submitted(tmp_path, monkeypatch):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(CAMPAIGNS / name, tmp_path / "work" / name)
    monkeypatch.chdir(tmp_path / "work")
    with daemon_at(tmp_path / "state") as part, part.client() as client:
        feed = Feed(lambda: Client.open(part.endpoint))
        app = Dashboard(feed, child_processes=InlineChildren())
        async with app.run_test(size=(80, 24)) as pilot:
            await eventually(lambda: app.state.connected)
            await pilot.press("s")
            await eventually(lambda: isinstance(app.screen, SubmitScreen))
            app.screen.query_one(Input).value = "demo"
            await eventually(lambda: app.screen.command().split()[2] == "demo/campaign.yaml")
            await pilot.press("enter")
            await eventually(lambda: client.campaigns())
            assert client.campaigns()[0].total == 15
            await eventually(lambda: isinstance(app.screen, CampaignsScreen))


def test_commands_answer_or_say_why_not(tmp_path):
    trace = record_run(tmp_path / "run.mcap")
    answer = run_command(("judge", str(trace), "--state", str(tmp_path)))
    (judged,) = from_plain(Rejudgement, answer).traces
    assert judged.outcome is judged.outcome_before
    with pytest.raises(DaemonError, match="scenario judge nothing.*not a trace, not a folder"):
        run_command(("judge", "nothing", "--state", str(tmp_path)))
