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
from scenario_tui.cli.examples import EXAMPLES

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
        "import": "Make a building, NAME.walls.yaml, from a robot's map or a drawing (DXF).",
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
    from scenario_tui.cli.answer import as_typed

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
