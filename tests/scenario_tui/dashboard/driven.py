"""A dashboard to drive: a daemon that remembers what it was told, and waiting for threads."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest import mock

from textual.command import Command, CommandList
from textual.pilot import Pilot
from textual.widgets import Input

from daemon.model.status import CampaignRow, DaemonOverview
from scenario_tui.dashboard.background import CommandAnswer, CommandLines
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.screens import help as help_screen
from tests.daemon.batch.harness import DEADLINE
from tests.scenario_tui.dashboard.inline import press, settle
from tests.scenario_tui.fake import CAMPAIGN, FakeDaemon


@dataclass
class SteeredDaemon(FakeDaemon):
    """Pauses and prefers its first campaign when it is told to."""

    paused: bool = False
    priority: int = 0
    state: str = "state"

    def _campaign_rows(self) -> tuple[CampaignRow, ...]:
        first, *others = super()._campaign_rows() or (None,)
        if first is None:
            return ()
        return (replace(first, paused=self.paused, priority=self.priority), *others)

    def overview(self) -> DaemonOverview:
        return replace(super().overview(), state=self.state)

    def pause(self, campaign: str) -> int:
        self.paused = campaign == CAMPAIGN
        return super().pause(campaign)

    def resume(self, campaign: str) -> int:
        self.paused = False
        return super().resume(campaign)

    def prioritise(self, campaign: str, priority: int) -> None:
        self.priority = priority
        super().prioritise(campaign, priority)

    def told(self, verb: str) -> list[tuple[object, ...]]:
        """What it was told to do by a verb."""
        return [call[1:] for call in self.calls if call[0] == verb]


@dataclass
class Commands:
    """Stands for the ``scenario`` commands the dashboard starts; they answer when ``done``."""

    answer: CommandAnswer = field(default_factory=dict)
    asked: list[tuple[str, ...]] = field(default_factory=list)
    done: threading.Event = field(default_factory=threading.Event)

    def __call__(self, arguments: tuple[str, ...]) -> CommandAnswer:
        self.asked.append(arguments)
        assert self.done.wait(DEADLINE)
        return self.answer


def configured(**settings: Any) -> Config:
    return Config(Path("config.toml"), **settings)


def local(state: Path) -> CommandLines:
    return CommandLines("", state)


async def eventually(condition: Callable[[], Any], pilot: Pilot[None] | None = None) -> None:
    """Wait for something another thread or process does; let a ``pilot``'s app come to rest."""
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        await asyncio.sleep(0.01)
        if pilot is not None:
            await settle(pilot)


async def until(pilot: Pilot[None], condition: Callable[[], Any]) -> None:
    """Wait for something another thread does."""
    await eventually(condition, pilot)


def notices(pilot: Any) -> str:
    return "\n".join(notice.message for notice in pilot.app._notifications)


async def choose_from_palette(pilot: Pilot[None], text: str, wanted: str) -> None:
    """Type a ``text`` into the list of places and take what is ``wanted`` from it.

    It is waited for: until the last letter is looked up, the list shows what an earlier one found.
    """
    await pilot.press("colon")
    await until(pilot, lambda: pilot.app.screen.query_one(CommandList).option_count)
    found = pilot.app.screen.query_one(CommandList)

    def first() -> str:
        option = found.get_option_at_index(0) if found.option_count else None
        return str(option.hit.text) if isinstance(option, Command) else ""

    # What the daemon is asked for is left out when it does not answer soon.
    with mock.patch.object(help_screen, "_PATIENCE", DEADLINE):
        pilot.app.screen.query_one(Input).value = text
        await until(pilot, lambda: first() == wanted)
    await press(pilot, "enter")
    await settle(pilot)
