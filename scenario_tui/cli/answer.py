"""Answers of commands: a value, its text for people, its exit code.

A command is a function: its parameters are the arguments and options, its body is one call of the
public library. It returns an :class:`Answer`, or nothing when it keeps running or only writes
files. :func:`as_typed` adapts it to typer: a parameter ``target`` becomes ``--connect``,
``--state`` and ``--keys``, and a command that answers gets ``--json``, which writes the value.
"""

from __future__ import annotations

import functools
import inspect
import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Final, Generic, TypeVar, get_type_hints

from grammars.text.terminal_text import escape_json
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import AsJson, Connect, Keys, State, use_keys
from scenario_tui.cli.output import say, show_progress
from scenario_tui.source import DaemonTarget

T = TypeVar("T")

_TARGET_OPTIONS: Final[dict[str, tuple[Any, Any]]] = {
    "connect": (Connect, ""),
    "state": (State, None),
    "keys": (Keys, None),
}


@dataclass(frozen=True, slots=True)
class Answer(Generic[T]):
    """The ``value`` that ``--json`` writes, the function that prints it, and the exit ``code``.

    ``schema`` is its name in :mod:`scenario_tui.cli.output_schemas`.
    """

    schema: str
    value: T
    text: Callable[[], None]
    code: int = ExitCode.EXPECTED


def as_typed(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command as typer calls it; it writes the answer and returns the exit code."""
    signature = inspect.signature(command)
    # Annotations are text (PEP 563), and the type of the answer is not imported at run time.
    annotations = {k: v for k, v in command.__annotations__.items() if k != "return"}
    types = get_type_hints(
        SimpleNamespace(__annotations__=annotations), command.__globals__, include_extras=True
    )
    parameters = [
        one.replace(annotation=types[name], kind=inspect.Parameter.KEYWORD_ONLY)
        for name, one in signature.parameters.items()
        if name != "target"
    ]
    common = dict(_TARGET_OPTIONS) if "target" in signature.parameters else {}
    if "Answer" in str(signature.return_annotation):
        common["as_json"] = (AsJson, False)
    parameters += [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
        for name, (kind, default) in common.items()
    ]

    @functools.wraps(command)
    def typed(**values: Any) -> Any:
        if "connect" in common:
            use_keys(values.pop("keys"))
            where = values.pop("connect"), values.pop("state")
            values["target"] = DaemonTarget(*where, say, show_progress)
        as_json = values.pop("as_json", False) if "as_json" in common else False
        answer = command(**values)
        if not isinstance(answer, Answer):
            return answer
        if as_json:
            write_json(answer.schema, answer.value)
        else:
            answer.text()
        return int(answer.code)

    typed.__annotations__ = {one.name: one.annotation for one in parameters}
    typed.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=parameters, return_annotation=inspect.Signature.empty
    )
    return typed


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
