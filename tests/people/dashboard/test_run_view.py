"""The screen of one run: its parts, one moment for all, and what is said without a trace."""

from dataclasses import replace

import pytest
from textual.widgets import Static

from daemon.batch.stores import file_sha256
from daemon.judging.oracles import judge
from daemon.model.run_state import RunState
from daemon.model.spec import TraceInfo
from daemon.trace import read_trace
from scenario_tui.dashboard.live_tracks import Tracks
from scenario_tui.dashboard.screens.compare import CompareScreen
from scenario_tui.dashboard.screens.run import RunScreen
from scenario_tui.dashboard.widgets.tables import VerdictList
from scenario_tui.dashboard.widgets.top_view import TopView
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.fake import CAMPAIGN, WAITING, FakeDaemon, make_live, make_result
from tests.people.recorded import HIT, TURNED, record_run

RUN = f"{CAMPAIGN}.5"


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    return record_run(tmp_path_factory.mktemp("traces") / "run.mcap")


class Recorded(FakeDaemon):
    """Runs 5 and 6 are the recorded one, with the verdicts it deserves."""

    def __init__(self, trace):
        super().__init__()
        self.rows = tuple(
            replace(row, trace=str(trace)) if row.index in (5, 6) else row for row in self.rows
        )
        recorded = read_trace(trace)
        self._verdicts = judge(recorded, recorded.spec.oracles)

    def run(self, run):
        detail = super().run(run)
        if detail.row.index not in (5, 6) or detail.row.result is None:
            return detail
        note = "parameters without effect: a, b"
        result = replace(detail.row.result, verdicts=self._verdicts, note=note)
        return replace(detail, row=replace(detail.row, result=result))


class Repeated(FakeDaemon):
    """Run 5 is executed and judged again: other recordings at the same path."""

    def __init__(self, path):
        super().__init__()
        self._path = path
        self.rows = tuple(
            replace(row, trace=str(path)) if row.index == 5 else row for row in self.rows
        )
        self._first, self._result = self.rows, None

    def execute(self, **changes):
        record_run(self._path, **changes)
        recorded = read_trace(self._path)
        self._result = replace(
            make_result(self._first[5]),
            verdicts=judge(recorded, recorded.spec.oracles),
            trace=TraceInfo(file_sha256(self._path), self._path.stat().st_size, 1),
        )
        self.rows = self._first

    def judge_again(self):
        verdicts = tuple(v for v in self._result.verdicts if v.oracle == "slow")
        self._result = replace(self._result, verdicts=verdicts)

    def become(self, state):
        self.rows = tuple(
            replace(row, state=state, outcome=None, trace="", attempt=2) if row.index == 5 else row
            for row in self.rows
        )

    def run(self, run):
        detail = super().run(run)
        if detail.row.index != 5 or detail.row.result is None:
            return detail
        return replace(detail, row=replace(detail.row, result=self._result))


def shown(pilot):
    return "\n".join(screen_text(pilot))


def opened(fake, size=(80, 24)):
    return make_dashboard(fake).run_test(size=size)


async def look_at(pilot, run=RUN):
    await pilot.pause(0)
    pilot.app.open("run", run)
    await settle(pilot)
    await pilot.app.workers.wait_for_complete()
    await settle(pilot)


def now(pilot):
    return float(pilot.app.screen.transport.time)


async def test_a_verdict_chosen_puts_everything_at_its_moment(trace):
    async with opened(Recorded(trace)) as pilot:
        await look_at(pilot)
        assert f"✗ fail !  ‖ 1x  {HIT} s of 10.0 s  1/3 wp" in shown(pilot)
        assert now(pilot) == HIT  # of the failure that is news
        await press(pilot, "down")
        assert now(pilot) == pytest.approx(TURNED)
        await press(pilot, "left", "enter")
        assert now(pilot) == pytest.approx(TURNED)
        await press(pilot, "tab")
        assert screen_text(pilot)[3].split()[0] == "speed.angular"  # what the oracle reads leads
        assert "0.9 rad/s" in shown(pilot)
        await press(pilot, "N", "tab")
        assert now(pilot) == HIT
        assert pilot.app.screen.query_one(VerdictList).chosen().oracle == "no-contact"
        assert "✱" in shown(pilot)


async def test_parts_follow_each_other_where_there_is_room_for_one(trace):
    async with opened(Recorded(trace)) as pilot:
        await look_at(pilot)
        for name, words in (
            ("verdicts", "✓ pass  slow"), ("signals", "loc.error"), ("map", "◆ waypoint"),
            ("log", "parameters without effect: a, b"),
        ):  # fmt: skip
            assert f"[{name}]" in shown(pilot)
            assert words in shown(pilot)
            await press(pilot, "tab")
        await press(pilot, "shift+tab")
        for words in ("seed 2024", "contact", "robot touches door-1.leaf", "✗ no-contact decided",
                      "door-1.hinge opens"):  # fmt: skip
            assert words in shown(pilot)


def robot_x(pilot):
    """Where the map shows the robot [m], ``None`` where it will start."""
    pose = pilot.app.screen.query_one(TopView)._view.robot_pose
    return None if pose is None else pose.x


async def test_a_run_that_was_executed_again_shows_its_new_recording(tmp_path):
    fake = Repeated(tmp_path / "run.mcap")
    fake.execute()
    async with opened(fake, (200, 50)) as pilot:
        await look_at(pilot)
        await press(pilot, "end")
        assert robot_x(pilot) == pytest.approx(6.0)
        fake.execute(speed=0.1)
        await settle(pilot)
        await pilot.app.workers.wait_for_complete()
        await settle(pilot)
        await press(pilot, "end")
        assert robot_x(pilot) == pytest.approx(2.0)


async def test_the_panel_beside_the_runs_shows_the_new_recording(tmp_path):
    fake = Repeated(tmp_path / "run.mcap")
    fake.execute()
    async with opened(fake, (200, 50)) as pilot:
        await pilot.pause(0)
        pilot.app.open("runs", CAMPAIGN)
        await settle(pilot)
        await press(pilot, *["j"] * 5)
        assert robot_x(pilot) == pytest.approx(4.0)  # where it was decided
        fake.execute(speed=0.1)
        await settle(pilot)
        assert robot_x(pilot) == pytest.approx(1.6)


async def test_a_run_that_was_judged_again_shows_the_moments_of_its_new_verdicts(tmp_path):
    fake = Repeated(tmp_path / "run.mcap")
    fake.execute()
    async with opened(fake) as pilot:
        await look_at(pilot)
        moments = [moment.oracle for moment in pilot.app.screen.moments()]
        assert moments == ["no-contact", "calm"]
        await press(pilot, "home", "right")
        fake.judge_again()
        await settle(pilot)
        await pilot.app.workers.wait_for_complete()
        await settle(pilot)
        assert pilot.app.screen.moments() == ()
        assert now(pilot) == 1.0


@pytest.mark.parametrize("state", [RunState.QUEUED, RunState.RUNNING])
async def test_an_old_recording_leaves_the_screen_while_the_run_is_executed_again(tmp_path, state):
    fake = Repeated(tmp_path / "run.mcap")
    fake.execute()
    async with opened(fake, (200, 50)) as pilot:
        await look_at(pilot)
        fake.become(state)
        await settle(pilot)
        assert "wp" not in shown(pilot).partition("\n")[0]
        assert pilot.app.screen.transport is None
        assert "speed.angular" not in shown(pilot)
        assert robot_x(pilot) is None
        fake.execute(speed=0.1)
        await settle(pilot)
        await pilot.app.workers.wait_for_complete()
        await settle(pilot)
        await press(pilot, "end")
        assert robot_x(pilot) == pytest.approx(2.0)


async def test_another_attempt_is_not_shown_where_the_last_one_was_heard(fake):
    run = f"{CAMPAIGN}.7"
    async with opened(fake, (200, 50)) as pilot:
        await look_at(pilot, run)
        fake.live = (make_live(7, 20.0), make_live(7, 60.0))
        await settle(pilot)
        assert robot_x(pilot) == pytest.approx(4.0)
        running = fake.rows
        fake.rows = tuple(
            replace(row, state=RunState.QUEUED) if row.id == run else row for row in running
        )
        await settle(pilot)
        fake.rows = running
        await settle(pilot)
        assert robot_x(pilot) is None


async def test_the_log_ends_with_what_an_external_system_printed(tmp_path):
    printed = b"".join(b"line %d\n" % i for i in range(60))
    found = record_run(tmp_path / "run.mcap", outputs={"stack.txt": printed, "relay.txt": b""})
    async with opened(Recorded(found), (200, 80)) as pilot:
        await look_at(pilot)
        told = str(pilot.app.screen.query_one("#log-text", Static).content)
        assert "planner_server no path yet" in told
        assert "mission    w1 reached, 1 of 3" in told
        assert told.endswith(
            "\nstack.txt\n20 lines before these: scenario show --log --all prints all\n"
            + "".join(f"line {i}\n" for i in range(20, 60))
            + "\nrelay.txt\n(nothing)\n"
        )


async def test_wide_terminals_show_everything_at_once(trace):
    async with opened(Recorded(trace), (200, 50)) as pilot:
        await look_at(pilot)
        for words in ("✗ fail !  no-contact", "◆ waypoint", "speed.angular", "seed 2024"):
            assert words in shown(pilot)


@pytest.mark.parametrize(("width", "words"), [(120, 46), (169, 46), (200, 60), (240, 72)])
async def test_the_words_of_a_run_grow_with_vast_terminals(trace, width, words):
    async with opened(Recorded(trace), (width, 40)) as pilot:
        await look_at(pilot)
        assert pilot.app.screen.query_one("#left").outer_size.width == words


async def test_time_passes_while_it_plays_and_follows_zoom_and_pan(trace):
    async with opened(Recorded(trace)) as pilot:
        await look_at(pilot)
        screen = pilot.app.screen
        clock = [0.0]
        screen.clock = lambda: clock[0]
        screen.tick()
        await pilot.press("home", "plus", "space", "tab", "tab")
        await settle(pilot)
        clock[0] += 1.0
        screen.tick()
        await settle(pilot)
        assert now(pilot) == pytest.approx(2.0)
        assert "▶ 2x" in shown(pilot)
        before = shown(pilot)
        await press(pilot, "H")
        assert "z comes nearer" in " ".join(n.message for n in pilot.app._notifications)
        await pilot.press("z", "z", "L", "K")
        top = screen.query_one(TopView)
        assert not top._follows
        await press(pilot, "F")
        assert top._follows
        assert shown(pilot) != before


@pytest.mark.parametrize(
    ("index", "words", "size"),
    [
        (0, "not on this machine", (80, 24)),
        (8, "Its signals are drawn while it runs", (40, 10)),
        (9, "r queues it again", (120, 40)),
    ],
)
async def test_what_cannot_be_shown_is_said(fake, index, words, size):
    async with opened(fake, size) as pilot:
        await look_at(pilot, f"{CAMPAIGN}.{index}")
        await pilot.press("tab", "space", "n", "right", "z", "p")
        await settle(pilot)
        assert words in " ".join(shown(pilot).split())


async def test_a_damaged_trace_is_said_to_be_one(fake, trace, tmp_path):
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(trace.read_bytes()[:300])
    fake.rows = tuple(replace(row, trace=str(broken)) for row in fake.rows)
    async with opened(fake) as pilot:
        await look_at(pilot)
        await press(pilot, "tab")
        assert "Run it again" in shown(pilot)


async def test_a_trace_that_was_cut_is_shown_as_far_as_it_goes(fake, trace, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(trace.read_bytes()[:-2000])
    fake.rows = tuple(replace(row, trace=str(cut)) for row in fake.rows)
    async with opened(fake) as pilot:
        await look_at(pilot)
        await press(pilot, "tab")
        assert "loc.error" in shown(pilot)


async def test_two_runs_marked_are_compared(trace):
    async with opened(Recorded(trace), (100, 24)) as pilot:
        await pilot.pause(0)
        pilot.app.open("runs", CAMPAIGN)
        await settle(pilot)
        await press(pilot, *["j"] * 5, "C")
        assert pilot.app.marked_run == RUN
        assert f"{RUN} marked" in shown(pilot)
        await press(pilot, "j", "C")
        await pilot.app.workers.wait_for_complete()
        await settle(pilot)
        assert isinstance(pilot.app.screen, CompareScreen)
        assert pilot.app.marked_run == ""
        await press(pilot, "escape")
        await look_at(pilot)
        await press(pilot, "C")
        assert pilot.app.marked_run == RUN
        await press(pilot, "C")
        assert pilot.app.marked_run == ""


async def test_a_run_without_a_trace_is_not_compared(fake):
    async with opened(fake) as pilot:
        await look_at(pilot, f"{CAMPAIGN}.0")
        pilot.app.marked_run = f"{CAMPAIGN}.1"
        await press(pilot, "C")
        await pilot.app.workers.wait_for_complete()
        assert "trace" in " ".join(n.message for n in pilot.app._notifications)
        assert isinstance(pilot.app.screen, RunScreen)


def detailed(time, **changes):
    live = make_live(7, time)
    more = {
        "spread": (0.04, 0.0, 0.04),
        "returns": (300, 100, 310, 110),
        "plan": (400, 200, 800, 100),
    }
    return replace(live, snapshot=replace(live.snapshot, **(more | changes)))


async def test_a_run_is_watched_while_it_is_shown_and_runs(fake):
    async with opened(fake) as pilot:
        await look_at(pilot, f"{CAMPAIGN}.7")
        assert list(fake.watchers) == [f"{CAMPAIGN}.7"]
        fake.live = (make_live(7, 20.0),)
        await settle(pilot)
        before = shown(pilot)
        fake.watchers[f"{CAMPAIGN}.7"](detailed(20.0, contacts=(600, 300)))
        await settle(pilot)
        assert shown(pilot) != before
        assert "✱" in shown(pilot)
        view = pilot.app.screen.query_one(TopView)._view
        assert view is not None
        assert view.returns == ((3.0, 1.0), (3.1, 1.1))
        assert view.plan[-1] == (8.0, 1.0)
        await press(pilot, "escape")
        assert fake.watchers == {}


@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
async def test_a_run_whose_system_is_being_started_says_what_it_waits_for(fake, size):
    async with opened(fake, size) as pilot:
        await look_at(pilot, f"{CAMPAIGN}.7")
        fake.live = (make_live(7, waiting=WAITING), make_live(7, waiting=WAITING))
        await settle(pilot)
        told = " ".join(shown(pilot).split())
        assert "3 of 8 nodes active, waiting for planner_server" in told
        assert "0 s of 1200 s" not in shown(pilot)
        # Simulated time stands still until it is up; then the run goes on from where it stood.
        fake.live = (make_live(7, 0.0), make_live(7, 2.0))
        await settle(pilot)
        assert "my-nav2" not in shown(pilot)
        assert "1/3 wp  2 s of 1200 s" in shown(pilot)


async def test_the_table_of_runs_tells_a_start_from_a_run_that_drives(fake):
    async with opened(fake, (140, 30)) as pilot:
        await pilot.pause(0)
        pilot.app.open("runs", CAMPAIGN)
        fake.live = (make_live(7, waiting=WAITING),)
        await settle(pilot)
        await press(pilot, *["j"] * 7)
        rows = [line for line in screen_text(pilot) if line.startswith(" S2/pilot/2")]
        row = rows[-1]
        assert row.partition("│")[0].split()[-1] == "starting"
        told = " ".join(shown(pilot).split())
        assert "simulated time begins when it is up" in told
        fake.live = (make_live(7, 1.0),)
        await settle(pilot)
        assert "1/3 wp  1 s" in shown(pilot)


def test_contacts_flash_for_a_while():
    clock = [0.0]
    tracks = Tracks(clock=lambda: clock[0])
    tracks.add(detailed(1.0, contacts=(100, 200)))
    clock[0] = 0.4
    tracks.add(detailed(2.0))
    track = tracks.get(f"{CAMPAIGN}.7")
    assert track is not None
    assert list(track.flashes) == [(1.0, 2.0)]
    clock[0] = 0.6
    tracks.add(detailed(3.0))
    assert track.flashes == {}


def test_a_long_trail_becomes_coarser_and_never_long():
    tracks = Tracks()
    for step in range(20_000):
        tracks.add(make_live(7, step * 2.0))
    track = tracks.get(f"{CAMPAIGN}.7")
    assert track is not None
    assert 500 < len(track.trail) <= 2000
    assert track.trail[0] == (1.0, 2.0)
    assert track.trail[-1][0] == pytest.approx(2001.0, abs=2.0)


@pytest.mark.parametrize(
    ("size", "keys"),
    [((80, 24), ()), ((80, 24), ("tab",)), ((120, 40), ())],
    ids=["verdicts-80x24", "signals-80x24", "120x40"],
)
def test_what_a_failed_run_looks_like(snap_compare, trace, size, keys):
    async def before(pilot):
        await look_at(pilot)
        # Where the trace lies differs from test to test, and is wrapped in the log.
        pilot.app.screen.query_one("#log-text", Static).update("")
        await press(pilot, *keys)

    dashboard = make_dashboard(Recorded(trace))
    assert snap_compare(dashboard, terminal_size=size, run_before=before)


async def test_a_screen_that_is_covered_lets_go_of_what_it_drew(trace):
    """Textual keeps every cut of each line: going through runs would take 5 MB each."""

    def lines(screen):
        return sum(len(each._styles_cache._cache) for each in screen.walk_children(with_self=True))

    async with opened(Recorded(trace), (200, 50)) as pilot:
        await press(pilot, "enter")
        covered, before = pilot.app.screen, screen_text(pilot)
        assert lines(covered) > 0
        await look_at(pilot)
        assert lines(covered) == 0
        await press(pilot, "escape")
        assert pilot.app.screen is covered
        assert screen_text(pilot) == before
