"""How joints of scenery objects behave during a run, how movers walk, what the log says of it."""

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
    """The joint stays at ``position`` for the whole run; nothing can push it."""

    joint: str
    position: float
    kind: Literal["hold"] = "hold"

    @property
    def start_position(self) -> float:
        """Where the joint is at time 0."""
        return self.position

    @property
    def positions(self) -> tuple[float, ...]:
        """All positions that the joint is sent to."""
        return (self.position,)


@dataclass(frozen=True, slots=True)
class KeyFrame:
    """At ``time`` the joint starts to move to ``position``."""

    time: float
    position: float


@dataclass(frozen=True, slots=True)
class KeyFrames:
    """The joint moves at given times, in order; between frames it is free to be pushed.

    A frame at time 0 that no later one comes before also sets where the joint starts. Frames that
    are not in order of time are played as they are listed, one in a physics step at most: one whose
    time has gone by is played in the step after the one before it.

    Raises:
        ValueError: a frame is before 0 s, or never.
    """

    joint: str
    frames: tuple[KeyFrame, ...]
    motion: Motion
    kind: Literal["key-frames"] = "key-frames"

    def __post_init__(self) -> None:
        # Not ``<``: a time that is nan never comes.
        if not all(0.0 <= frame.time < math.inf for frame in self.frames):
            raise ValueError(f"joint {self.joint!r} has a key frame before 0 s, or never")

    @property
    def start_position(self) -> float | None:
        """Where a frame at time 0 puts the joint, the last one if there are several."""
        first = tuple(itertools.takewhile(lambda frame: frame.time <= 0.0, self.frames))
        return first[-1].position if first else None

    @property
    def positions(self) -> tuple[float, ...]:
        """All positions that the joint is sent to."""
        return tuple(frame.position for frame in self.frames)

    @property
    def in_order(self) -> bool:
        """Whether no frame is earlier than the one before it."""
        return all(a.time <= b.time for a, b in itertools.pairwise(self.frames))


@dataclass(frozen=True, slots=True)
class Trigger:
    """The joint moves from ``start`` to ``end`` once the robot is nearer than ``distance``.

    ``of`` says what the distance is measured from (the anchor of the hinge, the origin of the
    object: its ``foot``, the moving leaf, or the centre of the doorway the object stands in),
    ``to`` whether it is measured to the robot's base frame or to its footprint. With ``begin``
    the joint is there at first, and its motion takes it to ``start`` from time 0 on. Without
    ``rearm`` the trigger latches; with it the joint returns to ``start`` when the robot is
    farther than ``rearm`` (> ``distance``) and can fire again.

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
        """Where the joint is at time 0."""
        return self.start if self.begin is None else self.begin

    @property
    def positions(self) -> tuple[float, ...]:
        """All positions that the joint is sent to."""
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
    """The first of ``joints`` does something.

    ``fires``: its trigger or reaction goes off. ``moves``: it has left the position it started
    in by 0.01 rad or 1 cm, whatever moved it.
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
        """Where the joint is at time 0."""
        return self.start

    @property
    def positions(self) -> tuple[float, ...]:
        """All positions that the joint is sent to."""
        return (self.start, self.end)


@dataclass(frozen=True, slots=True)
class Walk:
    """A mover (see :mod:`grammars.model.movers`) goes along ``route``, world points [m].

    It sets out ``start`` seconds into the run or, with an ``event``, so long after that; until
    then it stands on the first point. Way and time follow a trapezoidal profile with ``speed``
    [m/s] and ``acceleration`` [m/s^2], at rest at stops: the ends of the route or, with
    ``stops`` at points, all of its points. It rests ``pause`` seconds there, and longer if it
    must turn round (half a turn a second). ``round`` goes on from the last point to the first,
    and stops there only to pause.

    ``facing``: ``ahead``, ``sideways`` (the way to its right, both ways) or ``fixed`` at ``yaw``.
    With ``yielding`` [m] it brakes while the robot is ahead (60 deg to
    either side of its way) and nearer than that, outline to outline.

    Raises:
        ValueError: there is no way, speed or acceleration, or a time is negative.
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
            raise ValueError(f"{name}: it needs a way, a speed and an acceleration")
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
    """Return where every joint of ``scene`` is at time 0 [rad or m], by scene-wide name.

    Movers stand where the scene has put them, whatever the route they are about to walk.
    """
    # Key frames that all come later leave a joint where the scene has it.
    told = {b.joint: b.start_position for b in behaviours if not isinstance(b, Walk)}
    known = {name: position for name, position in told.items() if position is not None}
    return scene.initial_joints | known


class JointEvent(StrEnum):
    """Why a joint began to move; each is how its line in the log begins."""

    KEY_FRAME = "key frame "
    TRIGGERED = "triggered "
    REACTS = "reacts: "


def joint_event(text: str) -> JointEvent | None:
    """Return what a line of the log says of a joint, ``None`` when it is about something else."""
    return next((event for event in JointEvent if text.startswith(event)), None)
