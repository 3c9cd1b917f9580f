"""Command lines that do what the dashboard does, for the daemon it looks at."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

_PROGRAM: Final = "from scenario_tui.cli import main; main()"


@dataclass(frozen=True, slots=True)
class Equivalent:
    """How the dashboard was told which daemon it is about; empty when it was not."""

    connect: str = ""
    state: Path | None = None

    @property
    def _daemon(self) -> tuple[str, ...]:
        return (*self._named("--connect", self.connect), *self._named("--state", self.state))

    @staticmethod
    def _named(option: str, value: object) -> tuple[str, ...]:
        return (option, str(value)) if value else ()

    def line(self, command: str, *arguments: str) -> str:
        """Return the command line of something the daemon is asked for."""
        # A negative number is no option: it must come last, behind a bare --.
        last = ("--", arguments[-1]) if _negative(arguments) else ()
        plain = arguments[:-1] if last else arguments
        return shlex.join(("scenario", command, *plain, *self._daemon, *last))

    def local(self, state: Path, command: str, *arguments: str) -> tuple[str, ...]:
        """Return the arguments of something done here, on the state directory ``state``."""
        from daemon.places import Places

        told = self.state or (None if Places.find().state == state else state)
        return (command, *arguments, *self._named("--state", told))


def _negative(arguments: tuple[str, ...]) -> bool:
    return bool(arguments) and arguments[-1][:1] == "-" and arguments[-1][1:].isdigit()


def typed(arguments: tuple[str, ...]) -> str:
    """Return what to type for these arguments."""
    return shlex.join(("scenario", *arguments))


def process(arguments: tuple[str, ...]) -> list[str]:
    """Return how to start this installation's ``scenario`` with these arguments."""
    return [sys.executable, "-c", _PROGRAM, *arguments]
