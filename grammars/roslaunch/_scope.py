"""Declarations in force at a place of a launch file, and the names they give a node."""

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
    """A remap as it is written; its names are resolved for each node."""

    source: str
    target: str
    where: Where


@dataclass(slots=True)
class Scope:
    """A launch file, an include or a group while it is read; what is inside gets a copy.

    ``declared`` are the args this file has named, true for those that can be passed.
    ``overriding`` is set where all args of the outer file were passed on: values of the file then
    replace them. ``outermost`` is set in a file that is started, whose args are given by people.
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
        """Return a scope inside of this one, in a namespace of its own if there is one."""
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
        """Declare an arg; a ``value`` is fixed, a ``default`` holds where none was passed.

        Raises :class:`InputError` for what roslaunch refuses.
        """
        if name in self.declared and not self.overriding:
            raise InputError.at(where, f"arg {name} is declared twice", "take one of them out")
        # People name args once for all files they start, of which another one may have it open.
        free = self.overriding or self.outermost
        if value is not None and name in self.args and not free:
            message = f"arg {name} has a fixed value here, and another one was passed"
            raise InputError.at(where, message, "write default in place of value, or pass none")
        self.declared[name] = value is None
        if value is not None:
            self.args[name] = value
        elif default is not None:
            self.args.setdefault(name, default)

    def start(
        self, node: LaunchNode, arguments: str, where: Where, unknown: UnknownValues
    ) -> LaunchNode:
        """Return ``node`` with its remaps and arguments, which stand at ``where``.

        Its ``parameters`` are those among its arguments. Raises :class:`InputError` for names that
        ROS does not have.
        """
        try:
            words = split_words(arguments)
        except ValueError as error:
            raise InputError.at(where, f"args: {error}") from error
        written = [
            WrittenRemap(source, target, where)
            for source, sign, target in (word.partition(":=") for word in words)
            if sign and source and not source.startswith("_")
        ]
        # roslaunch appends what remaps say to the arguments, and the last one of a name counts.
        remaps: dict[str, LaunchRemap] = {}
        for remap in (*written, *self.remaps.values()):
            for name in (remap.source, remap.target):
                if remap not in written and not is_legal(name) and not unknown.reasons_in(name):
                    raise InputError.at(remap.where, f'"{name}" is no name that ROS has')
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
