"""The runs under way of all campaigns: how far, how near to failing, and the way to each."""

from dataclasses import replace

from textual.events import Key

from scenario_tui.dashboard.screens.run import RunScreen
from scenario_tui.dashboard.widgets.running_grid import RunningGrid, RunningRun, run_line
from scenario_tui.dashboard.widgets.tables import KeyedTable
from tests.people.fake import CAMPAIGN, WAITING, FakeDaemon, make_live, make_row, make_rows


def live(index, time=300.0, margin=0.11):
    found = make_live(index, time)
    oracle = "" if margin is None else "clear"
    changed = replace(found.snapshot, margin=margin, unit="m", oracle=oracle)
    return replace(found, snapshot=changed)


def busy(count):
    rows = make_rows()
    running = [replace(rows[7], id=f"{CAMPAIGN}.{7 + i}", index=7 + i, repeat=i) for i in
               range(count)]  # fmt: skip
    return FakeDaemon(
        (*rows[:5], *running),
        live=tuple(live(row.index, margin=0.5 - row.index / 20) for row in running),
    )


def grid_lines(dash):
    """Return the lines of the screen from the title of the grid on."""
    lines = dash.lines
    return lines[next(i for i, line in enumerate(lines) if "worst margin so far" in line) :]


async def test_of_more_than_fit_those_in_trouble_are_shown_in_their_order(dashboard):
    lines = grid_lines(await dashboard(busy(20)))
    assert "20 runs" in lines[0]
    assert "14 more" in lines[0]
    # The margin goes down with the number of the run.
    assert [line.split()[1] for line in lines[1:7]] == [f"S2/pilot/{i}" for i in range(14, 20)]
    assert "✗ −0.8 m clear" in lines[6]


async def test_below_the_campaigns_stands_what_is_under_way_of_all(dashboard):
    dash = await dashboard(busy(3))
    lines = grid_lines(dash)
    assert "▶ running  3 runs, worst margin so far" in lines[0]
    assert "S2/pilot/0" in lines[1]
    assert "+0.15 m clear" in lines[1]
    # Keys typed without a pause go there too.
    for key in ("tab", "j", "enter"):
        dash.app.post_message(Key(key, None))
    await dash.settle()
    assert isinstance(dash.screen, RunScreen)
    assert f"{CAMPAIGN} › S2/pilot/1" in dash.text
    await dash.press("escape")
    assert dash.one(RunningGrid).has_focus


async def test_the_table_has_the_keys_again_when_nothing_runs_any_more(dashboard):
    fake = busy(1)
    dash = await dashboard(fake)
    await dash.press("tab")
    fake.rows = tuple(make_row(i) for i in range(8))
    fake.calls.clear()
    await dash.settle()
    assert not dash.one(RunningGrid).display
    assert dash.one(KeyedTable).has_focus
    assert not [call for call in fake.calls if call[0] == "runs" and "running" in call]


async def test_the_table_tells_the_least_margin_so_far_of_a_run_that_goes_on(dashboard):
    dash = await dashboard(busy(1))
    await dash.press("enter")
    row = next(line for line in dash.lines if "running" in line and "S2/pilot/0" in line)
    assert "clear" in row
    assert "+0.15 m" in row


async def test_the_place_of_a_run_that_ended_is_kept_while_more_are_to_come(dashboard):
    grid = RunningGrid()
    dash = await dashboard(FakeDaemon())
    await dash.screen.mount(grid)
    two = [RunningRun("c.1", "S1/pilot/1"), RunningRun("c.2", "S1/pilot/2")]
    heights = []
    for runs, more in ((two, True), (two[:1], True), ([], True), ([], False)):
        grid.show(runs, more=more)
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
    assert "last heard 1 min 05 s ago" in silent
    assert "wp  " in run_line(RunningRun("a.1", "S1/nav2/0", live(7, margin=None).snapshot)).plain
