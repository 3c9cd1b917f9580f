"""Tables of campaigns, runs and workers: filters, order, pages, the cursor, ways between them."""

from dataclasses import replace

from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from scenario_tui.dashboard.screens import runs
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.run import RunScreen
from scenario_tui.dashboard.screens.runs import RunsScreen
from scenario_tui.dashboard.screens.workers import WorkersScreen
from scenario_tui.dashboard.widgets.tables import KeyedTable
from tests.people.dashboard.driven import choose_from_palette
from tests.people.fake import CAMPAIGN, NOW, OLD, FakeDaemon, make_row


def first_column(dash):
    table = dash.one(KeyedTable)
    return [str(table.get_row_at(i)[0]) for i in range(table.row_count)]


class NightlyDaemon(FakeDaemon):
    """Has an earlier campaign of the same name, in which half of the runs failed."""

    def _campaign_rows(self):
        first, nightly = super()._campaign_rows()
        before = replace(nightly, id="nightly-0", passed=2, failed=2, submitted_at=NOW - 2e5)
        return first, nightly, before


async def test_beside_the_table_stands_the_campaign_under_the_cursor(dashboard):
    dash = await dashboard(NightlyDaemon(), (120, 40))
    assert dash.screen.about == CAMPAIGN
    await dash.press("j")
    assert "50 % → 100 % passed, 2" in dash.text
    assert "last failures" not in dash.text


async def test_where_there_is_room_for_the_table_alone_nothing_more_is_judged(dashboard):
    dash = await dashboard(size=(80, 15))
    assert "last failures" not in dash.text
    assert dash.screen.about == ""
    await dash.resize(80, 24)
    assert dash.text.index("last failures") > dash.text.index(CAMPAIGN)


async def test_enter_goes_in_escape_goes_out_and_numbers_jump(dashboard):
    dash = await dashboard()
    for key, screen in (
        ("enter", RunsScreen), ("enter", RunScreen), ("escape", RunsScreen),
        ("escape", CampaignsScreen), ("escape", CampaignsScreen), ("2", RunsScreen),
        ("3", WorkersScreen), ("enter", RunScreen), ("1", CampaignsScreen),
    ):  # fmt: skip
        await dash.press(key)
        assert isinstance(dash.screen, screen), key


async def test_what_is_typed_narrows_campaigns_at_once_and_escape_brings_all_back(dashboard):
    dash = await dashboard()
    assert first_column(dash) == [CAMPAIGN, OLD]
    await dash.press("slash", *"nigh")
    assert first_column(dash) == [OLD]
    await dash.press("enter")
    assert dash.app.focused is dash.one(KeyedTable)
    assert first_column(dash) == [OLD]
    await dash.press("escape")
    assert first_column(dash) == [CAMPAIGN, OLD]
    assert isinstance(dash.screen, CampaignsScreen)


async def test_letters_and_slashes_typed_are_no_commands_and_no_match_is_said(dashboard):
    dash = await dashboard()
    for screen in (CampaignsScreen, RunsScreen):
        assert isinstance(dash.screen, screen)
        await dash.press("slash", *"qc/2s")
        assert isinstance(dash.screen, screen)
        assert "qc/2s" in dash.text
        assert "No row matches" in dash.text
        await dash.press("escape", "enter")
    assert isinstance(dash.screen, RunScreen)


async def test_runs_are_found_by_their_verdict_state_and_texts(dashboard):
    dash = await dashboard()
    await dash.press("enter")
    seen = []
    for word in ("fail", "error", "lost", "inconclusive", "running", "queued", "pass", "local"):
        await dash.press("slash", *word, "enter")
        seen.append(len(first_column(dash)))
        assert f"/{word}" in dash.text
        await dash.press("escape")
    assert seen == [2, 0, 1, 1, 1, 1, 4, 1]


async def test_workers_are_sorted_and_filtered(dashboard):
    dash = await dashboard()
    await dash.press("3", "i")
    assert first_column(dash)[0] == "shed-1"
    await dash.press("slash", *"pilot")
    assert first_column(dash) == ["bench-1"]


async def test_headers_say_what_is_sorted_by_and_keys_change_it(dashboard):
    dash = await dashboard()
    for key, header, names in (
        (None, "▼submitted", [CAMPAIGN, OLD]),
        ("greater_than_sign", "▲campaign", [CAMPAIGN, OLD]),
        ("i", "▼campaign", [OLD, CAMPAIGN]),
        ("less_than_sign", "▼submitted", [CAMPAIGN, OLD]),
    ):
        await dash.press(*[key] * bool(key))
        assert header in dash.lines[2]
        assert first_column(dash) == names


async def test_runs_are_sorted_by_the_daemon(dashboard):
    dash = await dashboard()
    await dash.press("enter", ">", ">")
    assert "by margin ▲" in dash.text
    assert first_column(dash)[0] == "S2/pilot/1"
    await dash.press("i")
    assert "by margin ▼" in dash.text
    await dash.press(*[">"] * (len(RunsScreen.SORTS) - 2))
    assert "▲run" in dash.text
    await dash.press("<")
    assert "by scenario ▲" in dash.text


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
            assert rest[0] == CAMPAIGN
            assert rest[1:3] == ["✓", "pass"]


async def test_filter_and_order_are_still_there_when_one_comes_back(dashboard):
    dash = await dashboard()
    await dash.press("2", "slash", *"fail", "enter", ">", ">", "i", "down")
    before, key = dash.text, dash.one(KeyedTable).key
    assert key != f"{CAMPAIGN}.0"
    assert "by margin ▼  /fail" in before
    await dash.press("1", "2")
    assert dash.text == before
    assert dash.one(KeyedTable).key == key
    await dash.press("slash", *"S2/", "enter", "1", "2")
    assert "/S2/" in dash.text
    assert dash.app.focused is dash.one(KeyedTable)
    # Other runs are looked at in their own way.
    await dash.press("1", "enter")
    assert "▲run" in dash.text


async def test_the_colon_opens_a_list_of_places(dashboard):
    dash = await dashboard()
    await choose_from_palette(dash, "workers", "Workers")
    assert isinstance(dash.screen, WorkersScreen)
    await choose_from_palette(dash, "campaign ni", f"go to campaign {OLD}")
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
