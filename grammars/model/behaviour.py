"""Behaviours of scenery joints during a run, walks of movers, and their lines in the log."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from grammars.model.geometry import Point2
from grammars.model.scene import Scene


@dataclass(frozen=True, slots=True)
class Jump:
    """The joint is set to its target within one physics step."""

    kind: Literal["jump"] = "jump"


@dataclass(frozen=True, slots=True)
class Servo:
    """The joint is driven at ``rate`` [rad/s or m/s] with at most ``effort`` [N m or N]."""

    rate: float = 1.0
    effort: float = 40.0
    kind: Literal["servo"] = "servo"


@dataclass(frozen=True, slots=True)
class Spring:
    """The joint is pulled to its target: ``stiffness`` [N m/rad or N/m], ``damping`` [.. s]."""

    stiffness: float = 0.5
    damping: float = 0.0
    kind: Literal["spring"] = "spring"


Motion: TypeAlias = Annotated[Jump | Servo | Spring, Field(discriminator="kind")]


@dataclass(frozen=True, slots=True)
class Hold:
    """The joint stays at ``position`` for the whole run and cannot be pushed."""

    joint: str
    position: float
    kind: Literal["hold"] = "hold"

    @property
    def start_position(self) -> float:
        """Position of the joint at time 0."""
        return self.position

    @property
    def positions(self) -> tuple[float, ...]:
        """All target positions of the joint."""
        return (self.position,)


@dataclass(frozen=True, slots=True)
class KeyFrame:
    """At ``time`` the joint starts to move to ``position``."""

    time: float
    position: float


@dataclass(frozen=True, slots=True)
class KeyFrames:
    """The joint moves at given times, in order; between frames it can be pushed.

    Frames at time 0 at the start of the list also set the start position. Frames are played in the
    order of the list, at most one in a physics step; a frame whose time has passed is played in the
    step after the previous one.

    Raises:
        ValueError: a frame is before 0 s, or never.
    """

    joint: str
    frames: tuple[KeyFrame, ...]
    motion: Motion
    kind: Literal["key-frames"] = "key-frames"

    def __post_init__(self) -> None:
        # This also refuses NaN.
        if not all(0.0 <= frame.time < math.inf for frame in self.frames):
            raise ValueError(f"joint {self.joint!r} has a key frame before 0 s, or never")

    @property
    def start_position(self) -> float | None:
        """Position of the last of the leading frames at time 0, if any."""
        first = tuple(itertools.takewhile(lambda frame: frame.time <= 0.0, self.frames))
        return first[-1].position if first else None

    @property
    def positions(self) -> tuple[float, ...]:
        """All target positions of the joint."""
        return tuple(frame.position for frame in self.frames)

    @property
    def in_order(self) -> bool:
        """``True`` if the frames are sorted by time."""
        return all(a.time <= b.time for a, b in itertools.pairwise(self.frames))


@dataclass(frozen=True, slots=True)
class Trigger:
    """The joint moves from ``start`` to ``end`` once the robot is nearer than ``distance``.

    The distance is measured from ``of`` (the anchor of the hinge, the origin of the object: its
    ``foot``, the moving leaf, or the centre of the doorway of the object) to ``to`` (the robot's
    base frame or its footprint). With ``begin``, the joint starts there and moves to ``start``
    from time 0 on. Without ``rearm`` the trigger latches; with it the joint returns to ``start``
    when the robot is farther than ``rearm`` (> ``distance``) and can fire again.

    Raises:
        ValueError: ``rearm`` is not greater than ``distance``, or a jump has a ``begin``.
    """

    joint: str
    start: float
    end: float
    distance: float
    motion: Motion
    of: Literal["hinge", "foot", "leaf", "doorway"] = "hinge"
    to: Literal["base", "footprint"] = "base"
    rearm: float | None = None
    begin: float | None = None
    kind: Literal["trigger"] = "trigger"

    def __post_init__(self) -> None:
        if self.rearm is not None and self.rearm <= self.distance:
            raise ValueError(f"trigger of joint {self.joint!r}: rearm must exceed distance")
        if self.begin is not None and isinstance(self.motion, Jump):
            raise ValueError(f"trigger of joint {self.joint!r}: a jump begins at its start")

    @property
    def start_position(self) -> float:
        """Position of the joint at time 0."""
        return self.start if self.begin is None else self.begin

    @property
    def positions(self) -> tuple[float, ...]:
        """All target positions of the joint."""
        return tuple(dict.fromkeys((self.start_position, self.start, self.end)))


@dataclass(frozen=True, slots=True)
class LegBegins:
    """The robot heads for waypoint number ``leg`` of its mission, counted from 1."""

    leg: int
    kind: Literal["leg-begins"] = "leg-begins"


@dataclass(frozen=True, slots=True)
class WaypointReached:
    """The robot has reached the (first) waypoint with the id ``waypoint``."""

    waypoint: str
    kind: Literal["waypoint-reached"] = "waypoint-reached"


@dataclass(frozen=True, slots=True)
class JointActs:
    """The first of ``joints`` acts.

    ``fires``: its trigger or reaction fires. ``moves``: it is 0.01 rad or 1 cm away from its start
    position, for any reason.
    """

    joints: tuple[str, ...]
    act: Literal["fires", "moves"]
    kind: Literal["joint-acts"] = "joint-acts"


Event: TypeAlias = Annotated[LegBegins | WaypointReached | JointActs, Field(discriminator="kind")]


@dataclass(frozen=True, slots=True)
class Reaction:
    """The joint moves from ``start`` to ``end``, once, ``delay`` seconds after ``event``."""

    joint: str
    start: float
    end: float
    event: Event
    motion: Motion
    delay: float = 0.0
    kind: Literal["reaction"] = "reaction"

    @property
    def start_position(self) -> float:
        """Position of the joint at time 0."""
        return self.start

    @property
    def positions(self) -> tuple[float, ...]:
        """All target positions of the joint."""
        return (self.start, self.end)


@dataclass(frozen=True, slots=True)
class Walk:
    """A mover (see :mod:`grammars.model.movers`) goes along ``route``, world points [m].

    It leaves the first point ``start`` seconds after the begin of the run or after ``event``. Its
    speed is a trapezoidal profile with ``speed`` [m/s] and ``acceleration`` [m/s^2], at rest at
    stops: the ends of the route or, with ``stops`` at points, all points. A stop takes ``pause``
    seconds, or longer if the mover must turn round (half a turn per second). ``round`` continues
    from the last point to the first and stops there only to pause.

    ``facing``: ``ahead``, ``sideways`` (the route to its right, both ways) or ``fixed`` at ``yaw``.
    With ``yielding`` [m] it brakes while the robot is ahead (within 60 deg of its direction) and
    nearer than that, outline to outline.

    Raises:
        ValueError: route, speed or acceleration is missing, or a time is negative.
    """

    object: str
    route: tuple[Point2, ...]
    speed: float
    acceleration: float = 1.0
    manner: Literal["once", "back-and-forth", "round"] = "once"
    pause: float = 0.0
    stops: Literal["ends", "points"] = "ends"
    start: float = 0.0
    event: Event | None = None
    facing: Literal["ahead", "sideways", "fixed"] = "ahead"
    yaw: float = 0.0
    yielding: float | None = None
    kind: Literal["walk"] = "walk"

    def __post_init__(self) -> None:
        name = f"walk of {self.object!r}"
        gaps = [math.dist(a, b) for a, b in itertools.pairwise(self.route)]
        if not gaps or min(gaps) <= 0.0 or not min(self.speed, self.acceleration) > 0.0:
            raise ValueError(f"{name}: it needs a route, a speed and an acceleration")
        if self.manner == "round" and math.dist(self.route[0], self.route[-1]) <= 0.0:
            raise ValueError(f"{name}: a round closes by itself")
        if min(self.start, self.pause) < 0.0:
            raise ValueError(f"{name}: times are never negative")

    @property
    def joint(self) -> str:
        """The first of the joints that the walk moves."""
        return f"{self.object}.x"

    @property
    def joints(self) -> tuple[str, ...]:
        """All joints that the walk moves: ``x``, ``y`` and ``yaw``."""
        return (f"{self.object}.x", f"{self.object}.y", f"{self.object}.yaw")


Behaviour: TypeAlias = Annotated[
    Hold | KeyFrames | Trigger | Reaction | Walk, Field(discriminator="kind")
]


def start_positions(scene: Scene, behaviours: Iterable[Behaviour]) -> dict[str, float]:
    """Return the position of every joint at time 0 [rad or m], by scene-wide name.

    Movers start at their position in the scene, independent of their route.
    """
    # Later key frames do not change the start position.
    starts = {b.joint: b.start_position for b in behaviours if not isinstance(b, Walk)}
    changes = {name: position for name, position in starts.items() if position is not None}
    return scene.initial_joints | changes


class JointEvent(StrEnum):
    """Causes of joint motion, each as the start of its line in the log."""

    KEY_FRAME = "key frame "
    TRIGGERED = "triggered "
    REACTS = "reacts: "


def joint_event(text: str) -> JointEvent | None:
    """Return the joint event of a line of the log, ``None`` if it has none."""
    return next((event for event in JointEvent if text.startswith(event)), None)
