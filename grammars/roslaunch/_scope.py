"""What holds at a place of a launch file: namespace, args, remaps and private parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from grammars.roslaunch._names import join_names
from grammars.roslaunch._substitution import Substituted
from grammars.text.diagnostics import Diagnostic, InputError, Where
from grammars.text.ros_yaml import ParameterValue


@dataclass(frozen=True, slots=True)
class WrittenRemap:
    """A remap as it is written; its names are resolved for each node."""

    source: Substituted
    target: Substituted
    where: Where


@dataclass(slots=True)
class Scope:
    """A launch file, an include or a group while it is read; what is inside gets a copy.

    ``declared`` are the args this file has named, true for those that can be passed.
    ``overriding`` is set where all args of the outer file were passed on: values of the file then
    replace them. ``outermost`` is set in a file that is started, whose args are given by people.
    ``missing`` is what the namespace lacks.
    """

    file: Path
    namespace: str = "/"
    args: dict[str, Substituted] = field(default_factory=dict)
    declared: dict[str, bool] = field(default_factory=dict)
    overriding: bool = False
    outermost: bool = False
    remaps: dict[str, WrittenRemap] = field(default_factory=dict)
    private: dict[str, ParameterValue] = field(default_factory=dict)
    missing: tuple[Diagnostic, ...] = ()

    def child(self, namespace: Substituted | None) -> Scope:
        """Return a scope inside of this one, in a namespace of its own if there is one."""
        name, missing = ("", ()) if namespace is None else (namespace.text, namespace.missing)
        return Scope(
            file=self.file,
            namespace=join_names(self.namespace, name) if name else self.namespace,
            args=dict(self.args),
            declared=dict(self.declared),
            outermost=self.outermost,
            remaps=dict(self.remaps),
            private=dict(self.private),
            missing=(*self.missing, *missing),
        )

    def declare(
        self, name: str, value: Substituted | None, default: Substituted | None, where: Where
    ) -> None:
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
