"""Fixtures of the people's side: a daemon that answers from fixed data."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import pytest
from textual._compositor import Compositor
from textual.css.model import RuleSet
from textual.css.stylesheet import Stylesheet
from textual.message_pump import MessagePump

from scenario_tui import source
from scenario_tui.cli import invoke
from scenario_tui.library import watching
from tests.people.cli.outputs import declared
from tests.people.fake import FakeDaemon
from tests.people.idle import wait_for_idle

_FRAME, _NEVER = 0.05, 1e6
"""Seconds between two frames of ours at least (textual's own are shorter), and a long time."""


class Said(NamedTuple):
    """What a command left: exit code, standard output, standard error."""

    code: int
    out: str
    err: str


@pytest.fixture(autouse=True)
def _as_wide_as_a_pipe(monkeypatch):
    """Who starts the tests may have said how wide his terminal is."""
    monkeypatch.delenv("COLUMNS", raising=False)


@pytest.fixture(autouse=True)
def _unseen_is_not_painted(monkeypatch):
    """Spare what an app without a terminal paints between two looks at its screen.

    It shows that to nobody, and a third of the time of the dashboard's tests went into it.
    Whoever reads the screen or takes a picture of it has all of it painted, and apps in terminals
    run in processes of their own.
    """
    paint = Compositor.render_update

    def render_update(compositor, full=False, **how):
        if full:
            return paint(compositor, full, **how)
        compositor._dirty_regions.clear()
        return None

    monkeypatch.setattr(Compositor, "render_update", render_update)


@pytest.fixture(scope="session", autouse=True)
def _styles_are_read_once():
    """Read the same style sheet for the same theme once, not for each app anew."""
    read, kept = Stylesheet._parse_rules, dict[Any, list[RuleSet]]()

    def parse_rules(sheet, *source, **more):
        key = (source, *more.items(), frozenset(sheet._variables.items()))
        if key not in kept:
            kept[key] = read(sheet, *source, **more)
        return kept[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stylesheet, "_parse_rules", parse_rules)
        yield


@pytest.fixture(autouse=True)
def _nothing_happens_by_itself(monkeypatch):
    """Keep timers that repeat from ticking: a test looks, and has time pass, when it wants to.

    A slow machine spent most of the time of the dashboard's tests on looks that nobody asked for.
    """
    start = MessagePump.set_interval

    def set_interval(pump, interval, *what, **how):
        return start(pump, max(interval, _NEVER) if interval >= _FRAME else interval, *what, **how)

    monkeypatch.setattr(MessagePump, "set_interval", set_interval)


@pytest.fixture(autouse=True)
def _idle_means_nothing_to_do(monkeypatch):
    """Wait after each key until it was taken in, not for as long as that takes at best."""
    monkeypatch.setattr("textual.app.wait_for_idle", wait_for_idle)
    monkeypatch.setattr("textual.pilot.wait_for_idle", wait_for_idle)


@pytest.fixture
def fake(monkeypatch):
    """A daemon that is watched without waiting."""
    monkeypatch.setattr(watching, "INTERVAL", 0.001)
    monkeypatch.setattr(watching, "_POLL", 0.0)
    return FakeDaemon()


@pytest.fixture
def scenario(fake, monkeypatch, capsys):
    """Call ``scenario ...`` in this process, against the fake daemon."""
    for name in ("SCENARIO_STATE", "SCENARIO_CONNECT"):
        monkeypatch.delenv(name, raising=False)
    read = source.DaemonTarget.read
    monkeypatch.setattr(source.DaemonTarget, "open", lambda self: fake.open())
    # Without --state it is the fake that has a ledger.
    monkeypatch.setattr(
        source.DaemonTarget, "read", lambda self: read(self) if self.state else fake.open()
    )
    before = dict(os.environ)

    def call(*arguments):
        code = invoke(arguments)
        said = capsys.readouterr()
        if "--json" in arguments and said.out:
            declared(said.out)
        return Said(code, said.out, said.err)

    yield call
    # Commands set variables for the processes they start, and end with their own elsewhere.
    os.environ.clear()
    os.environ.update(before)
