"""Nodes as they are started: their arguments, and the names that remaps in scope give them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from grammars.roslaunch._conversion import parameters_among, remaps_among, split_arguments
from grammars.roslaunch._model import LaunchNode, LaunchRemap
from grammars.roslaunch._names import ParameterName, is_legal, resolve_for_node
from grammars.roslaunch._scope import WrittenRemap
from grammars.roslaunch._substitution import Substituted
from grammars.text.diagnostics import Diagnostic, InputError, Where
from grammars.text.ros_yaml import ParameterValue


@dataclass(frozen=True, slots=True)
class StartedNode:
    """A node and what is missing to know its names; ``own`` are parameters in its arguments."""

    node: LaunchNode
    missing: tuple[Diagnostic, ...]
    own: dict[ParameterName, ParameterValue] = field(default_factory=dict)


def start_node(
    node: LaunchNode,
    arguments: Substituted,
    where: Where,
    remaps: Iterable[WrittenRemap],
    missing: tuple[Diagnostic, ...],
) -> StartedNode:
    """Return ``node`` with its arguments (which stand at ``where``) and the remaps in its scope.

    Raises :class:`InputError` for names that ROS does not have.
    """
    words = split_arguments(arguments, where)
    found: dict[str, LaunchRemap] = {}
    for source, to in remaps_among(words).items():
        found[resolve_for_node(source, node.name)] = LaunchRemap(
            resolve_for_node(to, node.name), where
        )
    # roslaunch appends what remaps say to the arguments, and the last one of a name counts.
    for remap in remaps:
        missing = (*missing, *remap.source.missing, *remap.target.missing)
        for name in (remap.source, remap.target):
            if not name.missing and not is_legal(name.text):
                raise InputError.at(remap.where, f'"{name.text}" is no name that ROS has')
        found[resolve_for_node(remap.source.text, node.name)] = LaunchRemap(
            resolve_for_node(remap.target.text, node.name), remap.where
        )
    changes = {source: to for source, to in found.items() if source != to.to}
    return StartedNode(
        replace(node, arguments=words, remaps=changes),
        tuple(dict.fromkeys(missing)),
        parameters_among(words, where, arguments.missing),
    )
