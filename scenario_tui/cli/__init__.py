"""The ``scenario`` command: one public module for each group of commands.

Heavy libraries are imported inside the commands, so that help and completion stay fast: at TAB
people wait for every import. The functions of commands are as long as their options, which typer
reads from the signature.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from scenario_tui.interrupts import remember_interrupts, was_interrupted

_INTERRUPTED = 130
"""ExitCode.INTERRUPTED, which takes typer to load."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    # Before the first library is loaded: people press Ctrl-C when a command is slow to start.
    remember_interrupts()
    try:
        from scenario_tui.cli import command_line

        command_line.main(arguments)
    except KeyboardInterrupt:
        sys.exit(_INTERRUPTED)
    except Exception:
        # A library that was interrupted may raise anything.
        if was_interrupted():
            sys.exit(_INTERRUPTED)
        raise


def invoke(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit code; every error has been reported."""
    from scenario_tui.cli import command_line

    return command_line.invoke(arguments)
