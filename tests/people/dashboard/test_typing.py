"""Keys typed faster than screens open: they go where they would go if somebody had waited."""

import pytest
from textual.events import Key
from textual.keys import key_to_character
from textual.widgets import Input

from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.matrix import MatrixScreen
from scenario_tui.dashboard.screens.submit import SubmitScreen
from tests.people.dashboard.driven import SteeredDaemon
from tests.people.fake import CAMPAIGN, OLD


@pytest.fixture
def fake():
    return SteeredDaemon()


async def type_at_once(dash, *keys):
    """Hand all keys to the dashboard before it has done anything because of the first one."""
    for key in keys:
        dash.app.post_message(Key(key, key_to_character(key)))
    await dash.settle()


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
async def test_what_is_typed_ahead_is_for_the_dialog(dashboard, fake, keys, verb, calls):
    dash = await dashboard(fake)
    await type_at_once(dash, *keys)
    await dash.settle()
    assert fake.told(verb) == calls


@pytest.mark.parametrize("keys", [("c", "y"), ("number_sign", "7", "enter"), ("r", "j", "enter")])
async def test_what_is_typed_for_a_dialog_that_does_not_open_does_nothing(dashboard, fake, keys):
    dash = await dashboard(fake)
    dash.app.read_only = True
    await type_at_once(dash, *keys)
    assert isinstance(dash.screen, CampaignsScreen)
    assert dash.app.clipboard == ""
    assert not {"steer", "cancel", "retry"} & {call[0] for call in fake.calls}


async def test_a_name_typed_ahead_is_that_of_a_file(dashboard, fake, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    dash = await dashboard(fake)
    await type_at_once(dash, *"s1q3s")
    assert isinstance(dash.screen, SubmitScreen)
    assert dash.one(Input).value == "1q3s"


async def test_a_text_typed_ahead_filters(dashboard, fake):
    dash = await dashboard(fake)
    await type_at_once(dash, "slash", *OLD[:4], "enter", "m")
    assert isinstance(dash.screen, MatrixScreen)
    assert dash.screen.campaign().id == OLD
