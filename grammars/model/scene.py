"""The scene: all data about the world of a run.

Behaviours, mission, robot and system under test are not part of it. Equal scenes have equal digests
on all machines.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from grammars.model.geometry import Point2, Pose2, Ring
from grammars.text import codec


@dataclass(frozen=True, slots=True)
class Region:
    """A named free area: the clear floor of a space (``outline``), before furniture.

    ``holes`` are rings inside it that are not floor: obstacles or unknown areas.
    """

    name: str
    outline: Ring
    # Not in JSON if empty, so that digests of regions without holes stay the same.
    holes: Annotated[tuple[Ring, ...], Field(exclude_if=operator.not_)] = ()


@dataclass(frozen=True, slots=True)
class Doorway:
    """An entryway as a passage: ``frame`` is on the floor at the start of its centre line.

    ``footprint`` is the outline through the wall(s), ``width`` the clear width [m].
    """

    name: str
    frame: Pose2
    footprint: Ring
    width: float
    z_min: float
    z_max: float


@dataclass(frozen=True, slots=True)
class Solid:
    """A convex part of an immovable element, from ``z_min`` to ``z_max`` above the floor.

    ``owner`` is the identifier of its floor plan element (``hall-wall-2``); a wall with openings
    has several solids, including the lintel above and the sill below an opening.
    """

    owner: str
    kind: Literal["wall", "column", "divider"]
    polygon: Ring
    z_min: float
    z_max: float


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid body of an object: convex polygons in the object frame, all joints at zero.

    ``mass`` is in kg, evenly spread over the polygons.
    """

    name: str
    polygons: tuple[Ring, ...]
    mass: float
    z_min: float
    z_max: float


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between two links of one object, in the object frame with all joints at zero.

    ``parent`` is a link name or ``world``; a child link has exactly one joint. ``anchor`` is the
    point of a revolute joint (positive is counter-clockwise); ``axis`` is the unit direction of a
    prismatic one. Positions are in rad or m. ``friction`` is dry friction [N m or N]; ``stiffness``
    and ``damping`` describe a closer that pulls to ``rest`` (both 0: no closer). A joint with both
    limits 0 is fixed.
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    parent: str
    child: str
    anchor: Point2
    axis: Point2
    lower: float
    upper: float
    friction: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    rest: float = 0.0


@dataclass(frozen=True, slots=True)
class SceneObject:
    """An object placed in the world. Links without a joint are fixed to the world.

    ``initial`` has the start positions of ``joints``. ``frozen`` objects never move. ``doorway``
    names the entryway of the object, or is empty. The scene-wide name of a joint is
    ``<object>.<joint>``. ``mirrored`` objects are mirror images of their model (geometry and limits
    are already mirrored); their revolute joints turn in the opposite direction.
    """

    name: str
    model: str
    pose: Pose2
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    initial: tuple[float, ...]
    frozen: bool = False
    doorway: str = ""
    mirrored: bool = False


@dataclass(frozen=True, slots=True)
class Scene:
    """One building with its objects, ready to simulate.

    ``frames`` has the world poses of the frames of the floor plan by name (``hall``,
    ``hall.walls[2]``), for the routes of movers; empty without movers.
    """

    name: str
    regions: tuple[Region, ...]
    doorways: tuple[Doorway, ...]
    solids: tuple[Solid, ...]
    objects: tuple[SceneObject, ...] = ()
    frames: tuple[tuple[str, Pose2], ...] = ()

    @property
    def digest(self) -> str:
        """Content address of the scene: 64 hexadecimal digits."""
        return codec.digest(self)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Scene-wide joint names ``<object>.<joint>``, in scene order."""
        return tuple(f"{o.name}.{j.name}" for o in self.objects for j in o.joints)

    @property
    def initial_joints(self) -> dict[str, float]:
        """Joint positions before any behaviour [rad or m], by name in scene order."""
        positions = (position for o in self.objects for position in o.initial)
        return dict(zip(self.joint_names, positions, strict=True))
