"""Declarations in force at a place of a launch file, and their effect on a node."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from grammars.roslaunch._model import LaunchNode, LaunchRemap
from grammars.roslaunch._names import (
    convert_argument,
    is_legal,
    join_names,
    resolve_for_node,
    split_name,
)
from grammars.roslaunch._substitution import UnknownValues, split_words
from grammars.text.diagnostics import InputError, Where
from grammars.text.ros_yaml import ParameterValue


@dataclass(frozen=True, slots=True)
class WrittenRemap:
    """Remap as written; its names are resolved for each node."""

    source: str
    target: str
    where: Where


@dataclass(slots=True)
class Scope:
    """Scope of a launch file, an include or a group; inner scopes begin as copies.

    ``declared`` are the args of this file, true for those that can be passed. ``overriding`` holds
    if the outer file passed on all args: values of this file then replace them. ``outermost`` holds
    in a started file, whose args come from people.
    """

    file: Path
    namespace: str = "/"
    args: dict[str, str] = field(default_factory=dict)
    declared: dict[str, bool] = field(default_factory=dict)
    overriding: bool = False
    outermost: bool = False
    remaps: dict[str, WrittenRemap] = field(default_factory=dict)
    private: dict[str, ParameterValue] = field(default_factory=dict)

    def child(self, namespace: str | None) -> Scope:
        """Return a scope inside this one, in its own namespace if any."""
        return Scope(
            file=self.file,
            namespace=join_names(self.namespace, namespace) if namespace else self.namespace,
            args=dict(self.args),
            declared=dict(self.declared),
            outermost=self.outermost,
            remaps=dict(self.remaps),
            private=dict(self.private),
        )

    def declare(self, name: str, value: str | None, default: str | None, where: Where) -> None:
        """Declare an arg; a ``value`` is fixed, a ``default`` holds if no value was passed.

        Raises :class:`InputError` for declarations that roslaunch refuses.
        """
        if name in self.declared and not self.overriding:
            raise InputError.at(where, f"arg {name} is declared twice", "remove one of them")
        # People give args once for all started files, and the arg may be open in another file.
        free = self.overriding or self.outermost
        if value is not None and name in self.args and not free:
            message = f"arg {name} has a fixed value here, but another value was passed"
            raise InputError.at(where, message, "write default instead of value, or pass no value")
        self.declared[name] = value is None
        if value is not None:
            self.args[name] = value
        elif default is not None:
            self.args.setdefault(name, default)

    def start(
        self, node: LaunchNode, arguments: str, where: Where, unknown: UnknownValues
    ) -> LaunchNode:
        """Return ``node`` with its remaps and ``arguments``, which are own_remaps at ``where``.

        Its ``parameters`` are those in its arguments. Raises :class:`InputError` for invalid names.
        """
        try:
            words = split_words(arguments)
        except ValueError as error:
            raise InputError.at(where, f"args: {error}") from error
        own_remaps = [
            WrittenRemap(source, target, where)
            for source, sign, target in (word.partition(":=") for word in words)
            if sign and source and not source.startswith("_")
        ]
        # roslaunch appends the remaps to the arguments, and the last remap of a name counts.
        remaps: dict[str, LaunchRemap] = {}
        for remap in (*own_remaps, *self.remaps.values()):
            for name in (remap.source, remap.target):
                if remap not in own_remaps and not is_legal(name) and not unknown.reasons_in(name):
                    raise InputError.at(remap.where, f'"{name}" is not a valid name of ROS')
            source = resolve_for_node(remap.source, node.name)
            remaps[source] = LaunchRemap(resolve_for_node(remap.target, node.name), remap.where)
        return replace(
            node,
            arguments=words,
            remaps={source: remap for source, remap in remaps.items() if source != remap.to},
            parameters={
                split_name(name[1:]): ParameterValue(
                    convert_argument(value), where, unknown.reasons_in(value)
                )
                for name, sign, value in (word.partition(":=") for word in words)
                if sign and name.startswith("_") and not name.startswith("__")
            },
        )
