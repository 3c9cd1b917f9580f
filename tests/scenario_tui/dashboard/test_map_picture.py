"""The map as a picture: what it shows, how it gets to the terminal, what is said when it cannot."""

import base64
import io

import pytest
from PIL import Image
from rich.console import Console

from grammars.model.geometry import Pose2
from scenario_tui.dashboard import map_picture
from scenario_tui.dashboard.map_picture import look_at_picture, paint_view, print_picture
from scenario_tui.dashboard.widgets.map_frame import View
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.terminal.limited_terminal import LimitedTerminalApp
from tests.scenario_tui.fake import MISSION, ROBOT, make_scene

WAY = tuple((1.0 + 0.1 * i, 2.0) for i in range(60))
VIEW = View(
    make_scene(), ROBOT, MISSION, (-0.5,), Pose2(7.0, 2.0), trail=WAY,
    clearances=(1.0,) * 30 + (0.1,) * 30, limit=0.2,
)  # fmt: skip


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    return paint_view(VIEW, tmp_path_factory.mktemp("map") / "map.png")


def terminal():
    return Console(file=io.StringIO(), force_terminal=True, width=80, height=24)


def test_the_picture_shows_the_way_and_where_it_was_near(picture):
    colours = {colour for _, colour in Image.open(picture).convert("RGB").getcolors(1 << 20) or ()}
    assert {(0x1D, 0x7F, 0x58), (0xE0, 0x8A, 0x1E)} <= colours


def test_kitty_gets_the_picture_as_it_is_in_pieces(picture, capfd):
    assert print_picture(picture, "kitty", terminal()) == ""
    pieces = [part for part in capfd.readouterr().out.split("\x1b_G") if ";" in part]
    sent = "".join(part.split(";", 1)[1].removesuffix("\x1b\\") for part in pieces)
    with Image.open(io.BytesIO(base64.b64decode(sent))) as shown:
        assert shown.format == "PNG"


def test_sixel_is_written_where_the_cursor_is(picture):
    console = terminal()
    assert print_picture(picture, "sixel", console) == ""
    assert "\x1bP" in console.file.getvalue()


def test_a_terminal_that_says_nothing_is_left_alone(picture, monkeypatch):
    images = pytest.importorskip("textual_image.renderable")
    monkeypatch.setattr(images, "Image", images.HalfcellImage)
    console = terminal()
    assert "does not say" in print_picture(picture, "auto", console)
    assert console.file.getvalue() == ""


class Map(LimitedTerminalApp):
    def compose(self):
        yield TopView()


@pytest.mark.parametrize(
    ("settings", "view", "words"),
    [
        ("", VIEW, 'pictures are off: write pictures = "auto" below [dashboard] in '),
        ('[dashboard]\npictures = "kitty"', None, "nothing to be seen"),
        ('[dashboard]\npictures = "kitty"', VIEW, "cannot be given back"),
        ('[dashboard]\npictures = "on"', VIEW, "must be one of"),
    ],
)
async def test_why_there_is_no_picture_is_said(settings, view, words, tmp_path, monkeypatch):
    file = tmp_path / "config.toml"
    file.write_text(settings)
    read = map_picture.read_config
    monkeypatch.setattr(map_picture, "read_config", lambda: read(file))
    async with Map().run_test(size=(80, 24)) as pilot:
        top = pilot.app.query_one(TopView)
        top.show(view)
        look_at_picture(top)
        await pilot.pause(0)
        assert words in " ".join(note.message for note in pilot.app._notifications)
