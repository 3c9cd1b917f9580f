"""Who hears the laser: names of topics resolved as roscpp does.

A name without a leading slash is resolved in the namespace of the node, ``/`` here; ``~name``
below the node's own name. A remap of the launch file holds for every node, the simulator's and
the driver's as well: **the published name is remapped too**. A name is remapped once, never
again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Final, TypeAlias

from pydantic import Field
from pydantic.dataclasses import dataclass as checked

_Name: TypeAlias = Annotated[str, Field(pattern=r"^[~/]?[A-Za-z][A-Za-z0-9_/]*$", max_length=200)]
MOVE_BASE: Final = "/move_base"


@checked(frozen=True, slots=True)
class TopicParameters:
    """Where the scan comes from and what the launch file makes of names."""

    scan: _Name = "/scan"
    """Topic the laser is published on, before any remap."""
    amcl: _Name | None = None
    """Topic that the launch file of amcl remaps its "scan" to; amcl has no parameter for it."""
    remap: dict[_Name, _Name] = Field(default_factory=dict)
    """Remaps for every node of the launch, the one that publishes the scan included."""


@dataclass(frozen=True, slots=True)
class Wiring:
    """Which parts of the stack receive the scan."""

    amcl: bool
    global_costmap: bool
    local_costmap: bool


@dataclass(frozen=True, slots=True)
class Topics:
    """Resolved names: where the scan is ``published``, where each part listens."""

    published: str
    amcl: str
    global_costmap: tuple[str, ...]
    local_costmap: tuple[str, ...]

    @property
    def wiring(self) -> Wiring:
        """Who hears what is published."""
        return Wiring(
            amcl=self.amcl == self.published,
            global_costmap=self.published in self.global_costmap,
            local_costmap=self.published in self.local_costmap,
        )


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
    return Topics(
        published=resolve_name(given.scan, "", remap),
        amcl=heard if given.amcl is None else _absolute(heard, "/amcl"),
        global_costmap=tuple(resolve_name(name, MOVE_BASE, remap) for name in global_sources),
        local_costmap=tuple(resolve_name(name, MOVE_BASE, remap) for name in local_sources),
    )
