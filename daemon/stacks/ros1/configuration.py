"""The whole configuration of the ROS stack, from the tree of parameters people have.

The tree holds what a parameter server holds, by namespace (``amcl``, ``move_base`` with
``global_costmap``, ``local_costmap``, ``DWAPlannerROS``, ``NavfnROS`` and the recoveries in it),
and three sections that are not ROS's: ``dispatcher``, ``topics`` and ``quirks``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final

from daemon.stacks.findings import (
    FindingCollector,
    ParameterFinding,
    ParameterFindings,
    ParameterLocation,
)
from daemon.stacks.ros1 import amcl, navfn
from daemon.stacks.ros1.amcl import AmclParameters
from daemon.stacks.ros1.costmap import CostmapParameters, ObservationSource, read_costmap
from daemon.stacks.ros1.dwa import WITHOUT_EFFECT as DWA_WITHOUT_EFFECT
from daemon.stacks.ros1.dwa import DwaParameters, contradictions
from daemon.stacks.ros1.move_base import (
    CLEAR,
    CLEAR_COSTMAP_WITHOUT_EFFECT,
    MOVE_BASE_WITHOUT_EFFECT,
    OTHER_NAMES,
    ROTATE,
    ClearCostmapParameters,
    DispatcherParameters,
    MoveBaseParameters,
    RotateRecoveryParameters,
)
from daemon.stacks.ros1.navfn import NavfnParameters
from daemon.stacks.ros1.parameters import read_section
from daemon.stacks.ros1.quirks import Quirks, read_quirks
from daemon.stacks.ros1.topics import (
    ONE_LASER,
    TopicParameters,
    Topics,
    Wiring,
    resolve_name,
    resolve_topics,
)
from grammars.text.diagnostics import did_you_mean

_SECTIONS: Final = ("amcl", "move_base", "dispatcher", "topics", "quirks")
_COSTMAPS: Final = ("global_costmap", "local_costmap")
_PLANNERS: Final = ("NavfnROS", "DWAPlannerROS", "TrajectoryPlannerROS")
_OTHER_PLANNER: Final = "DWA drives; of this namespace only rotate_recovery reads its limits"
_ONLY_LOCAL_SHOWN: Final = "only the local costmap is shown"
_ROTATION_OWN: Final = frozenset({"sim_granularity", "frequency"})


@dataclass(frozen=True, slots=True)
class RosParameters:
    """A checked configuration.

    ``dwa`` has the controller frequency it inherits from move_base where it has none of its own;
    the costmaps have only those sources that hear the scan (``topics`` and ``wiring`` say who
    listens where); ``resets`` holds the parameters of each reset recovery by its name;
    ``rotate_recovery`` has the limits of ``TrajectoryPlannerROS``, or those of DWA when
    :attr:`Quirks.rotate_reads_other_namespace` is off.
    """

    amcl: AmclParameters
    move_base: MoveBaseParameters
    global_costmap: CostmapParameters
    local_costmap: CostmapParameters
    navfn: NavfnParameters
    dwa: DwaParameters
    rotate_recovery: RotateRecoveryParameters
    resets: Mapping[str, ClearCostmapParameters]
    dispatcher: DispatcherParameters
    topics: Topics
    wiring: Wiring
    quirks: Quirks
    findings: ParameterFindings


def read_ros(parameters: Mapping[str, Any]) -> RosParameters:
    """Return the configuration in a tree of parameters.

    Raises :class:`~daemon.stacks.ros1.parameters.ParameterError` with everything that is wrong;
    what a run can live with is in ``findings``.
    """
    report = FindingCollector()
    _refuse_unknown_sections(parameters, report)
    tree = _Tree(parameters, report)
    quirks = read_quirks(parameters.get("quirks", "original"), ("quirks",), report)
    move_base = _read_move_base(tree)
    dwa = _read_dwa(tree, move_base)
    given = read_section(TopicParameters, tree.at("topics"), ("topics",), report, strict=True)
    costmaps = {name: _read_costmap(tree, name) for name in _COSTMAPS}
    topics, costmaps = _connect_topics(given, costmaps, report)
    return RosParameters(
        amcl=read_section(
            AmclParameters,
            tree.at("amcl"),
            ("amcl",),
            report,
            without_effect=amcl.WITHOUT_EFFECT,
        ),
        move_base=move_base,
        global_costmap=costmaps["global_costmap"],
        local_costmap=costmaps["local_costmap"],
        navfn=read_section(
            NavfnParameters,
            tree.at("move_base", "NavfnROS"),
            ("move_base", "NavfnROS"),
            report,
            without_effect=navfn.WITHOUT_EFFECT,
        ),
        dwa=dwa,
        rotate_recovery=_read_rotation(tree, move_base, dwa, quirks),
        resets={name: _read_reset(tree, name) for name in _resets(move_base)},
        dispatcher=read_section(
            DispatcherParameters, tree.at("dispatcher"), ("dispatcher",), report, strict=True
        ),
        topics=topics,
        wiring=topics.heard(ONE_LASER),
        quirks=quirks,
        findings=report.findings(),
    )


@dataclass(frozen=True, slots=True)
class _Tree:
    """The given tree; a namespace that is not there is empty."""

    data: Mapping[str, Any]
    report: FindingCollector

    def at(self, *path: str) -> Mapping[str, Any]:
        """Return a namespace; that it is no namespace is reported."""
        node: Mapping[str, Any] = self.data
        for depth, name in enumerate(path):
            below = node.get(name, {})
            if not isinstance(below, Mapping):
                place = path[: depth + 1]
                self.report.fatal.append(ParameterFinding(place, "must be names with values"))
                return {}
            node = below
        return node


def _refuse_unknown_sections(parameters: Mapping[str, Any], report: FindingCollector) -> None:
    for name in parameters:
        if name not in _SECTIONS:
            hint = did_you_mean(name, _SECTIONS)
            report.problems.append(
                ParameterFinding((name,), f'no node here is called "{name}"', hint)
            )


def _read_move_base(tree: _Tree) -> MoveBaseParameters:
    given = tree.at("move_base")
    names = [name for entry in _listed(given) if (name := entry.get("name"))]
    recoveries = {"rotate_recovery", "conservative_reset", "aggressive_reset", *map(str, names)}
    if given and "base_local_planner" not in given:
        message = (
            "base_local_planner is not given: ROS would take TrajectoryPlannerROS, here is DWA"
        )
        hint = "write base_local_planner: dwa_local_planner/DWAPlannerROS"
        tree.report.problems.append(ParameterFinding(("move_base",), message, hint))
    return read_section(
        MoveBaseParameters,
        given,
        ("move_base",),
        tree.report,
        without_effect=MOVE_BASE_WITHOUT_EFFECT,
        elsewhere=frozenset({*_COSTMAPS, *_PLANNERS, *recoveries}),
    )


def _listed(given: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    listed = given.get("recovery_behaviors")
    return [e for e in listed if isinstance(e, Mapping)] if isinstance(listed, list) else []


def _read_dwa(tree: _Tree, move_base: MoveBaseParameters) -> DwaParameters:
    """Return the parameters of DWA; limits no robot can drive with are fatal."""
    path = ("move_base", "DWAPlannerROS")
    given = tree.at(*path)
    before = len(tree.report.fatal)
    dwa = read_section(DwaParameters, given, path, tree.report, without_effect=DWA_WITHOUT_EFFECT)
    if len(tree.report.fatal) == before:
        for found in contradictions(dwa):
            # At the first of its parameters that somebody wrote; the others have their defaults.
            written = [name for name in found.names if name in given][:1]
            tree.report.fatal.append(ParameterFinding((*path, *written), found.text))
    if dwa.controller_frequency is None:
        return replace(dwa, controller_frequency=move_base.controller_frequency)
    return dwa


def _read_costmap(tree: _Tree, name: str) -> CostmapParameters:
    """Return one costmap: the global one lies in map, the local one in odom."""
    path = ("move_base", name)
    given = tree.at(*path)
    costmap = read_costmap(given, path, tree.report)
    if name == "global_costmap" and "publish_frequency" in given:
        tree.report.without_effect.append(
            ParameterFinding((*path, "publish_frequency"), _ONLY_LOCAL_SHOWN)
        )
    frame = {"global_costmap": "map", "local_costmap": "odom"}[name]
    if "global_frame" not in given:
        if frame != costmap.global_frame and given:
            message = f"global_frame is not given: ROS would take map, here it is {frame}"
            tree.report.problems.append(
                ParameterFinding(path, message, f"write global_frame: {frame}")
            )
    elif costmap.global_frame.strip("/") != frame:
        message = f"must be {frame}, the only frame this costmap can have here"
        tree.report.fatal.append(ParameterFinding((*path, "global_frame"), message))
    return replace(costmap, global_frame=frame)


def _connect_topics(
    given: TopicParameters, costmaps: dict[str, CostmapParameters], report: FindingCollector
) -> tuple[Topics, dict[str, CostmapParameters]]:
    """Return who listens where, and the costmaps with only the sources that hear the scan."""
    lasers = {name: _lasers(costmap) for name, costmap in costmaps.items()}
    topics = resolve_topics(
        given, *([source.topic for source in lasers[name]] for name in _COSTMAPS)
    )
    if not topics.heard(ONE_LASER).amcl and not topics.by_laser:
        message = f"amcl listens to {topics.amcl}, the scan comes on {topics.published}"
        hint = "amcl never corrects odometry: set topics/amcl or topics/remap"
        report.problems.append(ParameterFinding(("topics",), message, hint))
    connected = {}
    for name, costmap in costmaps.items():
        heard = tuple(
            source
            for source in lasers[name]
            if resolve_name(source.topic, "/move_base", given.remap) == topics.published
        )
        connected[name] = replace(costmap, sources=heard)
        if not heard:
            report.problems.append(
                _no_scan_finding(name, costmap, getattr(topics, name), topics.published)
            )
    return topics, connected


def _lasers(costmap: CostmapParameters) -> tuple[ObservationSource, ...]:
    return tuple(s for s in costmap.sources if s.data_type == "LaserScan")


def _no_scan_finding(
    name: str, costmap: CostmapParameters, listens: tuple[str, ...], published: str
) -> ParameterFinding:
    title = name.replace("_", " ")
    hint = f"the {title} shows no obstacle that the map does not show"
    if not listens:
        path: ParameterLocation = ("move_base", name, "observation_sources")
        return ParameterFinding(path, f"the {title} has no source of type LaserScan", hint)
    path = ("move_base", name, _lasers(costmap)[0].name, "topic")
    message = f"the {title} listens to {', '.join(listens)}, the scan comes on {published}"
    return ParameterFinding(path, message, hint)


def _resets(move_base: MoveBaseParameters) -> tuple[str, ...]:
    """Return the names of the reset recoveries."""
    if move_base.recovery_behaviors is None:
        return ("conservative_reset", "aggressive_reset")
    return tuple(b.name for b in move_base.recovery_behaviors if b.type == CLEAR)


def _read_reset(tree: _Tree, name: str) -> ClearCostmapParameters:
    return read_section(
        ClearCostmapParameters,
        tree.at("move_base", name),
        ("move_base", name),
        tree.report,
        without_effect=CLEAR_COSTMAP_WITHOUT_EFFECT,
    )


def _read_rotation(
    tree: _Tree, move_base: MoveBaseParameters, dwa: DwaParameters, quirks: Quirks
) -> RotateRecoveryParameters:
    """Return the turn on the spot: its own namespace and the limits of another one."""
    turns = [b.name for b in move_base.recovery_behaviors or () if b.type == ROTATE]
    name = turns[0] if turns else "rotate_recovery"
    own = _read_part(tree, ("move_base", name), _ROTATION_OWN)
    if not quirks.rotate_reads_other_namespace:
        return replace(
            own,
            acc_lim_theta=dwa.acc_lim_theta or own.acc_lim_theta,
            max_vel_theta=dwa.max_vel_theta or own.max_vel_theta,
            min_in_place_vel_theta=dwa.min_vel_theta,
            yaw_goal_tolerance=dwa.yaw_goal_tolerance or own.yaw_goal_tolerance,
        )
    limits = frozenset(f.name for f in fields(RotateRecoveryParameters)) - _ROTATION_OWN
    other = _read_part(tree, ("move_base", "TrajectoryPlannerROS"), limits)
    return replace(other, sim_granularity=own.sim_granularity, frequency=own.frequency)


def _read_part(
    tree: _Tree, path: tuple[str, str], names: frozenset[str]
) -> RotateRecoveryParameters:
    """Read those parameters of the recovery that stand in one namespace."""
    given = tree.at(*path)
    renamed = {OTHER_NAMES.get(name, name): value for name, value in given.items()}
    mine = {name: value for name, value in renamed.items() if name in names}
    for name in given:
        if OTHER_NAMES.get(name, name) in names:
            continue
        if path[-1] in _PLANNERS:
            tree.report.without_effect.append(ParameterFinding((*path, name), _OTHER_PLANNER))
        else:
            hint = did_you_mean(name, names)
            message = f'nothing reads a parameter "{name}"'
            tree.report.problems.append(ParameterFinding((*path, name), message, hint))
    return read_section(RotateRecoveryParameters, mine, path, tree.report)
