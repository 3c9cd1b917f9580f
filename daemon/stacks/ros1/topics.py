"""Who hears the lasers: names of topics resolved as roscpp does.

A name without a leading slash is resolved in the namespace of the node (``/`` for a node called
``/move_base``); ``~name`` below the node's own name. A remap of the launch file holds for every
node, the simulator's and the driver's as well: **the published name is remapped too**; remaps of
one node hold for that one. A name is remapped once, never again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import ConfigDict, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass as checked

from daemon.stacks.ros1.parameters import ALTERNATIVE

_Name: TypeAlias = Annotated[str, Field(pattern=r"^[~/]?[A-Za-z][A-Za-z0-9_/]*$", max_length=200)]
_NodeName: TypeAlias = Annotated[str, Field(pattern=r"^/[A-Za-z][A-Za-z0-9_/]*$", max_length=200)]
NodeOfStack: TypeAlias = Literal["amcl", "move_base"]
MOVE_BASE: Final = "/move_base"


_ONE: Final = f"{ALTERNATIVE} one"
_SEVERAL: Final = f"{ALTERNATIVE} several"
# Messages are about the alternative that is meant, not about all of them.
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
    """What the launch file made of one node."""

    name: _NodeName | None = None
    """Its full name, such as /robot1/move_base: names without a slash are resolved beside it."""
    remap: dict[_Name, _Name] = Field(default_factory=dict)
    """Remaps for this node alone; they win over those for every node."""


@checked(frozen=True, slots=True)
class TopicParameters:
    """Where the scan comes from and what the launch file makes of names."""

    scan: _Scan | None = None
    """Topic the laser is published on, before any remap; for a robot with several lasers a topic
    or a list of them by the laser's name. Not given: where amcl listens, or /scan_NAME of every
    laser of a robot with several."""
    amcl: _Name | None = None
    """Topic that the launch file of amcl remaps its "scan" to; amcl has no parameter for it."""
    remap: dict[_Name, _Name] = Field(default_factory=dict)
    """Remaps for every node of the launch, the one that publishes the scan included."""
    nodes: dict[NodeOfStack, NodeNames] = Field(default_factory=dict)
    """What the launch file made of amcl and of move_base alone."""
    maps: tuple[_Name, ...] | None = None
    """Topics on which the map of the run is published. Not given: the one amcl would listen to."""

    def resolve(self, node: NodeOfStack, name: str) -> str:
        """Return the name that ``node`` ends up with for ``name``."""
        names = self.nodes.get(node, NodeNames())
        return resolve_name(name, names.name or f"/{node}", {**self.remap, **names.remap})

    def resolved_maps(self) -> tuple[str, ...]:
        """Return the topics on which the map of the run is published."""
        if self.maps is None:
            return (self.resolve("amcl", "map"),)
        return tuple(_absolute(name, "") for name in self.maps)


@dataclass(frozen=True, slots=True)
class Wiring:
    """Which parts of the stack receive which lasers, by name; a robot's only one may have none."""

    amcl: tuple[str, ...]
    global_costmap: tuple[str, ...]
    local_costmap: tuple[str, ...]


ONE_LASER: Final = ("",)
"""The names of the lasers of a robot that has one, without a name."""


@dataclass(frozen=True, slots=True)
class Topics:
    """Resolved names: where scans are published, where each part listens.

    ``by_laser`` says where each laser is published when the file says it by laser. Otherwise the
    only one is on ``published``, of several laser NAME on ``published`` with ``_NAME`` behind it.
    """

    published: str
    amcl: str
    global_costmap: tuple[str, ...]
    local_costmap: tuple[str, ...]
    by_laser: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def topics_of(self, laser: str, lasers: Sequence[str]) -> tuple[str, ...]:
        """Return the topics on which ``laser`` of a robot with ``lasers`` (names) is published."""
        if self.by_laser:
            return self.by_laser.get(laser, ())
        return (self.published,) if len(lasers) == 1 else (f"{self.published}_{laser}",)

    def lasers_on(self, topic: str, lasers: Sequence[str]) -> tuple[str, ...]:
        """Return those of a robot's ``lasers`` (names) that are published on ``topic``."""
        return tuple(name for name in lasers if topic in self.topics_of(name, lasers))

    def may_carry_scan(self, topic: str) -> bool:
        """Whether any robot publishes a laser on ``topic``."""
        if self.by_laser:
            return any(topic in topics for topics in self.by_laser.values())
        return topic == self.published or topic.startswith(f"{self.published}_")

    def heard(self, lasers: Sequence[str]) -> Wiring:
        """Return who hears which of a robot's ``lasers`` (names)."""

        def on(topics: Iterable[str]) -> tuple[str, ...]:
            found = {name for topic in topics for name in self.lasers_on(topic, lasers)}
            return tuple(name for name in lasers if name in found)

        return Wiring(on((self.amcl,)), on(self.global_costmap), on(self.local_costmap))


def resolve_name(name: str, node: str = "", remap: Mapping[str, str] | None = None) -> str:
    """Return the name a node called ``node`` ends up with: absolute, remapped once."""
    full = _absolute(name, node)
    # Of two remaps of one name the later one holds, as on the command line of a node.
    for old, new in reversed(list((remap or {}).items())):
        if _absolute(old, node) == full:
            return _absolute(new, node)
    return full


def _absolute(name: str, node: str) -> str:
    if name.startswith("~"):
        name = f"{node}/{name[1:].lstrip('/')}"
    elif not name.startswith("/"):
        name = f"{node.rpartition('/')[0]}/{name}"
    return "/" + "/".join(part for part in name.split("/") if part)


def resolve_topics(
    given: TopicParameters, global_sources: Iterable[str], local_sources: Iterable[str]
) -> Topics:
    """Return who listens where; ``*_sources`` are the topics of a costmap's laser sources.

    amcl subscribes to ``scan``. What its own launch file remaps that to (``amcl``) is not remapped
    again by the launch around it: roscpp looks a name up once.
    """
    remap = given.remap
    node = given.nodes.get("amcl", NodeNames()).name or "/amcl"
    amcl = given.resolve("amcl", "scan") if given.amcl is None else _absolute(given.amcl, node)
    by_laser: dict[str, tuple[str, ...]] = {}
    if isinstance(given.scan, Mapping):
        for laser, names in given.scan.items():
            listed = (names,) if isinstance(names, str) else names
            by_laser[laser] = tuple(resolve_name(name, "", remap) for name in listed)
    return Topics(
        published=resolve_name(given.scan, "", remap) if isinstance(given.scan, str) else amcl,
        amcl=amcl,
        global_costmap=tuple(given.resolve("move_base", name) for name in global_sources),
        local_costmap=tuple(given.resolve("move_base", name) for name in local_sources),
        by_laser=by_laser,
    )
