"""Steering campaigns from every screen, and what is said where that cannot be."""

import shlex
from collections import Counter

import pytest

from daemon.model.run_state import RunState
from scenario_tui.dashboard.screens import steering
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.dialogs import Menu, Prompt, Question, Refusal
from scenario_tui.dashboard.screens.matrix import MatrixScreen
from scenario_tui.dashboard.screens.run import RunScreen
from scenario_tui.dashboard.screens.runs import RunsScreen
from scenario_tui.terminal.capabilities import copy_to_tmux
from tests.people.dashboard.driven import (
    Commands,
    SteeredDaemon,
    choose_from_palette,
    configured,
    local,
    notices,
    until,
)
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.fake import CAMPAIGN, OLD, make_row

SCREENS = {
    CampaignsScreen: ((), ()),
    MatrixScreen: (("m",), ("escape",)),
    RunsScreen: (("enter",), ()),
    RunScreen: (("enter",), ()),
}
"""Screens, and the keys that lead there and back."""


@pytest.fixture
def fake():
    return SteeredDaemon()


def opened(fake, width=80, **settings):
    return make_dashboard(fake, **settings).run_test(size=(width, 24))


def shown(pilot):
    return "\n".join(screen_text(pilot))


async def test_a_campaign_is_steered_from_every_screen(fake):
    async with opened(fake) as pilot:
        await settle(pilot)
        for screen, (way, back) in SCREENS.items():
            await press(pilot, *way)
            assert isinstance(pilot.app.screen, screen)
            fake.calls.clear()
            await pilot.press("P", "c", "y", "r", "f", "y")
            await settle(pilot)
            assert isinstance(pilot.app.screen, screen)
            (steered,) = fake.told("steer")
            assert steered in ((CAMPAIGN, True, None), (CAMPAIGN, False, None))
            assert fake.told("cancel") == [(CAMPAIGN,)]
            assert fake.told("retry") == [(CAMPAIGN, ("fail",))]
            assert CAMPAIGN in pilot.app.clipboard
            await press(pilot, *back)


async def test_one_key_pauses_and_resumes_and_is_called_what_it_does(fake):
    async with opened(fake) as pilot:
        await settle(pilot)
        assert pilot.app.screen.active_bindings["P"].binding.description == "Pause"
        await press(pilot, "P")
        await settle(pilot)
        assert "‖ paused" in shown(pilot)
        assert pilot.app.screen.active_bindings["P"].binding.description == "Resume"
        assert f"same as: scenario pause {CAMPAIGN}" in notices(pilot)
        await press(pilot, "r")
        assert "It is paused: they wait until it is resumed." in shown(pilot)
        await press(pilot, "f")
        await press(pilot, "P")
        await settle(pilot)
        assert f"same as: scenario pause {CAMPAIGN} --off" in notices(pilot)
    assert fake.told("steer") == [(CAMPAIGN, True, None), (CAMPAIGN, False, None)]


async def test_only_whole_numbers_in_range_are_priorities(fake):
    async with opened(fake, 120) as pilot:
        await settle(pilot)
        await press(pilot, "number_sign")
        for wrong, why in (("x", "write a whole number"), ("1001", "number, −1000 to 1000")):
            await pilot.press("home", "ctrl+k", *wrong, "enter")
            assert isinstance(pilot.app.screen, Prompt)
            assert why in shown(pilot)
        await pilot.press("home", "ctrl+k", "minus", "5")
        await settle(pilot)
        assert f"scenario priority {CAMPAIGN} -- -5" in shown(pilot)
        await press(pilot, "enter")
        assert "priority −5" in shown(pilot)
    assert fake.told("steer") == [(CAMPAIGN, None, -5)]


async def test_the_menu_of_retries_says_how_many_there_are_of_each(fake):
    async with opened(fake) as pilot:
        await settle(pilot)
        await press(pilot, "r")
        assert "l  lost and cancelled: 1" in shown(pilot)
        assert "f  failed: 2" in shown(pilot)
        assert "e  broken (error)  (none)" in shown(pilot)
        await press(pilot, "e")
        assert isinstance(pilot.app.screen, Menu)
        await press(pilot, "j")
        assert f"same as: scenario retry {CAMPAIGN} --only fail" in shown(pilot)
        await press(pilot, "a")
    assert fake.told("retry") == [(CAMPAIGN, ("all",))]


async def test_menus_leave_room_for_their_choices_on_the_smallest_screens(fake):
    async with make_dashboard(fake).run_test(size=(40, 10)) as pilot:
        await settle(pilot)
        await press(pilot, "r")
        assert "failed: 2" in shown(pilot)
        assert "all that are over: 8" in shown(pilot)


async def test_answers_can_be_clicked_on(fake):
    async with opened(fake) as pilot:
        await settle(pilot)
        await press(pilot, "c")
        line = next(i for i, text in enumerate(screen_text(pilot)) if "y yes" in text)
        column = screen_text(pilot)[line].index("yes")
        await pilot.click(offset=(column, line))
        await settle(pilot)
        assert not isinstance(pilot.app.screen, Question)
    assert fake.told("cancel") == [(CAMPAIGN,)]


def test_outside_of_tmux_its_buffer_is_left_alone():
    assert not copy_to_tmux("text", {})


async def test_every_command_shown_is_one_of_the_command_line(fake, scenario):
    """`scenario` talks to the same fake daemon here, so what it understands is done twice."""
    async with opened(fake) as pilot:
        await settle(pilot)
        await press(pilot, "P", "P", "number_sign", "minus", "1", "enter", "c", "y", "r", "a")
        said = notices(pilot)
    before = list(fake.calls)
    lines = [line.removeprefix("same as: ") for line in said.splitlines() if "same as" in line]
    assert len(lines) == 5
    for line in lines:
        assert scenario(*shlex.split(line)[1:]).code == 0, line
    for verb in ("steer", "cancel", "retry"):
        told = Counter(fake.told(verb))
        assert set(told.values()) == {2}, (verb, before)


async def test_the_report_is_made_and_its_place_is_said(fake, tmp_path, monkeypatch):
    monkeypatch.setattr(steering, "open_in_browser", lambda page, environ: False)
    (tmp_path / "ledger.db").touch()
    fake.state = str(tmp_path)
    ask = Commands({"answer": "Yes. All is as expected."})
    async with opened(fake, run_command=ask, target=local(tmp_path)) as pilot:
        await settle(pilot)
        await press(pilot, "o")
        assert f"goes on writing the report of {CAMPAIGN}" in pilot.app.farewell()
        await press(pilot, "o")
        assert f"writing the report of {CAMPAIGN} already" in notices(pilot)
        ask.done.set()
        await until(pilot, lambda: "Yes. All is as expected." in notices(pilot))
        assert f"{CAMPAIGN}.html (open it in a browser)" in notices(pilot)
        assert "writing" not in pilot.app.farewell()
    page = f"{CAMPAIGN}.html"
    assert ask.asked == [("report", CAMPAIGN, "-o", page, "--state", str(tmp_path))]


REFUSALS = {
    "finished": {"P": "nothing to pause", "c": "nothing is left", "number_sign": "no effect"},
    "waiting": {"r": "nothing to retry", "D": "cancel it, then delete it"},
    "empty": dict.fromkeys(("P", "c", "r", "number_sign", "o", "m"), "no campaign here"),
    "elsewhere": {"o": "are not on this machine"},
    "unreachable": dict.fromkeys(("P", "c", "r", "number_sign", "s"), "no daemon answers"),
    "read-only": dict.fromkeys((*"PcrADos", "number_sign"), "read-only"),
}
"""What cannot be done, and the words of the reason of each key."""


@pytest.mark.parametrize("case", REFUSALS)
async def test_a_key_that_can_do_nothing_says_why_and_takes_what_is_typed_behind_it(fake, case):
    if case == "waiting":
        fake.rows = (make_row(0, state=RunState.QUEUED, outcome=None, oracle="", margin=None),)
    fake.empty = case == "empty"
    async with opened(fake, config=configured(read_only=case == "read-only")) as pilot:
        await settle(pilot)
        if case == "finished":
            await press(pilot, "down")
        if case == "unreachable":
            fake.reachable = False
            await settle(pilot)
        clipboard = pilot.app.clipboard
        for key, why in REFUSALS[case].items():
            await press(pilot, key)
            assert isinstance(pilot.app.screen, Refusal)
            assert why in shown(pilot)
            await press(pilot, "7", "j", "y")
            assert isinstance(pilot.app.screen, CampaignsScreen)
            bindings = pilot.app.screen.active_bindings
            assert key == "s" or not bindings[key].enabled
        assert pilot.app.clipboard == clipboard
        fake.reachable = True
        await settle(pilot)
    assert not {"steer", "cancel", "retry", "delete"} & {call[0] for call in fake.calls}


@pytest.mark.parametrize("reachable", [True, False])
async def test_who_only_looks_is_offered_nothing_that_changes_anything(fake, reachable):
    fake.reachable = reachable
    async with opened(fake, config=configured(read_only=True)) as pilot:
        await settle(pilot)
        assert "starts" not in shown(pilot)
        if not reachable:
            await press(pilot, "d")
            assert "read-only" in shown(pilot)
            await press(pilot, "escape")
        await pilot.press("colon")
        commands = pilot.app.get_system_commands(pilot.app.screen_stack[-2])
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


async def test_the_palette_goes_to_campaigns(fake):
    async with opened(fake) as pilot:
        await settle(pilot)
        await choose_from_palette(pilot, "campaign ni", f"go to campaign {OLD}")
        assert isinstance(pilot.app.screen, RunsScreen)
        assert f"campaigns › {OLD}" in shown(pilot)
