"""Built-in planners by their pluginlib names, and their parameters.

move_base loads a planner by its full name (``navfn/NavfnROS``). The last part of the name is the
namespace of its parameters. Only the namespaces of the two planners in use are read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final, TypeAlias, TypeVar

from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.global_planner import GlobalPlannerParameters
from daemon.stacks.ros1.navfn import NavfnParameters
from daemon.stacks.ros1.parameters import ParameterTree, read_section
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters

GlobalPlannerChoice: TypeAlias = NavfnParameters | GlobalPlannerParameters
LocalPlannerChoice: TypeAlias = DwaParameters | TrajectoryPlannerParameters
P = TypeVar("P", GlobalPlannerChoice, LocalPlannerChoice)

DWA: Final = "dwa_local_planner/DWAPlannerROS"
TRAJECTORY: Final = "base_local_planner/TrajectoryPlannerROS"
GLOBAL: Final[Mapping[str, type[GlobalPlannerChoice]]] = {
    "navfn/NavfnROS": NavfnParameters,
    "global_planner/GlobalPlanner": GlobalPlannerParameters,
}
LOCAL: Final[Mapping[str, type[LocalPlannerChoice]]] = {
    DWA: DwaParameters,
    TRAJECTORY: TrajectoryPlannerParameters,
}
_ELSEWHERE: Final = (
    "to test a stack that uses it, bring that stack itself as the system under test (docs/ros2.md)"
)


def namespace_of(planner: str) -> str:
    """Return the namespace of a plugin's parameters: the last part of its name."""
    return re.split(r"[/:]", planner)[-1]


NAMESPACES: Final = frozenset(namespace_of(name) for name in (*GLOBAL, *LOCAL))
"""Namespaces of the built-in planners."""


def read_global_planner(tree: ParameterTree, plugin: str) -> GlobalPlannerChoice:
    """Return the parameters of the global planner ``plugin``; refuse an unknown one."""
    return _read(tree, "global", plugin, GLOBAL, {})


def read_local_planner(
    tree: ParameterTree, plugin: str, controller_frequency: float
) -> LocalPlannerChoice:
    """Return the parameters of the local planner ``plugin``; refuse an unknown one.

    It inherits ``controller_frequency`` [Hz] unless it has its own.
    """
    inherited = {"controller_frequency": controller_frequency}
    return _read(tree, "local", plugin, LOCAL, inherited)


def _read(
    tree: ParameterTree,
    kind: str,
    plugin: str,
    planners: Mapping[str, type[P]],
    inherited: Mapping[str, Any],
) -> P:
    """Read a planner's section; refuse a planner that is not built in."""
    if plugin in planners:
        path = ("move_base", namespace_of(plugin))
        return read_section(
            planners[plugin], tree.at(*path), path, tree.report, inherited=inherited
        )
    place = ("move_base", f"base_{kind}_planner")
    near = [full for full in planners if namespace_of(full) == namespace_of(plugin.strip())]
    if near:
        message = f'pluginlib knows no {kind} planner "{plugin}": a name is taken to the letter'
        tree.report.refuse(place, message, f"write {near[0]}")
    else:
        message = f"the {kind} planner {plugin} is not built in, {', '.join(planners)} are"
        tree.report.refuse(place, message, _ELSEWHERE)
    return next(iter(planners.values()))()


def say_unread(tree: ParameterTree, plugins: tuple[str, str]) -> None:
    """Report the values in namespaces of planners other than the two ``plugins``.

    ``TrajectoryPlannerROS`` is exempt: the recovery that turns on the spot reads it.
    """
    read = {namespace_of(name) for name in plugins}
    for space in sorted(NAMESPACES - read - {"TrajectoryPlannerROS"}):
        reason = f"the planners are {' and '.join(plugins)}"
        for name in tree.at("move_base", space):
            tree.report.ignore(("move_base", space, name), reason)
