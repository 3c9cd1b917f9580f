"""``$(arg …)``, ``$(env …)``, ``$(find …)`` and the like in texts of launch files.

What is not known (a variable that is not set, a package that is not given) stays as it is written
and is noted: it is wrong only where somebody needs it. ``$(find PACKAGE)`` stays in texts in any
case and becomes a path where a file is opened, so that no parameter depends on a machine's folders.
Source: roslaunch.substitution_args (ROS Noetic).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from grammars.roslaunch._expressions import ExpressionError, evaluate
from grammars.roslaunch._names import convert_value
from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean

_COMMAND: Final = re.compile(r"\$\(([^)]*)\)")
_COMMANDS: Final = ("anon", "arg", "dirname", "env", "find", "optenv")
Locate: TypeAlias = Callable[[int], Where]
"""Where the character at an offset of a text stands."""


@dataclass(frozen=True, slots=True)
class Substituted:
    """A text with what is known filled in; ``missing`` says what is not."""

    text: str
    missing: tuple[Diagnostic, ...] = ()


class MissingValueError(Exception):
    """Something is needed that is not known; ``missing`` says what."""

    def __init__(self, missing: tuple[Diagnostic, ...]) -> None:
        self.missing = missing
        super().__init__("\n".join(map(str, missing)))


@dataclass(frozen=True, slots=True)
class Substitution:
    """What commands stand for in one file: its args, its folder, the variables that are given."""

    args: Mapping[str, Substituted]
    env: Mapping[str, str]
    folder: str

    def fill_in(self, text: str, locate: Locate) -> Substituted:
        """Return ``text`` with its commands replaced; ``locate`` says where they stand.

        Raises :class:`InputError` for commands that roslaunch does not know or cannot read.
        """
        if "$(" not in text:
            return Substituted(text)
        if text.startswith("$(eval ") and text.endswith(")"):
            return self._evaluated(text, locate(0))
        missing: list[Diagnostic] = []

        def replaced(match: re.Match[str]) -> str:
            try:
                found = self._command(match[0], match[1], locate(match.start()))
            except MissingValueError as error:
                missing.extend(error.missing)
                return match[0]
            missing.extend(found.missing)
            return found.text

        filled = _COMMAND.sub(replaced, text)
        return Substituted(filled, tuple(dict.fromkeys(missing)))

    def _command(self, whole: str, inside: str, where: Where) -> Substituted:
        if "$" in inside or "(" in inside:
            message = f"{whole}: nothing can stand inside of a substitution"
            raise InputError.at(where, message, "only $(eval …), alone in its text, has parts")
        name, *arguments = inside.split() or [""]
        if name == "eval":
            message = "$(eval …) must be the whole of its text"
            raise InputError.at(where, message, "put what stands beside it into the expression")
        if name not in _COMMANDS:
            hint = did_you_mean(name, (*_COMMANDS, "eval"))
            raise InputError.at(where, f'{whole}: there is no command "{name}"', hint)
        few, many = {"dirname": (0, 0), "optenv": (1, 99)}.get(name, (1, 1))
        if not few <= len(arguments) <= many:
            raise InputError.at(where, f"{whole}: {name} takes {_counted(few)}")
        match name:
            case "arg":
                return self._arg(arguments[0], where)
            case "env":
                return Substituted(self._env(arguments[0], where))
            case "optenv":
                return Substituted(self.env.get(arguments[0], " ".join(arguments[1:])))
            case "dirname":
                return Substituted(self.folder)
            case "anon":
                return Substituted(_anonymous(arguments[0]))
        return Substituted(f"$(find {arguments[0]})")

    def _arg(self, name: str, where: Where) -> Substituted:
        if name not in self.args:
            message = f"arg {name} has no value here"
            hint = 'give it under "args", where the file is included, or as a default'
            raise InputError.at(where, message, hint)
        return self.args[name]

    def _env(self, name: str, where: Where) -> str:
        if name not in self.env:
            hint = f'write it under "env", such as {name}: VALUE'
            here = os.environ.get(name)
            if here is not None:
                hint = f'write it under "env"; in this shell it is {name}: {here}'
            message = f"environment variable {name} is not given"
            raise MissingValueError((Diagnostic(where, message, hint),))
        return self.env[name]

    def _evaluated(self, text: str, where: Where) -> Substituted:
        def arg(name: str) -> Any:
            value = self._arg(name, where)
            if value.missing:
                raise MissingValueError(value.missing)
            return convert_value(value.text)

        functions: dict[str, Callable[..., Any]] = {
            "arg": arg,
            "env": lambda name: self._env(str(name), where),
            "optenv": lambda name, default="": self.env.get(str(name), default),
            "find": lambda package: f"$(find {package})",
            "dirname": lambda: self.folder,
            "anon": lambda name: _anonymous(str(name)),
        }
        try:
            value = evaluate(
                text[len("$(eval ") : -1],
                lambda name: arg(name) if name in self.args else None,
                functions,
            )
        except MissingValueError as error:
            return Substituted(text, error.missing)
        except ExpressionError as error:
            hint = did_you_mean("", self.args) if "no arg is called" in str(error) else ""
            raise InputError.at(where, f"{text}: {error}", hint) from error
        return Substituted(str(value))


def _anonymous(name: str) -> str:
    """Return a name of its own; roslaunch adds host, process and time, which no run may hang on."""
    return f"{name}_anonymous"


def _counted(few: int) -> str:
    return ("nothing", "one word")[few]
