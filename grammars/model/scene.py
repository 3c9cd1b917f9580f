"""The Scene: everything one run needs to know about the world, compiled once, shared by all.

A scene is plain data; behaviours, mission, robot and system under test come with the run. Equal
scenes have equal digests, whatever machine compiled them.
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

    ``holes`` are rings inside of it that are not floor: what stands there, or is not known.
    """

    name: str
    outline: Ring
    # Left out where there are none: most regions have none, and digests are taken of the rest.
    holes: Annotated[tuple[Ring, ...], Field(exclude_if=operator.not_)] = ()


@dataclass(frozen=True, slots=True)
class Doorway:
    """An entryway seen as a passage: ``frame`` on the floor at its centre line start.

    ``footprint`` is its outline through the wall(s), ``width`` the clear width [m].
    """

    name: str
    frame: Pose2
    footprint: Ring
    width: float
    z_min: float
    z_max: float


@dataclass(frozen=True, slots=True)
class Solid:
    """A convex piece of something that never moves, from ``z_min`` to ``z_max`` above the floor.

    ``owner`` is the identifier of the floor plan element it is part of (``hall-wall-2``); a wall
    with openings has several solids, also the lintel above and the sill below an opening.
    """

    owner: str
    kind: Literal["wall", "column", "divider"]
    polygon: Ring
    z_min: float
    z_max: float


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid body of an object: convex polygons in the object frame, all joints at zero.

    ``mass`` in kg, evenly spread over the polygons.
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
    point of a revolute joint (positive turns counter-clockwise); ``axis`` the unit direction of a
    prismatic one. Positions in rad or m. ``friction`` is dry friction [N m or N]; ``stiffness``
    and ``damping`` of a closer that pulls to ``rest`` (none when both are 0). A joint whose limits
    are both 0 is fixed: the child rides on its parent.
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

    ``initial`` gives each joint's position at the start (same order as ``joints``). ``frozen``
    objects never move. ``doorway`` names the entryway the object stands in, or is empty.
    A joint's name in the whole scene is ``<object>.<joint>``. ``mirrored`` objects are their model
    seen in a mirror (geometry and limits here are already mirrored); their revolute joints turn
    the other way than the model's.
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

    ``frames`` are the world poses of the floor plan's frames by name (``hall``,
    ``hall.walls[2]``), kept for routes when there is a mover among the objects.
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
        """Where every joint is before any behaviour [rad or m], by name in scene order."""
        positions = (position for o in self.objects for position in o.initial)
        return dict(zip(self.joint_names, positions, strict=True))
