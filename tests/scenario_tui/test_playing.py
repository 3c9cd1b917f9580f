"""From a run of the dashboard to its replay, and what is said where there is none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from scenario_tui.screens.replay import ReplayScreen
from scenario_tui.screens.run import RunScreen
from tests.scenario_tui.fake import CAMPAIGN, FakeDaemon
from tests.scenario_tui.inline import make_dashboard, press, screen_text, settle
from tests.scenario_tui.recorded import record_run


def opened(fake: FakeDaemon) -> Any:
    return make_dashboard(fake).run_test(size=(80, 24))


def shown(pilot: Any) -> str:
    return "\n".join(screen_text(pilot))


def notices(pilot: Any) -> str:
    return " ".join(notice.message for notice in pilot.app._notifications)


async def test_p_plays_a_finished_run_and_q_comes_back(fake: FakeDaemon, tmp_path: Path) -> None:
    trace = record_run(tmp_path / "run.mcap")
    rows = list(fake.rows)
    rows[0] = replace(rows[0], trace=str(trace))
    fake.rows = tuple(rows)
    async with opened(fake) as pilot:
        await settle(pilot)
        await press(pilot, "enter", "enter", "p")
        await pilot.app.workers.wait_for_complete()
        await pilot.pause(0)
        assert isinstance(pilot.app.screen, ReplayScreen)
        # Shown are the verdicts the run got, not new ones.
        result = fake.run(f"{CAMPAIGN}.0").result
        assert result is not None
        assert pilot.app.screen.playback.verdicts == result.verdicts
        await pilot.press("q")
        await pilot.pause(0)
        assert isinstance(pilot.app.screen, RunScreen)


async def test_a_finished_run_without_its_trace_says_so_instead_of_a_map(fake: FakeDaemon) -> None:
    async with opened(fake) as pilot:
        await settle(pilot)
        await press(pilot, "enter", "enter", "v")
        assert "Its trace is not on this machine" in shown(pilot)
        assert "↑ robot" not in shown(pilot)
        await press(pilot, "p")
        assert "not on this machine" in notices(pilot)
        assert isinstance(pilot.app.screen, RunScreen)


async def test_p_waits_until_a_run_is_over(fake: FakeDaemon) -> None:
    async with opened(fake) as pilot:
        await settle(pilot)
        await press(pilot, "enter", *"jjjjjjj", "enter", "p")
        assert "when it is over" in notices(pilot)
