"""Every key of the dashboard does what its help says."""

from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from typing import Any

import pytest

from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.dialogs import Menu, Question
from scenario_tui.dashboard.screens.help import Help, our_bindings
from scenario_tui.dashboard.screens.run import RunScreen
from scenario_tui.dashboard.screens.runs import RunsScreen
from scenario_tui.dashboard.screens.workers import WorkersScreen
from scenario_tui.dashboard.widgets.tables import KeyedTable
from scenario_tui.dashboard.widgets.top_view import TopView
from tests.people.dashboard.driven import choose_from_palette
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.fake import CAMPAIGN, NOW, OLD, make_live, make_row

Open = Callable[..., AbstractAsyncContextManager[Any]]


@pytest.fixture
def opened(fake):
    def start(width=80, height=24):
        return make_dashboard(fake).run_test(size=(width, height))

    return start


def shown(pilot):
    return "\n".join(screen_text(pilot))


def notices(pilot):
    return " ".join(notice.message for notice in pilot.app._notifications)


def first_column(pilot):
    table = pilot.app.screen.query_one(KeyedTable)
    return [str(table.get_row_at(i)[0]) for i in range(table.row_count)]


async def test_the_first_line_says_whether_it_is_fine(opened):
    async with opened(120, 30) as pilot:
        await settle(pilot)
        line = screen_text(pilot)[0]
    for words in ("✗ first: 2 runs unexpected", "11/14 verdicts, 1 min left", "✗2 fail", "∅1 lost"):
        assert words in line


async def test_the_first_line_fits_into_eighty_cells(opened, fake):
    fake.rows = tuple(
        replace(row, id=f"{CAMPAIGN}.{i}", repeat=i) for i, row in enumerate(fake.rows * 150)
    )
    async with opened() as pilot:
        await settle(pilot)
        line = screen_text(pilot)[0]
    assert "1,054/1,504, 1 min left" in line
    assert "✗300 fail" in line


async def test_enter_goes_in_and_escape_goes_out(opened):
    async with opened() as pilot:
        await settle(pilot)
        assert isinstance(pilot.app.screen, CampaignsScreen)
        await press(pilot, "enter")
        assert isinstance(pilot.app.screen, RunsScreen)
        assert f"campaigns › {CAMPAIGN}" in shown(pilot)
        await press(pilot, "down", "enter")
        assert isinstance(pilot.app.screen, RunScreen)
        assert "S1/pilot/1" in shown(pilot)
        await press(pilot, "escape", "escape", "escape")
        assert isinstance(pilot.app.screen, CampaignsScreen)


async def test_numbers_jump_to_the_main_screens(opened):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter", "enter", "3")
        assert isinstance(pilot.app.screen, WorkersScreen)
        assert "bench-1" in shown(pilot)
        assert "1 of 6 slots busy" in shown(pilot)
        await press(pilot, "2")
        assert isinstance(pilot.app.screen, RunsScreen)
        assert "all runs" in shown(pilot)
        await press(pilot, "1")
        assert isinstance(pilot.app.screen, CampaignsScreen)


async def test_rows_are_reached_with_vi_keys_too(opened):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter", "j", "j", "k")
        table = pilot.app.screen.query_one(KeyedTable)
        assert table.key == f"{CAMPAIGN}.1"
        await press(pilot, "G")
        assert table.key == f"{CAMPAIGN}.9"
        await press(pilot, "g")
        assert table.key == f"{CAMPAIGN}.0"


async def test_typing_a_filter_narrows_the_page_at_once(opened):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter", "slash", *"local")
        assert first_column(pilot) == ["S1/pilot/4"]
        assert "/local" in shown(pilot)
        await press(pilot, "enter")
        assert pilot.app.focused is pilot.app.screen.query_one(KeyedTable)
        await press(pilot, "escape")
        assert len(first_column(pilot)) == 10
        assert isinstance(pilot.app.screen, RunsScreen)


async def test_letters_typed_into_the_filter_are_no_commands(opened):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter", "slash", *"qc1s")
        assert isinstance(pilot.app.screen, RunsScreen)
        assert "No row matches" in shown(pilot)


async def test_a_verdict_or_a_state_in_the_filter_is_one(opened):
    seen = []
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter")
        for word in ("fail", "error", "lost", "inconclusive", "running", "queued", "pass"):
            await press(pilot, "slash", *word, "enter")
            seen.append(len(first_column(pilot)))
            assert f"/{word}" in shown(pilot)
            await press(pilot, "escape")
    assert seen == [2, 0, 1, 1, 1, 1, 4]


async def test_the_table_has_the_keys_again_after_an_empty_page(opened):
    async with opened(120, 30) as pilot:
        await settle(pilot)
        await press(pilot, "enter", "slash", *"fail pilot/4", "enter")
        assert "No row matches" in shown(pilot)
        await press(pilot, "escape", "enter")
        assert isinstance(pilot.app.screen, RunScreen)


async def test_columns_are_sorted_by_and_inverted(opened):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter", ">", ">")
        assert "by margin ▲" in shown(pilot)
        assert first_column(pilot)[0] == "S2/pilot/1"
        await press(pilot, "i")
        assert "by margin ▼" in shown(pilot)
        for _ in list(RunsScreen.SORTS)[2:]:
            await press(pilot, ">")
        assert "▲run" in shown(pilot)
        await press(pilot, "<")
        assert "by scenario ▲" in shown(pilot)


async def test_only_a_page_is_asked_for_and_pages_are_turned(opened, fake):
    fake.rows = tuple(make_row(i, repeat=i) for i in range(250))
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter")
        assert len(first_column(pilot)) == 100
        assert "1-100 of 250" in shown(pilot)
        await press(pilot, "G")
        assert "201-250 of 250" in shown(pilot)
        assert first_column(pilot)[0] == "S2/pilot/200"
    assert {call[8] for call in fake.calls if call[0] == "runs" and not call[-1]} == {100}


async def test_a_run_shows_verdicts_margins_evidence_and_its_trace(opened):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter", *["down"] * 5, "enter")
        text = shown(pilot)
        await press(pilot, "shift+tab")
        text += shown(pilot)
    for words in ("✗ fail", "no-contact  −0.0312 m", "   ▐│      at 512.2 s, door-1",
                  "−0.0312 m, limit 0 m, front left corner", "    │███   at 312.5 s",
                  "✓ pass  reached  +888 s", "· measure  travelled",
                  "seed 2024", "S1.pilot.5.mcap"):  # fmt: skip
        assert words in text


async def test_a_running_run_shows_the_robot_from_above(opened, fake):
    fake.live = tuple(make_live(7, float(t)) for t in range(0, 61, 2))
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter")
        assert "1/3 wp  60 s" in shown(pilot)
        await press(pilot, *["down"] * 7, "enter")
        before = shown(pilot)
        assert "▶ running  1/3 wp  60 s of 1200 s" in before
        assert "→" in before
        assert "◇" in before
        assert before.count("◆") == 3  # two ahead, one in the legend
        fake.live = (make_live(7, 120.0),)
        await settle(pilot)
        assert shown(pilot) != before
        await press(pilot, "z")
        assert "→" in shown(pilot)
        await press(pilot, "z", "z")
        await press(pilot, "V", "V")
        assert "will be judged by" in shown(pilot)
        assert "→" not in shown(pilot)


async def test_the_map_is_drawn_only_where_it_changed(opened, fake, monkeypatch):
    fake.live = (make_live(7, 60.0),)
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter", *["down"] * 7, "enter")
        rows = []
        view = pilot.app.screen.query_one(TopView)
        monkeypatch.setattr(view, "refresh", lambda *regions, **_: rows.append(len(regions)))
        fake.live = (make_live(7, 62.0),)
        await settle(pilot)
    assert rows
    assert all(0 < count <= 4 for count in rows)


async def test_wide_terminals_show_the_run_beside_the_table(opened):
    async with opened(120, 40) as pilot:
        await settle(pilot)
        await press(pilot, "enter", *["down"] * 5)
        text = shown(pilot)
        assert isinstance(pilot.app.screen, RunsScreen)
        assert "S2/pilot/0  ✗ fail" in text
        assert "at 512.2 s, door-1" in text
        await pilot.resize_terminal(80, 24)
        await settle(pilot)
        assert "at 512.2 s, door-1" not in shown(pilot)


async def test_no_line_of_any_screen_is_wider_than_the_terminal(opened):
    async with opened() as pilot:
        await settle(pilot)
        for keys in ((), ("enter",), ("enter",), ("v",), ("2",), ("3",)):
            await press(pilot, *keys)
            widget = pilot.app.screen.query(KeyedTable)
            assert all(table.max_scroll_x == 0 for table in widget)


async def test_c_cancels_after_a_question(opened, fake):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "c")
        assert isinstance(pilot.app.screen, Question)
        assert f"scenario cancel {CAMPAIGN}" in shown(pilot)
        await press(pilot, "n")
        assert ("cancel", CAMPAIGN) not in fake.calls
        await press(pilot, "c", "y")
        assert ("cancel", CAMPAIGN) in fake.calls
        assert "cancelled 2 runs" in notices(pilot)


async def test_d_deletes_a_finished_campaign_after_a_question(opened, fake):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "down", "D")
        assert f"scenario delete {OLD}" in shown(pilot)
        assert ("delete", (OLD,), False) not in fake.calls
        await press(pilot, "y")
        assert ("delete", (OLD,), False) in fake.calls
        assert f"deleted {OLD}: 4 runs, 3 traces, 3.0 MiB" in notices(pilot)


async def test_r_retries_what_was_lost_from_a_menu(opened, fake):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter", "r")
        assert isinstance(pilot.app.screen, Menu)
        await press(pilot, "l")
        assert ("retry", CAMPAIGN, ("lost", "cancelled")) in fake.calls
        assert "queued 1 run" in notices(pilot)


async def test_help_lists_the_keys_the_user_has_and_the_signs(fake):
    config = Config(keys={"view": "f6", "retry": "ctrl+t"})
    async with make_dashboard(fake, config=config).run_test(size=(100, 100)) as pilot:
        await settle(pilot)
        await press(pilot, "enter", "question_mark")
        assert isinstance(pilot.app.screen, Help)
        text = shown(pilot)
        for line in ("in the list", "here", "everywhere", "Filter: Only rows that mention a text",
                     "^t  Retry: Queue lost, failed or all runs again", "esc  Back:", "? f1  Help:",
                     "✗  fail", "a  known failure", "◆  waypoint"):  # fmt: skip
            assert line in text, line
        await press(pilot, "escape", "enter", "question_mark")
        assert "f6  View:" in shown(pilot)


async def test_help_leaves_out_what_cannot_be_done_here(opened):
    async with opened() as pilot:
        await settle(pilot)
        for keys, present, absent in (
            ((), {"Cancel", "Pause", "Retry"}, {"Delete", "Resume", "Back"}),
            (("down",), {"Delete", "Retry"}, {"Cancel", "Pause", "Priority"}),
            (("3",), {"Back", "Quit"}, {"Retry", "Matrix"}),
        ):
            await press(pilot, *keys)
            names = {one.binding.description for one in our_bindings(pilot.app.screen)}
            assert present <= names
            assert not absent & names


async def test_copying_gives_the_command_for_what_the_cursor_is_on(opened):
    copied = []
    async with opened() as pilot:
        await settle(pilot)
        for keys in (["y"], ["enter", "down", "y"], ["enter", "y"], ["escape", "m", "y"],
                     ["3", "y"]):  # fmt: skip
            await press(pilot, *keys)
            copied.append(pilot.app.clipboard)
    assert copied == [
        f"scenario results {CAMPAIGN}",
        f"scenario show {CAMPAIGN}.1",
        f"scenario replay {CAMPAIGN}.1 --frame no-contact",
        f"scenario results {CAMPAIGN} --filter S1/pilot/",
        "scenario status",
    ]


async def test_runs_of_all_campaigns_name_theirs_the_newest_first(opened):
    async with opened(120, 30) as pilot:
        await settle(pilot)
        await press(pilot, "2")
        row = pilot.app.screen.query_one(KeyedTable).get_row_at(0)
        assert [str(cell) for cell in row[:2]] == ["S2/pilot/4", CAMPAIGN]
        assert "all runs  1-10 of 10\n" in shown(pilot)
        assert "▼run" in shown(pilot)


@pytest.mark.parametrize("width", [80, 92, 108, 120])
async def test_repeats_are_told_apart_however_long_names_are(opened, fake, width):
    fake.rows = tuple(
        make_row(i, scenario="busy-house-with-many-doors", sut="pilot-b", repeat=i)
        for i in range(4)
    )
    async with opened(width, 24) as pilot:
        await settle(pilot)
        await press(pilot, "2")
        for line, row in zip(screen_text(pilot)[3:7], reversed(fake.rows), strict=True):
            run, *rest = line.split()
            assert run.endswith(f"t-b/{row.repeat}"), line
            assert rest[0] == CAMPAIGN
            assert rest[1:3] == ["✓", "pass"]


async def test_filter_and_order_are_still_there_when_one_comes_back(opened):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "2", "slash", *"fail", "enter", ">", ">", "i", "down")
        before = shown(pilot)
        table = pilot.app.screen.query_one(KeyedTable)
        key = table.key
        assert key != f"{CAMPAIGN}.0"
        assert "by margin ▼  /fail" in before
        await press(pilot, "1", "2")
        assert shown(pilot) == before
        assert pilot.app.screen.query_one(KeyedTable).key == key
        await press(pilot, "slash", *"S2/", "enter", "1", "2")
        assert "/S2/" in shown(pilot)
        assert pilot.app.focused is pilot.app.screen.query_one(KeyedTable)
        # Other runs are looked at in their own way.
        await press(pilot, "1", "enter")
        assert "▲run" in shown(pilot)


async def test_the_colon_opens_a_list_of_places(opened):
    async with opened() as pilot:
        await settle(pilot)
        await choose_from_palette(pilot, "workers", "Workers")
        assert isinstance(pilot.app.screen, WorkersScreen)


async def test_workers_are_shown_slot_by_slot_and_enter_opens_the_run_in_one(opened, fake):
    fake.away = True
    fake.live = (make_live(7, 300.0),)
    async with opened(120, 30) as pilot:
        await settle(pilot)
        await press(pilot, "3")
        assert "workers (1, 1 away)  1 of 2 slots busy" in shown(pilot)
        rows = [line.split() for line in shown(pilot).splitlines() if "bench-1" in line]
        assert rows[0][:6] == ["bench-1", "S2/pilot/2", "━━────", "1/3", "wp", "300"]
        assert rows[0][7:13] == ["██··", "45%", "1.3", "of", "16", "GB"]
        assert rows[1] == ["bench-1", "1", "idle"]
        (away,) = (line.split() for line in shown(pilot).splitlines() if "shed-1" in line)
        assert away[:7] == ["shed-1", "4", "idle", "away", "1", "s", "ago"]
        await press(pilot, "enter")
        assert isinstance(pilot.app.screen, RunScreen)


async def test_workers_are_sorted_and_filtered(opened):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "3", "i")
        assert first_column(pilot)[0] == "shed-1"
        await press(pilot, "slash", *"pilot")
        assert first_column(pilot) == ["bench-1"]


async def test_quitting_says_that_work_goes_on(opened):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "q")
        assert not pilot.app.is_running or pilot.app._exit
        assert "the daemon goes on with 2 unfinished runs" in pilot.app.farewell()


async def test_without_a_daemon_the_screen_says_what_to_type(opened, fake):
    fake.reachable = False
    async with opened() as pilot:
        await settle(pilot)
        assert "no daemon answers, reconnecting" in shown(pilot)
        assert "scenario daemon" in shown(pilot)
        fake.reachable = True
        await settle(pilot)
        assert CAMPAIGN in shown(pilot)
        assert pilot.app.focused is pilot.app.screen.query_one(KeyedTable)


async def test_old_data_stays_with_its_age_until_the_daemon_is_back(opened, fake):
    async with opened() as pilot:
        await settle(pilot)
        fake.reachable = False
        fake.now = NOW + 12.0
        await settle(pilot)
        assert "no daemon answers, data is 12 s old, reconnecting" in shown(pilot)
        assert CAMPAIGN in shown(pilot)
        assert pilot.app.screen.has_class("-stale")
        fake.reachable = True
        await settle(pilot)
        assert "✗ first: 2 unexpected" in shown(pilot)
        assert not pilot.app.screen.has_class("-stale")


async def test_empty_screens_say_what_to_type(opened, fake):
    fake.empty = True
    fake.rows = ()
    async with opened() as pilot:
        await settle(pilot)
        assert "scenario submit my-tests/campaign.yaml" in shown(pilot)
        await press(pilot, "2")
        assert "No runs yet" in shown(pilot)


async def test_the_cursor_stays_on_its_run_when_rows_come_before_it(opened, fake):
    async with opened() as pilot:
        await settle(pilot)
        await press(pilot, "enter", ">", ">", "down")
        table = pilot.app.screen.query_one(KeyedTable)
        assert table.key == f"{CAMPAIGN}.5"
        rows = list(fake.rows)
        rows[7] = replace(rows[7], state=RunState.DONE, outcome=Outcome.FAIL, margin=-9.0,
                          oracle="no-contact", unit="m")  # fmt: skip
        fake.rows = tuple(rows)
        await settle(pilot)
        assert first_column(pilot)[0] == "S2/pilot/2"
        assert table.key == f"{CAMPAIGN}.5"


@pytest.mark.parametrize("width", [80, 120])
async def test_every_screen_is_legible_without_colour(opened, fake, monkeypatch, width):
    monkeypatch.setenv("NO_COLOR", "1")
    fake.live = (make_live(7, 60.0),)
    async with opened(width, 30) as pilot:
        assert pilot.app.no_color
        await settle(pilot)
        await press(pilot, "enter")
        assert "✗ fail" in shown(pilot)
        assert "? inconclusive" in shown(pilot)
        await press(pilot, "G", "enter", "v", "escape", "k", "k", "enter", "z", "v", "3")
        assert "bench-1" in shown(pilot)
