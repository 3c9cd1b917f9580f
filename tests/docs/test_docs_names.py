"""What the documentation names is there: commands and options, files that ship, doors."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import NamedTuple

import pytest

from grammars.floorplan import load_floorplan
from grammars.scenery import load_scenery
from scenario_tui.cli.commands import COMMANDS, load_command

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md")))
_BLOCK = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`([^`\n]+)`")
_COMMAND = re.compile(r"(?:^\s*|[$>] ?|&& |run: |- )scenario ([a-z]+\b.*)")
_ROOMS = ("campaigns", "daemon", "docs", "grammars", "scenario_tui", "templates", "tests")
_NO_NAMES = {("docs/languages/floorplan.md", "door-1")}
"""What a page says is no name."""


class Line(NamedTuple):
    """A piece of code of a page, and the page."""

    page: str
    text: str


def _code():
    for page in PAGES:
        text = page.read_text("utf-8")
        name = str(page.relative_to(ROOT))
        for block in _BLOCK.findall(text):
            for line in block.replace("\\\n", " ").splitlines():
                yield Line(name, line)
        for inline in _INLINE.findall(_BLOCK.sub("", text)):
            yield Line(name, inline)


CODE = tuple(_code())


def _typed():
    """Return the words behind ``scenario`` of every command in the pages."""
    for line in CODE:
        for found in _COMMAND.findall(line.text):
            words = re.split(r" (?:[#|>;]|&&|then\b)|\s{3,}", found.partition("  #")[0])[0]
            try:
                yield line, shlex.split(words)
            except ValueError:
                yield line, words.split()


def _command_of(words):
    command, rest = load_command(words[0]), words[1:]
    inner = getattr(command, "commands", None)
    if inner and rest and rest[0] in inner:
        return inner[rest[0]], rest[1:]
    return command, rest


def test_the_pages_name_commands_that_there_are():
    typed = list(_typed())
    assert len(typed) > 150, "the pages are not read as they are written"
    assert not [(line.page, words[0]) for line, words in typed if words[0] not in COMMANDS]


def test_the_options_of_commands_exist():
    wrong = []
    for line, words in _typed():
        if words[0] not in COMMANDS:
            continue
        command, rest = _command_of(words)
        known = {"--help", "-h"}
        for parameter in command.params:
            known |= {*parameter.opts, *parameter.secondary_opts}
        for word in rest:
            if word == "--":
                break
            option = re.match(r"--[a-z][a-z0-9-]*|-[a-zA-Z]$", word)
            if option and option[0] not in known:
                wrong.append((line.page, " ".join(words), option[0]))
    assert not wrong


def test_options_of_the_help_stand_behind_the_command_they_are_of():
    """Every option named alone is one of some command."""
    known = {"--help"}
    for name in COMMANDS:
        found = load_command(name)
        for command in (found, *getattr(found, "commands", {}).values()):
            for parameter in command.params:
                known |= {*parameter.opts, *parameter.secondary_opts}
    pages = {"docs/command-line.md", "docs/operation.md", "docs/reports.md", "docs/replay.md"}
    named = {
        option
        for line in CODE
        if line.page in pages and line.text.startswith("--")
        for option in re.findall(r"--[a-z][a-z0-9-]+", line.text)
    }
    assert len(named) > 15
    assert named <= known


def test_files_that_pages_name_ship():
    missing = set()
    for line in CODE:
        for word in re.findall(r"[\w./-]+", line.text):
            first, slash, rest = word.partition("/")
            # Placeholders are written in capitals.
            if not slash or first not in _ROOMS or not rest or re.search(r"\b[A-Z]{3,}\b", rest):
                continue
            if not (ROOT / word.rstrip("./")).exists():
                missing.add((line.page, word))
    assert not missing


@pytest.fixture(scope="module")
def building():
    """The ids of building C: its spaces, entryways and doors."""
    folder = ROOT / "campaigns" / "ortega2024"
    plan = load_floorplan(folder / "building_c.fpm")
    doors = load_scenery(folder / "doors.scenery")
    return frozenset(
        {space.name for space in plan.spaces}
        | {opening.name for opening in plan.openings}
        | {placed.name for placed in doors.instances}
    )


def test_numbered_doors_are_those_of_the_building(building):
    named = {
        (str(page.relative_to(ROOT)), name)
        for page in (*PAGES, *ROOT.glob("scenario_tui/**/*.py"), *ROOT.glob("grammars/oracle/*.py"))
        for name in re.findall(r"\bdoor[_-]\d+\b(?!-)", page.read_text("utf-8"))
    }
    assert named
    assert {(page, name) for page, name in named if name not in building} == _NO_NAMES


def test_every_row_of_a_table_is_one_line():
    cut = []
    for page in PAGES:
        text = _BLOCK.sub("", page.read_text("utf-8"))
        rows = [line for line in text.splitlines() if line.startswith("|")]
        cut += [(page.name, row) for row in rows if not row.rstrip().endswith("|")]
    assert not cut


def test_keys_that_are_said_to_copy_do_so():
    table = (ROOT / "docs" / "dashboard.md").read_text("utf-8")
    rows = [line for line in table.splitlines() if line.startswith("| `") and "opy" in line]
    keys = {key for row in rows for key in _INLINE.findall(row.split("|")[1])}
    said = [
        (page.name, key)
        for page in PAGES
        for key in re.findall(r"`(.)` copies", page.read_text("utf-8"))
    ]
    assert len(said) > 2, "the pages are not read as they are written"
    assert [one for one in said if one[1] not in keys] == []
