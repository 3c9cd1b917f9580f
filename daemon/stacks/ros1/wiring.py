"""Wiring of lasers: topics as roscpp resolves them, and their listeners.

A name without a leading slash is resolved in the namespace of the node (``/`` for a node called
``/move_base``), ``~name`` below the node's own name. A remap of the launch file holds for every
node, also for the simulator and the driver: **the published name is remapped too**. A remap of one
node holds for that node. A name is remapped only once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from pydantic import ConfigDict, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass as checked

from daemon.stacks.ros1.amcl import AmclParameters
from daemon.stacks.ros1.costmap.layers import (
    InflationLayer,
    LayeredCostmap,
    ObstacleLayer,
    StaticLayer,
)
from daemon.stacks.ros1.costmap.reading import CostmapContext, CostmapReader
from daemon.stacks.ros1.parameters import ALTERNATIVE, ParameterTree, Section

_Name: TypeAlias = Annotated[str, Field(pattern=r"^[~/]?[A-Za-z][A-Za-z0-9_/]*$", max_length=200)]
_NodeName: TypeAlias = Annotated[str, Field(pattern=r"^/[A-Za-z][A-Za-z0-9_/]*$", max_length=200)]
NodeOfStack: TypeAlias = Literal["amcl", "move_base"]
COSTMAPS: Final = ("global_costmap", "local_costmap")
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
            localisation.global_frame_id.removeprefix("/"): "map",
            localisation.odom_frame_id.removeprefix("/"): "odom",
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
    if report.fatal:
        # Warnings about the whole would be about defaults in the place of bad values.
        return costmap
    has_map = any(isinstance(layer, StaticLayer) for layer in costmap.layers)
    if space.entries and not (costmap.rolling_window or has_map or "origin_x" in space.entries):
        message = f"the {title} neither rolls nor shows the map: it stays at its origin"
        hint = "write rolling_window: true, static_map: true, or its origin"
        report.warn((*path, "rolling_window"), message, hint)
    if not is_local and not any(isinstance(layer, InflationLayer) for layer in costmap.layers):
        message = "the global costmap has no inflation layer: plans lead right along walls"
        hint = "add {name: inflation_layer, type: costmap_2d::InflationLayer} at its end"
        report.warn((*path, "plugins"), message, hint)
    if not any(isinstance(layer, ObstacleLayer) for layer in costmap.layers):
        report.warn((*path, "plugins"), f"the {title} has no obstacle layer", blind(title))
    elif not any(costmap.laser_sources()):
        message = f"the {title} has no source of type LaserScan"
        report.warn((*path, "observation_sources"), message, blind(title))
    return costmap


def blind(title: str) -> str:
    """Return the effect of a costmap without lasers."""
    return f"the {title} shows no obstacle that the map does not show"
