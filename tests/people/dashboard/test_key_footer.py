"""The line of keys is made anew when it says something else, and only then."""

from dataclasses import replace

import pytest
from textual.widgets._footer import FooterKey

from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from tests.people.dashboard.driven import SteeredDaemon


async def test_the_line_of_keys_is_made_when_it_says_something_else(dashboard, monkeypatch):
    made = []
    usual = KeyFooter.recompose

    async def recompose(self):
        made.append(type(self.screen).__name__)
        await usual(self)

    monkeypatch.setattr(KeyFooter, "recompose", recompose)
    dash = await dashboard(SteeredDaemon())
    await dash.until(lambda: "Quit" in dash.lines[-1])
    assert made == ["CampaignsScreen"]
    # A filter is left by a key, which is one more in the line.
    await dash.press("slash", "n", "enter")
    await dash.until(lambda: len(made) > 1)


class OneAcknowledged(SteeredDaemon):
    def _campaign_rows(self):
        first, second, *others = super()._campaign_rows()
        return (first, replace(second, acknowledged=True), *others)


async def test_keys_that_become_grey_keep_their_widgets(dashboard):
    dash = await dashboard(OneAcknowledged())
    footer = dash.one(KeyFooter)
    await dash.until(lambda: footer.query(FooterKey))
    keys = list(footer.query(FooterKey))

    def grey():
        return {key.description for key in keys if key.has_class("-disabled")}

    assert "Acknowledge" not in grey()
    await dash.press("j")
    await dash.until(lambda: "Acknowledge" in grey())
    assert list(footer.query(FooterKey)) == keys
    await dash.press("k")
    await dash.until(lambda: "Acknowledge" not in grey())


async def test_keys_that_come_back_while_the_line_is_made_are_shown(dashboard, monkeypatch):
    absent = set()
    check, make_anew = CampaignsScreen.check_action, KeyFooter.recompose

    async def recompose(self):
        absent.add("matrix")  # after the line was told of its keys, before it is made of them
        await make_anew(self)

    dash = await dashboard(SteeredDaemon())
    screen = dash.screen
    monkeypatch.setattr(
        CampaignsScreen,
        "check_action",
        lambda it, action, given: action not in absent and check(it, action, given),
    )
    with monkeypatch.context() as meanwhile:
        meanwhile.setattr(KeyFooter, "recompose", recompose)
        absent.add("steer")
        screen.refresh_bindings()
        await dash.settle()
    assert "Matrix" not in dash.lines[-1]
    absent.remove("matrix")
    screen.refresh_bindings()
    await dash.settle()
    assert "Matrix" in dash.lines[-1]
    assert "Cancel" not in dash.lines[-1]


@pytest.mark.parametrize("keys", [(), ("enter",), ("enter", "enter"), ("m",), ("3",), ("2",)])
async def test_the_line_fits_80_columns_and_leads_to_help_and_palette(dashboard, keys):
    dash = await dashboard(SteeredDaemon())
    await dash.press(*keys)
    await dash.until(lambda: dash.lines[-1].endswith(": Go  ? Help  q Quit"))


@pytest.mark.parametrize("keys", [(), ("enter",), ("enter", "enter"), ("m",)])
async def test_the_key_of_the_help_comes_first_where_there_is_less_room(dashboard, keys):
    dash = await dashboard(SteeredDaemon(), size=(60, 20))
    await dash.press(*keys)
    await dash.until(lambda: dash.lines[-1].strip().startswith("? Help  "))
