"""The whole configuration of the ROS stack, from the tree of parameters people have.

The tree holds what a parameter server holds, by namespace (``amcl``, ``move_base`` with
``global_costmap``, ``local_costmap``, ``DWAPlannerROS``, ``NavfnROS`` and the recoveries in it),
and three sections that are not ROS's: ``dispatcher``, ``topics`` and ``quirks``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final, Literal

from daemon.stacks.findings import (
    FindingCollector,
    ParameterFinding,
    ParameterFindings,
    ParameterLocation,
)
from daemon.stacks.ros1 import amcl, navfn
from daemon.stacks.ros1.amcl import AmclParameters
from daemon.stacks.ros1.costmap import (
    CostmapContext,
    LayeredCostmap,
    Namespace,
    ObservationSource,
    ObstacleLayer,
    read_costmap,
)
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
    resolve_topics,
)
from grammars.text.diagnostics import did_you_mean

_SECTIONS: Final = ("amcl", "move_base", "dispatcher", "topics", "quirks")
_COSTMAPS: Final = ("global_costmap", "local_costmap")
_FRAMES: Final[tuple[tuple[str, Literal["map", "odom"]], ...]] = (
    ("global_frame_id", "map"),
    ("odom_frame_id", "odom"),
)
_PLANNERS: Final = ("NavfnROS", "DWAPlannerROS", "TrajectoryPlannerROS")
_OTHER_PLANNER: Final = "DWA drives; of this namespace only rotate_recovery reads its limits"
_ONLY_LOCAL_SHOWN: Final = "only the local costmap is shown"
_ROTATION_OWN: Final = frozenset({"sim_granularity", "frequency"})


@dataclass(frozen=True, slots=True)
class RosParameters:
    """A checked configuration.

    ``dwa`` has the controller frequency it inherits from move_base where it has none of its own;
    ``topics`` says who listens where, ``wiring`` who hears the laser of a robot that has one;
    ``resets`` holds the parameters of each reset recovery by its name;
    ``rotate_recovery`` has the limits of ``TrajectoryPlannerROS``, or those of DWA when
    :attr:`Quirks.rotate_reads_other_namespace` is off.
    """

    amcl: AmclParameters
    move_base: MoveBaseParameters
    global_costmap: LayeredCostmap
    local_costmap: LayeredCostmap
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
    localisation = read_section(
        AmclParameters,
        tree.at("amcl"),
        ("amcl",),
        report,
        without_effect=amcl.WITHOUT_EFFECT,
    )
    costmaps, topics = _read_costmaps(tree, given)
    return RosParameters(
        amcl=localisation,
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


def _read_costmaps(tree: _Tree, given: TopicParameters) -> tuple[dict[str, LayeredCostmap], Topics]:
    """Return both costmaps, and who listens where."""
    topics = resolve_topics(given, (), ())
    if not topics.heard(ONE_LASER).amcl and not topics.by_laser:
        message = f"amcl listens to {topics.amcl}, the scan comes on {topics.published}"
        hint = "amcl never corrects odometry: set topics/amcl or topics/remap"
        tree.report.problems.append(ParameterFinding(("topics",), message, hint))
    context = CostmapContext(
        above=Namespace.of(tree.at("move_base"), ("move_base",)),
        frames=_frames(tree.at("amcl")),
        resolve=lambda name: given.resolve("move_base", name),
        maps=given.resolved_maps(),
        may_carry_scan=topics.may_carry_scan,
    )
    costmaps = {name: _read_costmap(tree, name, context) for name in _COSTMAPS}
    wide, near = (
        tuple(dict.fromkeys(source.topic for source in _sources(costmaps[name])))
        for name in _COSTMAPS
    )
    topics = replace(topics, global_costmap=wide, local_costmap=near)
    for name, costmap in costmaps.items():
        tree.report.problems += _deaf_sources(name, costmap, topics, tree.at("move_base", name))
    return costmaps, topics


def _frames(amcl_parameters: Mapping[str, Any]) -> dict[str, Literal["map", "odom"]]:
    """Return which of the two frames has which name, as amcl broadcasts them."""
    names: dict[str, Literal["map", "odom"]] = {}
    for parameter, frame in _FRAMES:
        given = amcl_parameters.get(parameter, frame)
        names[(given if isinstance(given, str) else frame).strip("/")] = frame
    return names


def _read_costmap(tree: _Tree, name: str, context: CostmapContext) -> LayeredCostmap:
    path = ("move_base", name)
    given = tree.at(*path)
    wide = name == "global_costmap"
    # MoveBase::executeCycle asks the controller's costmap alone whether it is current.
    costmap = read_costmap(given, path, tree.report, replace(context, stops_robot=not wide))
    if wide and "publish_frequency" in given:
        tree.report.without_effect.append(
            ParameterFinding((*path, "publish_frequency"), _ONLY_LOCAL_SHOWN)
        )
    if not wide and given and "global_frame" not in given:
        message = "global_frame is not given: ROS takes map, a local costmap usually has odom"
        hint = "write global_frame: odom, or map if that is meant"
        tree.report.problems.append(ParameterFinding(path, message, hint))
    return costmap


def _sources(costmap: LayeredCostmap) -> tuple[ObservationSource, ...]:
    return tuple(
        source
        for layer in costmap.layers
        if isinstance(layer, ObstacleLayer)
        for source in layer.sources
    )


def _deaf_sources(
    name: str, costmap: LayeredCostmap, topics: Topics, given: Mapping[str, Any]
) -> Iterator[ParameterFinding]:
    """Yield what is to be said of sources on topics where no laser can be."""
    title = name.replace("_", " ")
    sources = _sources(costmap)
    deaf = [source for source in sources if not topics.may_carry_scan(source.topic)]
    hint = f"the {title} shows no obstacle that the map does not show"
    comes = topics.published
    if topics.by_laser:
        comes = ", ".join(topic for each in topics.by_laser.values() for topic in each)
    if not sources:
        message = f"the {title} has no source of type LaserScan"
        yield ParameterFinding(("move_base", name, "observation_sources"), message, hint)
    elif len(deaf) == len(sources):
        listens = ", ".join(dict.fromkeys(source.topic for source in deaf))
        message = f"the {title} listens to {listens}, the scan comes on {comes}"
        yield ParameterFinding(_place(name, costmap, deaf[0], given), message, hint)
    else:
        for source in deaf:
            message = f'the source "{source.name}" of the {title} listens to {source.topic}'
            hint = f"no laser is there: lasers come on {comes}"
            yield ParameterFinding(_place(name, costmap, source, given), message, hint)


def _place(
    name: str, costmap: LayeredCostmap, source: ObservationSource, given: Mapping[str, Any]
) -> ParameterLocation:
    """Return where the topic of a source stands: below its layer, or flat in the costmap's."""
    layers = (each for each in costmap.layers if isinstance(each, ObstacleLayer))
    layer = next(each.name for each in layers if source in each.sources)
    own = given.get(layer)
    inside = isinstance(own, Mapping) and source.name in own
    return ("move_base", name, *((layer,) if inside else ()), source.name, "topic")


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
