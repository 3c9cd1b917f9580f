"""The user's settings: what they change, and what is said of wrong ones."""

import pytest
from rich.color_triplet import ColorTriplet
from textual.color import Color
from textual.widgets._footer import FooterKey

from grammars.text.diagnostics import InputError
from scenario_tui.dashboard.config import read_config
from scenario_tui.dashboard.key_bindings import (
    check_config,
    classes_with_bindings,
    list_key_bindings,
)
from scenario_tui.dashboard.screens.help import our_bindings
from scenario_tui.terminal.filters import darken
from scenario_tui.text.styles import COLOURS
from tests.people.dashboard.driven import SteeredDaemon
from tests.people.dashboard.inline import make_dashboard
from tests.people.dashboard.searching import SearchingDaemon

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
    "[keys]\n\ncancel = 'fnord'": 'config.toml: cancel: "fnord" is no key',
    "[keys]\ncancel = []": 'config.toml: cancel: "" is no key',
    "[keys]\ncancel = 1": "config.toml: keys.cancel.str: Input should be a valid string",
    "[dashboard]\ntheme = 'nrod'": 'config.toml: unknown theme "nrod"; themes are ',
    "[dashboard]\nmouse = 'no'": "config.toml: dashboard.mouse: Input should be a valid boolean",
    "[dashboard]\nmuose = true": "config.toml: dashboard.muose: Extra inputs are not permitted",
    "mouse = true": "config.toml: mouse: Extra inputs are not permitted",
    "[keyz]\na = 'b'": "config.toml: keyz: Extra inputs are not permitted",
    "[keys\n": "config.toml: is no TOML: ",
}


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "config.toml"
        path.write_text(text)
        return path

    return write


def test_no_file_says_nothing(tmp_path):
    config = read_config(tmp_path / "config.toml")
    check_config(config)
    assert not config.read_only
    assert config.mouse
    assert not config.keys


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
    fake = SteeredDaemon()
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


async def test_footers_fit_and_help_tells_the_rest(dashboard):
    app = make_dashboard(SteeredDaemon())
    dash = await dashboard(app)
    for key in ("1", "m", "1", "enter", "enter", "3", "s"):
        await dash.press(key)
        screen = dash.screen
        assert screen.query_one("Footer").virtual_size.width <= 80
        listed = {one.binding.description for one in our_bindings(screen)}
        footer = {one.description for one in screen.query(FooterKey) if not one.disabled}
        assert footer
        assert footer <= listed


async def test_the_footer_of_a_search_fits_and_help_tells_the_rest(dashboard):
    dash = await dashboard(SearchingDaemon.finished())
    await dash.press("enter")
    screen = dash.screen
    assert screen.query_one("Footer").virtual_size.width <= 80
    listed = {one.binding.description for one in our_bindings(screen)}
    assert {"Next", "Rerun", "All runs", "View"} <= listed


PALE = {name: Color.parse(colour).rich_color.get_truecolor() for name, colour in COLOURS.items()}


def luminance(colour):
    """Relative luminance as the WCAG defines it."""
    parts = [p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in colour.normalized]
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]


@pytest.mark.parametrize("colour", PALE.values(), ids=PALE)
def test_words_can_be_read_in_bright_themes(colour):
    """A contrast of 4.5 to 1, which the WCAG asks for, over the background of textual-light."""
    dark = darken(Color(*colour)).rich_color.get_truecolor()
    paper, ink = luminance(ColorTriplet(224, 224, 224)), luminance(dark)
    assert (paper + 0.05) / (ink + 0.05) >= 4.5


async def test_a_bright_theme_darkens_the_words(dashboard, written):
    config = read_config(written("[dashboard]\ntheme = 'textual-light'"))
    dash = await dashboard(SteeredDaemon(), config=config)
    strips = dash.screen._compositor.render_strips()
    styles = [segment.style for strip in strips for segment in strip if segment.style]
    used = {style.color.get_truecolor() for style in styles if style.color is not None}
    assert not used & set(PALE.values())
    assert darken(Color(*PALE["bad"])).rich_color.get_truecolor() in used


def test_doctor_says_which_settings_are_used(scenario, written, monkeypatch, tmp_path):
    path = written(GOOD)
    monkeypatch.setattr("scenario_tui.dashboard.config.config_path", lambda: path)
    said = scenario("doctor", "--state", str(tmp_path / "state"))
    assert f"{path} 2 keys, theme nord, read-only" in said.out
    written("[keys")
    said = scenario("doctor", "--state", str(tmp_path / "state"))
    assert said.code == 3
    assert "is no TOML" in said.out
