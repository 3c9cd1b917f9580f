"""The line of keys is made anew when it says something else, and only then."""

from __future__ import annotations

import pytest

from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from tests.scenario_tui.dashboard.driven import SteeredDaemon, until
from tests.scenario_tui.dashboard.inline import make_dashboard, press, screen_text, settle


async def test_the_line_of_keys_is_made_when_it_says_something_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made: list[str] = []
    usual = KeyFooter.recompose

    async def recompose(self: KeyFooter) -> None:
        made.append(type(self.screen).__name__)
        await usual(self)

    monkeypatch.setattr(KeyFooter, "recompose", recompose)
    async with make_dashboard(SteeredDaemon()).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await until(pilot, lambda: "Quit" in screen_text(pilot)[-1])
        assert made == ["CampaignsScreen"]
        # The key that pauses resumes then: another name, and so another line.
        await press(pilot, "P")
        await until(pilot, lambda: len(made) > 1)
