"""What the command line knows of its commands before one is called: a name, a module, a line.

Help and completion need no more than this table, so that a command loads its own module and no
other. A test holds every line to the first sentence of the command it is about.
"""

from __future__ import annotations

from collections import UserDict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, Final

import typer
from typer.core import TyperCommand

from scenario_tui.cli.plain_flags import PlainFlagsCommand, PlainFlagsGroup


@dataclass(frozen=True)
class CommandEntry:
    """A command: the function or group ``attribute`` of a ``module`` of ours, and what help says.

    The function is called as the command is unless ``attribute`` says otherwise.
    """

    name: str
    module: str
    summary: str
    attribute: str = ""


_PANELS: Final[dict[str, tuple[CommandEntry, ...]]] = {
    "Run campaigns": (
        CommandEntry(
            "demo",
            "run_campaigns",
            "Show everything once: a robot, moving doors, verdicts.",
        ),
        CommandEntry("new", "begin", "Write a small campaign that runs, to change into yours."),
        CommandEntry("check", "run_campaigns", "Find every problem of campaigns and layers."),
        CommandEntry("run", "run_campaigns", "Run a campaign here and now, without a daemon."),
        CommandEntry(
            "submit",
            "run_campaigns",
            "Hand a campaign to the daemon, watch it if you like.",
        ),
        CommandEntry(
            "search",
            "search",
            "Search for values that make a scenario fail, and for the failure nearest to it.",
        ),
        CommandEntry(
            "wait",
            "run_campaigns",
            "Wait until a campaign is over, and leave with its exit code.",
        ),
        CommandEntry(
            "serve",
            "serve",
            "Let a scenario's world go on by the clock: drive in it, look at it, connect a stack "
            "to it.",
        ),
        CommandEntry(
            "sut",
            "sut",
            "Show a system under test, or start an external one and see what it lacks.",
            "sut_app",
        ),
    ),
    "Look": (
        CommandEntry("tui", "tui", "Open the dashboard; leaving it never stops any work."),
        CommandEntry("status", "status", "Say how everything stands: daemon, workers, campaigns."),
        CommandEntry(
            "results",
            "look",
            "Show what came out of a campaign: every cell, what is not as expected and why.",
        ),
        CommandEntry(
            "show",
            "look",
            "Show one run: what each oracle says and why, or what happened in it.",
        ),
        CommandEntry(
            "replay",
            "recorded_runs",
            "Watch a recorded run from above, with what its oracles say, or two of them side by "
            "side.",
        ),
        CommandEntry(
            "plot",
            "recorded_runs",
            "Draw signals of a recorded run over time, with the moments that decided against it.",
        ),
    ),
    "Understand": (
        CommandEntry(
            "judge",
            "judge",
            "Judge recorded runs again and say which verdicts differ; traces stay as they are.",
        ),
        CommandEntry(
            "verify",
            "verify",
            "Run specifications twice and say whether the bytes are the same, or where they part.",
        ),
        CommandEntry(
            "compare",
            "compare",
            "Compare two campaigns: verdicts, margins, measures, cell by cell.",
        ),
        CommandEntry(
            "report",
            "report",
            "Write a campaign or a search as one page with figures, a campaign as tables, too.",
        ),
        CommandEntry(
            "coverage",
            "coverage",
            "Say which features a campaign exercises, and which it does not.",
        ),
        CommandEntry(
            "blame",
            "blame",
            "Find the layer or parameter that makes a run fail, and the least that still fails.",
        ),
    ),
    "Steer": (
        CommandEntry("cancel", "steer", "Cancel what is queued or running of a campaign."),
        CommandEntry("retry", "steer", "Queue lost or cancelled runs of a campaign again."),
        CommandEntry("pause", "steer", "Start no more runs of a campaign, or go on with it."),
        CommandEntry("priority", "steer", "Let a campaign go before those of lower priority."),
        CommandEntry(
            "delete",
            "steer",
            "Remove campaigns for good: runs, results, and traces that no other campaign uses.",
        ),
    ),
    "Machines": (
        CommandEntry("daemon", "machines", "Run the daemon in the foreground, or end it."),
        CommandEntry("worker", "machines", "Run a worker in the foreground."),
        CommandEntry(
            "keys",
            "keys",
            "Make the keys with which machines prove to each other who they are.",
            "keys_app",
        ),
    ),
    "Operate": (
        CommandEntry(
            "doctor",
            "operate",
            "Say what is configured, what answers, and what is wrong, each with its remedy.",
        ),
        CommandEntry(
            "gc",
            "operate",
            "Remove what nobody needs, and traces of finished campaigns, the oldest first.",
        ),
    ),
    "Artefacts": (
        CommandEntry(
            "import",
            "import_building",
            "Make a building, NAME.walls.yaml, of the map of a robot or of a drawing (DXF).",
            "import_building",
        ),
        CommandEntry(
            "export",
            "export",
            "Write artefacts of a building, a campaign or a run: maps, worlds, pictures, traces, …",
        ),
        CommandEntry("vary", "vary", "Write variants of a floor plan, drawn from distributions."),
    ),
    "Editors": (
        CommandEntry(
            "schema",
            "editors",
            "Print or write what editors use: JSON Schemas of YAML files, the VS Code extension.",
        ),
    ),
}
"""Help shows commands in this order, in panels of these names."""

COMMANDS: Final[dict[str, CommandEntry]] = {
    entry.name: entry for entries in _PANELS.values() for entry in entries
}
_PANEL_OF: Final = {entry.name: panel for panel, entries in _PANELS.items() for entry in entries}


@cache
def load_command(entry: CommandEntry) -> Any:
    """Import a command and return it as typer calls it."""
    module = import_module(f"scenario_tui.cli.{entry.module}")
    found = getattr(module, entry.attribute or entry.name)
    if not isinstance(found, typer.Typer):
        from scenario_tui.cli.options import with_keys_option

        alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        alone.command(entry.name, cls=PlainFlagsCommand)(with_keys_option(found))
        found = alone
    return typer.main.get_command(found)


class _Commands(UserDict[str, Any]):
    """Commands by name, each made when it is asked for."""

    def __getitem__(self, name: str) -> Any:
        found = self.data[name]
        return load_command(found) if isinstance(found, CommandEntry) else found


class CommandGroup(PlainFlagsGroup):
    """All our commands; help and completion list them without loading any."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = _Commands(COMMANDS)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands in the order of help."""
        return list(self.commands)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help."""
        with self._summaries():
            super().format_help(ctx, formatter)

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Return the commands and options that begin so."""
        with self._summaries():
            return super().shell_complete(ctx, incomplete)

    @contextmanager
    def _summaries(self) -> Iterator[None]:
        """Have every command be its name and its line, while none is called."""
        whole = self.commands
        self.commands = {
            entry.name: TyperCommand(
                name=entry.name, help=entry.summary, rich_help_panel=_PANEL_OF[entry.name]
            )
            for entry in COMMANDS.values()
        }
        try:
            yield
        finally:
            self.commands = whole
