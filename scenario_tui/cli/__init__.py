"""The ``scenario`` command: one public module for each group of commands.

Heavy libraries are imported inside the commands, so that help and completion stay fast.
"""

from scenario_tui.cli.command_line import app, invoke, main

__all__ = [
    "app",
    "invoke",
    "main",
]
