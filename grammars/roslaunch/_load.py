"""From launch files to nodes with their parameters, and what is wrong for those that matter."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from grammars.roslaunch._model import Launch, LaunchNode, LaunchSettings, NodeType
from grammars.roslaunch._names import absolute_name, split_name
from grammars.roslaunch._packages import Packages, files_near, is_file
from grammars.roslaunch._parameters import ParameterServer
from grammars.roslaunch._reader import LaunchReader
from grammars.text.diagnostics import Finding, InputError, Severity, Where, did_you_mean

_NOT_XML: Final = (".py", ".yaml", ".yml")


def load_launch(
    files: Sequence[tuple[Path, Where]],
    settings: LaunchSettings,
    of_interest: Collection[NodeType] = (),
) -> Launch:
    """Read launch files, each started after the one before, and the place that names each.

    What could not be read is an error only if it concerns a node ``of_interest`` or decides what
    is started; a parameter says itself what it lacks. Raises :class:`InputError` with everything
    wrong.
    """
    packages = Packages()
    problems: list[Finding] = []
    for index, folder in enumerate(settings.packages):
        try:
            packages.add(folder, settings.where(("packages", index)))
        except InputError as error:
            problems += error.findings
    for path, where in files:
        problems += _unsuitable(path, where)
    if problems:
        raise InputError(problems)
    reader = LaunchReader(settings, packages)
    server = ParameterServer()
    for path, _ in files:
        packages.add_around(path)
        reader.start(path)
        server.take(reader.upload)
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
        each: dict[tuple[Where, str], Finding] = {}
        for problem in problems:
            each.setdefault((problem.where, problem.message), problem)
        raise InputError(each.values())
    return Launch(
        nodes=tuple(nodes),
        parameters=dict(server.values),
        files=tuple(reader.files),
        left_out=tuple(dict.fromkeys(reader.left_out)),
        warnings=tuple(dict.fromkeys(warnings)),
    )


def _unsuitable(path: Path, where: Where) -> list[Finding]:
    """Say what keeps a file from being a launch file of ROS 1."""
    if not is_file(path, where):
        return [Finding(where, f"no file {path}", files_near(path))]
    if path.suffix in _NOT_XML:
        message = f"{path.name} is no launch file of ROS 1, which are XML"
        return [Finding(where, message, 'one of ROS 2 is started by "kind: ros2"')]
    return []


def _unknown_args(settings: LaunchSettings, declared: dict[str, bool]) -> list[Finding]:
    """Refuse args that no launch file has; roslaunch would say nothing."""
    known = [name for name, open_ in declared.items() if open_]
    return [
        Finding(
            settings.where(("args", name)),
            f"arg {name} has a fixed value in the launch file"
            if name in declared
            else f"no launch file named here has an arg {name}",
            did_you_mean(name, known),
        )
        for name in settings.args
        if not declared.get(name)
    ]


def _unused_endings(settings: LaunchSettings, skipped: set[str]) -> list[Finding]:
    return [
        Finding(
            settings.where(("skip", index)),
            f'skip: no file that is loaded or included ends with "{ending}"',
            "take it out, or write the file's name as the launch file does",
            Severity.WARNING,
        )
        for index, ending in enumerate(settings.skip)
        if ending not in skipped
    ]


def _errors_of(node: LaunchNode, reader: LaunchReader) -> list[Finding]:
    """Return what names of a node and its parameters lack, and why some could not be read."""
    name = split_name(node.name)
    names = [node.name, *node.remaps, *(remap.to for remap in node.remaps.values())]
    names += map(absolute_name, node.parameters)
    unknown = [reason for text in names for reason in reader.unknown.reasons_in(text)]
    unread = [reason for part in reader.unread if part.inside(name) for reason in part.reasons]
    return unknown + unread


def _warnings_of(node: LaunchNode, reader: LaunchReader) -> list[Finding]:
    """Return notes about parameters of a node, and what may hold some and could not be read."""
    name = split_name(node.name)
    notes = [note for part in reader.notes if part.inside(name) for note in part.reasons]
    return notes + [
        replace(reason, severity=Severity.WARNING)
        for part in reader.unread
        if part.around(name) and not part.inside(name)
        for reason in part.reasons
    ]
