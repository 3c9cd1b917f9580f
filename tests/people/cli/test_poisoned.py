"""Every command on a terminal, with a daemon, files and traces that want to steer it."""

import json
import shutil
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
import typer

from daemon.analysis.charts import page_script
from grammars.model.map_files import write_map
from scenario_tui.cli import command_line, invoke
from scenario_tui.cli.commands import PlainFlagsCommand
from scenario_tui.source import DaemonTarget
from tests.people.cli.commands import commands
from tests.people.fake_search import make_proposals, make_search
from tests.people.poison import (
    NAME,
    POISON,
    WORD,
    PoisonedDaemon,
    assert_harmless,
    record_poisoned,
    write_foreign_trace,
    yaml_text,
)
from tests.people.terminal.pseudo_terminal import typed_here
from tests.scene.maps.imported import house

TYPED = [
    line.split(" ")[1:]
    for line in Path(__file__).with_name("hostile.txt").read_text("utf-8").splitlines()
]
"""What is typed about hostile things, for every command."""
QUIET = {"sut relay", "tui"}
"""Commands that may say nothing of what is poisoned."""


COMMANDS = dict(commands())


def words_of(line):
    """Return the words that call the command of a line."""
    return next(w for w in (" ".join(line[:2]), line[0]) if w in COMMANDS)


@pytest.fixture(scope="module")
def place(tmp_path_factory, campaigns):
    """A folder full of hostile files, and how to type in it on a terminal."""
    folder = tmp_path_factory.mktemp("poisoned") / f"work{NAME}"
    for part in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / part, folder / part)
    _write_files(folder)
    trace = record_poisoned(folder / "traces" / f"run{NAME}.mcap")
    foreign = write_foreign_trace(folder / f"foreign{NAME}.mcap")
    search, running = make_search(note="a note"), make_search("running", campaign="house-9")
    fake = PoisonedDaemon(
        trouble="the disk is full", found=(search, running), proposed=make_proposals()
    )

    def typed(*words):
        chosen = {"NAME": NAME, "TRACE": trace, "FOREIGN": foreign}
        return typed_here(partial(invoke, [word.format(**chosen) for word in words]))

    page_script()  # Before the cache of this machine is out of sight: bundling takes seconds.
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name in ("SCENARIO_STATE", "SCENARIO_CONNECT", "NO_COLOR", "COLUMNS"):
            patch.delenv(name, raising=False)
        for name in ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_STATE_HOME"):
            patch.setenv(name, str(folder / name))
        patch.setenv("TERM", "xterm-256color")
        patch.setenv("SCENARIO_KEYS", f"keys{NAME}")
        for road in ("open", "read"):
            patch.setattr(DaemonTarget, road, lambda self: fake.open())
        # Made once: typer makes all commands anew each time they are called.
        patch.setattr(command_line, "app", typer.main.get_command(command_line.app))
        yield SimpleNamespace(folder=folder, type=typed)


def _write_files(folder):
    texts = {
        "keys.yaml": f"campaign: x\nabout: {yaml_text(POISON)}\n{yaml_text(NAME)}: 1\n",
        "raw.yaml": f"campaign: x{NAME}\n",
        f"sut{NAME}.yaml": f"sut: x\nkind: pilot\nparameters: {{{yaml_text(NAME)}: 1}}\n",
        "plan.fpm": f"Floor plan: {NAME}\nSpace {NAME}: shape: Rectangle\n",
        "doors.scenery": f"kitchen{NAME} moves to closed at 0 s\n",
        "good.oracles.yaml": f"oracles:\n  {yaml_text(NAME)}: {yaml_text('never ' + NAME)}\n",
        "graph.jsonld": json.dumps({"@graph": [{"@id": NAME, NAME: NAME}]}, ensure_ascii=False),
        f"text{NAME}.txt": POISON,
        f"flat{NAME}.variation": f'import "{NAME}.fpm"\nwide{NAME}: uniform(1 .. 2)\n',
        f"map{NAME}.yaml": f"image: {yaml_text(NAME)}\nresolution: {yaml_text(NAME)}\n",
        "taken": POISON,
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    write_map(house(), folder / "map", laser_height=0.2)
    campaign = folder / "demo" / "campaign.yaml"
    lines = campaign.read_text().splitlines()
    lines = [f"about: {yaml_text(POISON)}" if one.startswith("about") else one for one in lines]
    text = "\n".join(lines) + "\n"
    campaign.write_text(text.replace("shut out, the pilot", f"\\e]0;{WORD}\\a\\e[2J the pilot"))
    (folder / "broken").mkdir()
    (folder / "broken" / "campaign.yaml").write_text(
        text.replace("busy-house:", f"{yaml_text(NAME)}:").replace("courier", yaml_text(NAME))
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_nothing_that_a_command_shows_steers_the_terminal(place, command):
    lines = [line for line in TYPED if words_of(line) == command]
    assert lines
    seen = "".join(assert_harmless(place.type(*line)[1]) for line in lines)
    assert WORD in seen or command in QUIET


def test_neither_do_complaints_about_what_was_typed(place):
    for words in COMMANDS:
        code, raw = place.type(*words.split(), "--{NAME}")
        assert code == 2
        assert WORD in assert_harmless(raw)


def test_help_keeps_its_colours(place):
    # A stream lets no styles through: help goes around it, which these classes see to.
    assert {type(command) for command in COMMANDS.values()} == {PlainFlagsCommand}
    for words in ((), ("status",), ("sut",), ("keys", "issue")):
        code, raw = place.type(*words, "--help")
        assert code == 0
        assert b"\x1b[1m" in raw
        assert "\N{REPLACEMENT CHARACTER}" not in assert_harmless(raw)


def test_neither_do_the_files_of_a_report(place):
    page, junit = (place.folder / "out" / f"report.{ending}" for ending in ("html", "xml"))
    page.parent.mkdir(exist_ok=True)
    words = ("traces", "-o", str(page), "--junit", str(junit), "-j", "1")
    code, _ = place.type("report", *words)
    assert code == 0
    ElementTree.parse(junit)
    for file in (page, junit):
        assert WORD in assert_harmless(file.read_bytes())
