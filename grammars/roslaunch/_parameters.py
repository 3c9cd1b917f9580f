"""Parameters that launch files put on the parameter server, and unread ones.

roslaunch collects the parameters of one launch, where the last value of a name counts, and sends
them together. ``clear_params`` and ``rosparam delete`` remove only parameters of launch files that
were started before. Source: roslaunch.launch, roslaunch.config (ROS Noetic).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from grammars.roslaunch._names import ParameterName, convert_value, split_name
from grammars.roslaunch._substitution import UnknownValues
from grammars.roslaunch._xml import XmlElement
from grammars.text.diagnostics import Finding, InputError
from grammars.text.documents import KeyPath, YamlDocument, paths_inside
from grammars.text.ros_yaml import ParameterValue, parse_ros_yaml

_NOT_READ: Final = {
    "textfile": "is the text of a file, which is not read",
    "binfile": "is the content of a file, which is not read",
    "command": "is the output of a command, and commands of launch files are never run",
}
SOURCES: Final = ("value", *_NOT_READ)
"""Attributes of a ``<param>``, one of which gives its value."""


@dataclass(frozen=True, slots=True)
class UnreadParameters:
    """Unread parameters below ``namespace``, and the reasons.

    ``owner`` is the node whose tag loads them, if any.
    """

    namespace: ParameterName
    owner: ParameterName | None
    reasons: tuple[Finding, ...]

    def is_inside(self, node: ParameterName) -> bool:
        """Return whether all of them belong to ``node``."""
        return self.owner == node or self.namespace[: len(node)] == node

    def is_around(self, node: ParameterName) -> bool:
        """Return whether some of them may belong to ``node``."""
        return node[: len(self.namespace)] == self.namespace


def read_param(
    element: XmlElement, source: str, text: str, unknown: UnknownValues
) -> ParameterValue:
    """Return the value of a ``<param>`` from its attribute ``source``.

    Raises :class:`InputError` for a value that does not have the declared type.
    """
    where = element.place(source)
    name = element.attributes.get("name", "")
    if source != "value":
        hint = 'write the value under "parameters" if the node needs it'
        lack = Finding(where, f"{name}: {_NOT_READ[source]}", hint)
        return ParameterValue(text, where, (lack,))
    text = text.strip()
    if reasons := unknown.reasons_in(text):
        return ParameterValue(text, where, reasons)
    kind = (element.attributes.get("type") or "auto").strip().lower()
    if kind == "yaml":
        document, _ = parse_ros_yaml(text, where.file, locate=lambda *_: where, any_value=True)
        return ParameterValue(document.data, where)
    try:
        return ParameterValue(convert_value(text, kind), where)
    except ValueError as error:
        raise InputError.at(where, f"{name}: {error}") from error


@dataclass(slots=True)
class ParameterUpload:
    """Parameters that one launch sets, and namespaces that it clears before."""

    values: dict[ParameterName, ParameterValue] = field(default_factory=dict)
    cleared: list[ParameterName] = field(default_factory=list)

    def set(self, name: ParameterName, parameter: ParameterValue) -> None:
        """Set one parameter, or each of a mapping."""
        if isinstance(parameter.value, Mapping):
            for key, value in parameter.value.items():
                below = ParameterValue(value, parameter.where, parameter.missing)
                self.set((*name, *split_name(str(key))), below)
            return
        self.values[name] = parameter

    def load(
        self, namespace: ParameterName, document: YamlDocument, unknown: UnknownValues
    ) -> None:
        """Set the values of a YAML document; names with a leading slash leave the namespace."""
        for path, value in _leaves(document.data, ()):
            name = namespace
            for part in map(str, path):
                name = split_name(part) if part.startswith("/") else (*name, *split_name(part))
            inside = {below: document.where((*path, *below)) for below in paths_inside(value)}
            parameter = ParameterValue(
                value, document.where(path), unknown.reasons_in(str(value)), inside
            )
            self.set(name, parameter)


def _leaves(data: Any, above: KeyPath) -> Iterable[tuple[KeyPath, Any]]:
    """Return the values of nested mappings; an empty mapping sets nothing."""
    if not isinstance(data, Mapping):
        return [(above, data)]
    return [leaf for name, value in data.items() for leaf in _leaves(value, (*above, name))]


@dataclass(slots=True)
class ParameterServer:
    """Content of the parameter server after each launch."""

    values: dict[ParameterName, ParameterValue] = field(default_factory=dict)
    _namespaces: set[ParameterName] = field(default_factory=set)
    """All namespaces of parameters set so far; only these can have parameters below them."""

    def apply(self, upload: ParameterUpload) -> None:
        """Clear the namespaces of a launch, then set its parameters."""
        for namespace in upload.cleared:
            for name in [n for n in self.values if n[: len(namespace)] == namespace]:
                del self.values[name]
        for name, parameter in upload.values.items():
            self._set(name, parameter)

    def _set(self, name: ParameterName, parameter: ParameterValue) -> None:
        """Set a parameter; remove those at its name, above it and below it."""
        for length in range(1, len(name)):
            self.values.pop(name[:length], None)
            self._namespaces.add(name[:length])
        if name in self._namespaces:
            for old in [n for n in self.values if n[: len(name)] == name]:
                del self.values[old]
        self.values[name] = parameter

    def below(self, namespace: ParameterName) -> dict[ParameterName, ParameterValue]:
        """Return the parameters below a namespace by the rest of their names."""
        count = len(namespace)
        return {
            name[count:]: parameter
            for name, parameter in self.values.items()
            if len(name) > count and name[:count] == namespace
        }
