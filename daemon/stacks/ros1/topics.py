"""Who hears the laser: names of topics resolved as roscpp does.

A name without a leading slash is resolved in the namespace of the node, ``/`` here; ``~name``
below the node's own name. A remap of the launch file holds for every node, the simulator's and
the driver's as well: **the published name is remapped too**. A name is remapped once, never
again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Final, TypeAlias

from pydantic import Field
from pydantic.dataclasses import dataclass as checked

_Name: TypeAlias = Annotated[str, Field(pattern=r"^[~/]?[A-Za-z][A-Za-z0-9_/]*$", max_length=200)]
MOVE_BASE: Final = "/move_base"


@checked(frozen=True, slots=True)
class TopicParameters:
    """Where the scan comes from and what the launch file makes of names."""

    scan: _Name | dict[str, _Name | tuple[_Name, ...]] | None = None
    """Topic the laser is published on, before any remap; by name for a robot with several lasers.
    Not given: where amcl listens, or /scan_NAME of every laser of a robot with several."""
    amcl: _Name | None = None
    """Topic that the launch file of amcl remaps its "scan" to; amcl has no parameter for it."""
    remap: dict[_Name, _Name] = Field(default_factory=dict)
    """Remaps for every node of the launch, the one that publishes the scan included."""


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

    def heard(self, lasers: Sequence[str]) -> Wiring:
        """Return who hears which of a robot's ``lasers`` (names)."""

        def on(topics: Iterable[str]) -> tuple[str, ...]:
            found = {name for topic in topics for name in self.lasers_on(topic, lasers)}
            return tuple(name for name in lasers if name in found)

        return Wiring(on((self.amcl,)), on(self.global_costmap), on(self.local_costmap))


def resolve_name(name: str, node: str = "", remap: Mapping[str, str] | None = None) -> str:
    """Return the name a node called ``node`` ends up with: absolute, remapped once."""
    full = _absolute(name, node)
    for old, new in (remap or {}).items():
        if _absolute(old, node) == full:
            return _absolute(new, node)
    return full


def _absolute(name: str, node: str) -> str:
    if name.startswith("~"):
        name = f"{node}/{name[1:].lstrip('/')}"
    return "/" + "/".join(part for part in name.split("/") if part)


def resolve_topics(
    given: TopicParameters, global_sources: Iterable[str], local_sources: Iterable[str]
) -> Topics:
    """Return who listens where; ``*_sources`` are the topics of a costmap's laser sources.

    amcl subscribes to ``scan``. What its own launch file remaps that to (``amcl``) is not remapped
    again by the launch around it: roscpp looks a name up once.
    """
    remap = given.remap
    heard = resolve_name("scan", "/amcl", remap) if given.amcl is None else given.amcl
    amcl = heard if given.amcl is None else _absolute(heard, "/amcl")
    by_laser: dict[str, tuple[str, ...]] = {}
    if isinstance(given.scan, Mapping):
        for laser, names in given.scan.items():
            listed = (names,) if isinstance(names, str) else names
            by_laser[laser] = tuple(resolve_name(name, "", remap) for name in listed)
    return Topics(
        published=resolve_name(given.scan, "", remap) if isinstance(given.scan, str) else amcl,
        amcl=amcl,
        global_costmap=tuple(resolve_name(name, MOVE_BASE, remap) for name in global_sources),
        local_costmap=tuple(resolve_name(name, MOVE_BASE, remap) for name in local_sources),
        by_laser=by_laser,
    )
