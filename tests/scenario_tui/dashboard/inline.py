"""The dashboard without a thread: the feed asks the fake daemon whenever the screen looks."""

from __future__ import annotations

import asyncio
import itertools
from typing import Any, Final

from textual.pilot import Pilot
from textual.widget import Widget

from daemon.batch.errors import DaemonError
from daemon.model.status import LiveSnapshot
from scenario_tui.dashboard.app import Dashboard
from scenario_tui.dashboard.feed import Feed
from scenario_tui.dashboard.state import CampaignAssessor, DashboardState, Notice
from tests.scenario_tui.fake import FakeDaemon

_QUIET: Final = 10
"""Turns of the loop without a message after which there will be none."""


class InlineFeed(Feed):
    """Takes its picture in the caller's thread, so that tests know when it is taken."""

    def __init__(self, daemon: FakeDaemon) -> None:
        assessor = CampaignAssessor(every=0.0, elsewhere=0.0)
        super().__init__(daemon.open, clock=lambda: daemon.now, assessor=assessor)
        self.fake = daemon

    def start(self) -> None:
        """Start no thread."""

    def take_news(self) -> tuple[DashboardState | None, list[LiveSnapshot], list[Notice]]:
        try:
            self.step(self.fake)
            if self.assess(self.fake):
                self.step(self.fake)
        except DaemonError as error:
            self._lose(error)
        self._lives.extend(self.fake.live)
        self.fake.live = ()
        return super().take_news()


def make_dashboard(fake: FakeDaemon, **settings: Any) -> Dashboard:
    dashboard = Dashboard(InlineFeed(fake), clock=lambda: fake.now, **settings)
    # On a busy machine what a test reads would be gone before.
    dashboard.NOTIFICATION_TIMEOUT = 600.0
    return dashboard


async def settle(pilot: Pilot[None]) -> None:
    """Let the dashboard take over what is new, twice: some screens ask because of what they see."""
    for _ in range(2):
        await _quiet(pilot)
        assert isinstance(pilot.app, Dashboard)
        pilot.app.update_state()
        await _quiet(pilot)


async def _quiet(pilot: Pilot[None]) -> None:
    """Wait until nobody has a message to handle.

    The pilot's own pause takes a process for idle that a loaded machine does not let run.
    """
    await pilot.pause(0)
    quiet = 0
    while quiet < _QUIET:
        await asyncio.sleep(0)
        stack = pilot.app.screen_stack if pilot.app.is_running else []
        nodes = [pilot.app, *(node for screen in stack for node in screen.walk_children(Widget))]
        busy = any(node.message_queue_size for node in (*nodes, *stack))
        quiet = 0 if busy else quiet + 1


async def press(pilot: Pilot[None], *keys: str) -> None:
    """Press keys; only moving the cursor needs no new picture in between."""
    for key, repeated in itertools.groupby(keys):
        together = list(repeated)
        for group in [together] if key in ("down", "j", "k") else [[k] for k in together]:
            await pilot.press(*group)
            await settle(pilot)


def screen_text(pilot: Pilot[None]) -> list[str]:
    """Return the lines of the screen as a reader sees them."""
    lines = pilot.app.screen._compositor.render_strips()
    return [strip.text.rstrip() for strip in lines]
