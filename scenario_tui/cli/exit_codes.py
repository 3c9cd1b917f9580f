"""Exit codes: the code of a set of runs, and errors with a code."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum

import typer

from grammars.text.diagnostics import Finding


class ExitCode(IntEnum):
    """Codes that scripts can rely on; ``BUG`` is EX_SOFTWARE of sysexits.h."""

    EXPECTED = 0
    UNEXPECTED = 1
    BAD_INPUT = 2
    INFRASTRUCTURE = 3
    INCONCLUSIVE = 4
    BUG = 70
    # The codes of shells for SIGINT and SIGPIPE: 128 plus the number of the signal.
    INTERRUPTED = 130
    BROKEN_PIPE = 141


class CommandError(Exception):
    """Reason, in a line, why a command cannot do its work; ``code`` is the exit code."""

    def __init__(self, message: str, code: ExitCode = ExitCode.BAD_INPUT) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True, slots=True)
class ErrorValue:
    """Answer of a command that failed: the reason, the exit code, the findings about files."""

    error: str
    exit_code: int
    diagnostics: tuple[Finding, ...] = ()


def exit_code(words: Iterable[str]) -> ExitCode:
    """Return the code for finished runs from their words (``pass``, ``lost`` ...).

    A failure counts even if other runs were lost. Without a failure, broken runs weigh more than
    inconclusive ones.
    """
    outcomes = set(words)
    if "fail" in outcomes:
        return ExitCode.UNEXPECTED
    if outcomes & {"lost", "error"}:
        return ExitCode.INFRASTRUCTURE
    if not outcomes or outcomes - {"pass"}:
        return ExitCode.INCONCLUSIVE
    return ExitCode.EXPECTED


@contextmanager
def wrong_usage(hint: str | None = None) -> Iterator[None]:
    """Turn a ``ValueError`` into wrong usage of the parameter ``hint``."""
    try:
        yield
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint=hint) from error
