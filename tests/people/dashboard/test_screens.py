"""What screens do that no way through them tells: pages, logs, memory, the grid."""

from dataclasses import replace

import pytest
from textual.widgets import Static

from scenario_tui.dashboard.screens import runs
from scenario_tui.dashboard.widgets.running_grid import RunningGrid, RunningRun, run_line
from scenario_tui.dashboard.widgets.tables import KeyedTable
from tests.people.dashboard.daemons import RecordedDaemon
from tests.people.dashboard.dash import InlineChildren
from tests.people.fake import CAMPAIGN, WAITING, FakeDaemon, make_live, make_row
from tests.people.recorded import record_run

RUN = f"{CAMPAIGN}.5"
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


async def test_quitting_says_that_work_goes_on(dashboard):
    dash = await dashboard()
    await dash.press("q")
    assert not dash.app.is_running or dash.app._exit
    assert "the daemon continues with 2 unfinished runs" in dash.app.farewell()


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    return record_run(tmp_path_factory.mktemp("traces") / "run.mcap")


async def test_the_log_ends_with_what_an_external_system_printed(dashboard, tmp_path):
    printed = b"".join(b"line %d\n" % i for i in range(60))
    found = record_run(tmp_path / "run.mcap", outputs={"stack.txt": printed, "relay.txt": b""})
    dash = await dashboard(RecordedDaemon(found), (200, 80), run=RUN)
    told = str(dash.one("#log-text", Static).content)
    assert "planner_server no path yet" in told
    assert "mission    w1 reached, 1 of 3" in told
    assert told.endswith(
        "\nstack.txt\n20 lines before these: scenario show --log --all prints all\n"
        + "".join(f"line {i}\n" for i in range(20, 60))
        + "\nrelay.txt\n(nothing)\n"
    )


async def test_the_words_of_a_run_grow_with_vast_terminals(dashboard, trace):
    dash = await dashboard(RecordedDaemon(trace), run=RUN)
    for width, words in ((120, 46), (169, 46), (200, 60), (240, 72)):
        await dash.resize(width, 40)
        assert dash.one("#left").outer_size.width == words


async def test_a_screen_that_is_covered_lets_go_of_what_it_drew(dashboard, trace):
    """Textual keeps every cut of each line: going through runs would take 5 MB each."""

    def lines(screen):
        return sum(len(each._styles_cache._cache) for each in screen.walk_children(with_self=True))

    dash = await dashboard(RecordedDaemon(trace), (200, 50))
    await dash.press("enter")
    covered, before = dash.screen, dash.lines
    assert lines(covered) > 0
    await dash.open("run", RUN)
    assert lines(covered) == 0
    await dash.press("escape")
    assert dash.screen is covered
    assert dash.lines == before


async def test_what_reads_traces_is_loaded_when_runs_are_shown_and_not_before(
    dashboard, monkeypatch
):
    calls = []
    monkeypatch.setattr(InlineChildren, "run", lambda _, *call: calls.append(call))
    dash = await dashboard()
    assert not calls
    await dash.press("enter")
    assert len(calls) == 1


def live(index, time=300.0, margin=0.11):
    found = make_live(index, time)
    oracle = "" if margin is None else "clear"
    changed = replace(found.snapshot, margin=margin, unit="m", oracle=oracle)
    return replace(found, snapshot=changed)


async def test_the_place_of_a_run_that_ended_is_kept_while_more_are_to_come(dashboard):
    grid = RunningGrid()
    dash = await dashboard(FakeDaemon())
    await dash.screen.mount(grid)
    two = [RunningRun("c.1", "S1/pilot/1"), RunningRun("c.2", "S1/pilot/2")]
    heights = []
    for found, more in ((two, True), (two[:1], True), ([], True), ([], False)):
        grid.show(found, more=more)
        heights.append(grid.styles.height.value if grid.display else 0)
    assert heights == [3, 3, 3, 0]


def test_the_bar_of_a_run_does_not_move_what_follows_while_its_time_grows():
    runs = [RunningRun("c.1", "S1/pilot/1", live(7, time).snapshot) for time in (9.0, 99.0, 300.0)]
    assert len({run_line(one).plain.index(" clear") for one in runs}) == 1


def test_a_long_name_keeps_its_end():
    line = run_line(RunningRun("c.1", "frontiers-2024 S3.6/fro-omni/4"), 20).plain
    assert line.startswith("…024 S3.6/fro-omni/4 ")


def test_a_line_says_what_is_waited_for_and_what_is_not_heard_of():
    def words(one):
        return run_line(one).plain.split(maxsplit=1)[1]

    assert words(RunningRun("a.1", "S1/nav2/0")) == "starting"
    starting = make_live(7, waiting=WAITING).snapshot
    assert words(RunningRun("a.1", "S1/nav2/0", starting)) == WAITING
    silent = run_line(RunningRun("a.1", "S1/nav2/0", live(7).snapshot, silence=65.0)).plain
    assert "last report 1 min 05 s ago" in silent
    assert "wp  " in run_line(RunningRun("a.1", "S1/nav2/0", live(7, margin=None).snapshot)).plain
