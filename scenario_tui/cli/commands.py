"""Table of the commands: the name, the panel of the help, a line about it.

Help and completion need only this table, so a command loads its own module and no other. A test
compares every line with the first sentence of its command.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import cache
from importlib import import_module
from keyword import iskeyword
from typing import Any, Final, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from grammars.text.terminal_text import unfiltered

C = TypeVar("C", bound=Callable[..., Any])

_PANELS: Final[dict[str, dict[str, str]]] = {
    "Run campaigns": {
        "demo": "Show everything once: a robot, moving doors, verdicts.",
        "new": "Write a small campaign that runs, for you to change.",
        "check": "Find every problem in campaigns and layers.",
        "run": "Run a campaign here and now, without a daemon.",
        "submit": "Submit a campaign to the daemon, and watch it with --watch.",
        "search": "Search for values that make a scenario fail, and for the nearest failure.",
        "wait": "Wait until a campaign ends, and exit with its code.",
        "serve": "Run the world of a scenario live: drive in it, watch it, connect a stack to it.",
        "sut": "Show a system under test, or start an external one and see what it lacks.",
    },
    "Look": {
        "tui": "Open the dashboard; leaving it never stops any work.",
        "status": "Show the state of the daemon, its workers and its campaigns.",
        "results": "Show the results of a campaign: every cell, and why cells are not as expected.",
        "show": "Show one run: the verdict of each oracle and its reason, or the log.",
        "replay": "Watch a recorded run from above with its verdicts, or two runs side by side.",
        "plot": "Draw signals of a recorded run over time, and mark the moments of failures.",
    },
    "Understand": {
        "judge": "Judge recorded runs again and list the verdicts that differ.",
        "verify": "Run specifications twice and compare the traces byte by byte.",
        "compare": "Compare two campaigns: verdicts, margins, measures, cell by cell.",
        "report": "Write a report of a campaign or a search: one page with figures.",
        "coverage": "List the features that a campaign exercises, and those that it does not.",
        "blame": "Find the layer or parameter that makes a run fail, and the smallest failing "
        "scenario.",
    },
    "Steer": {
        "cancel": "Cancel the queued and running runs of a campaign.",
        "retry": "Queue lost or cancelled runs of a campaign again.",
        "acknowledge": "Mark the failures of a campaign as seen; the dashboard then shows new ones "
        "only.",
        "pause": "Start no more runs of a campaign, or continue it with --off.",
        "priority": "Set the priority of a campaign; a higher one runs first.",
        "delete": "Delete campaigns: runs, results, and traces that no other campaign uses.",
    },
    "Machines": {
        "daemon": "Run the daemon in the foreground, or stop it.",
        "worker": "Run a worker in the foreground.",
        "keys": "Manage the keys by which machines authenticate each other.",
    },
    "Operate": {
        "doctor": "Examine the installation: settings, connections, results; with remedies.",
        "gc": "Remove unused files, and the oldest traces of finished campaigns.",
    },
    "Artefacts": {
        "import": "Make a building, NAME.walls.yaml, from a map, a drawing (DXF) or a picture.",
        "export": "Write artefacts of a building, a campaign or a run: maps, worlds, pictures, "
        "traces, …",
        "vary": "Write variants of a floor plan, drawn from distributions.",
    },
    "Editors": {
        "schema": "Print or write files for editors: JSON Schemas, the VS Code extension.",
    },
}
"""Lines about the commands by the panel of the help, in its order."""

COMMANDS: Final = {
    name: (panel, about) for panel, lines in _PANELS.items() for name, about in lines.items()
}
_MODULES: Final = {
    **dict.fromkeys(("cancel", "retry", "acknowledge", "pause", "priority", "delete"), "steer"),
    "demo": "run",
    "wait": "submit",
    "import": "import_",
}
"""Modules of the commands whose module has another name."""

EXAMPLES: Final[dict[str, tuple[str, ...]]] = {
    "demo": ("scenario demo",),
    "new": (
        "scenario new my-tests",
        "scenario new my-office --floorplan flat.fpm",
        "scenario new --layers",
    ),
    "check": ("scenario check campaign.yaml", "scenario check flat.fpm doors.scenery"),
    "run": (
        "scenario run campaign.yaml",
        "scenario run campaign.yaml --out results --junit results.xml",
    ),
    "submit": ("scenario submit campaign.yaml", "scenario submit campaign.yaml --fresh --watch"),
    "search": (
        "scenario search campaign.yaml doors-in-time --budget 4 --detach",
        "scenario search",
    ),
    "wait": ("scenario wait nightly --timeout 10min",),
    "serve": ("scenario serve campaign.yaml --scenario open-house --headless",),
    "sut show": ("scenario sut show pilot", "scenario sut show pilot --json"),
    "sut check": ("scenario sut check my_stack.yaml",),
    "sut relay": ("scenario sut relay > relay.py",),
    "tui": ("scenario tui", "scenario tui --read-only", "scenario tui --bindings"),
    "status": ("scenario status", "scenario status --json"),
    "results": (
        "scenario results",
        "scenario results nightly --runs",
        "scenario results nightly --outcome fail --json",
        "scenario results nightly --table nightly.parquet",
    ),
    "show": ("scenario show nightly.0", "scenario show nightly.0 --log"),
    "replay": ("scenario replay nightly.0", "scenario replay nightly.0 --frame 5"),
    "plot": ("scenario plot nightly.0 clearance speed",),
    "judge": ("scenario judge nightly.0", "scenario judge nightly.0 --json"),
    "verify": ("scenario verify nightly.0",),
    "compare": ("scenario compare nightly nightly",),
    "report": (
        "scenario report nightly",
        "scenario report nightly -o nightly.html --junit nightly.xml",
    ),
    "coverage": ("scenario coverage nightly", "scenario coverage campaign.yaml"),
    "blame": ("scenario blame nightly.1 --runs 10",),
    "cancel": ("scenario cancel nightly",),
    "retry": ("scenario retry nightly", 'scenario retry nightly --only "fail|error"'),
    "acknowledge": ("scenario acknowledge nightly",),
    "pause": ("scenario pause nightly", "scenario pause nightly --off"),
    "priority": ("scenario priority nightly 5", "scenario priority nightly -- -5"),
    "delete": ("scenario delete nightly --dry-run",),
    "daemon": (
        "scenario daemon",
        "scenario daemon --listen tls/0.0.0.0:7447 --slots 0",
        "scenario daemon --print-unit",
        "scenario daemon --stop",
    ),
    "worker": (
        "scenario worker --connect tls/build.example:7447 -j 8",
        "scenario worker --connect tls/build.example:7447 --print-unit",
    ),
    "keys init": ("scenario keys init my-keys --host build.example",),
    "keys issue": ("scenario keys issue viewer wall-screen --keys my-keys",),
    "keys list": ("scenario keys list --keys my-keys",),
    "keys bundle": ("scenario keys bundle worker -o worker.tar --keys my-keys",),
    "keys revoke": ("scenario keys revoke viewer.wall-screen --keys my-keys",),
    "doctor": ("scenario doctor --quick", "scenario doctor --quick --json"),
    "gc": ("scenario gc --dry-run", "scenario gc --older-than 30d --max-size 20GiB --dry-run"),
    "import": ("scenario import map.yaml -o home", "scenario import map.yaml -o home --force"),
    "export": (
        "scenario export flat.fpm jsonld picture",
        "scenario export campaign.yaml map sdf -o artefacts",
        "scenario export nightly.0 picture --from 2 --until 6 -o part.svg",
        "scenario export nightly traces -o traces",
    ),
    "vary": ("scenario vary flat.variation -n 3 --seed 7 -o variants",),
    "schema": (
        "scenario schema campaign",
        "scenario schema --outputs",
        "scenario schema --vscode .",
    ),
}
"""Examples by the words of the command, below its help: lines to copy.

The tests execute each of them in a folder with a campaign file ``campaign.yaml``, submitted as
``nightly``, a floor plan ``flat.fpm``, and the output of earlier lines.
"""


class _PlainFlags:
    """Shows flags without the ``<bool>`` that typer puts behind them, and help in colours."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters as help shows them."""
        parameters: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        for one in parameters:
            if isinstance(one, TyperOption) and one.is_flag and one.metavar is None:
                one.metavar = ""
        return parameters

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help in colours; all of its text is ours."""
        # typer joins the lines of the first paragraph only.
        paragraphs = inspect.cleandoc(self.help or "").split("\n\n")
        self.help: str | None = "\n\n".join(" ".join(one.split()) for one in paragraphs)
        # typer prints by rich, which writes its styles as text of this stream.
        with redirect_stdout(unfiltered(sys.stdout)):
            super().format_help(ctx, formatter)  # type: ignore[misc]


class PlainFlagsCommand(_PlainFlags, TyperCommand):
    """A command whose flags are shown without ``<bool>``."""


class PlainFlagsGroup(_PlainFlags, TyperGroup):
    """A group of commands whose flags are shown without ``<bool>``."""


@cache
def load_command(name: str) -> Any:
    """Import a command and return it as typer calls it."""
    module = import_module(f"scenario_tui.cli.{_MODULES.get(name, name)}")
    # A group of commands is the ``app`` of its module.
    group = getattr(module, "app", None)
    if group is not None:
        return typer.main.get_command(group)
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    command_of(alone, name)(getattr(module, f"{name}_" if iskeyword(name) else name))
    return typer.main.get_command(alone)


def command_of(group: typer.Typer, name: str) -> Callable[[C], C]:
    """Return a decorator that adds a function as the command ``name`` of a group."""
    from scenario_tui.cli.options import as_typed

    lines = EXAMPLES.get(" ".join(filter(None, (str(group.info.name or ""), name))), ())
    # typer prints a line for each paragraph.
    epilog = "\n\n".join(("Examples:", *lines)) if lines else None

    def add(command: C) -> C:
        typed = as_typed(command)
        group.command(name, cls=PlainFlagsCommand, epilog=epilog)(typed)
        return command

    return add


class CommandGroup(PlainFlagsGroup):
    """All commands; help and completion list them without loading any."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = {
            name: TyperCommand(name=name, help=about, rich_help_panel=panel)
            for name, (panel, about) in COMMANDS.items()
        }

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Return the name and the called command, the only one that is loaded."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, command and load_command(command.name or ""), rest
