"""Commands of ``scenario``: their lines, for people to type, and those the dashboard runs."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

from daemon.batch.errors import DaemonError
from daemon.model.execution import python_command
from grammars.text.words import command_line

_ERROR: Final = "scenario/error/1"
_PROGRAM: Final = "from scenario_tui.cli import main; main()"
CommandAnswer: TypeAlias = Mapping[str, Any]
CommandRunner: TypeAlias = Callable[[tuple[str, ...]], CommandAnswer]
"""Runs ``scenario`` with arguments and ``--json``; returns the object it wrote."""


@dataclass(frozen=True, slots=True)
class CommandLines:
    """How the dashboard was told which daemon it is about; empty when it was not."""

    connect: str = ""
    state: Path | None = None

    @property
    def _daemon(self) -> tuple[str, ...]:
        return (*self._named("--connect", self.connect), *self._named("--state", self.state))

    @staticmethod
    def _named(option: str, value: object) -> tuple[str, ...]:
        return (option, str(value)) if value else ()

    def daemon_line(self, command: str, *arguments: str) -> str:
        """Return the command line of something the daemon is asked for."""
        # A negative number is no option: it must come last, behind a bare --.
        last = ("--", arguments[-1]) if _negative(arguments) else ()
        plain = arguments[:-1] if last else arguments
        return command_line(command, *plain, *self._daemon, *last)

    def local_arguments(self, state: Path, command: str, *arguments: str) -> tuple[str, ...]:
        """Return the arguments of something done here, on the state directory ``state``."""
        from daemon.batch.paths import StatePaths

        # Named when it is not the one found without: what is told to be typed shall be short.
        state_option = self.state or (None if StatePaths.find().state == state else state)
        return (command, *arguments, *self._named("--state", state_option))


def _negative(arguments: tuple[str, ...]) -> bool:
    return bool(arguments) and arguments[-1][:1] == "-" and arguments[-1][1:].isdigit()


def command_argv(arguments: tuple[str, ...]) -> list[str]:
    """Return how to start this installation's ``scenario`` with these arguments."""
    return python_command("-c", _PROGRAM, *arguments)


def run_command(arguments: tuple[str, ...]) -> CommandAnswer:
    """Run a command and return what it wrote.

    It goes on when the dashboard is left. Raises :class:`daemon.batch.errors.DaemonError` with its
    last words when it wrote nothing usable.
    """
    done = subprocess.run(
        command_argv((*arguments, "--json")),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        start_new_session=True,
        # Its last words become a notice: in one line, without colours, and in its own session it
        # does not hear Ctrl-C or that the terminal was closed.
        env=os.environ | {"COLUMNS": "160", "TERM": "dumb"},
    )
    try:
        answer: CommandAnswer = json.loads(done.stdout)
    except ValueError as error:
        said = [line for line in done.stderr.splitlines() if line.strip()]
        last = said[-1] if said else f"it left with code {done.returncode}"
        message = f"{command_line(*arguments)}: {last.removeprefix('scenario: ')}"
        raise DaemonError(message) from error
    if answer.get("schema") == _ERROR:
        raise DaemonError(f"{command_line(*arguments)}: {answer['error']}")
    return answer
