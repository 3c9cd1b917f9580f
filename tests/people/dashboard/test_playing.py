"""From a run of the dashboard to its replay, and what is said where there is none."""

from dataclasses import replace

from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.run import RunScreen
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.fake import CAMPAIGN
from tests.people.recorded import record_run


def opened(fake):
    return make_dashboard(fake).run_test(size=(80, 24))


def shown(pilot):
    return "\n".join(screen_text(pilot))


def notices(pilot):
    return " ".join(notice.message for notice in pilot.app._notifications)


async def look_at(pilot, index):
    await pilot.pause(0)
    pilot.app.open("run", f"{CAMPAIGN}.{index}")
    await settle(pilot)
    await pilot.app.workers.wait_for_complete()  # its trace is read
    await settle(pilot)


async def test_p_plays_a_finished_run_and_q_comes_back(fake, tmp_path):
    trace = record_run(tmp_path / "run.mcap")
    fake.rows = (replace(fake.rows[0], trace=str(trace)), *fake.rows[1:])
    async with opened(fake) as pilot:
        await look_at(pilot, 0)
        await press(pilot, "p")
        screen = pilot.app.screen
        assert isinstance(screen, ReplayScreen)
        assert screen.transport is not None
        assert screen.transport.time < screen.transport.end  # there is something left to play
        # Shown are the verdicts the run got, not new ones.
        result = fake.run(f"{CAMPAIGN}.0").row.result
        assert result is not None
        assert pilot.app.screen.playback.verdicts == result.verdicts
        await press(pilot, "escape")
        assert isinstance(pilot.app.screen, RunScreen)


async def test_where_there_is_nothing_to_play_the_screen_says_why(fake):
    async with opened(fake) as pilot:
        await look_at(pilot, 0)
        await press(pilot, "v", "p")
        assert "Its trace is not on this machine" in shown(pilot)
        assert "↑ robot" not in shown(pilot)
        assert "not on this machine" in notices(pilot)
        assert isinstance(pilot.app.screen, RunScreen)
        await look_at(pilot, 7)  # still running
        await press(pilot, "p")
        assert "when it is over" in notices(pilot)
