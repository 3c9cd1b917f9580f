"""Tables of campaigns, runs and workers: filters, order, pages, the cursor, ways between them."""

from dataclasses import replace

import pytest

from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from scenario_tui.dashboard.screens import runs
from scenario_tui.dashboard.screens.runs import RunsScreen
from scenario_tui.dashboard.screens.workers import WorkersScreen
from scenario_tui.dashboard.widgets.tables import KeyedTable
from tests.people.fake import CAMPAIGN, NOW, OLD, Entered, FakeDaemon, make_row


def first_column(dash):
    table = dash.one(KeyedTable)
    return [str(table.get_row_at(i)[0]) for i in range(table.row_count)]


async def test_beside_the_table_stands_the_campaign_under_the_cursor(dashboard, fake):
    """There is an earlier campaign of the same name, in which half of the runs failed."""
    rows = (
        make_row(i, id=f"nightly-0.{i}", campaign="nightly-0", outcome=outcome)
        for i, outcome in enumerate((Outcome.PASS, Outcome.FAIL) * 2)
    )
    fake.more = (Entered("nightly-0", "nightly", tuple(rows), NOW - 2e5),)
    dash = await dashboard(fake, (120, 40))
    assert dash.screen.about == CAMPAIGN
    await dash.press("j")
    assert "50 % → 100 % passed, 2" in dash.text
    assert "last failures" not in dash.text


async def test_where_there_is_room_for_the_table_alone_nothing_more_is_judged(dashboard):
    dash = await dashboard(size=(80, 15))
    assert "last failures" not in dash.text
    assert "worst margin so far" not in dash.text
    assert dash.screen.about == ""
    await dash.resize(80, 24)
    assert dash.text.index("last failures") > dash.text.index(CAMPAIGN)


VERDICTS = ("fail", "error", "lost", "inconclusive", "running", "queued", "pass", "local")
WALKS = {
    "places": ("enter", "enter", "escape", "escape", "escape", "2", "3", "enter", "1"),
    "typed": ("/nigh", "enter", "escape"),
    "letters": ("/qc/2s", "escape", "enter", "/qc/2s", "escape"),
    "found": ("enter", *(step for word in VERDICTS for step in (f"/{word}", "escape"))),
    "workers": ("3", "i", "/pilot"),
    "headers": (">", "i", "<"),
    "sorted": ("enter", ">", ">", "i", *[">"] * (len(RunsScreen.SORTS) - 2), "<"),
    "back": ("2", "/fail", "enter", ">", ">", "i", "down", "1", "2", "/S2/", "enter", "1", "2", "1",
             "enter"),
}  # fmt: skip
"""Keys that are pressed one after the other; behind a slash stands a text that is typed."""


@pytest.mark.parametrize("name", WALKS)
async def test_keys_lead_to_what_they_did(dashboard, golden, name):
    """After each step: where one is, what has the keys, what is listed, with the cursor's row."""
    dash = await dashboard()
    texts = []
    for step in WALKS[name]:
        await dash.press(*(("slash", *step[1:]) if step[0] == "/" else (step,)))
        place, focused = (type(one).__name__ for one in (dash.screen, dash.app.focused))
        texts.append(f"--- {step}\n{place}, {focused}\n{dash.lines[1].strip()}")
        if dash.screen.query(KeyedTable):
            table = dash.one(KeyedTable)
            rows = first_column(dash)
            cursor = f"at {rows[table.cursor_row]}" if rows else "\n".join(dash.lines[4:8]).strip()
            texts.append(f"{dash.lines[2].strip()}\n{', '.join(rows)}\n{cursor}")
    golden(f"screens/walk-{name}.txt", "\n".join([*texts, ""]))


async def test_only_a_page_is_asked_for_and_pages_are_turned(dashboard, fake):
    fake.rows = tuple(make_row(i, repeat=i) for i in range(250))
    dash = await dashboard()
    await dash.press("enter")
    assert len(first_column(dash)) == 100
    assert "1-100 of 250" in dash.text
    await dash.press("G")
    assert "201-250 of 250" in dash.text
    assert first_column(dash)[0] == "S2/pilot/200"
    assert {call[8] for call in fake.calls if call[0] == "runs" and not call[-1]} == {100}


STEPS = (
    ("k", 0, "1-10 of 25"), ("G", 24, "21-25 of 25"), ("j", 24, "21-25 of 25"),
    ("pageup", 20, "21-25 of 25"), ("k", 19, "11-20 of 25"), ("pageup", 11, "11-20 of 25"),
    ("pageup", 10, "11-20 of 25"), ("k", 9, "1-10 of 25"), ("j", 10, "11-20 of 25"),
    ("pageup", 9, "1-10 of 25"), ("pagedown", 10, "11-20 of 25"), ("g", 0, "1-10 of 25"),
)  # fmt: skip
"""A key, the run the cursor is on afterwards, the page that is shown."""


async def test_the_cursor_goes_on_to_the_rows_behind(dashboard, monkeypatch):
    monkeypatch.setattr(runs, "PAGE", 10)
    dash = await dashboard(FakeDaemon(rows=tuple(make_row(i) for i in range(25))), (80, 12))
    await dash.press("enter")
    table = dash.one(KeyedTable)
    for key, run, page in STEPS:
        await dash.press(key)
        assert table.key == f"{CAMPAIGN}.{run}", key
        assert page in dash.lines[1], key
        top = table.scroll_y
        assert top <= table.cursor_row < top + table.size.height - 1, key


async def test_the_cursor_stays_on_its_run_when_rows_come_before_it(dashboard, fake):
    dash = await dashboard()
    await dash.press("enter", ">", ">", "down")
    table = dash.one(KeyedTable)
    assert table.key == f"{CAMPAIGN}.5"
    rows = list(fake.rows)
    rows[7] = replace(rows[7], state=RunState.DONE, outcome=Outcome.FAIL, margin=-9.0,
                      oracle="no-contact", unit="m")  # fmt: skip
    fake.rows = tuple(rows)
    await dash.settle()
    assert first_column(dash)[0] == "S2/pilot/2"
    assert table.key == f"{CAMPAIGN}.5"


async def test_repeats_are_told_apart_however_long_names_are(dashboard, fake):
    fake.rows = tuple(
        make_row(i, scenario="busy-house-with-many-doors", sut="pilot-b", repeat=i)
        for i in range(4)
    )
    dash = await dashboard()
    await dash.press("2")
    for width in (80, 92, 108, 120):
        await dash.resize(width, 24)
        for line, row in zip(dash.lines[3:7], reversed(fake.rows), strict=True):
            run, *rest = line.split()
            assert run.endswith(f"t-b/{row.repeat}"), line
            assert rest[:3] == [CAMPAIGN, "✓", "pass"]


async def test_the_colon_opens_a_list_of_places(dashboard):
    dash = await dashboard()
    await dash.choose_from_palette("workers", "Workers")
    assert isinstance(dash.screen, WorkersScreen)
    await dash.choose_from_palette("campaign ni", f"go to campaign {OLD}")
    assert isinstance(dash.screen, RunsScreen)
    assert f"campaigns › {OLD}" in dash.text


async def test_copying_gives_the_command_for_what_the_cursor_is_on(dashboard):
    dash = await dashboard()
    copied = []
    for keys in (["y"], ["enter", "down", "y"], ["enter", "y"], ["escape", "m", "y"], ["3", "y"]):
        await dash.press(*keys)
        copied.append(dash.app.clipboard)
    assert copied == [
        f"scenario results {CAMPAIGN}",
        f"scenario show {CAMPAIGN}.1",
        f"scenario replay {CAMPAIGN}.1 --frame no-contact",
        f"scenario results {CAMPAIGN} --filter S1/pilot/",
        "scenario status",
    ]


async def test_quitting_says_that_work_goes_on(dashboard):
    dash = await dashboard()
    await dash.press("q")
    assert not dash.app.is_running or dash.app._exit
    assert "the daemon goes on with 2 unfinished runs" in dash.app.farewell()


async def test_the_table_has_the_keys_when_a_daemon_answers_again(dashboard, fake):
    fake.reachable = False
    dash = await dashboard()
    assert "no daemon answers, reconnecting" in dash.text
    fake.reachable = True
    await dash.settle()
    assert CAMPAIGN in dash.text
    assert dash.app.focused is dash.one(KeyedTable)
