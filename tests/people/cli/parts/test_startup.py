"""What commands load: as little as they need, for people wait for every import."""

import inspect
import subprocess
import sys

import pytest

from scenario_tui._own_packages import OWN_PACKAGES
from scenario_tui.cli.commands import COMMANDS, load_command
from tests.parts import ROOT

FEW = {
    "cmaes", "dask", "jinja2", "matplotlib", "mcap", "numba", "optuna", "pyarrow", "pymunk",
    "rdflib", "rosbags", "scipy", "sqlalchemy", "textual",
}  # fmt: skip
"""Libraries that few commands need."""
LANGUAGES = {"numpy", "shapely", "textx"}
BUS = {"zenoh", "cryptography"}
HEAVY = FEW | LANGUAGES | BUS | {"pydantic"}
SEARCH = {"daemon.search", "cmaes", "optuna", "sqlalchemy"}


def typed(words, code):
    return (
        "from scenario_tui.cli.command_line import invoke\n"
        f"assert invoke({words.split()!r}) == {code}"
    )


EVERY_COMMAND = """
from scenario_tui.cli.commands import COMMANDS, load_command
for name in COMMANDS:
    load_command(name)
"""
COMPLETION = """
import os
from scenario_tui.cli.command_line import invoke
typed = {"_SCENARIO_COMPLETE": "complete_bash", "COMP_WORDS": "scenario\\nreplay\\n",
         "COMP_CWORD": "2"}
os.environ |= typed
invoke([])
for name in typed:
    del os.environ[name]
"""
FIRST_SCREEN = """
import scenario_tui.cli.tui, scenario_tui.source, scenario_tui.dashboard.key_bindings
from pathlib import Path
from scenario_tui.dashboard.app import Dashboard
from scenario_tui.dashboard.config import read_config
from scenario_tui.dashboard.feed import Feed
Dashboard(Feed(None), config=read_config(Path("/nowhere/config.toml")))
"""
STEPS = {
    "words": (
        # Pytest loads it in every project, whose packages may have names of ours.
        ("import scenario_tui_pytest", {"scenario_tui", *OWN_PACKAGES}),
        ("import scenario_tui", HEAVY | {"rich", *OWN_PACKAGES}),
        ("import scenario_tui.cli", HEAVY | {"rich.console"}),
        # Help and completion load a command, and print no more than its options.
        (EVERY_COMMAND, HEAVY | {"rich.console", "daemon.model.status"}),
        (typed("--help", 0), HEAVY),
        # typer itself checks what stands before the word with pydantic.
        (COMPLETION, HEAVY - {"pydantic"}),
        (typed("status", 3), FEW | LANGUAGES | BUS),
        (typed("results nothing", 2), FEW | LANGUAGES | BUS),
        (typed("search", 3), FEW | LANGUAGES),
    ),
    "files": (
        (typed("check campaigns/demo/flat.fpm", 0), FEW | BUS | {"daemon.campaign"}),
        (typed("sut show campaigns/suts/a2s.yaml", 0), FEW | BUS),
        (typed("check campaigns/ortega2024/first.yaml", 0), FEW | BUS | SEARCH),
        (
            typed("check campaigns/demo/campaign.yaml", 0),
            FEW | BUS | {"daemon.model.messages", "grammars.variation"},
        ),
        (typed("export campaigns/demo/flat.fpm mesh -o OUT", 0), BUS),
    ),
    "screen": (
        (FIRST_SCREEN, (HEAVY - {"textual"}) | {"daemon.model.spec", "daemon.model.status"}),
        (
            "import scenario_tui.library.job",
            {"daemon.batch.ledger", "daemon.trace", "mcap", "numpy"},
        ),
    ),
    "execution": (("import daemon.batch.server, daemon.batch.worker, daemon.run", SEARCH),),
}
"""Programs, each behind the one before, and what none may have loaded by then."""
LEAVE = "from scenario_tui.cli import main\nmain(['--version'])"


@pytest.mark.parametrize("name", STEPS)
def test_nothing_is_loaded_that_is_not_needed(name, monkeypatch, tmp_path):
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path))
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    steps = (f"{code}\nprint('\\nloaded', *sys.modules)" for code, _ in STEPS[name])
    program = "\n".join(("import sys", *steps, LEAVE)).replace("OUT", str(tmp_path))
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    lines = [one.split() for one in done.stdout.splitlines() if one.startswith("loaded ")]
    for (code, unneeded), loaded in zip(STEPS[name], lines, strict=True):
        assert len(loaded) > 50
        assert not unneeded.intersection(loaded), code
    assert not done.stderr.count("nanobind"), "a library of meshes says what it leaks"


def test_help_says_of_a_command_what_the_command_says():
    for name, (_, about) in COMMANDS.items():
        command = load_command(name)
        said = inspect.cleandoc(command.help or "").partition("\n\n")[0]
        assert about == " ".join(said.split()), name
        assert command.name == name


def test_an_option_has_one_long_name():
    groups = [load_command(name) for name in COMMANDS]
    groups += [one for group in groups for one in getattr(group, "commands", {}).values()]
    for command in groups:
        for option in command.params:
            assert sum(name.startswith("--") for name in option.opts) <= 1, option.opts
