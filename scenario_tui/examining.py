"""Checking and preparing campaigns apart from the dashboard: ``python -m scenario_tui.examining``.

What reads the languages takes 100 MB and keeps a core busy; the dashboard stays small and quick
when a process of its own does it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

from daemon.errors import DaemonError
from daemon.protocol import Submission
from grammars import codec
from grammars.diagnostics import Diagnostic, InputError

_SUBMIT: Final = "--submit"
_FRESH: Final = "--fresh"


@dataclass(frozen=True, slots=True)
class Examined:
    """What a file is in a few words, what was found, and what to hand over if that was asked for
    and nothing stands against it.
    """

    about: str = ""
    findings: tuple[Diagnostic, ...] = ()
    submission: Submission | None = None


class Examine(Protocol):
    """How a campaign file is examined; ``submit`` asks for what to hand over."""

    def __call__(self, path: Path, *, submit: bool = False, fresh: bool = False) -> Examined: ...  # noqa: D102


def examine(path: Path, *, submit: bool = False, fresh: bool = False) -> Examined:
    """Examine a file in this process."""
    from scenario_tui.cli._check import checked
    from scenario_tui.preparing import prepare

    if not submit:
        return Examined(*checked(path))
    try:
        submission, warnings = prepare(path, fresh=fresh)
    except InputError as error:
        return Examined("", error.diagnostics)
    return Examined("", warnings, submission)


def examine_apart(path: Path, *, submit: bool = False, fresh: bool = False) -> Examined:
    """Examine a file in another process.

    Raises :class:`daemon.errors.DaemonError` with its last words when it answers nothing.
    """
    options = [*([_SUBMIT] if submit else []), *([_FRESH] if fresh else [])]
    done = subprocess.run(
        [sys.executable, "-m", "scenario_tui.examining", str(path), *options],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
        start_new_session=True,
    )
    try:
        return codec.from_json(Examined, done.stdout)
    except ValueError as error:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        last = said[-1] if said else f"it left with code {done.returncode}"
        raise DaemonError(f"{path} could not be checked: {last}") from error


def main(arguments: list[str]) -> None:
    """Write what was found of a file to standard output, and nothing else there."""
    # Systems under test that plug in may print.
    answer = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    path, *options = arguments
    found = examine(Path(path), submit=_SUBMIT in options, fresh=_FRESH in options)
    with os.fdopen(answer, "wb") as output:
        output.write(codec.to_json(found))


if __name__ == "__main__":
    main(sys.argv[1:])
