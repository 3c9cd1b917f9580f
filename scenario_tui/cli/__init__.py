"""The ``scenario`` command: one module for each group of commands.

Heavy libraries are imported inside the commands, so that help and completion stay fast.
"""

from scenario_tui.cli._main import app, main

__all__ = ["app", "main"]
