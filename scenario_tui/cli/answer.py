"""Answers of commands: a value, its text for people, its exit code; errors with a code.

A command is a function: its parameters are the arguments and options, its body is one call of the
public library. It returns an :class:`Answer`, or nothing when it keeps running or only writes
files. :func:`scenario_tui.cli.options.as_typed` adapts it to typer.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Generic, TypeVar

import typer

from grammars.text.diagnostics import Finding
from grammars.text.terminal_text import escape_json

T = TypeVar("T")


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


@dataclass(frozen=True, slots=True)
class Answer(Generic[T]):
    """The ``value`` that ``--json`` writes, the function that prints it, and the exit ``code``.

    ``schema`` is its name in :mod:`scenario_tui.cli.output_schemas`.
    """

    schema: str
    value: T
    text: Callable[[], None]
    code: int = ExitCode.EXPECTED


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


def schema_identifier(name: str) -> str:
    """Return the content of the field ``schema`` of an answer."""
    return f"scenario/{name}/1"


def write_json(schema: str, value: Any) -> None:
    """Write a value as one JSON object to standard output; numbers that JSON lacks are null."""
    from grammars.text.codec import to_plain

    body = {"schema": schema_identifier(schema)} | _null_for_nonfinite(to_plain(value))
    # Escapes carry any text through any encoding; UTF-8 needs none.
    escaped = (sys.stdout.encoding or "").lower().replace("-", "") != "utf8"
    text = json.dumps(body, ensure_ascii=escaped, indent=2, allow_nan=False)
    sys.stdout.write(escape_json(text) + "\n")


def _null_for_nonfinite(plain: Any) -> Any:
    """Return plain data with ``None`` for numbers that are infinite or not a number."""
    # Margins may be infinite. JSON has no such number, and other readers refuse the Infinity that
    # Python's json writes.
    if isinstance(plain, float):
        return plain if math.isfinite(plain) else None
    if isinstance(plain, dict):
        return {key: _null_for_nonfinite(value) for key, value in plain.items()}
    if isinstance(plain, list):
        return [_null_for_nonfinite(value) for value in plain]
    return plain
