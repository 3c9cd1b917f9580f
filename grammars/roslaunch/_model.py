"""What a launch file comes to: nodes, the parameters each would find, and the names it uses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from grammars.roslaunch._names import ParameterName
from grammars.text.diagnostics import Finding, Where
from grammars.text.ros_yaml import ParameterValue

SettingPlace: TypeAlias = Callable[[tuple[str | int, ...]], Where]
NodeType: TypeAlias = tuple[str, str]
"""Package and type of a node: ``("amcl", "amcl")``."""


@dataclass(frozen=True, slots=True)
class LaunchSettings:
    """What a person says beside the launch files, and where they said it.

    ``args`` are those of the command line, ``packages`` folders that are packages or hold some,
    ``env`` all environment variables there are, ``skip`` endings of files that are left out.
    ``where`` places such a setting: ``where(("args", "model"))``.
    """

    where: SettingPlace
    args: Mapping[str, str] = field(default_factory=dict)
    packages: tuple[Path, ...] = ()
    env: Mapping[str, str] = field(default_factory=dict)
    skip: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LaunchRemap:
    """The absolute name that takes the place of another one."""

    to: str
    where: Where


@dataclass(frozen=True, slots=True)
class LaunchNode:
    """A node that is started: ``name`` is absolute, as are the names in ``remaps``.

    ``parameters`` are its private ones by the parts of their names below the node.
    """

    name: str
    package: str
    type: str
    arguments: tuple[str, ...]
    where: Where
    parameters: Mapping[ParameterName, ParameterValue] = field(default_factory=dict)
    remaps: Mapping[str, LaunchRemap] = field(default_factory=dict)

    @property
    def kind(self) -> NodeType:
        """Package and type."""
        return self.package, self.type


@dataclass(frozen=True, slots=True)
class Launch:
    """What was read: all ``nodes`` in the order of the files, all ``parameters`` by full name.

    ``files`` are all files that were read, in the order they were first named; ``left_out`` are
    includes of packages that are not given.
    """

    nodes: tuple[LaunchNode, ...]
    parameters: Mapping[ParameterName, ParameterValue]
    files: tuple[str, ...]
    left_out: tuple[str, ...]
    warnings: tuple[Finding, ...]
