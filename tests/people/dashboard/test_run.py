"""The screen of one run: its parts, one moment for all, and what is said without a trace."""

from dataclasses import replace

import pytest
from textual.widgets import Static

from daemon.model.run_state import RunState
from scenario_tui.dashboard.screens.compare import CompareScreen
from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.run import RunScreen
from scenario_tui.dashboard.widgets.tables import VerdictList
from tests.people.dashboard.daemons import RecordedDaemon, RepeatingDaemon
from tests.people.dashboard.dash import InlineChildren
from tests.people.fake import CAMPAIGN, make_live
from tests.people.recorded import HIT, TURNED, record_run

RUN, RUNNING = f"{CAMPAIGN}.5", f"{CAMPAIGN}.7"


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    return record_run(tmp_path_factory.mktemp("traces") / "run.mcap")


def now(dash):
    return float(dash.screen.transport.time)


async def test_a_verdict_chosen_puts_everything_at_its_moment(dashboard, trace):
    dash = await dashboard(RecordedDaemon(trace), run=RUN)
    assert f"✗ fail !  ‖ 1x  {HIT} s of 10.0 s  1/3 wp" in dash.text
    assert now(dash) == HIT  # of the failure that is news
    await dash.press("down")
    assert now(dash) == pytest.approx(TURNED)
    await dash.press("left", "enter")
    assert now(dash) == pytest.approx(TURNED)
    await dash.press("tab")
    assert dash.lines[3].split()[0] == "speed.angular"  # what the oracle reads leads
    assert "0.9 rad/s" in dash.text
    await dash.press("N", "tab")
    assert now(dash) == HIT
    assert dash.one(VerdictList).chosen().oracle == "no-contact"
    assert "✱" in dash.text


def robot_x(dash):
    """Where the map shows the robot [m], ``None`` where it will start."""
    pose = dash.map.robot_pose
    return None if pose is None else pose.x


async def test_a_run_that_was_judged_again_shows_the_moments_of_its_new_verdicts(
    dashboard, tmp_path
):
    fake = RepeatingDaemon(tmp_path / "run.mcap")
    dash = await dashboard(fake, run=RUN)
    moments = [moment.oracle for moment in dash.screen.moments()]
    assert moments == ["no-contact", "calm"]
    await dash.press("home", "right")
    fake.judge_again()
    await dash.read()
    assert dash.screen.moments() == ()
    assert now(dash) == 1.0


@pytest.mark.parametrize("state", [RunState.QUEUED, RunState.RUNNING])
async def test_an_old_recording_leaves_the_screen_while_the_run_is_executed_again(
    dashboard, tmp_path, state
):
    fake = RepeatingDaemon(tmp_path / "run.mcap")
    dash = await dashboard(fake, (200, 50), run=RUN)
    fake.become(state)
    await dash.settle()
    assert "wp" not in dash.text.partition("\n")[0]
    assert dash.screen.transport is None
    assert "speed.angular" not in dash.text
    assert robot_x(dash) is None
    fake.execute(speed=0.1)
    await dash.read()
    await dash.press("end")
    assert robot_x(dash) == pytest.approx(2.0)


async def test_another_attempt_is_not_shown_where_the_last_one_was_heard(dashboard, fake):
    dash = await dashboard(fake, (200, 50), run=RUNNING)
    fake.live = (make_live(7, 20.0), make_live(7, 60.0))
    await dash.settle()
    assert robot_x(dash) == pytest.approx(4.0)
    running = fake.rows
    fake.rows = tuple(
        replace(row, state=RunState.QUEUED) if row.id == RUNNING else row for row in running
    )
    await dash.settle()
    fake.rows = running
    await dash.settle()
    assert robot_x(dash) is None


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


async def test_time_passes_while_it_plays_and_follows_zoom_and_pan(dashboard, trace):
    dash = await dashboard(RecordedDaemon(trace), run=RUN)
    screen = dash.screen
    clock = [0.0]
    screen.clock = lambda: clock[0]
    screen.tick()
    await dash.press("home", "plus", "space", "tab", "tab")
    clock[0] += 1.0
    screen.tick()
    await dash.settle()
    assert now(dash) == pytest.approx(2.0)
    assert "▶ 2x" in dash.text
    await dash.press("H")
    assert "z comes nearer" in dash.notices
    await dash.press("z", "z")
    followed = dash.lines[4:-1]
    await dash.press("L", "K")
    assert dash.lines[4:-1] != followed
    await dash.press("F")
    assert dash.lines[4:-1] == followed


async def test_what_cannot_be_shown_is_said(dashboard):
    dash = await dashboard()
    for index, words, why, size in (
        (0, "not on this machine", "not on this machine", (80, 24)),
        (7, "", "when it is over", (80, 24)),
        (8, "Its signals are drawn while it runs", "", (40, 10)),
        (9, "r queues it again", "", (120, 40)),
    ):
        await dash.resize(*size)
        await dash.open("run", f"{CAMPAIGN}.{index}")
        await dash.press("tab", "space", "n", "right", "z", "p")
        assert words in dash.words
        assert why in dash.notices
        assert isinstance(dash.screen, RunScreen)


async def test_two_runs_marked_are_compared(dashboard, trace):
    dash = await dashboard(RecordedDaemon(trace), (100, 24))
    await dash.open("runs", CAMPAIGN)
    await dash.press(*["j"] * 5, "C")
    assert dash.app.marked_run == RUN
    assert f"{RUN} marked" in dash.text
    await dash.press("j", "C")
    await dash.read()
    assert isinstance(dash.screen, CompareScreen)
    assert dash.app.marked_run == ""
    await dash.press("escape")
    await dash.open("run", RUN)
    await dash.press("C")
    assert dash.app.marked_run == RUN
    await dash.press("C")
    assert dash.app.marked_run == ""


async def test_a_run_without_a_trace_is_not_compared(dashboard, fake):
    dash = await dashboard(fake, run=f"{CAMPAIGN}.0")
    dash.app.marked_run = f"{CAMPAIGN}.1"
    await dash.press("C")
    await dash.read()
    assert "trace" in dash.notices
    assert isinstance(dash.screen, RunScreen)


async def test_a_run_is_watched_while_it_is_shown_and_runs(dashboard, fake):
    dash = await dashboard(fake, run=RUNNING)
    assert list(fake.watchers) == [RUNNING]
    fake.live = (make_live(7, 20.0),)
    await dash.settle()
    before = dash.text
    live = make_live(7, 20.0)
    details = {
        "spread": (0.04, 0.0, 0.04),
        "returns": (300, 100, 310, 110),
        "plan": (400, 200, 800, 100),
        "contacts": (600, 300),
    }
    fake.watchers[RUNNING](replace(live, snapshot=replace(live.snapshot, **details)))
    await dash.settle()
    assert dash.text != before
    assert "✱" in dash.text
    assert dash.map.returns == ((3.0, 1.0), (3.1, 1.1))
    assert dash.map.plan[-1] == (8.0, 1.0)
    await dash.press("escape")
    assert fake.watchers == {}


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


async def test_p_plays_a_finished_run_and_q_comes_back(dashboard, fake, trace):
    fake.rows = (replace(fake.rows[0], trace=str(trace)), *fake.rows[1:])
    dash = await dashboard(fake, run=f"{CAMPAIGN}.0")
    await dash.press("p")
    assert isinstance(dash.screen, ReplayScreen)
    assert dash.screen.transport.time < dash.screen.transport.end  # something is left to play
    # Shown are the verdicts the run got, not new ones.
    assert dash.screen.playback.verdicts == fake.run(f"{CAMPAIGN}.0").row.result.verdicts
    await dash.press("escape")
    assert isinstance(dash.screen, RunScreen)


async def test_what_reads_traces_is_loaded_when_runs_are_shown_and_not_before(
    dashboard, monkeypatch
):
    calls = []
    monkeypatch.setattr(InlineChildren, "run", lambda _, *call: calls.append(call))
    dash = await dashboard()
    assert not calls
    await dash.press("enter")
    assert len(calls) == 1
