"""Every command on a terminal, with a daemon, files and traces that want to steer it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import pytest
import typer

from grammars.model.map_files import write_map
from scenario_tui.cli import command_line, invoke
from scenario_tui.cli.commands import COMMANDS, PlainFlagsCommand, load_command
from scenario_tui.source import DaemonTarget
from tests.people.fake_search import SEARCH, make_proposals, make_search
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
from tests.people.terminal.pseudo_terminal import ROOT, typed_here
from tests.scene.maps.imported import house

RUN = "first-ab12cd34.5"
CASES = {
    "demo": (("--out", "taken/{NAME}"),),
    "new": (("mine{NAME}",), ("mine", "--floorplan", "{NAME}.fpm"), ("--layers",)),
    "check": (
        ("demo/campaign.yaml",),
        ("broken/campaign.yaml",),
        ("keys.yaml", "raw.yaml", "sut{NAME}.yaml", "plan.fpm", "doors.scenery"),
        ("good.oracles.yaml", "graph.jsonld", "{NAME}", "text{NAME}.txt"),
    ),
    "run": (("broken/campaign.yaml",), ("{NAME}.yaml",)),
    "submit": (
        ("broken/campaign.yaml",),
        # Named, so that none is started.
        ("demo/campaign.yaml", "--connect", "tcp/127.0.0.1:7"),
    ),
    "search": (
        (SEARCH, "-o", "out/search", "--no-gazebo"),
        (SEARCH, "--json", "--detach"),
        ("--list",),
        ("none{NAME}",),
        ("broken/campaign.yaml", "{NAME}"),
        (SEARCH, "--budget", "{NAME}"),
        ("demo/campaign.yaml", "--stop", "{NAME}"),
    ),
    "wait": (("first", "--timeout", "0s"), ("none{NAME}",), (SEARCH,)),
    "serve": (("broken/campaign.yaml",), ("demo/campaign.yaml", "{NAME}")),
    "tui": ((), ("--keys", "{NAME}")),
    "status": ((), ("--json",)),
    "results": (("first",), (SEARCH,), ("first", "--runs"), ("first", "--json"), ("none{NAME}",)),
    "show": (
        (RUN,),
        (RUN, "--json"),
        ("{TRACE}",),
        ("none{NAME}.1",),
        ("{TRACE}", "--log"),
        ("{TRACE}", "--all"),
        ("{TRACE}", "--log", "--json"),
        ("{FOREIGN}", "--log"),
        (RUN, "--log"),
    ),
    "replay": (("{TRACE}", "--frame", "0.5"), ("{TRACE}", "{TRACE}"), ("{FOREIGN}",)),
    "plot": (("{TRACE}", "speed"), ("{TRACE}", "spe{NAME}"), ("{FOREIGN}", "speed")),
    "judge": (("{TRACE}", "{FOREIGN}"), ("{TRACE}", "--json")),
    "verify": (("{FOREIGN}",), ("none{NAME}",)),
    "compare": (("first", "nightly"), ("{FOREIGN}", "{NAME}.json")),
    "report": (
        ("traces", "--table", "out/{NAME}.csv", "--junit", "out/junit.xml"),
        ("first", "-o", "out/{NAME}.html"),
    ),
    "coverage": (("{TRACE}", "{FOREIGN}"), ("demo/campaign.yaml",)),
    "blame": (("{FOREIGN}",), (RUN, "--oracle", "{NAME}")),
    "cancel": (("first",), ("none{NAME}",)),
    "acknowledge": (("first",), ("none{NAME}",)),
    "retry": (("first",), ("first", "--only", "{NAME}")),
    "pause": (("first",), ("first", "--json"), ("first", "--off")),
    "priority": (("first", "3"), ("first", "{NAME}")),
    "delete": (("first", "--yes"), ("first",), ("none{NAME}", "-n")),
    "daemon": (("--stop",), ("--print-unit", "--state", "{NAME}"), ("--listen", "{NAME}")),
    "worker": (("--print-unit", "--state", "{NAME}"), ("--connect", "{NAME}")),
    "doctor": (("--state", "{NAME}"), ("--state", "{NAME}", "--json")),
    "gc": (("--keep", "0", "--state", "{NAME}"),),
    "import": (("map{NAME}.yaml",), ("map.yaml", "-o", "{NAME}"), ("plan.fpm",)),
    "export": (
        ("plan.fpm", "jsonld"),
        ("demo/campaign.yaml", "{NAME}"),
        ("first", "traces"),
        ("{TRACE}", "traces"),
        ("{TRACE}", "picture", "-o", "out/{NAME}.svg"),
    ),
    "vary": (("flat{NAME}.variation",),),
    "schema": (("{NAME}",), ("--vscode", "taken/{NAME}")),
    "sut show": (("sut{NAME}.yaml",), ("fro-omni{NAME}",)),
    "sut check": (("sut{NAME}.yaml",), ("{NAME}",)),
    "sut relay": ((),),
    "keys init": (("keys{NAME}",), ("--host", "{NAME}")),
    "keys issue": (("viewer", "me{NAME}"),),
    "keys list": (("keys{NAME}",), ()),
    "keys revoke": (("me{NAME}",),),
    "keys bundle": (("me{NAME}", "-o", "{NAME}.tar"),),
}
"""What is typed about hostile things, for every command."""
QUIET = {"sut relay", "tui"}
"""Commands that may say nothing of what is poisoned."""


def commands():
    """Return every command with the words that call it."""

    def walk(command, words):
        inner = getattr(command, "commands", None)
        if inner is None:
            yield " ".join(words), command
        for name, one in (inner or {}).items():
            yield from walk(one, (*words, name))

    for name in COMMANDS:
        yield from walk(load_command(name), (name,))


@dataclass(frozen=True)
class Place:
    """A folder full of hostile files, and how to type in it on a terminal."""

    folder: Path
    type: Callable[..., tuple[int, bytes]]


@pytest.fixture(scope="module")
def place(tmp_path_factory, campaigns):
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
        chosen = {"{NAME}": NAME, "{TRACE}": str(trace), "{FOREIGN}": str(foreign)}
        arguments = list(words)
        for wanted, text in chosen.items():
            arguments = [one.replace(wanted, text) for one in arguments]
        return typed_here(partial(invoke, arguments))

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
        yield Place(folder, typed)


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


def test_every_command_is_tried():
    assert set(CASES) == {words for words, _ in commands()}


@pytest.mark.parametrize("command", CASES)
def test_nothing_that_a_command_shows_steers_the_terminal(place, command):
    seen = ""
    for words in CASES[command]:
        _, raw = place.type(*command.split(), *words)
        seen += assert_harmless(raw)
    assert WORD in seen or command in QUIET


def test_neither_do_complaints_about_what_was_typed(place):
    for words, _ in commands():
        code, raw = place.type(*words.split(), f"--{NAME}")
        assert code == 2
        assert WORD in assert_harmless(raw)


def test_help_keeps_its_colours(place):
    # A stream lets no styles through: help goes around it, which these classes see to.
    assert {type(command) for _, command in commands()} == {PlainFlagsCommand}
    for words in ((), ("status",), ("sut",), ("keys", "issue")):
        code, raw = place.type(*words, "--help")
        assert code == 0
        assert b"\x1b[1m" in raw
        assert "\N{REPLACEMENT CHARACTER}" not in assert_harmless(raw)


def test_neither_do_the_files_of_a_report(place):
    page, junit = (place.folder / "out" / f"report.{ending}" for ending in ("html", "xml"))
    page.parent.mkdir(exist_ok=True)
    code, _ = place.type("report", "traces", "-o", str(page), "--junit", str(junit))
    assert code == 0
    ElementTree.parse(junit)
    for file in (page, junit):
        assert WORD in assert_harmless(file.read_bytes())


def test_what_daemons_and_workers_say_in_processes_of_their_own(place):
    for process, order in (
        ("worker", {"connect": f"tcp/{NAME}"}),
        ("serve", {"state": f"/dev/null/{NAME}"}),
    ):
        command = [sys.executable, "-m", "daemon", process, json.dumps(order)]
        said = subprocess.run(command, capture_output=True, check=False, cwd=ROOT)
        assert said.returncode == 3
        assert WORD in assert_harmless(said.stderr)
