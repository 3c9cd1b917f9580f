"""The values of ``<param>``, and what arguments of a node say about names and parameters."""

from __future__ import annotations

import shlex
from typing import Final

from grammars.roslaunch._names import ParameterName, convert_argument, convert_value, split_name
from grammars.roslaunch._substitution import Substituted
from grammars.roslaunch._xml import XmlElement
from grammars.text.diagnostics import Diagnostic, InputError, Where
from grammars.text.ros_yaml import ParameterValue, parse_ros_yaml

SOURCES: Final = ("value", "textfile", "binfile", "command")
"""The attributes of a ``<param>`` of which one gives its value."""
_NOT_READ: Final = {
    "textfile": "is the text of a file, which is not read",
    "binfile": "is the content of a file, which is not read",
    "command": "is what a command prints, and commands of launch files are never run",
}


def read_param(element: XmlElement, source: str, text: Substituted, kind: str) -> ParameterValue:
    """Return the value that a ``<param>`` has by one of its attributes.

    Raises :class:`InputError` for a value that is not of the type it is said to be.
    """
    where = element.place(source)
    if source != "value":
        message = f"{element.attributes.get('name', '')}: {_NOT_READ[source]}"
        hint = 'write the value under "parameters" if the node needs it'
        return ParameterValue(text.text, where, (Diagnostic(where, message, hint),))
    written = text.text.strip()
    if text.missing:
        return ParameterValue(written, where, text.missing)
    if kind == "yaml":
        found, _ = parse_ros_yaml(written, where.file, locate=lambda *_: where, any_value=True)
        return ParameterValue(found.data, where)
    try:
        return ParameterValue(convert_value(written, kind), where)
    except ValueError as error:
        raise InputError.at(where, f"{element.attributes.get('name', '')}: {error}") from error


def split_arguments(text: Substituted, where: Where) -> tuple[str, ...]:
    """Return the arguments of a node; raises :class:`InputError` for quotes without an end."""
    try:
        return tuple(shlex.split(text.text))
    except ValueError as error:
        raise InputError.at(where, f"args: {error}") from error


def remaps_among(arguments: tuple[str, ...]) -> dict[str, str]:
    """Return the names that ``FROM:=TO`` among a node's arguments remaps."""
    pairs = (argument.split(":=", 1) for argument in arguments if ":=" in argument)
    return {source: to for source, to in pairs if source and not source.startswith("_")}


def parameters_among(
    arguments: tuple[str, ...], where: Where, missing: tuple[Diagnostic, ...]
) -> dict[ParameterName, ParameterValue]:
    """Return the private parameters that ``_NAME:=VALUE`` among a node's arguments sets."""
    found = {}
    for argument in arguments:
        name, sign, value = argument.partition(":=")
        if sign and name.startswith("_") and not name.startswith("__"):
            unfilled = missing if "$(" in value else ()
            parts = split_name(name[1:])
            found[parts] = ParameterValue(convert_argument(value), where, unfilled)
    return found
