"""A table of more runs than a page: moving on from its last row brings the rows behind it."""

from scenario_tui.dashboard.screens import runs
from scenario_tui.dashboard.widgets.tables import KeyedTable
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.fake import CAMPAIGN, FakeDaemon, make_row

STEPS = (
    ("k", 0, "1-10 of 25"),
    ("G", 24, "21-25 of 25"),
    ("j", 24, "21-25 of 25"),
    ("pageup", 20, "21-25 of 25"),
    ("k", 19, "11-20 of 25"),
    ("pageup", 11, "11-20 of 25"),
    ("pageup", 10, "11-20 of 25"),
    ("k", 9, "1-10 of 25"),
    ("j", 10, "11-20 of 25"),
    ("pageup", 9, "1-10 of 25"),
    ("pagedown", 10, "11-20 of 25"),
    ("g", 0, "1-10 of 25"),
)
"""A key, the run the cursor is on afterwards, the page that is shown."""


async def test_the_cursor_goes_on_to_the_rows_behind(monkeypatch):
    monkeypatch.setattr(runs, "PAGE", 10)
    fake = FakeDaemon(rows=tuple(make_row(i) for i in range(25)))
    async with make_dashboard(fake).run_test(size=(80, 12)) as pilot:
        await settle(pilot)
        await press(pilot, "enter")
        table = pilot.app.screen.query_one(KeyedTable)
        for key, run, shown in STEPS:
            await press(pilot, key)
            assert table.key == f"{CAMPAIGN}.{run}", key
            assert shown in screen_text(pilot)[1], key
            top = table.scroll_y
            assert top <= table.cursor_row < top + table.size.height - 1, key
