"""Content of launch files: nodes, their parameters, and the names they use."""

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
    """Settings for the launch files, with their places.

    ``args`` are those of the command line. ``packages`` are folders that are packages or contain
    some. ``env`` holds all environment variables, ``skip`` the endings of files to ignore.
    ``where`` returns the place of a setting: ``where(("args", "model"))``.
    """

    where: SettingPlace
    args: Mapping[str, str] = field(default_factory=dict)
    packages: tuple[Path, ...] = ()
    env: Mapping[str, str] = field(default_factory=dict)
    skip: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LaunchRemap:
    """Absolute name that replaces another one."""

    to: str
    where: Where


@dataclass(frozen=True, slots=True)
class LaunchNode:
    """Started node; its ``name`` and the names in ``remaps`` are absolute.

    ``parameters`` are its private ones, by the parts of their names below the node.
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
    """All ``nodes`` of launch files in order, and all ``parameters`` by full name.

    ``files`` are all files that were read, in the order of their first use. ``left_out`` are
    includes of unknown packages.
    """

    nodes: tuple[LaunchNode, ...]
    parameters: Mapping[ParameterName, ParameterValue]
    files: tuple[str, ...]
    left_out: tuple[str, ...]
    warnings: tuple[Finding, ...]
