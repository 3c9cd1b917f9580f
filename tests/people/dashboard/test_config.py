"""The user's settings: what they change, and what is said of wrong ones."""

import pytest

from grammars.text.diagnostics import InputError
from scenario_tui.dashboard.config import read_config
from scenario_tui.dashboard.key_bindings import (
    check_config,
    classes_with_bindings,
    list_key_bindings,
)
from scenario_tui.dashboard.screens.campaigns import CampaignsScreen
from scenario_tui.dashboard.screens.dialogs import Help, our_bindings
from scenario_tui.dashboard.widgets.key_footer import KeyFooter
from tests.people.dashboard.searching import SearchingDaemon
from tests.people.fake import OLD, FakeDaemon

SHARED_MEANINGS = {
    "take what the cursor is on": ("open", "submit-file", "verdict-moment"),
    "one step back": ("back", "leave"),
    "down": ("down", "next-file", "verdict-next"),
    "up": ("up", "previous-file", "verdict-before"),
    "to the first": ("top", "start"),
    "to the last": ("bottom", "end"),
    "next to look at": ("next-unexpected", "next-failure", "next-found"),
    "the one before to look at": ("previous-unexpected", "previous-failure", "previous-found"),
}
"""Ids that say one thing of different screens; every other id is a meaning of its own.

A key has one meaning on all screens. Exempt are dialogs, which take all keys while they are open,
and the screen of ``scenario serve``, where keys are held to steer a robot.
"""
ALONE = ("live", "dialogs", "help")
"""Places of keys that may mean something else there."""

GOOD = """
[dashboard]
theme = "nord"
read-only = true
mouse = false

[keys]
cancel = "ctrl+d"
open = ["enter", "space"]
"""
BAD = {
    "[keys]\nxyz = 'a'": 'config.toml: unknown key id "xyz"; ids are ',
    "[keys]\n\ncancel = 'fnord'": 'config.toml: cancel: "fnord" is not a key',
    "[keys]\ncancel = []": 'config.toml: cancel: "" is not a key',
    "[keys]\ncancel = 1": "config.toml: keys.cancel.str: Input should be a valid string",
    "[dashboard]\ntheme = 'nrod'": 'config.toml: unknown theme "nrod"; themes are ',
    "[dashboard]\nmouse = 'no'": "config.toml: dashboard.mouse: Input should be a valid boolean",
    "[dashboard]\nmuose = true": "config.toml: dashboard.muose: Extra inputs are not permitted",
    "mouse = true": "config.toml: mouse: Extra inputs are not permitted",
    "[keyz]\na = 'b'": "config.toml: keyz: Extra inputs are not permitted",
    "[keys\n": "config.toml: is not valid TOML: ",
}


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "config.toml"
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("text", BAD)
def test_what_is_wrong_is_said_by_its_name(written, text):
    with pytest.raises(InputError) as caught:
        check_config(read_config(written(text)))
    assert BAD[text] in str(caught.value)


def test_keys_may_be_exchanged(written):
    check_config(read_config(written('[keys]\ncancel = "P"\npause = "c"')))


async def test_keys_and_colours_are_those_of_the_file(dashboard, written):
    config = read_config(written(GOOD))
    check_config(config)
    fake = FakeDaemon()
    dash = await dashboard(fake, config=config)
    assert dash.app.theme == "nord"
    assert dash.screen.active_bindings["ctrl+d"].binding.id == "cancel"
    await dash.press("space")
    assert "1-10 of 10" in dash.text


def test_a_bad_file_is_told_before_the_dashboard_starts(scenario, written, monkeypatch):
    path = written('[keys]\ncancle = "x"')
    monkeypatch.setattr("scenario_tui.dashboard.config.config_path", lambda: path)
    said = scenario("tui")
    assert said.code == 2
    assert f'{path}: error: unknown key id "cancle"; ids are ' in said.err
    assert "Traceback" not in said.err


def test_the_ids_of_all_keys_are_listed(scenario):
    said = scenario("tui", "--bindings")
    assert said.code == 0
    for bound in list_key_bindings():
        assert f"{bound.id} " in said.out


def test_every_key_has_an_id_a_name_and_an_explanation():
    for kind in classes_with_bindings():
        for binding in vars(kind)["BINDINGS"]:
            assert binding.id, (kind, binding)
            assert binding.description, (kind, binding)
            assert binding.tooltip, (kind, binding)


def test_a_key_means_one_thing_on_all_screens():
    meanings = {id: meaning for meaning, ids in SHARED_MEANINGS.items() for id in ids}
    found = {}
    for bound in list_key_bindings():
        if bound.place not in ALONE:
            for key in bound.keys.split(","):
                found.setdefault(key, set()).add(meanings.get(bound.id, bound.id))
    assert {key: sorted(meant) for key, meant in found.items() if len(meant) > 1} == {}
    assert found["n"] == {"next to look at"}


def test_a_meaning_has_the_same_keys_on_all_screens():
    keys = {}
    for bound in list_key_bindings():
        if bound.place not in ALONE:
            keys.setdefault(bound.id, set()).add(bound.keys)
    assert {id: sorted(found) for id, found in keys.items() if len(found) > 1} == {}


def test_shared_meanings_are_those_of_keys_there_are():
    ids = {bound.id for bound in list_key_bindings()}
    assert {id for shared in SHARED_MEANINGS.values() for id in shared} <= ids


@pytest.mark.parametrize(
    ("fake", "keys"),
    [
        (FakeDaemon(), ("1", "m", "1", "enter", "enter", "3", "s")),
        (SearchingDaemon.finished(), ("enter",)),
    ],
    ids=["campaign", "search"],
)
async def test_footers_fit_and_help_tells_the_rest(dashboard, fake, keys):
    dash = await dashboard(fake)
    for key in keys:
        await dash.press(key)
        listed = {one.binding.description for one in our_bindings(dash.screen)}
        bound = dash.screen.active_bindings.values()
        footer = [one.binding.description for one in bound if one.binding.show and one.enabled]
        assert footer
        assert set(footer) <= listed
        assert all(f" {name}" in dash.lines[-1] for name in footer)


async def test_keys_can_be_clicked_on_unless_they_are_grey(dashboard, fake):
    fake.acknowledge(OLD)
    dash = await dashboard()
    footer = dash.one(KeyFooter)

    def at(name):
        return dash.lines[-1].index(name), 0

    def grey():
        colours = {one.text.strip(): one.style.color for one in dash.strips[-1]}
        return {name for name in colours if name[1:] and colours[name] != colours["Help"]}

    assert grey() == set()
    await dash.pilot.hover(footer, at("Acknowledge"))
    assert "seen" in str(footer.tooltip)
    await dash.press("j")
    assert grey() == {"Acknowledge"}
    for name in ("Acknowledge", "Help"):
        assert isinstance(dash.screen, CampaignsScreen)
        await dash.pilot.click(footer, at(name))
        await dash.settle()
    assert isinstance(dash.screen, Help)
    assert fake.told("acknowledge") == [(OLD,)]


def test_doctor_says_which_settings_are_used(scenario, written, monkeypatch, tmp_path):
    path = written(GOOD)
    monkeypatch.setattr("scenario_tui.dashboard.config.config_path", lambda: path)
    said = scenario("doctor", "--state", str(tmp_path / "state"))
    assert f"{path} 2 keys, theme nord, read-only" in said.out
    written("[keys")
    said = scenario("doctor", "--state", str(tmp_path / "state"))
    assert said.code == 3
    assert "is not valid TOML" in said.out
