"""From a campaign file to a submission: load, check and expand it, here or in a child process.

What reads the languages takes 100 MB and keeps a core busy; the dashboard stays small and quick
when a process of its own does it: ``python -m scenario_tui.submission FILE [--submit] [--fresh]``.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Protocol

from daemon.batch.errors import DaemonError
from daemon.model.execution import python_command
from daemon.model.status import Submission, SubmissionReceipt
from grammars.text import codec
from grammars.text.diagnostics import Diagnostic, InputError, Severity
from scenario_tui.text.formatting import pluralise

_SUBMIT: Final = "--submit"
_FRESH: Final = "--fresh"


@dataclass(frozen=True, slots=True)
class PreparedSubmission:
    """A campaign to hand over, with its warnings; its ``searches`` are no part of that."""

    submission: Submission
    warnings: tuple[Diagnostic, ...]
    searches: tuple[str, ...]


def prepare_submission(path: Path, *, fresh: bool = False) -> PreparedSubmission:
    """Load, check and expand a campaign.

    Raises :class:`InputError` with everything found when there is an error.
    """
    from daemon.campaign import campaign_origin, examine, expand

    campaign, found = examine(path)
    if any(d.severity is Severity.ERROR for d in found):
        raise InputError(found)
    names = tuple(task.name for task in campaign.searches)
    submission = replace(expand(campaign, fresh=fresh), origin=campaign_origin(campaign, path))
    return PreparedSubmission(submission, found, names)


def searches_text(path: Path, names: tuple[str, ...]) -> str:
    """Say which searches a campaign has besides, and what starts them; nothing without any."""
    if not names:
        return ""
    if len(names) == 1:
        return f"{names[0]} is a search: start it with `scenario search {path}`"
    return f"{', '.join(names)} are searches: start one with `scenario search {path} NAME`"


def receipt_text(receipt: SubmissionReceipt) -> str:
    """Say what became of a submission."""
    runs = pluralise(receipt.runs, "run")
    if receipt.known:
        return f"{receipt.campaign} is known already, its {runs} are kept (--fresh runs them anew)"
    cached = f", {receipt.cached:,} cached (--fresh runs them anew)" if receipt.cached else ""
    return f"submitted {receipt.campaign}: {runs}{cached}"


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """What a file is in a few words, what was found, and what to hand over if that was asked for
    and nothing stands against it.
    """

    about: str = ""
    findings: tuple[Diagnostic, ...] = ()
    submission: Submission | None = None


class FileChecker(Protocol):
    """How a campaign file is examined; ``submit`` asks for what to hand over."""

    def __call__(self, path: Path, *, submit: bool = False, fresh: bool = False) -> CheckedFile: ...  # noqa: D102


def check_file(path: Path, *, submit: bool = False, fresh: bool = False) -> CheckedFile:
    """Examine a file in this process."""
    from scenario_tui import file_check

    if not submit:
        return CheckedFile(*file_check.check_file(path))
    try:
        prepared = prepare_submission(path, fresh=fresh)
    except InputError as error:
        return CheckedFile("", error.diagnostics)
    return CheckedFile("", prepared.warnings, prepared.submission)


def check_file_in_child(path: Path, *, submit: bool = False, fresh: bool = False) -> CheckedFile:
    """Examine a file in another process.

    Raises :class:`daemon.batch.errors.DaemonError` with its last words when it answers nothing.
    """
    options = [*([_SUBMIT] if submit else []), *([_FRESH] if fresh else [])]
    done = subprocess.run(
        python_command("-m", "scenario_tui.submission", str(path), *options),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
        start_new_session=True,  # Ctrl-C is for the dashboard
    )
    try:
        return codec.from_json(CheckedFile, done.stdout)
    except ValueError as error:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        last = said[-1] if said else f"it left with code {done.returncode}"
        raise DaemonError(f"{path} could not be checked: {last}") from error


def main(arguments: list[str]) -> None:
    """Write what was found of a file to standard output, and nothing else there."""
    # Systems under test that plug in may print: that goes to standard error, and only the answer to
    # what was standard output.
    answer = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    path, *options = arguments
    found = check_file(Path(path), submit=_SUBMIT in options, fresh=_FRESH in options)
    with os.fdopen(answer, "wb") as output:
        output.write(codec.to_json(found))


if __name__ == "__main__":
    main(sys.argv[1:])
