"""Launch files as sections of parameters for the reference stack.

Of the nodes in a launch file, move_base and amcl exist here. Their private parameters become the
sections ``move_base`` and ``amcl``; names, remaps and the topic of the map become ``topics/nodes``
and ``topics/maps``. Every value keeps its place in the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from daemon.campaign._parameter_files import LaunchChange, ParameterValues
from grammars.roslaunch import (
    Launch,
    LaunchNode,
    LaunchSettings,
    NodeType,
    load_launch,
    resolve_for_node,
)
from grammars.text.diagnostics import Finding, InputError, Severity, Where, did_you_mean
from grammars.text.ros_yaml import ParameterValue
from grammars.text.words import first_words

_MOVE_BASE: Final[NodeType] = ("move_base", "move_base")
_AMCL: Final[NodeType] = ("amcl", "amcl")
_MAP_SERVER: Final[NodeType] = ("map_server", "map_server")
_SEARCHED_UPWARDS: Final = ("footprint", "robot_radius")
"""Parameters that costmaps search in every namespace above theirs (costmap_2d, footprint.cpp)."""
_LOCALISERS: Final = {
    "cartographer_ros": "maps while it drives",
    "fake_localization": "gets the true pose of the robot",
    "gmapping": "maps while it drives",
    "hector_mapping": "maps while it drives",
    "mcl_3dl": "localises in 3D",
    "mrpt_localization": "is another particle filter",
    "rtabmap_ros": "maps while it drives",
    "slam_karto": "maps while it drives",
    "slam_toolbox": "maps while it drives",
}
_DRIVERS: Final = {
    "mbf_costmap_nav": "Move Base Flex",
    "mbf_simple_nav": "Move Base Flex",
    "move_base_flex": "Move Base Flex",
}
_EXTERNAL: Final = "test your own stack as an external system, see docs/ros2.md"
_MOST_NAMED: Final = 8


def load_launched(
    base: LaunchChange, changes: Sequence[LaunchChange], warnings: list[Finding]
) -> ParameterValues:
    """Return the parameters of the nodes that launch files start, by section.

    ``base`` names the files, ``changes`` to it come from the SUT files above it, the lowest first.
    Raises :class:`InputError` with all errors.
    """
    files = tuple(
        (base.folder / name, base.where("launch", index))
        for index, name in enumerate(base.source.launch)
    )
    where = base.where("launch")
    launch = load_launch(files, _launch_settings((base, *changes)), {_MOVE_BASE, _AMCL})
    warnings += launch.warnings
    move_base = _choose_move_base(launch, (base, *changes), where)
    amcl = _choose_amcl(launch, move_base, where, warnings)
    settings = _inherited(launch, move_base)
    for section, node in (("move_base", move_base), ("amcl", amcl)):
        if node is not None:
            settings |= _section(section, node)
    return settings | _maps(launch, amcl or move_base)


def _launch_settings(changes: Sequence[LaunchChange]) -> LaunchSettings:
    """Return the settings of all SUT files for launch files."""
    places: dict[tuple[str | int, ...], Where] = {}
    args: dict[str, str] = {}
    env: dict[str, str] = {}
    packages: list[tuple[Path, Where]] = []
    skip: list[str] = []
    for change in changes:
        source = change.source
        args |= source.args
        env |= source.env
        places |= {("args", name): change.where("args", name) for name in source.args}
        # The packages of a file come before those of the files below it.
        packages[:0] = [
            (change.folder / name, change.where("packages", index))
            for index, name in enumerate(source.packages)
        ]
        skip += [ending for ending in source.skip if ending not in skip]
        for index, ending in enumerate(source.skip):
            places["skip", skip.index(ending)] = change.where("skip", index)
    places |= {("packages", index): where for index, (_, where) in enumerate(packages)}
    folders = tuple(folder for folder, _ in packages)
    return LaunchSettings(places.__getitem__, args, folders, env, tuple(skip))


def _section(section: str, node: LaunchNode) -> ParameterValues:
    settings = {(section, *name): parameter for name, parameter in node.parameters.items()}
    above = ("topics", "nodes", section)
    settings[(*above, "name")] = ParameterValue(node.name, node.where)
    for source, remap in node.remaps.items():
        settings[(*above, "remap", source)] = ParameterValue(remap.to, remap.where)
    return settings


def _inherited(launch: Launch, move_base: LaunchNode) -> ParameterValues:
    """Return the values that costmaps find above move_base, from the nearest namespace."""
    spaces = tuple(part for part in move_base.name.split("/") if part)
    return {
        ("move_base", name): launch.parameters[*spaces[:depth], name]
        for depth in range(len(spaces))
        for name in _SEARCHED_UPWARDS
        if (*spaces[:depth], name) in launch.parameters
    }


def _choose_move_base(launch: Launch, changes: Sequence[LaunchChange], where: Where) -> LaunchNode:
    """Return the move_base to test: the only one, or the one that the last SUT file names."""
    nodes = [node for node in launch.nodes if node.kind == _MOVE_BASE]
    for change in reversed(changes):
        if change.source.node is None:
            continue
        name = "/" + change.source.node.strip("/")
        for node in nodes:
            if node.name == name:
                return node
        hint = did_you_mean(name, (node.name for node in nodes))
        raise InputError.at(change.where("node"), f"node: no move_base is called {name}", hint)
    if not nodes:
        others = [node for node in launch.nodes if node.package in _DRIVERS]
        message = f"starts no move_base; it starts {_listed(launch.nodes)}"
        hints = [
            *(f"{node.name} is {_DRIVERS[node.package]}: {_EXTERNAL}" for node in others),
            *_left_out(launch),
        ]
        raise InputError.at(where, message, "; ".join(hints))
    if len(nodes) > 1:
        names = ", ".join(f"{node.name} ({_place(node)})" for node in nodes)
        message = f"starts {len(nodes)} move_base nodes: {names}"
        raise InputError.at(where, message, f'write "node: {nodes[0].name}" for that one')
    return nodes[0]


def _choose_amcl(
    launch: Launch, move_base: LaunchNode, where: Where, warnings: list[Finding]
) -> LaunchNode | None:
    """Return the amcl of a robot: the only one, or the one beside its move_base."""
    nodes = [node for node in launch.nodes if node.kind == _AMCL]
    space = move_base.name.rpartition("/")[0]
    beside = [node for node in nodes if node.name.rpartition("/")[0] == space]
    if len(nodes) == 1 or len(beside) == 1:
        return (beside if len(beside) == 1 else nodes)[0]
    if nodes:
        names = ", ".join(f"{node.name} ({_place(node)})" for node in nodes)
        message = f"starts {len(nodes)} amcl nodes: {names}"
        hint = f"one of them must be in the namespace of {move_base.name}"
        raise InputError.at(where, message, hint)
    message = "starts no amcl: amcl's defaults apply here, except for parameters/amcl"
    others = [
        f"{node.name} ({node.package}) {_LOCALISERS[node.package]}, which is not supported here"
        for node in launch.nodes
        if node.package in _LOCALISERS
    ]
    hint = "; ".join([*others, *_left_out(launch)])
    warnings.append(Finding(where, message, hint, Severity.WARNING))
    return None


def _left_out(launch: Launch) -> list[str]:
    """Return a hint on includes of missing packages, which may start the node."""
    if not launch.left_out:
        return []
    return [f"a file that is left out may start it: {', '.join(launch.left_out)}"]


def _maps(launch: Launch, listener: LaunchNode) -> ParameterValues:
    """Return the topics of the map of a run, the one that ``listener`` hears.

    A server of another map, such as one of forbidden places, is left out: no run has it.
    """
    servers = {
        _resolve_topic(node, "map"): node for node in launch.nodes if node.kind == _MAP_SERVER
    }
    topic = _resolve_topic(listener, "map")
    server = servers.get(topic) or (next(iter(servers.values())) if len(servers) == 1 else None)
    if server is None:
        return {}
    same = [name for name, node in servers.items() if node.arguments == server.arguments]
    return {("topics", "maps"): ParameterValue(same, server.where)}


def _resolve_topic(node: LaunchNode, name: str) -> str:
    """Return the full topic of ``name`` in ``node``."""
    full = resolve_for_node(name, node.name)
    remap = node.remaps.get(full)
    return full if remap is None else remap.to


def _listed(nodes: Iterable[LaunchNode]) -> str:
    names = [f"{node.name} ({node.package}/{node.type})" for node in nodes]
    return first_words(names, _MOST_NAMED) or "no node at all"


def _place(node: LaunchNode) -> str:
    return f"{Path(node.where.file).name}:{node.where.line}"
