"""Keys typed faster than screens open: they go where they would go if somebody had waited."""

import pytest
from textual.events import Key
from textual.keys import key_to_character
from textual.widgets import Input

from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.matrix import MatrixScreen
from scenario_tui.dashboard.screens.submit import SubmitScreen
from tests.people.dashboard.driven import SteeredDaemon
from tests.people.dashboard.inline import make_dashboard, settle
from tests.people.fake import CAMPAIGN, OLD


@pytest.fixture
def fake():
    return SteeredDaemon()


async def type_at_once(pilot, *keys):
    """Hand all keys to the dashboard before it has done anything because of the first one."""
    for key in keys:
        pilot.app.post_message(Key(key, key_to_character(key)))
    await settle(pilot)


@pytest.mark.parametrize(
    ("keys", "verb", "calls"),
    [
        (("c", "y"), "cancel", [(CAMPAIGN,)]),
        (("c", "n", "P"), "steer", [(CAMPAIGN, True, None)]),
        (("r", "f"), "retry", [(CAMPAIGN, ("fail",))]),
        (("r", "j", "enter"), "retry", [(CAMPAIGN, ("fail",))]),
        (("number_sign", "ctrl+u", "7", "enter"), "steer", [(CAMPAIGN, None, 7)]),
        (("enter", "r", "f"), "retry", [(CAMPAIGN, ("fail",))]),
    ],
)
async def test_what_is_typed_ahead_is_for_the_dialog(fake, keys, verb, calls):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await type_at_once(pilot, *keys)
        await settle(pilot)
    assert fake.told(verb) == calls


@pytest.mark.parametrize("keys", [("c", "y"), ("number_sign", "7", "enter"), ("r", "j", "enter")])
async def test_what_is_typed_for_a_dialog_that_does_not_open_does_nothing(fake, keys):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        pilot.app.read_only = True
        await type_at_once(pilot, *keys)
        assert isinstance(pilot.app.screen, CampaignsScreen)
        assert pilot.app.clipboard == ""
    assert not {"steer", "cancel", "retry"} & {call[0] for call in fake.calls}


async def test_a_name_typed_ahead_is_that_of_a_file(fake, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await type_at_once(pilot, *"s1q3s")
        assert isinstance(pilot.app.screen, SubmitScreen)
        assert pilot.app.screen.query_one(Input).value == "1q3s"


async def test_a_text_typed_ahead_filters(fake):
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await type_at_once(pilot, "slash", *OLD[:4], "enter", "m")
        assert isinstance(pilot.app.screen, MatrixScreen)
        assert pilot.app.screen.campaign().id == OLD
