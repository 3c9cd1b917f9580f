"""What launch files put on the parameter server, and what could not be read of it.

roslaunch gathers the parameters of one launch, of a name the last, and sends them all at once;
what ``clear_params`` and ``rosparam delete`` take away is what was there before: from launch
files that were started earlier. Source: roslaunch.launch, roslaunch.config (ROS Noetic).
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
    "command": "is what a command prints, and commands of launch files are never run",
}
SOURCES: Final = ("value", *_NOT_READ)
"""The attributes of a ``<param>`` of which one gives its value."""


@dataclass(frozen=True, slots=True)
class UnreadParameters:
    """Parameters that could not be read, why, and whom that concerns.

    They belong below ``namespace``; ``owner`` is the node in which they are loaded, if any.
    """

    namespace: ParameterName
    owner: ParameterName | None
    reasons: tuple[Finding, ...]

    def inside(self, node: ParameterName) -> bool:
        """Say whether they are meant for ``node``."""
        return self.owner == node or self.namespace[: len(node)] == node

    def around(self, node: ParameterName) -> bool:
        """Say whether there may be some among them for ``node``."""
        return node[: len(self.namespace)] == self.namespace


def read_param(
    element: XmlElement, source: str, text: str, unknown: UnknownValues
) -> ParameterValue:
    """Return the value that a ``<param>`` has by one of its attributes.

    Raises :class:`InputError` for a value that is not of the type it is said to be.
    """
    where = element.place(source)
    name = element.attributes.get("name", "")
    if source != "value":
        hint = 'write the value under "parameters" if the node needs it'
        lack = Finding(where, f"{name}: {_NOT_READ[source]}", hint)
        return ParameterValue(text, where, (lack,))
    written = text.strip()
    if reasons := unknown.reasons_in(written):
        return ParameterValue(written, where, reasons)
    kind = (element.attributes.get("type") or "auto").strip().lower()
    if kind == "yaml":
        document, _ = parse_ros_yaml(written, where.file, locate=lambda *_: where, any_value=True)
        return ParameterValue(document.data, where)
    try:
        return ParameterValue(convert_value(written, kind), where)
    except ValueError as error:
        raise InputError.at(where, f"{name}: {error}") from error


@dataclass(slots=True)
class ParameterUpload:
    """The parameters of one launch, as roslaunch gathers them."""

    values: dict[ParameterName, ParameterValue] = field(default_factory=dict)
    taken_away: list[ParameterName] = field(default_factory=list)

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
        """Set what a YAML document holds; names that begin with a slash leave the namespace."""
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
    """What is on the server after each launch."""

    values: dict[ParameterName, ParameterValue] = field(default_factory=dict)
    _namespaces: set[ParameterName] = field(default_factory=set)
    """Every namespace that something was ever set in: where to look for what is below a name."""

    def take(self, upload: ParameterUpload) -> None:
        """Take away what a launch clears, then set what it has."""
        for namespace in upload.taken_away:
            for name in [n for n in self.values if n[: len(namespace)] == namespace]:
                del self.values[name]
        for name, parameter in upload.values.items():
            self._set(name, parameter)

    def _set(self, name: ParameterName, parameter: ParameterValue) -> None:
        """Set a parameter in place of what stands at its name, above it or below it."""
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
