"""The commands before one is called: a name, the panel of help it stands in, a line about it.

Help and completion need no more than this table, so that a command loads its own module and no
other. A test holds every line to the first sentence of the command it is about.
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
        "new": "Write a small campaign that runs, to change into yours.",
        "check": "Find every problem of campaigns and layers.",
        "run": "Run a campaign here and now, without a daemon.",
        "submit": "Hand a campaign to the daemon, watch it if you like.",
        "search": "Search for values that make a scenario fail, and for the failure nearest to it.",
        "wait": "Wait until a campaign is over, and leave with its exit code.",
        "serve": "Let a scenario's world go on by the clock: drive in it, look at it, connect a "
        "stack to it.",
        "sut": "Show a system under test, or start an external one and see what it lacks.",
    },
    "Look": {
        "tui": "Open the dashboard; leaving it never stops any work.",
        "status": "Say how everything stands: daemon, workers, campaigns.",
        "results": "Show what came out of a campaign: every cell, what is not as expected and why.",
        "show": "Show one run: what each oracle says and why, or what happened in it.",
        "replay": "Watch a recorded run from above, with what its oracles say, or two of them "
        "side by side.",
        "plot": "Draw signals of a recorded run over time, with the moments that decided against "
        "it.",
    },
    "Understand": {
        "judge": "Judge recorded runs again and say which verdicts differ; traces stay as they "
        "are.",
        "verify": "Run specifications twice and say whether the bytes are the same, or where they "
        "part.",
        "compare": "Compare two campaigns: verdicts, margins, measures, cell by cell.",
        "report": "Write a campaign or a search as one page with figures, a campaign as tables, "
        "too.",
        "coverage": "Say which features a campaign exercises, and which it does not.",
        "blame": "Find the layer or parameter that makes a run fail, and the least that still "
        "fails.",
    },
    "Steer": {
        "cancel": "Cancel what is queued or running of a campaign.",
        "retry": "Queue lost or cancelled runs of a campaign again.",
        "acknowledge": "Note that you know what went wrong in a campaign; the dashboard tells what "
        "is new.",
        "pause": "Start no more runs of a campaign, or go on with it.",
        "priority": "Let a campaign go before those of lower priority.",
        "delete": "Remove campaigns for good: runs, results, and traces that no other campaign "
        "uses.",
    },
    "Machines": {
        "daemon": "Run the daemon in the foreground, or end it.",
        "worker": "Run a worker in the foreground.",
        "keys": "Make the keys with which machines prove to each other who they are.",
    },
    "Operate": {
        "doctor": "Say what is configured, what answers, and what is wrong, each with its remedy.",
        "gc": "Remove what nobody needs, and traces of finished campaigns, the oldest first.",
    },
    "Artefacts": {
        "import": "Make a building, NAME.walls.yaml, of the map of a robot or of a drawing (DXF).",
        "export": "Write artefacts of a building, a campaign or a run: maps, worlds, pictures, "
        "traces, …",
        "vary": "Write variants of a floor plan, drawn from distributions.",
    },
    "Editors": {
        "schema": "Print or write what editors use: JSON Schemas of YAML files, the VS Code "
        "extension.",
    },
}
"""Help shows commands in this order, in panels of these names."""

COMMANDS: Final = {
    name: (panel, about) for panel, lines in _PANELS.items() for name, about in lines.items()
}
_MODULES: Final = {
    **dict.fromkeys(("cancel", "retry", "acknowledge", "pause", "priority", "delete"), "steer"),
    "demo": "run",
    "wait": "submit",
    "import": "import_",
}
"""The module of a command that is not in one of its own name."""


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
        """Print the help, whose words are all ours, in colours."""
        # typer joins the lines of the first paragraph only.
        paragraphs = inspect.cleandoc(self.help or "").split("\n\n")
        self.help: str | None = "\n\n".join(" ".join(one.split()) for one in paragraphs)
        # rich, which typer prints it with, writes its styles as text of this stream.
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
    """All our commands; help and completion list them without loading any."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = {
            name: TyperCommand(name=name, help=about, rich_help_panel=panel)
            for name, (panel, about) in COMMANDS.items()
        }

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Return the command that is called, by its name; only that one is loaded."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, command and load_command(command.name or ""), rest
