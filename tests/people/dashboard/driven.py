"""A dashboard to drive: a daemon that remembers what it was told, and waiting for threads."""

from __future__ import annotations

import asyncio
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

from textual.command import Command, CommandList
from textual.widgets import Input

from scenario_tui.dashboard.commands import CommandAnswer
from scenario_tui.dashboard.config import Config
from scenario_tui.source import DaemonTarget
from tests.parts import DEADLINE
from tests.people.dashboard.inline import settle
from tests.people.fake import FakeDaemon

SteeredDaemon = FakeDaemon


@dataclass
class Commands:
    """Stands for the ``scenario`` commands the dashboard starts; they answer when ``done``."""

    answer: CommandAnswer = field(default_factory=dict)
    asked: list[tuple[str, ...]] = field(default_factory=list)
    done: threading.Event = field(default_factory=threading.Event)

    def __call__(self, arguments):
        self.asked.append(arguments)
        assert self.done.wait(DEADLINE)
        return self.answer


def configured(**settings):
    return Config(Path("config.toml"), **settings)


def local(state):
    return DaemonTarget(state=state)


async def eventually(condition, pilot=None):
    """Wait for something another thread or process does; let a ``pilot``'s app come to rest."""
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        await asyncio.sleep(0.01)
        if pilot is not None:
            await settle(pilot)


async def until(pilot, condition):
    """Wait for something another thread does."""
    await eventually(condition, pilot)


def notices(pilot):
    return "\n".join(notice.message for notice in pilot.app._notifications)


async def choose_from_palette(dash, text, wanted):
    """Type a ``text`` into the list of places and take what is ``wanted`` from it.

    It is waited for: until the last letter is looked up, the list shows what an earlier one found.
    """
    await dash.pilot.press("colon")
    await dash.until(lambda: dash.one(CommandList).option_count)
    found = dash.one(CommandList)

    def first():
        option = found.get_option_at_index(0) if found.option_count else None
        return str(option.hit.text) if isinstance(option, Command) else ""

    dash.one(Input).value = text
    await dash.until(lambda: first() == wanted)
    await dash.press("enter")
