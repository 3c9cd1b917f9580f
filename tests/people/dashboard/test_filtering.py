"""Filter and order of a table: typed text narrows it, keys choose the column to sort by."""

from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.widgets.tables import KeyedTable
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.fake import FakeDaemon


def names(pilot):
    table = pilot.app.screen.query_one(KeyedTable)
    return [str(table.get_row_at(place)[0]).partition("-")[0] for place in range(table.row_count)]


async def test_what_is_typed_narrows_the_table_at_once_and_escape_brings_all_back():
    async with make_dashboard(FakeDaemon()).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert names(pilot) == ["first", "nightly"]
        await press(pilot, "slash", *"nigh")
        assert names(pilot) == ["nightly"]
        await press(pilot, "enter")
        assert pilot.app.focused is pilot.app.screen.query_one(KeyedTable)
        assert names(pilot) == ["nightly"]
        await press(pilot, "escape")
        assert names(pilot) == ["first", "nightly"]
        assert isinstance(pilot.app.screen, CampaignsScreen)


async def test_letters_and_slashes_typed_are_no_commands_and_no_match_is_said():
    async with make_dashboard(FakeDaemon()).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await press(pilot, "slash", *"q/2s")
        assert isinstance(pilot.app.screen, CampaignsScreen)
        text = "\n".join(screen_text(pilot))
        assert "q/2s" in text
        assert "No row matches" in text
        await press(pilot, "escape", "enter")
        assert not isinstance(pilot.app.screen, CampaignsScreen)


async def test_headers_say_what_is_sorted_by_and_keys_change_it():
    async with make_dashboard(FakeDaemon()).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert "▼submitted" in screen_text(pilot)[2]
        await press(pilot, "greater_than_sign")
        assert "▲campaign" in screen_text(pilot)[2]
        assert names(pilot) == ["first", "nightly"]
        await press(pilot, "i")
        assert "▼campaign" in screen_text(pilot)[2]
        assert names(pilot) == ["nightly", "first"]
        await press(pilot, "less_than_sign")
        assert "▼submitted" in screen_text(pilot)[2]
        assert names(pilot) == ["first", "nightly"]
