"""Launch files of ROS 1 (roslaunch XML): the nodes they start, with parameters and remaps.

:func:`load_launch` reads them without ROS and without running anything. Every parameter has its
place in the file.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from grammars.roslaunch._model import (
    Launch,
    LaunchNode,
    LaunchSettings,
    NodeType,
)
from grammars.roslaunch._names import absolute_name, resolve_for_node, split_name
from grammars.roslaunch._packages import Packages, is_file, similar_name
from grammars.roslaunch._parameters import ParameterServer
from grammars.roslaunch._reader import LaunchReader
from grammars.text.diagnostics import (
    Finding,
    Findings,
    InputError,
    Severity,
    Where,
    did_you_mean,
    raise_all,
)

_NOT_XML: Final = (".py", ".yaml", ".yml")


def load_launch(
    files: Sequence[tuple[Path, Where]],
    settings: LaunchSettings,
    of_interest: Collection[NodeType] = (),
) -> Launch:
    """Read launch files in the order of their start; each comes with the place that names it.

    An unreadable part is an error only if it concerns a node ``of_interest`` or decides which nodes
    are started. Incomplete parameters hold their own findings. Raises :class:`InputError` with all
    errors and warnings.
    """
    packages = Packages()
    findings = Findings()
    for index, folder in enumerate(settings.packages):
        with findings.collecting():
            packages.add(folder, settings.where(("packages", index)))
    for path, where in files:
        _check_file(path, where, findings)
    raise_all(findings.all)
    reader = LaunchReader(settings, packages)
    server = ParameterServer()
    for path, _ in files:
        packages.add_around(path)
        reader.start(path)
        server.apply(reader.upload)
    problems = [*reader.errors, *_unknown_args(settings, reader.declared)]
    warnings = [*reader.warnings, *_unused_endings(settings, reader.skipped)]
    nodes = []
    for node in reader.nodes.values():
        parameters = {**server.below(split_name(node.name)), **node.parameters}
        nodes.append(replace(node, parameters=parameters))
        if node.kind in of_interest:
            problems += _errors_of(nodes[-1], reader)
            warnings += _warnings_of(node, reader)
    if problems:
        # Several nodes may lack the same value.
        unique: dict[tuple[Where, str], Finding] = {}
        for problem in problems:
            unique.setdefault((problem.where, problem.message), problem)
        raise InputError(dict.fromkeys((*unique.values(), *warnings)))
    return Launch(
        nodes=tuple(nodes),
        parameters=dict(server.values),
        files=tuple(reader.files),
        left_out=tuple(dict.fromkeys(reader.left_out)),
        warnings=tuple(dict.fromkeys(warnings)),
    )


def _check_file(path: Path, where: Where, findings: Findings) -> None:
    """Report a path that cannot be a launch file of ROS 1."""
    if not is_file(path, where):
        findings.error(where, f"no file {path}", similar_name(path))
    elif path.suffix in _NOT_XML:
        message = f"{path.name} is not a launch file of ROS 1, which is XML"
        findings.error(where, message, 'use "kind: ros2" for a launch file of ROS 2')


def _unknown_args(settings: LaunchSettings, declared: dict[str, bool]) -> list[Finding]:
    """Report args that no launch file has; roslaunch ignores them silently."""
    open_names = [name for name, is_open in declared.items() if is_open]
    return [
        Finding(
            settings.where(("args", name)),
            f"arg {name} has a fixed value in the launch file"
            if name in declared
            else f"no launch file named here has an arg {name}",
            did_you_mean(name, open_names),
        )
        for name in settings.args
        if not declared.get(name)
    ]


def _unused_endings(settings: LaunchSettings, skipped: set[str]) -> list[Finding]:
    return [
        Finding(
            settings.where(("skip", index)),
            f'skip: no loaded or included file ends with "{ending}"',
            "remove it, or write the file's name as in the launch file",
            Severity.WARNING,
        )
        for index, ending in enumerate(settings.skip)
        if ending not in skipped
    ]


def _errors_of(node: LaunchNode, reader: LaunchReader) -> list[Finding]:
    """Return errors about names of a node and its parameters, and about its unread parameters."""
    name = split_name(node.name)
    names = [node.name, *node.remaps, *(remap.to for remap in node.remaps.values())]
    names += map(absolute_name, node.parameters)
    unknown = [reason for text in names for reason in reader.unknown.reasons_in(text)]
    unread = [reason for part in reader.unread if part.is_inside(name) for reason in part.reasons]
    return unknown + unread


def _warnings_of(node: LaunchNode, reader: LaunchReader) -> list[Finding]:
    """Return notes about a node's parameters, and unread parts that may hold some."""
    name = split_name(node.name)
    notes = [note for part in reader.notes if part.is_inside(name) for note in part.reasons]
    return notes + [
        replace(reason, severity=Severity.WARNING)
        for part in reader.unread
        if part.is_around(name) and not part.is_inside(name)
        for reason in part.reasons
    ]
