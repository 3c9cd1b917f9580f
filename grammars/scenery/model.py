"""Meaning of a ``.scenery`` file before it meets a floor plan: one layer of a scenario.

A layer only refers to other layers by name, it never edits them. Everything keeps the place where
it was written, for diagnostics; quantities keep their unit and text as well, sentences their text.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from grammars.model.scene import Joint, Link
from grammars.scenery.measure import Measure
from grammars.text.diagnostics import Where


@dataclass(frozen=True, slots=True)
class Word:
    """A name as written, and where."""

    text: str
    where: Where = field(compare=False)

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Statement:
    """Part of a layer that keeps its ``text``: one line, without comments."""

    text: str = field(default="", compare=False, repr=False, kw_only=True)


Amount: TypeAlias = Measure | Word
"""A quantity, or the name of a parameter (for joint positions also of a state)."""


@dataclass(frozen=True, slots=True)
class NamedState:
    """A named joint state of an object model: position [rad or m] per joint."""

    name: str
    positions: tuple[tuple[str, float], ...]
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class ObjectModel:
    """A kind of articulated object, in its own frame.

    A mover has the planar chain of :mod:`grammars.model.movers` among its links and joints.
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    states: tuple[NamedState, ...]
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class FrameName:
    """A frame of the floor plan: ``world``, ``hall``, ``hall.walls[2]``, ``hall.column_1``."""

    name: str
    wall: int | None
    part: str
    where: Where = field(compare=False)

    def __str__(self) -> str:
        if self.wall is not None:
            return f"{self.name}.walls[{self.wall}]"
        return f"{self.name}.{self.part}" if self.part else self.name


@dataclass(frozen=True, slots=True)
class At:
    """Placed in a frame: ``x``, ``y`` [m] and ``yaw`` [rad] in it; ``inside``: of a space."""

    frame: FrameName
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    inside: bool = False


Towards: TypeAlias = Literal["in", "out"] | Word
"""A side of a wall: into the first room of an entryway, out of it, or a space by name."""


@dataclass(frozen=True, slots=True)
class In:
    """Placed in an entryway.

    ``side`` is where the hinge is, or where a slider goes, seen from ``seen_from`` (a space; the
    entryway's first room when ``None``). ``towards`` is the side of the wall a leaf opens to or a
    slider hangs on: ``in`` and ``out`` are meant from the first room (``in`` is into it).
    ``recess`` moves a leaf from that face of the wall into it [m]. Without ``side`` the object's
    frame stands in the middle of the doorway, turned by ``yaw``.
    """

    entryway: Word
    manner: Literal["hinge", "sliding", ""] = ""
    side: Literal["left", "right", ""] = ""
    seen_from: Word | None = None
    towards: Towards = "in"
    recess: float = 0.0
    yaw: float = 0.0


@dataclass(frozen=True, slots=True)
class Instance(Statement):
    """An object placed in a floor plan; ``starts`` is a state, a position or nothing said."""

    name: str
    model: Word
    place: At | In
    starts: Amount | None
    frozen: bool
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class Path:
    """``door_1`` or one of its joints, ``door_1.hinge``."""

    object: str
    joint: str
    where: Where = field(compare=False)

    def __str__(self) -> str:
        return f"{self.object}.{self.joint}" if self.joint else self.object


@dataclass(frozen=True, slots=True)
class Subject:
    """Subject of a sentence: names, or every member of the named groups and models."""

    every: bool
    names: tuple[Path, ...]
    exceptions: tuple[Path, ...]
    where: Where = field(compare=False)

    def __str__(self) -> str:
        text = ", ".join(str(name) for name in self.names)
        return f"every {text}" if self.every else text


@dataclass(frozen=True, slots=True)
class Group(Statement):
    """A named set of objects; a campaign may give it other members."""

    name: str
    members: Subject
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class Parameter(Statement):
    """A named quantity with its default; a campaign may give it another value."""

    name: str
    value: Measure
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class SentenceAbout(Statement):
    """Sentence about a subject, with which it begins."""

    subject: Subject

    @property
    def where(self) -> Where:
        """The place of the sentence."""
        return self.subject.where


@dataclass(frozen=True, slots=True)
class Starts(SentenceAbout):
    """The subject starts in another state than its instance says."""

    position: Amount


@dataclass(frozen=True, slots=True)
class Freezes(SentenceAbout):
    """The subject never moves."""


Setting: TypeAlias = Starts | Freezes


@dataclass(frozen=True, slots=True)
class MotionAs:
    """Motion of a joint to its target; absent numbers are the defaults of the motion."""

    kind: Literal["jump", "servo", "spring"] = "servo"
    rate: Amount | None = None
    effort: Amount | None = None
    stiffness: Amount | None = None
    damping: Amount | None = None


@dataclass(frozen=True, slots=True)
class Stays(SentenceAbout):
    """Held for the whole run."""

    position: Amount


@dataclass(frozen=True, slots=True)
class Moves(SentenceAbout):
    """Moved at given times: ``frames`` are (position, time).

    ``listed``: their order is that of the list, whatever their times.
    """

    frames: tuple[tuple[Amount, Amount], ...]
    motion: MotionAs
    listed: bool = False


@dataclass(frozen=True, slots=True)
class Toggles(SentenceAbout):
    """Starts at ``first`` and may change to the other position every so often, by chance."""

    first: Amount
    second: Amount
    every: Amount
    since: Amount | None
    until: Amount | None
    probability: float
    delay: Amount | None
    step: Amount | None
    motion: MotionAs


@dataclass(frozen=True, slots=True)
class Goes(SentenceAbout):
    """Moves when the robot comes near, and back when it is ``again`` away (if that is given).

    ``begin`` is where it is at first, if that is not ``start``.
    """

    start: Amount
    end: Amount
    distance: Amount
    of: Literal["hinge", "foot", "leaf", "doorway"]
    to: Literal["base", "footprint"]
    again: Amount | None
    begin: Amount | None
    motion: MotionAs


@dataclass(frozen=True, slots=True)
class Waiting:
    """A distribution of waiting times: ``first`` is the least or the mean, see ``kind``.

    ``second`` is the greatest of a uniform one and the standard deviation of a normal one.
    """

    kind: Literal["uniform", "exponential", "normal"]
    first: Amount
    second: Amount | None = None


@dataclass(frozen=True, slots=True)
class Alternates(SentenceAbout):
    """Starts at ``first`` and changes to the other position again and again after waiting."""

    first: Amount
    second: Amount
    waiting: Waiting
    since: Amount | None
    until: Amount | None
    motion: MotionAs


@dataclass(frozen=True, slots=True)
class OnLeg:
    """Leg number ``leg`` of the mission begins, counted from 1."""

    leg: int
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class OnWaypoint:
    """The waypoint with this id is reached."""

    waypoint: str
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class OnObject:
    """A joint of ``path`` (any, if it names none) fires or starts to move."""

    path: Path
    act: Literal["fires", "moves"]
    where: Where = field(compare=False)


EventPhrase: TypeAlias = OnLeg | OnWaypoint | OnObject


@dataclass(frozen=True, slots=True)
class Reacts(SentenceAbout):
    """Moves once when something happens, ``after`` some time."""

    start: Amount
    end: Amount
    occasion: EventPhrase
    after: Amount | None
    motion: MotionAs


@dataclass(frozen=True, slots=True)
class RoutePoint:
    """A point of a route in a frame of the floor plan [m]."""

    frame: FrameName
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Walks(SentenceAbout):
    """A mover walks a route; see :class:`grammars.model.behaviour.Walk` for what it means."""

    route: tuple[RoutePoint, ...]
    speed: Amount | None
    acceleration: Amount | None
    manner: Literal["once", "back-and-forth", "round"]
    pause: Amount | None
    everywhere: bool
    since: Amount | None
    occasion: EventPhrase | None
    facing: Literal["ahead", "sideways"] | Amount
    yielding: Amount | None


Sentence: TypeAlias = Stays | Moves | Toggles | Goes | Alternates | Reacts | Walks


@dataclass(frozen=True, slots=True)
class SceneryLayer:
    """One ``.scenery`` file; ``name`` is the file's name without its ending."""

    name: str
    file: str
    models: tuple[ObjectModel, ...] = ()
    instances: tuple[Instance, ...] = ()
    groups: tuple[Group, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    settings: tuple[Setting, ...] = ()
    sentences: tuple[Sentence, ...] = ()
