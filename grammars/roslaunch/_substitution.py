"""Commands such as ``$(arg …)``, ``$(env …)`` and ``$(find …)`` in texts of launch files.

Unset variables and args without a value remain in the text as written. They are errors only in a
text that a node of interest needs (:class:`UnknownValues`). ``$(find PACKAGE)`` always remains and
becomes a path when a file is opened, so that no parameter depends on a machine's folders. Source:
roslaunch.substitution_args (ROS Noetic).
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from grammars.roslaunch._expressions import ExpressionError, evaluate
from grammars.roslaunch._names import convert_value
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean

_COMMAND: Final = re.compile(r"\$\(([^)]*)\)")
_LONGEST: Final = 10_000
"""Largest length of a text with commands: args that double each other grow without end."""
_COMMANDS: Final = ("anon", "arg", "dirname", "env", "find", "optenv")


class UnknownValues:
    """Commands without a value and the reasons, for each text that needs them."""

    def __init__(self) -> None:
        self._reasons: dict[str, tuple[Finding, ...]] = {}

    def add(self, command: str, reasons: Iterable[Finding]) -> None:
        """Store why a command such as ``$(env ROBOT)`` has no value; the first reasons count."""
        self._reasons.setdefault(command, tuple(reasons))

    def add_remedy(self, text: str, remedy: str) -> None:
        """Add a remedy to the hints about commands in ``text`` without a value."""
        for match in _COMMAND.finditer(text):
            reasons = self._reasons.get(match[0], ())
            self._reasons[match[0]] = tuple(
                one if remedy in one.hint else replace(one, hint=f"{one.hint}; or {remedy}")
                for one in reasons
            )

    def reasons_in(self, text: str) -> tuple[Finding, ...]:
        """Return the reasons why commands in ``text`` have no value."""
        commands = (match[0] for match in _COMMAND.finditer(text))
        return tuple(reason for one in commands for reason in self._reasons.get(one, ()))

    def refuse_in(self, text: str) -> None:
        """Raise :class:`InputError` if a command in ``text`` has no value."""
        if reasons := self.reasons_in(text):
            raise InputError(reasons)


@dataclass(frozen=True, slots=True)
class Substitution:
    """Meaning of commands in one file: its args, its folder, the given variables."""

    args: Mapping[str, str]
    env: Mapping[str, str]
    folder: str
    unknown: UnknownValues

    def fill_in(self, text: str, where: Where) -> str:
        """Return ``text``, which is written at ``where``, with its commands replaced.

        Raises :class:`InputError` for unknown and malformed commands.
        """
        if "$(" not in text:
            return text
        if text.startswith("$(eval ") and text.endswith(")"):
            return self._evaluated(text, where)
        result = text[: _LONGEST + 1]
        if len(text) <= _LONGEST:
            result = _COMMAND.sub(lambda match: self._command(match[0], match[1], where), text)
        if len(result) > _LONGEST:
            message = f"is a text of more than {_LONGEST:,} characters with its commands replaced"
            raise InputError.at(where, message)
        return result

    def _command(self, whole: str, inside: str, where: Where) -> str:
        if "$" in inside or "(" in inside:
            message = f"{whole}: a substitution cannot contain another one"
            raise InputError.at(where, message, "only $(eval …), alone in its text, can")
        name, *arguments = inside.split() or [""]
        if name == "eval":
            message = "$(eval …) must be the whole of its text"
            raise InputError.at(where, message, "move the rest of the text into the expression")
        if name not in _COMMANDS:
            hint = did_you_mean(name, (*_COMMANDS, "eval"))
            raise InputError.at(where, f'{whole}: there is no command "{name}"', hint)
        few, many = {"dirname": (0, 0), "optenv": (1, 99)}.get(name, (1, 1))
        if not few <= len(arguments) <= many:
            raise InputError.at(where, f"{whole}: {name} takes {('nothing', 'one word')[few]}")
        match name:
            case "arg":
                return self._arg(arguments[0], where)
            case "env":
                return self._env(arguments[0], where)
            case "optenv":
                return self.env.get(arguments[0], " ".join(arguments[1:]))
            case "dirname":
                return self.folder
            case "anon":
                return _anonymous(arguments[0])
        return f"$(find {arguments[0]})"

    def _arg(self, name: str, where: Where) -> str:
        if name not in self.args:
            message = f"arg {name} has no value here"
            hint = 'give it under "args", where the file is included, or as a default'
            raise InputError.at(where, message, hint)
        return self.args[name]

    def _env(self, name: str, where: Where) -> str:
        if name in self.env:
            return self.env[name]
        hint = f'write it under "env", such as {name}: VALUE'
        value_here = os.environ.get(name)
        if value_here is not None:
            hint = f'write it under "env"; in this shell it is {name}: {value_here}'
        command = f"$(env {name})"
        message = f"environment variable {name} is not given"
        self.unknown.add(command, [Finding(where, message, hint)])
        return command

    def _evaluated(self, text: str, where: Where) -> str:
        """Return the value of an expression, or the first text in it without a value."""

        def checked(value: str) -> str:
            if self.unknown.reasons_in(value):
                raise _UnknownError(value)
            return value

        def arg(name: str) -> Any:
            return convert_value(checked(self._arg(name, where)))

        functions: dict[str, Callable[..., Any]] = {
            "arg": arg,
            "env": lambda name: checked(self._env(str(name), where)),
            "optenv": lambda name, default="": self.env.get(str(name), default),
            "find": lambda package: f"$(find {package})",
            "dirname": lambda: self.folder,
            "anon": lambda name: _anonymous(str(name)),
        }
        try:
            return str(
                evaluate(
                    text[len("$(eval ") : -1],
                    lambda name: arg(name) if name in self.args else None,
                    functions,
                )
            )
        except _UnknownError as error:
            return error.text
        except ExpressionError as error:
            hint = did_you_mean("", self.args) if "there is no arg" in str(error) else ""
            raise InputError.at(where, f"{text}: {error}", hint) from error


class _UnknownError(Exception):
    """An expression needs ``text``, which contains a command without a value."""

    def __init__(self, text: str) -> None:
        self.text = text
        super().__init__(text)


def split_words(text: str) -> tuple[str, ...]:
    """Return the words of a command line as in a shell; a command belongs to a single word.

    Raises ``ValueError`` for an unclosed quote.
    """
    closed = _COMMAND.sub(lambda match: match[0].replace(" ", "\0"), text)
    return tuple(word.replace("\0", " ") for word in shlex.split(closed))


def _anonymous(name: str) -> str:
    """Return a unique name; roslaunch adds host, process and time, which would change each run."""
    return f"{name}_anonymous"
