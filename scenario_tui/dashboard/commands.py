"""Commands of ``scenario`` that the dashboard runs in processes."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias

from daemon.batch.errors import DaemonError
from daemon.model.execution import python_command
from grammars.text.words import command_line

_ERROR: Final = "scenario/error/1"
CommandAnswer: TypeAlias = Mapping[str, Any]
CommandRunner: TypeAlias = Callable[[tuple[str, ...]], CommandAnswer]
"""Runs ``scenario`` with arguments and ``--json``; returns the object it wrote."""


def run_command(arguments: tuple[str, ...]) -> CommandAnswer:
    """Run a command and return the object it wrote.

    The command continues if the user leaves the dashboard. Raises
    :class:`daemon.batch.errors.DaemonError` with its last words if it wrote no object.
    """
    done = subprocess.run(
        python_command("-c", "from scenario_tui.cli import main; main()", *arguments, "--json"),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        start_new_session=True,
        # Its last words become a notice: in one line, without colours.
        env=os.environ | {"COLUMNS": "160", "TERM": "dumb"},
    )
    try:
        answer: CommandAnswer = json.loads(done.stdout)
    except ValueError as error:
        words = [line for line in done.stderr.splitlines() if line.strip()]
        last = words[-1] if words else f"it left with code {done.returncode}"
        message = f"{command_line(*arguments)}: {last.removeprefix('scenario: ')}"
        raise DaemonError(message) from error
    if answer.get("schema") == _ERROR:
        raise DaemonError(f"{command_line(*arguments)}: {answer['error']}")
    return answer
