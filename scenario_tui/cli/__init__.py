"""The ``scenario`` command: one public module for each group of commands.

Heavy libraries are imported inside the commands, so that help and completion stay fast: at TAB
people wait for every import. The functions of commands are as long as their options, which typer
reads from the signature.
"""

from scenario_tui.cli.command_line import app, invoke, main

__all__ = [
    "app",
    "invoke",
    "main",
]
