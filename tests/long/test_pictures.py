"""The pictures of the documentation show what there is to be seen."""

import re
import tempfile
from pathlib import Path

import pytest

from campaigns.studies.pictures.diagrams import DIAGRAMS
from campaigns.studies.pictures.executed_campaign import execute_campaign
from campaigns.studies.pictures.moving_picture import MOVING, moving_svg
from campaigns.studies.pictures.shots import (
    COMMANDS,
    FOLDER,
    KEYS,
    ROOT,
    SHOTS,
    draw,
    key_table,
    typed,
    visible,
)

_DOTS = re.compile("[\u2800-\u28ff]")
AGAIN = "record it again: python -m campaigns.studies.pictures --views"


def _words(svg):
    """Return what is written in a picture without the dots of maps, which rounding may move."""
    return [" ".join(_DOTS.sub(" ", line).split()) for line in visible(svg)]


def _stored(name):
    return _words((FOLDER / f"{name}.svg").read_text("utf-8"))


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    """The campaign of all pictures, executed once."""
    return execute_campaign(tmp_path_factory.mktemp("executed"))


@pytest.mark.parametrize("name", SHOTS)
async def test_a_view_is_as_in_its_picture(name, tmp_path, executed):
    assert _words(await draw(name, tmp_path, executed)) == _stored(name), AGAIN


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_prints_what_its_picture_shows(name, tmp_path, executed):
    assert _words(typed(name, tmp_path, executed)) == _stored(name), AGAIN


@pytest.mark.parametrize("name", DIAGRAMS)
def test_a_diagram_is_as_it_is_drawn_today(name):
    stored = (FOLDER / f"{name}.svg").read_text("utf-8")
    assert DIAGRAMS[name]() == stored, AGAIN.replace("--views", "--diagrams")


def test_the_moving_picture_is_that_of_the_recording():
    assert moving_svg() == MOVING.read_text("utf-8"), AGAIN.replace("--views", "--cast")


def test_every_picture_is_of_something_and_in_the_documentation():
    pictures = {path.stem for path in FOLDER.glob("*.svg")}
    assert pictures == {*SHOTS, *COMMANDS, *DIAGRAMS, MOVING.stem}
    documents = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
    text = "".join(path.read_text("utf-8") for path in documents)
    assert {name for name in pictures if f"pictures/{name}.svg" not in text} == set()


def test_the_table_of_keys_is_true():
    assert (ROOT / "docs" / "dashboard.md").read_text("utf-8").endswith(KEYS + key_table()), AGAIN


def test_pictures_name_no_machine():
    # The moving picture shows the folder of its own session.
    for path in {*FOLDER.glob("*.svg")} - {MOVING}:
        svg = path.read_text("utf-8")
        for folder in ("/home", tempfile.gettempdir(), Path.home(), ROOT):
            assert f"{folder}/" not in svg, path
        assert len(svg) < 150_000, path
