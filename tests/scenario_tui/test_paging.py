"""A table of more runs than a page: moving on from its last row brings the rows behind it."""

from __future__ import annotations

import pytest

from scenario_tui.screens.runs import PAGE
from scenario_tui.widgets.keyed_table import KeyedTable
from tests.scenario_tui.fake import CAMPAIGN, FakeDaemon, make_row
from tests.scenario_tui.inline import make_dashboard, press, screen_text, settle

RUNS = 2 * PAGE + 50


@pytest.mark.parametrize(
    ("keys", "run", "shown"),
    [
        (("G",), RUNS - 1, f"{2 * PAGE + 1}-{RUNS} of {RUNS}"),
        (("G", "g"), 0, f"1-{PAGE} of {RUNS}"),
        (("n", "k"), PAGE - 1, f"1-{PAGE} of {RUNS}"),
        (("n", "k", "j"), PAGE, f"{PAGE + 1}-{2 * PAGE} of {RUNS}"),
        (("n", "pageup"), PAGE - 1, f"1-{PAGE} of {RUNS}"),
        (("k",), 0, f"1-{PAGE} of {RUNS}"),
        (("G", "j"), RUNS - 1, f"{2 * PAGE + 1}-{RUNS} of {RUNS}"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, tuple) else "",
)
async def test_the_cursor_goes_on_to_the_rows_behind(
    keys: tuple[str, ...], run: int, shown: str
) -> None:
    fake = FakeDaemon(rows=tuple(make_row(i) for i in range(RUNS)))
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await press(pilot, "enter", *keys)
        table = pilot.app.screen.query_one(KeyedTable)
        assert table.key == f"{CAMPAIGN}.{run}"
        assert shown in screen_text(pilot)[1]
        top = table.scroll_y
        assert top <= table.cursor_row < top + table.size.height
