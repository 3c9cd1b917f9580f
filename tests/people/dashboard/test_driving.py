"""Steering campaigns from every screen, and what is said where that cannot be."""

import shlex
from collections import Counter

import pytest
from textual.events import Key
from textual.keys import key_to_character
from textual.widgets import Input

from daemon.model.run_state import RunState
from scenario_tui.dashboard.config import Config
from scenario_tui.dashboard.screens import steering
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.dialogs import Menu, Prompt, Question, Refusal
from scenario_tui.dashboard.screens.matrix import MatrixScreen
from scenario_tui.dashboard.screens.run import RunScreen
from scenario_tui.dashboard.screens.runs import RunsScreen
from scenario_tui.dashboard.screens.submit import SubmitScreen
from scenario_tui.source import DaemonTarget
from scenario_tui.terminal.capabilities import copy_to_tmux
from tests.people.dashboard.dash import Commands
from tests.people.fake import CAMPAIGN, OLD, make_row

SCREENS = {
    CampaignsScreen: ((), ()),
    MatrixScreen: (("m",), ("escape",)),
    RunsScreen: (("enter",), ()),
    RunScreen: (("enter",), ()),
}
"""Screens, and the keys that lead there and back."""


async def test_a_campaign_is_steered_from_every_screen(dashboard, fake):
    dash = await dashboard(fake)
    for screen, (way, back) in SCREENS.items():
        await dash.press(*way)
        assert isinstance(dash.screen, screen)
        fake.calls.clear()
        await dash.press("P", "c", "y", "r", "f", "y")
        assert isinstance(dash.screen, screen)
        (steered,) = fake.told("steer")
        assert steered in ((CAMPAIGN, True, None), (CAMPAIGN, False, None))
        assert fake.told("cancel") == [(CAMPAIGN,)]
        assert fake.told("retry") == [(CAMPAIGN, ("fail",))]
        assert CAMPAIGN in dash.app.clipboard
        await dash.press(*back)


async def test_one_key_pauses_and_resumes_and_is_called_what_it_does(dashboard, fake):
    dash = await dashboard(fake)
    assert dash.screen.active_bindings["P"].binding.description == "Pause"
    await dash.press("P")
    assert "‖ paused" in dash.text
    assert dash.screen.active_bindings["P"].binding.description == "Resume"
    assert f"same as: scenario pause {CAMPAIGN}" in dash.notices
    await dash.press("r")
    assert "It is paused: they wait until it is resumed." in dash.text
    await dash.press("f")
    await dash.press("P")
    assert f"same as: scenario pause {CAMPAIGN} --off" in dash.notices
    assert fake.told("steer") == [(CAMPAIGN, True, None), (CAMPAIGN, False, None)]


async def test_a_finished_campaign_is_deleted_after_a_question(dashboard, fake):
    dash = await dashboard()
    await dash.press("down", "D")
    assert f"scenario delete {OLD}" in dash.text
    assert not fake.told("delete")
    await dash.press("y")
    assert fake.told("delete") == [((OLD,), False)]
    assert f"deleted {OLD}: 4 runs" in dash.notices


async def test_only_whole_numbers_in_range_are_priorities(dashboard, fake):
    dash = await dashboard(fake, (120, 24))
    await dash.press("number_sign")
    for wrong, why in (("x", "write a whole number"), ("1001", "number, −1000 to 1000")):
        await dash.press("home", "ctrl+k", *wrong, "enter")
        assert isinstance(dash.screen, Prompt)
        assert why in dash.text
    await dash.press("home", "ctrl+k", "minus", "5")
    assert f"scenario priority {CAMPAIGN} -- -5" in dash.text
    await dash.press("enter")
    assert "priority −5" in dash.text
    assert fake.told("steer") == [(CAMPAIGN, None, -5)]


async def test_the_menu_of_retries_says_how_many_there_are_of_each(dashboard, fake):
    dash = await dashboard(fake)
    await dash.press("r")
    assert "l  lost and cancelled: 1" in dash.text
    assert "f  failed: 2" in dash.text
    assert "e  broken (error)  (none)" in dash.text
    await dash.press("e")
    assert isinstance(dash.screen, Menu)
    await dash.press("j")
    assert f"same as: scenario retry {CAMPAIGN} --only fail" in dash.text
    await dash.press("a")
    assert fake.told("retry") == [(CAMPAIGN, ("all",))]


async def test_answers_can_be_clicked_on(dashboard, fake):
    dash = await dashboard(fake)
    await dash.press("c")
    line = next(i for i, text in enumerate(dash.lines) if "y yes" in text)
    column = dash.lines[line].index("yes")
    await dash.pilot.click(offset=(column, line))
    await dash.settle()
    assert not isinstance(dash.screen, Question)
    assert fake.told("cancel") == [(CAMPAIGN,)]


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
    monkeypatch.setattr(steering, "open_in_browser", lambda page, environ: False)
    (tmp_path / "ledger.db").touch()
    fake.state = str(tmp_path)
    ask = Commands({"answer": "Yes. All is as expected."})
    dash = await dashboard(fake, run_command=ask, target=DaemonTarget(state=tmp_path))
    await dash.pilot.press("o")
    assert f"goes on writing the report of {CAMPAIGN}" in dash.app.farewell()
    await dash.pilot.press("o")
    assert f"writing the report of {CAMPAIGN} already" in dash.notices
    ask.done.set()
    await dash.until(lambda: "Yes. All is as expected." in dash.notices)
    assert f"{CAMPAIGN}.html (open it in a browser)" in dash.notices
    assert "writing" not in dash.app.farewell()
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
async def test_a_key_that_can_do_nothing_says_why_and_takes_what_is_typed_behind_it(
    dashboard, fake, case
):
    if case == "waiting":
        fake.rows = (make_row(0, state=RunState.QUEUED, outcome=None, oracle="", margin=None),)
    fake.empty = case == "empty"
    dash = await dashboard(fake, config=Config(read_only=case == "read-only"))
    if case == "finished":
        await dash.press("down")
    if case == "unreachable":
        fake.reachable = False
        await dash.settle()
    clipboard = dash.app.clipboard
    for key, why in REFUSALS[case].items():
        await dash.press(key)
        assert isinstance(dash.screen, Refusal)
        assert why in dash.text
        await dash.press("7", "j", "y")
        assert isinstance(dash.screen, CampaignsScreen)
        bindings = dash.screen.active_bindings
        assert key == "s" or not bindings[key].enabled
    assert dash.app.clipboard == clipboard
    fake.reachable = True
    await dash.settle()
    assert not {"steer", "cancel", "retry", "delete"} & {call[0] for call in fake.calls}


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


async def type_at_once(dash, *keys):
    """Hand all keys to the dashboard before it has done anything because of the first one."""
    for key in keys:
        dash.app.post_message(Key(key, key_to_character(key)))
    await dash.settle()


@pytest.mark.parametrize(
    ("keys", "verb", "calls"),
    [
        (("c", "y"), "cancel", [(CAMPAIGN,)]),
        (("c", "n", "P"), "steer", [(CAMPAIGN, True, None)]),
        (("r", "f"), "retry", [(CAMPAIGN, ("fail",))]),
        (("r", "j", "enter"), "retry", [(CAMPAIGN, ("fail",))]),
        (("number_sign", "ctrl+u", "7", "enter"), "steer", [(CAMPAIGN, None, 7)]),
        (("enter", "r", "f"), "retry", [(CAMPAIGN, ("fail",))]),
    ],
)
async def test_what_is_typed_ahead_is_for_the_dialog(dashboard, fake, keys, verb, calls):
    dash = await dashboard(fake)
    await type_at_once(dash, *keys)
    assert fake.told(verb) == calls


async def test_what_is_typed_for_a_dialog_that_does_not_open_does_nothing(dashboard, fake):
    dash = await dashboard(fake)
    dash.app.read_only = True
    for keys in (("c", "y"), ("number_sign", "7", "enter"), ("r", "j", "enter")):
        await type_at_once(dash, *keys)
        assert isinstance(dash.screen, CampaignsScreen)
    assert dash.app.clipboard == ""
    assert not {"steer", "cancel", "retry"} & {call[0] for call in fake.calls}


async def test_a_name_typed_ahead_is_that_of_a_file(dashboard, fake, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    dash = await dashboard(fake)
    await type_at_once(dash, *"s1q3s")
    assert isinstance(dash.screen, SubmitScreen)
    assert dash.one(Input).value == "1q3s"


async def test_a_text_typed_ahead_filters(dashboard, fake):
    dash = await dashboard(fake)
    await type_at_once(dash, "slash", *OLD[:4], "enter", "m")
    assert isinstance(dash.screen, MatrixScreen)
    assert dash.screen.campaign().id == OLD
