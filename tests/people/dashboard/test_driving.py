"""Steering campaigns from every screen, and what is said where that cannot be."""

import shlex
from collections import Counter

import pytest

from daemon.model.verdicts import RunState
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.screens import steering
from scenario_tui.source import DaemonTarget
from scenario_tui.terminal.capabilities import copy_to_tmux
from tests.people.dashboard.dash import Commands
from tests.people.dashboard.journeys import LOOK, Journey, clicked, follow, has, resized
from tests.people.fake import CAMPAIGN, FakeDaemon, make_row, make_rows

STEERED = ["P", "c y", "r f", "P", "y"]
ANEW = has(rows=lambda _: make_rows())


def waiting():
    return FakeDaemon((make_row(0, state=RunState.QUEUED, outcome=None, oracle="", margin=None),))


def nobody():
    return FakeDaemon(empty=True, rows=())


JOURNEYS = {
    "steered": Journey(
        [*STEERED, "m", *STEERED[:3], "escape enter", *STEERED[:3], "enter", *STEERED[:3]]
    ),
    "paused": Journey(["P", "r", "f", "P", "c", clicked("y yes"), "down", "D", "y"]),
    "priority": Journey(
        [LOOK, "number_sign", "home ctrl+k x enter", "home ctrl+k 1 0 0 1 enter",
         "home ctrl+k minus 5", "enter"], size=(120, 24),
    ),
    "retried": Journey(["r", "e", "j", "a"]),
    "refused-finished": Journey(
        ["down", "P", "!7 j y", "c", "!7 j y", "number_sign", "!7 j y", "o", "!7 j y"]
    ),
    "refused-waiting": Journey([LOOK, "r", "!7 j y", "D", "!7 j y"], waiting),
    "refused-empty": Journey(
        [LOOK, "P", "7", "c", "j", "r", "y", "number_sign", "7", "o", "j", "m", "y", "2", "3",
         resized(40, 10), "1"], nobody
    ),
    "refused-unreachable": Journey(
        [has(reachable=False), "P", "!7 j y", "c", "7", "r", "j", "number_sign", "y", "s", "7",
         has(reachable=True)],
    ),
    "refused-read-only": Journey(
        [LOOK, "P", "!7 j y", "c", "7", "r", "j", "A", "y", "D", "7", "o", "j", "s", "y",
         "number_sign", "7"], config=Config(read_only=True),
    ),
    "typed-ahead": Journey(
        ["!c y", ANEW, "!c n P", ANEW, "!r f", ANEW, "!r j enter", ANEW,
         "!number_sign ctrl+u 7 enter", "!enter r f"],
    ),
    "typed-ahead-for-nothing": Journey(
        ["!c y", "!number_sign 7 enter", "!r j enter"], config=Config(read_only=True)
    ),
    "typed-ahead-name": Journey([LOOK, "!s 1 q 3 s"], size=(200, 24)),
    "typed-ahead-filter": Journey(["!slash n i g h enter m"]),
}  # fmt: skip


@pytest.mark.parametrize("name", JOURNEYS)
async def test_a_campaign_is_steered_as_it_was(dashboard, golden, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    way = JOURNEYS[name]
    dash = await dashboard(way.daemon(), way.size, config=way.config)
    text = await follow(dash, way.steps)
    golden(f"journeys/{name}.txt", text.replace(str(tmp_path), "HERE"))


def test_outside_of_tmux_its_buffer_is_left_alone():
    assert not copy_to_tmux("text", {})


async def test_every_command_shown_is_one_of_the_command_line(dashboard, fake, scenario):
    """`scenario` talks to the same fake daemon here, so what it understands is done twice."""
    dash = await dashboard(fake)
    await dash.press("P", "P", "number_sign", "minus", "1", "enter", "c", "y", "r", "a")
    said = dash.notices
    before = list(fake.calls)
    lines = [line.removeprefix("same as: ") for line in said.splitlines() if "same as" in line]
    assert len(lines) == 5
    for line in lines:
        assert scenario(*shlex.split(line)[1:]).code == 0, line
    for verb in ("steer", "cancel", "retry"):
        told = Counter(fake.told(verb))
        assert set(told.values()) == {2}, (verb, before)


async def test_the_report_is_made_and_its_place_is_said(dashboard, fake, tmp_path, monkeypatch):
    monkeypatch.setattr(steering, "open_in_browser", lambda page: False)
    (tmp_path / "ledger.db").touch()
    fake.state = str(tmp_path)
    ask = Commands({"answer": "Yes. All is as expected."})
    dash = await dashboard(fake, run_command=ask, target=DaemonTarget(state=tmp_path))
    await dash.pilot.press("o")
    assert f"continues writing the report of {CAMPAIGN}" in dash.app.farewell()
    await dash.pilot.press("o")
    assert f"writing the report of {CAMPAIGN} already" in dash.notices
    ask.done.set()
    await dash.until(lambda: "Yes. All is as expected." in dash.notices)
    assert f"{CAMPAIGN}.html (open it in a browser)" in dash.notices
    assert "writing" not in dash.app.farewell()
    page = f"{CAMPAIGN}.html"
    assert ask.asked == [("report", CAMPAIGN, "-o", page, "--state", str(tmp_path))]


@pytest.mark.parametrize("reachable", [True, False])
async def test_who_only_looks_is_offered_nothing_that_changes_anything(dashboard, fake, reachable):
    fake.reachable = reachable
    dash = await dashboard(fake, config=Config(read_only=True))
    assert "starts" not in dash.text
    if not reachable:
        await dash.press("d")
        assert "read-only" in dash.text
        await dash.press("escape")
    await dash.press("colon")
    commands = dash.app.get_system_commands(dash.app.screen_stack[-2])
    steered = {binding.description for binding in steering.steering_keys()}
    offered = {command.title for command in commands}
    assert offered.isdisjoint({"Start daemon", "Submit", "Report", *steered})


@pytest.mark.parametrize(
    ("environ", "there"),
    [
        ({"DISPLAY": ":0"}, True),
        ({"WAYLAND_DISPLAY": "wayland-0"}, True),
        ({"DISPLAY": ":0", "SSH_CONNECTION": "10.0.0.1 1 10.0.0.2 22"}, False),
        ({}, False),
    ],
)
def test_a_browser_is_opened_only_on_a_screen_of_this_machine(environ, there):
    assert steering.has_display(environ) is there
