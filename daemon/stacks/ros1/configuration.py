"""Configuration of the whole ROS stack, read from a tree of parameters.

The tree has the namespaces of a parameter server: ``amcl``, and ``move_base`` with
``global_costmap``, ``local_costmap``, the planners and the recoveries in it. Three sections are
not ROS's: ``dispatcher``, ``topics`` and ``quirks``.

move_base loads a planner by its full name (``navfn/NavfnROS``). The last part of the name is the
namespace of its parameters. Only the namespaces of the two planners in use are read.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final, TypeAlias, TypeVar

from daemon.stacks.findings import FindingCollector, ParameterFinding, ParameterFindings
from daemon.stacks.ros1.amcl import AmclParameters
from daemon.stacks.ros1.costmap.layers import LayeredCostmap
from daemon.stacks.ros1.dwa import DwaParameters
from daemon.stacks.ros1.move_base import (
    CLEAR,
    OTHER_NAMES,
    ROTATE,
    ClearCostmapParameters,
    DispatcherParameters,
    MoveBaseParameters,
    RotateRecoveryParameters,
)
from daemon.stacks.ros1.navfn import GlobalPlannerParameters, NavfnParameters
from daemon.stacks.ros1.parameters import Entry, ParameterNamespace, ParameterTree, read_section
from daemon.stacks.ros1.quirks import DEFAULT_PROFILE, Quirks, read_quirks
from daemon.stacks.ros1.trajectory_planner import TrajectoryPlannerParameters
from daemon.stacks.ros1.wiring import COSTMAPS, TopicParameters, Topics, read_costmaps
from grammars.text.diagnostics import did_you_mean

GlobalPlannerChoice: TypeAlias = NavfnParameters | GlobalPlannerParameters
LocalPlannerChoice: TypeAlias = DwaParameters | TrajectoryPlannerParameters
P = TypeVar("P", GlobalPlannerChoice, LocalPlannerChoice)

_DWA: Final = "dwa_local_planner/DWAPlannerROS"
_TRAJECTORY: Final = "base_local_planner/TrajectoryPlannerROS"
GLOBAL: Final[Mapping[str, type[GlobalPlannerChoice]]] = {
    "navfn/NavfnROS": NavfnParameters,
    "global_planner/GlobalPlanner": GlobalPlannerParameters,
}
LOCAL: Final[Mapping[str, type[LocalPlannerChoice]]] = {
    _DWA: DwaParameters,
    _TRAJECTORY: TrajectoryPlannerParameters,
}


def namespace_of(planner: str) -> str:
    """Return the namespace of a plugin's parameters: the last part of its name."""
    return re.split(r"[/:]", planner)[-1]


_PLANNERS: Final = frozenset(namespace_of(name) for name in (*GLOBAL, *LOCAL))
"""Namespaces of the built-in planners."""
_SECTIONS: Final = ("amcl", "move_base", "dispatcher", "topics", "quirks")
_BODY: Final = ("footprint", "robot_radius", "obstacle_range", "raytrace_range")
"""Names that costmaps look up in the namespace of move_base if their own lacks them."""
_ROTATION_OWN: Final = frozenset({"sim_granularity", "frequency"})
_TURN: Final = {*OTHER_NAMES, *(field.name for field in fields(RotateRecoveryParameters))}
"""Names that rotate_recovery reads, most of them in the namespace of TrajectoryPlannerROS."""


@dataclass(frozen=True, slots=True)
class RosParameters:
    """A checked configuration.

    ``local_planner`` includes the controller frequency that it may inherit from move_base.
    ``resets`` holds the parameters of each reset recovery by its name. ``rotate_recovery`` has the
    limits of ``TrajectoryPlannerROS``, or those of DWA if
    :attr:`Quirks.rotate_reads_other_namespace` is off.
    """

    amcl: AmclParameters
    move_base: MoveBaseParameters
    global_costmap: LayeredCostmap
    local_costmap: LayeredCostmap
    global_planner: GlobalPlannerChoice
    local_planner: LocalPlannerChoice
    rotate_recovery: RotateRecoveryParameters
    resets: Mapping[str, ClearCostmapParameters]
    dispatcher: DispatcherParameters
    topics: Topics
    quirks: Quirks
    findings: ParameterFindings


def read_ros(parameters: Mapping[str, Any]) -> RosParameters:
    """Return the configuration in a tree of parameters.

    Raises :class:`~daemon.stacks.findings.ParameterError` with all errors. Warnings are in
    ``findings``.
    """
    report = FindingCollector()
    _check_sections(parameters, report)
    tree = ParameterTree(parameters, report)
    quirks = read_quirks(parameters.get("quirks", DEFAULT_PROFILE), ("quirks",), report)
    move_base = _read_move_base(tree)
    # DWA and TrajectoryPlannerROS inherit this parameter unless they have their own.
    inherited = {"controller_frequency": move_base.controller_frequency}
    local_planner = _read_planner(tree, "local", move_base.base_local_planner, LOCAL, inherited)
    names, amcl = read_section(TopicParameters, tree.at("topics"), report), tree.at("amcl")
    localisation = read_section(AmclParameters, amcl, report, without_effect=_usual_frames(amcl))
    costmaps, topics = read_costmaps(tree, names, localisation)
    resets = _read_resets(tree, move_base, costmaps)
    global_planner = _read_planner(tree, "global", move_base.base_global_planner, GLOBAL, {})
    _ignore_other_planners(tree, move_base)
    return RosParameters(
        amcl=localisation,
        move_base=move_base,
        global_costmap=costmaps[0],
        local_costmap=costmaps[1],
        global_planner=global_planner,
        local_planner=local_planner,
        rotate_recovery=_read_rotation(tree, move_base, local_planner, quirks),
        resets=resets,
        dispatcher=read_section(DispatcherParameters, tree.at("dispatcher"), report),
        topics=topics,
        quirks=quirks,
        findings=report.findings(),
    )


def _check_sections(parameters: Mapping[str, Any], report: FindingCollector) -> None:
    for name in parameters:
        if name == "planner":
            message = "plans are always made as navfn and GlobalPlanner make them"
            report.refuse((name,), message, "leave planner out")
        elif name not in _SECTIONS:
            hint = did_you_mean(name, _SECTIONS)
            report.problems.append(
                ParameterFinding((name,), f'no node here is called "{name}"', hint, unread=True)
            )


def _read_move_base(tree: ParameterTree) -> MoveBaseParameters:
    space = tree.at("move_base")
    listed = space.value("recovery_behaviors")
    names = [
        str(each["name"])
        for each in (listed if isinstance(listed, list) else [])
        if isinstance(each, Mapping) and each.get("name")
    ]
    recoveries = {"rotate_recovery", "conservative_reset", "aggressive_reset", *names}
    if "footprint_padding" in space.entries:
        message = "costmap_2d looks for it in the namespaces of the costmaps only"
        hint = "write it under global_costmap and local_costmap"
        tree.report.warn(("move_base", "footprint_padding"), message, hint)
    return read_section(
        MoveBaseParameters,
        space,
        tree.report,
        elsewhere={*COSTMAPS, *_PLANNERS, *recoveries, *_BODY, "footprint_padding"},
    )


def _usual_frames(amcl: ParameterNamespace) -> dict[str, str]:
    """Return the frame names of AMCL that have no effect, each with the reason."""
    return {
        name: f"costmaps call this frame {usual} anyway"
        for name, usual in (("global_frame_id", "map"), ("odom_frame_id", "odom"))
        if str(amcl.value(name)).removeprefix("/") == usual
    }


def _read_planner(
    tree: ParameterTree,
    kind: str,
    plugin: str,
    planners: Mapping[str, type[P]],
    inherited: Mapping[str, Any],
) -> P:
    """Return a planner's parameters; refuse a planner that is not built in."""
    key = f"base_{kind}_planner"
    if plugin in planners:
        _doubt_choice(tree, key, plugin, [name for name in planners if name != plugin])
        space = tree.at("move_base", namespace_of(plugin))
        return read_section(planners[plugin], space, tree.report, inherited=inherited)
    place = ("move_base", key)
    near = [full for full in planners if namespace_of(full) == namespace_of(plugin.strip())]
    if near:
        message = f'pluginlib knows no {kind} planner "{plugin}": a name is taken to the letter'
        tree.report.refuse(place, message, f"write {near[0]}")
    else:
        message = f"the {kind} planner {plugin} is not built in, {', '.join(planners)} are"
        hint = "to test a stack that uses it, bring that stack itself as the system under test"
        tree.report.refuse(place, message, f"{hint} (docs/ros2.md)")
    return next(iter(planners.values()))()


def _doubt_choice(tree: ParameterTree, key: str, chosen: str, others: Iterable[str]) -> None:
    """Warn of parameters of other planners if nobody chose, or if the chosen one has none."""
    spaces = tree.at("move_base").entries
    message = f"{key} is not given: ROS takes {chosen}, and nobody reads this"
    if key in spaces:
        message = f"{key} is {chosen}, which has no parameters and reads none of these"
    for other in others if key not in spaces or namespace_of(chosen) not in spaces else ():
        unread = {*tree.at("move_base", namespace_of(other)).entries}
        if unread - _TURN or (unread and key not in spaces):
            tree.report.warn(("move_base", namespace_of(other)), message, f"write {key}: {other}")


def _ignore_other_planners(tree: ParameterTree, move_base: MoveBaseParameters) -> None:
    """Report the values in namespaces of planners that are not in use.

    ``TrajectoryPlannerROS`` is exempt: the recovery that turns on the spot reads it.
    """
    plugins = (move_base.base_global_planner, move_base.base_local_planner)
    read = {"TrajectoryPlannerROS", *map(namespace_of, plugins)}
    reason = f"the planners are {' and '.join(plugins)}"
    for space in sorted(_PLANNERS - read):
        for entry in tree.at("move_base", space).entries.values():
            tree.report.ignore(entry.place, reason)


def _read_resets(
    tree: ParameterTree, move_base: MoveBaseParameters, costmaps: Iterable[LayeredCostmap]
) -> dict[str, ClearCostmapParameters]:
    """Return the parameters of each reset recovery; warn if no costmap has its layers."""
    names: Iterable[str] = ("conservative_reset", "aggressive_reset")
    if move_base.recovery_behaviors is not None:
        names = [each.name for each in move_base.recovery_behaviors if each.type == CLEAR]
    spaces = {name: tree.at("move_base", name) for name in names}
    resets = {
        name: read_section(ClearCostmapParameters, space, tree.report)
        for name, space in spaces.items()
    }
    layers = {layer.name for costmap in costmaps for layer in costmap.layers}
    for name, reset in resets.items():
        listed = spaces[name].entries.get("layer_names")
        if listed is not None and not layers & set(reset.layer_names):
            message = f"no costmap has a layer of these names, so {name} clears nothing"
            hint = f"their layers are {', '.join(sorted(layers))}"
            tree.report.warn(listed.place, message, hint)
    return resets


def _read_rotation(
    tree: ParameterTree,
    move_base: MoveBaseParameters,
    planner: LocalPlannerChoice,
    quirks: Quirks,
) -> RotateRecoveryParameters:
    """Return the turn on the spot: its own namespace, and limits from another one."""
    turns = [b.name for b in move_base.recovery_behaviors or () if b.type == ROTATE]
    own = tree.at("move_base", turns[0] if turns else "rotate_recovery")
    for name in [name for name in own.entries if name not in _ROTATION_OWN]:
        hint, message = did_you_mean(name, _ROTATION_OWN), f'nothing reads a parameter "{name}"'
        finding = ParameterFinding(own.entries.pop(name).place, message, hint, unread=True)
        tree.report.problems.append(finding)
    reads_dwa = isinstance(planner, DwaParameters) and not quirks.rotate_reads_other_namespace
    if not reads_dwa:
        own.entries |= _limits(tree, move_base.base_local_planner)
    turn = read_section(RotateRecoveryParameters, own, tree.report)
    if isinstance(planner, DwaParameters) and reads_dwa:
        return replace(
            turn,
            acc_lim_theta=planner.acc_lim_theta or turn.acc_lim_theta,
            max_vel_theta=planner.max_vel_theta or turn.max_vel_theta,
            min_in_place_vel_theta=planner.min_vel_theta,
            yaw_goal_tolerance=planner.yaw_goal_tolerance or turn.yaw_goal_tolerance,
        )
    return turn


def _limits(tree: ParameterTree, local_planner: str) -> dict[str, Entry]:
    """Return the turn's limits in ``TrajectoryPlannerROS``, by name.

    Other names there have no effect unless that controller drives.
    """
    names = {field.name for field in fields(RotateRecoveryParameters)} - _ROTATION_OWN
    space = tree.at("move_base", "TrajectoryPlannerROS")
    entries = space.entries
    # Of two names of a limit the newer one counts (nav_core ``loadParameterWithDeprecation``).
    limits = {OTHER_NAMES[name]: name for name in entries if name in OTHER_NAMES}
    limits |= {name: name for name in entries if name in names}
    if namespace_of(local_planner) != space.path[-1]:
        reason = f"{local_planner} drives; rotate_recovery reads only the limits"
        for name, entry in entries.items():
            if name not in limits.values():
                tree.report.ignore(entry.place, reason)
    return {limit: entries[name] for limit, name in limits.items()}
