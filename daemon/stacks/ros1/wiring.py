"""Wiring of lasers: topics as roscpp resolves them, listeners, advice for a robot.

A name without a leading slash is resolved in the namespace of the node (``/`` for a node called
``/move_base``), ``~name`` below the node's own name. A remap of the launch file holds for every
node, also for the simulator and the driver: **the published name is remapped too**. A remap of one
node holds for that node. A name is remapped only once.

A configuration gives the topics of listeners and their heights, a robot the lasers. Advice
therefore needs a robot. It also describes what the original would do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from pydantic import ConfigDict, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass as checked

from daemon.stacks.findings import ParameterFinding, ParameterLocation
from daemon.stacks.ros1.amcl import AmclParameters
from daemon.stacks.ros1.costmap import point_height
from daemon.stacks.ros1.costmap.layers import (
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    VoxelLayer,
)
from daemon.stacks.ros1.costmap.reading import CostmapContext, CostmapReader
from daemon.stacks.ros1.parameters import ALTERNATIVE, ParameterTree, Section
from grammars.model.robot import Laser, Robot

_Name: TypeAlias = Annotated[str, Field(pattern=r"^[~/]?[A-Za-z][A-Za-z0-9_/]*$", max_length=200)]
_NodeName: TypeAlias = Annotated[str, Field(pattern=r"^/[A-Za-z][A-Za-z0-9_/]*$", max_length=200)]
NodeOfStack: TypeAlias = Literal["amcl", "move_base"]
COSTMAPS: Final = ("global_costmap", "local_costmap")
_SCAN: Final[ParameterLocation] = ("topics", "scan")
_WHERE: Final = "topics/scan says where lasers are published"
_ONE: Final = f"{ALTERNATIVE} one"
_SEVERAL: Final = f"{ALTERNATIVE} several"
# With tags, messages are about the intended alternative only.
_Topics: TypeAlias = Annotated[
    Annotated[_Name, Tag(_ONE)] | Annotated[tuple[_Name, ...], Tag(_SEVERAL)],
    Discriminator(lambda value: _SEVERAL if isinstance(value, list | tuple) else _ONE),
]
_Scan: TypeAlias = Annotated[
    Annotated[_Name, Tag(_ONE)] | Annotated[dict[str, _Topics], Tag(_SEVERAL)],
    Discriminator(lambda value: _SEVERAL if isinstance(value, Mapping) else _ONE),
]


@checked(frozen=True, slots=True, config=ConfigDict(extra="forbid"))
class NodeNames:
    """Name and remaps of one node in the launch file."""

    name: _NodeName | None = None
    """Full name, such as /robot1/move_base."""
    remap: dict[_Name, _Name] = Field(default_factory=dict)
    """Remaps for this node alone, before those for every node."""


@checked(frozen=True, slots=True)
class TopicParameters(Section):
    """Topics of scans and maps, and the names in the launch file."""

    strict: ClassVar[bool] = True

    scan: _Scan | None = None
    """Topic of the laser before any remap, or topics by laser. Default: the topic of amcl; of
    several lasers /scan_NAME."""
    amcl: _Name | None = None
    """Topic to which the launch file of amcl remaps "scan"."""
    remap: dict[_Name, _Name] = Field(default_factory=dict)
    """Remaps for every node, the one that publishes the scan included."""
    nodes: dict[NodeOfStack, NodeNames] = Field(default_factory=dict)
    """Names and remaps of amcl and of move_base alone."""
    maps: tuple[_Name, ...] | None = None
    """Topics of the map of the run. Default: the map topic of amcl."""

    def resolve(self, node: NodeOfStack, name: str) -> str:
        """Return the name that ``node`` uses for ``name``."""
        names = self.nodes.get(node, NodeNames())
        return resolve_name(name, names.name or f"/{node}", {**self.remap, **names.remap})

    def resolved_maps(self) -> tuple[str, ...]:
        """Return the topics on which the map of the run is published."""
        if self.maps is None:
            return (self.resolve("amcl", "map"),)
        return tuple(_absolute(name, "") for name in self.maps)

    def resolved_amcl(self) -> str:
        """Return the topic that amcl subscribes to as ``scan``.

        roscpp looks a name up once: after a remap in its own launch file (``amcl``), the enclosing
        launch file does not remap it again.
        """
        if self.amcl is None:
            return self.resolve("amcl", "scan")
        return _absolute(self.amcl, self.nodes.get("amcl", NodeNames()).name or "/amcl")

    def resolved_scans(self) -> Scans:
        """Return the topics on which lasers are published."""
        if isinstance(self.scan, str):
            return Scans(resolve_name(self.scan, "", self.remap), {})
        by_laser: dict[str, tuple[str, ...]] = {}
        for laser, names in (self.scan or {}).items():
            listed = (names,) if isinstance(names, str) else names
            by_laser[laser] = tuple(resolve_name(name, "", self.remap) for name in listed)
        return Scans(self.resolved_amcl(), by_laser)


@dataclass(frozen=True, slots=True)
class Wiring:
    """Names of the lasers that each part of the stack receives; a single laser may be nameless."""

    amcl: tuple[str, ...]
    global_costmap: tuple[str, ...]
    local_costmap: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Scans:
    """Resolved names of the topics on which scans are published.

    ``by_laser`` holds the topics by laser, if the file gives them. Otherwise a single laser is on
    ``published``, and laser NAME of several is on ``published`` with the suffix ``_NAME``.
    """

    published: str
    by_laser: Mapping[str, tuple[str, ...]]

    def lasers(self) -> tuple[str, ...]:
        """Return the names of the lasers in the file; a single laser has an empty name."""
        return tuple(self.by_laser) or ("",)

    def topics_of(self, laser: str, lasers: Sequence[str]) -> tuple[str, ...]:
        """Return the topics on which ``laser`` of a robot with ``lasers`` (names) is published."""
        if self.by_laser:
            return self.by_laser.get(laser, ())
        return (self.published,) if len(lasers) == 1 else (f"{self.published}_{laser}",)

    def lasers_on(self, topic: str, lasers: Sequence[str]) -> tuple[str, ...]:
        """Return the names among a robot's ``lasers`` that are published on ``topic``."""
        return tuple(name for name in lasers if topic in self.topics_of(name, lasers))

    def may_carry_scan(self, topic: str) -> bool:
        """Tell whether some robot may publish a laser on ``topic``."""
        if self.by_laser:
            return any(topic in topics for topics in self.by_laser.values())
        return topic == self.published or topic.startswith(f"{self.published}_")


@dataclass(frozen=True, slots=True)
class Topics(Scans):
    """Resolved topics of the scans, and of each part that listens to them."""

    amcl: str
    global_costmap: tuple[str, ...]
    local_costmap: tuple[str, ...]

    def wire(self, lasers: Sequence[str]) -> Wiring:
        """Return which part receives which of a robot's ``lasers`` (names)."""

        def on(topics: Iterable[str]) -> tuple[str, ...]:
            names = {name for topic in topics for name in self.lasers_on(topic, lasers)}
            return tuple(name for name in lasers if name in names)

        return Wiring(on((self.amcl,)), on(self.global_costmap), on(self.local_costmap))


def resolve_name(name: str, node: str, remap: Mapping[str, str]) -> str:
    """Return the absolute name that ``node`` uses for ``name``, remapped once."""
    full = _absolute(name, node)
    # The later of two remaps of one name holds, as on the command line of a node.
    for old, new in reversed(list(remap.items())):
        if _absolute(old, node) == full:
            return _absolute(new, node)
    return full


def _absolute(name: str, node: str) -> str:
    if name.startswith("~"):
        name = f"{node}/{name[1:].lstrip('/')}"
    elif not name.startswith("/"):
        name = f"{node.rpartition('/')[0]}/{name}"
    return "/" + "/".join(part for part in name.split("/") if part)


def read_costmaps(
    tree: ParameterTree, names: TopicParameters, localisation: AmclParameters
) -> tuple[tuple[LayeredCostmap, LayeredCostmap], Topics]:
    """Return the global and the local costmap, and all topics."""
    scans = names.resolved_scans()
    context = CostmapContext(
        above=tree.at("move_base"),
        frames={
            localisation.global_frame_id.strip("/"): "map",
            localisation.odom_frame_id.strip("/"): "odom",
        },
        resolve=lambda name: names.resolve("move_base", name),
        maps=names.resolved_maps(),
        may_carry_scan=scans.may_carry_scan,
    )
    wide, near = (_read_costmap(tree, name, context) for name in COSTMAPS)
    listened = (
        tuple(dict.fromkeys(source.topic for _, source in costmap.laser_sources()))
        for costmap in (wide, near)
    )
    topics = Topics(scans.published, scans.by_laser, names.resolved_amcl(), *listened)
    return (wide, near), topics


def _read_costmap(tree: ParameterTree, name: str, context: CostmapContext) -> LayeredCostmap:
    report, path, title = tree.report, ("move_base", name), name.replace("_", " ")
    space, is_local = tree.at(*path), name == "local_costmap"
    # MoveBase::executeCycle asks the controller's costmap alone whether it is current.
    context = replace(context, stops_robot=is_local)
    costmap = CostmapReader(space, report, context).read()
    if "publish_frequency" in space.entries and not is_local:
        report.ignore((*path, "publish_frequency"), "only the local costmap is shown")
    if space.entries and "global_frame" not in space.entries and is_local:
        message = "global_frame is missing: ROS takes map, a local costmap usually has odom"
        report.warn(path, message, "write global_frame: odom, or map if you want map")
    if not any(isinstance(layer, ObstacleLayer) for layer in costmap.layers):
        report.warn((*path, "plugins"), f"the {title} has no obstacle layer", _blind(title))
    elif not any(costmap.laser_sources()):
        message = f"the {title} has no source of type LaserScan"
        report.warn((*path, "observation_sources"), message, _blind(title))
    return costmap


def _blind(title: str) -> str:
    return f"the {title} shows no obstacle that the map does not show"


def advise_for_robot(
    topics: Topics, costmaps: tuple[LayeredCostmap, LayeredCostmap], robot: Robot
) -> Iterator[ParameterFinding]:
    """Yield warnings about lasers of ``robot`` that do not fit their listeners.

    ``costmaps`` are the global and the local one.
    """
    names = [laser.name for laser in robot.lasers]
    for name in topics.by_laser:
        if name not in names:
            others = ", ".join(other for other in names if other)
            hint = f"its lasers are {others}" if others else "its only laser has no name"
            yield ParameterFinding((*_SCAN, name), f"the robot has no laser {name}", hint)
    wiring = topics.wire(names)
    used = {*wiring.amcl, *wiring.global_costmap, *wiring.local_costmap}
    for laser in robot.lasers:
        if laser.name not in used:
            published = ", ".join(topics.topics_of(laser.name, names))
            where = f"it is published on {published}" if published else "it is published nowhere"
            message = f"nobody listens to the {laser.label} of robot {robot.name}: {where}"
            yield ParameterFinding(_SCAN, message, _WHERE)
    if not wiring.amcl:
        published = ", ".join(topic for name in names for topic in topics.topics_of(name, names))
        message = (
            f"amcl listens to {topics.amcl}, the lasers of robot {robot.name} are on "
            f"{published or 'no topic'}"
        )
        hint = "amcl never corrects odometry: set topics/amcl or topics/remap"
        yield ParameterFinding(_SCAN, message, hint)
    for name, costmap in zip(COSTMAPS, costmaps, strict=True):
        yield from _about_costmap(name, costmap, topics, robot)


def _about_costmap(
    name: str, costmap: LayeredCostmap, topics: Topics, robot: Robot
) -> Iterator[ParameterFinding]:
    title, names = name.replace("_", " "), [laser.name for laser in robot.lasers]
    sources = list(costmap.laser_sources())
    sees = any(topics.lasers_on(source.topic, names) for _, source in sources)
    for layer, source in sources:
        below = ("move_base", name, layer.name, source.name)
        audible = topics.lasers_on(source.topic, names)
        if not audible:
            message = (
                f'the source "{source.name}" of the {title} listens to {source.topic}, where robot '
                f"{robot.name} publishes no laser"
            )
            hint = _WHERE if sees else _blind(title)
            rate = source.expected_update_rate
            if rate > 0.0:
                message += f": after {rate:g} s move_base would stop the robot"
            yield ParameterFinding((*below, "topic"), message, hint)
        for laser in robot.lasers:
            if laser.name in audible:
                yield from _about_laser(laser, layer, source, below)


def _about_laser(
    laser: Laser, layer: ObstacleLayer, source: ObservationSource, place: ParameterLocation
) -> Iterator[ParameterFinding]:
    """Yield warnings about a height that excludes a laser, and a rate that would stop the robot."""
    _, name, *_ = place
    title, above = str(name).replace("_", " "), place[:-1]
    at, height = f"the {laser.label} at {laser.z:g} m", point_height(laser.z)
    marks_nothing = f"{at} marks nothing in the layer {layer.name} of the {title}"
    if height < source.min_obstacle_height:
        message = f"the {title} ignores {at}, below {source.min_obstacle_height:g} m"
        yield ParameterFinding((*place, "min_obstacle_height"), message)
    elif height > source.max_obstacle_height:
        message = f"the {title} ignores {at}, above {source.max_obstacle_height:g} m"
        yield ParameterFinding((*place, "max_obstacle_height"), message)
    elif source.marking and height > layer.max_obstacle_height:
        message = f"{marks_nothing}, whose limit is {layer.max_obstacle_height:g} m"
        yield ParameterFinding((*above, "max_obstacle_height"), message)
    elif source.marking and isinstance(layer, VoxelLayer) and height >= layer.top:
        message = f"{marks_nothing}, whose voxels end at {layer.top:g} m"
        yield ParameterFinding((*above, "z_voxels"), message)
    expected = source.expected_update_rate
    if expected > 0.0 and laser.rate > 0.0 and 1.0 / laser.rate > expected:
        message = (
            f"a scan of the {laser.label} comes every {1.0 / laser.rate:g} s, and move_base would "
            f"stop the robot after {expected:g} s without one; here it does not"
        )
        place = (*place, "expected_update_rate")
        yield ParameterFinding(place, message, "write a longer time, or 0 for none")
