"""Content of a ``.scenery`` file before composition with a floor plan: one layer of a scenario.

Layers refer to each other only by name. All parts keep their place in the file for messages;
quantities also keep their unit and text, sentences their text.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

from grammars.model.behaviour import LegBegins, WaypointReached
from grammars.model.scene import Joint, Link
from grammars.text.diagnostics import InputError, Where, with_article
from grammars.text.quantity import parse_quantity, unit_of
from grammars.text.units import DIMENSIONS, NAMES, TIME, UNIT, read_unit
from grammars.text.words import enumerate_words

LARGEST: Final = 1e6
"""Largest value of a quantity in a scenery, in SI units."""
_NUMBER: Final = re.compile(r"\s*([-+]?[\d.,]+(?:[eE][-+]?\d+)?)")
_DEGREES: Final = {"angle": "deg", "angular speed": "deg/s"}
"""Units that people prefer over SI."""


@dataclass(frozen=True, slots=True)
class Measure:
    """``value`` in SI units and radians; ``text`` as in the file."""

    value: float
    dimension: str
    text: str
    where: Where = field(compare=False)

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Word:
    """A name and its place."""

    text: str
    where: Where = field(compare=False)

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Statement:
    """Part of a layer with its source ``text`` on one line, without comments."""

    text: str = field(default="", compare=False, repr=False, kw_only=True)


Amount: TypeAlias = Measure | Word
"""A quantity, or the name of a parameter (or of a state, for joint positions)."""


@dataclass(frozen=True, slots=True)
class NamedState:
    """A named joint state of an object model: position [rad or m] per joint."""

    name: str
    positions: tuple[tuple[str, float], ...]
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class ObjectModel:
    """A kind of articulated object, in its own frame.

    Links and joints of a mover include the planar chain of :mod:`grammars.model.movers`.
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
    """Placement in a frame at ``x``, ``y`` [m], ``yaw`` [rad]; ``inside`` requires a space."""

    frame: FrameName
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    inside: bool = False


Towards: TypeAlias = Literal["in", "out"] | Word
"""A side of a wall: in the first room of an entryway, outside it, or a space by name."""


@dataclass(frozen=True, slots=True)
class In:
    """Placement in an entryway.

    ``side`` is the side of the hinge, or the direction of a slider, seen from ``seen_from`` (a
    space; by default the first room of the entryway). ``towards`` is the side of the wall to which
    a leaf opens or on which a slider hangs; ``in`` is the first room. ``recess`` moves a leaf from
    that face into the wall [m]. Without ``side``, the frame of the object is in the middle of the
    doorway, turned by ``yaw``.
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
    """An object placed in a floor plan; ``starts`` is an optional state or position."""

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
    """A named set of objects; campaigns can change its members."""

    name: str
    members: Subject
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class Parameter(Statement):
    """A named quantity with its default; campaigns can change its value."""

    name: str
    value: Measure
    where: Where = field(compare=False)


@dataclass(frozen=True, slots=True)
class SentenceAbout(Statement):
    """A sentence, which begins with its subject."""

    subject: Subject

    @property
    def where(self) -> Where:
        """The place of the sentence."""
        return self.subject.where


@dataclass(frozen=True, slots=True)
class Starts(SentenceAbout):
    """The subject starts in another state than that of its instance."""

    position: Amount


@dataclass(frozen=True, slots=True)
class Freezes(SentenceAbout):
    """The subject never moves."""


Setting: TypeAlias = Starts | Freezes


@dataclass(frozen=True, slots=True)
class MotionAs:
    """Motion of a joint to its target; ``None`` is the default of the motion."""

    kind: Literal["jump", "servo", "spring"] = "servo"
    rate: Amount | None = None
    effort: Amount | None = None
    stiffness: Amount | None = None
    damping: Amount | None = None


@dataclass(frozen=True, slots=True)
class Stays(SentenceAbout):
    """The subject holds a position for the whole run."""

    position: Amount


@dataclass(frozen=True, slots=True)
class Moves(SentenceAbout):
    """The subject moves at given times: ``frames`` are (position, time).

    ``listed``: frames are played in the order of the list, even if their times are not sorted.
    """

    frames: tuple[tuple[Amount, Amount], ...]
    motion: MotionAs
    listed: bool = False


@dataclass(frozen=True, slots=True)
class Goes(SentenceAbout):
    """The subject moves when the robot comes near, and back beyond the distance ``again``, if any.

    ``begin`` is its first position if that is not ``start``.
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
    """A distribution of waiting times.

    ``uniform`` is from ``first`` to ``second``; for other kinds ``first`` is the mean; ``second``
    is the standard deviation of ``normal``.
    """

    kind: Literal["uniform", "exponential", "normal"]
    first: Amount
    second: Amount | None = None


@dataclass(frozen=True, slots=True)
class Toggles(SentenceAbout):
    """The subject starts at ``first`` and changes to the other position again and again.

    It changes with ``probability`` and up to ``delay`` late in every ``period``, or after every
    random wait.
    """

    first: Amount
    second: Amount
    period: Amount | Waiting
    since: Amount | None
    until: Amount | None
    probability: float
    delay: Amount | None
    step: Amount | None
    motion: MotionAs


@dataclass(frozen=True, slots=True)
class OnObject:
    """The joint of ``path`` (or any joint of the object) fires or starts to move."""

    path: Path
    act: Literal["fires", "moves"]


EventPhrase: TypeAlias = LegBegins | WaypointReached | OnObject


@dataclass(frozen=True, slots=True)
class Reacts(SentenceAbout):
    """The subject moves once, a time ``after`` the event."""

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
    """A mover walks a route, see :class:`grammars.model.behaviour.Walk`."""

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


Sentence: TypeAlias = Stays | Moves | Toggles | Goes | Reacts | Walks


@dataclass(frozen=True, slots=True)
class SceneryLayer:
    """One ``.scenery`` file; ``name`` is its file name without ending."""

    name: str
    file: str
    models: tuple[ObjectModel, ...] = ()
    instances: tuple[Instance, ...] = ()
    groups: tuple[Group, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    settings: tuple[Setting, ...] = ()
    sentences: tuple[Sentence, ...] = ()


def parse_measure(text: str, where: Where, *dimensions: str, beside: str = "") -> Measure:
    """Read ``1.3 m``, of one of ``dimensions`` if any are given.

    ``beside`` is the text behind it, which hints at a missing unit. Raises :class:`InputError` for
    anything but a number with such a unit.
    """
    # Exactly one blank after the number.
    spelled = " ".join(_NUMBER.sub(r"\1 ", text, count=1).split())
    number, _, unit = spelled.partition(" ")
    if "," in number:
        raise InputError.at(where, "write decimals with a point", "1.5, not 1,5")
    if number and not unit and "ratio" not in dimensions:
        units = [_DEGREES.get(dimension, unit_of(dimension)) for dimension in dimensions]
        hint = f"write {number} m, {number} rad, {number} s, …"
        near = next((u for u in _UNIT.findall(beside) if _dimension_of(u) in dimensions), "")
        units = [near] if near else units
        if units:
            hint = f"write {enumerate_words([f'{number} {unit}' for unit in units], 'or')}"
        raise InputError.at(where, f"a unit is missing after {number}", hint)
    quantity = parse_quantity(spelled, where)
    if abs(quantity.value) > LARGEST:
        raise InputError.at(where, f"{spelled} is too large", "check the unit")
    measure = Measure(quantity.value, quantity.dimension, spelled, where)
    if dimensions:
        require_dimension(measure, *dimensions)
    return measure


def require_dimension(value: Measure, *dimensions: str) -> float:
    """Return the SI value of a measure; raises :class:`InputError` for other dimensions."""
    if value.dimension in dimensions:
        return value.value
    expected = enumerate_words([_in_words(d) for d in dimensions], "or")
    is_ratio = dimensions[0] == "ratio"
    raise InputError.at(
        value.where,
        f"expected {expected}, but {value.text} is {_in_words(value.dimension)}",
        "write it as 0.5 or 50 %" if is_ratio else _remedy(value, dimensions),
    )


_UNIT: Final = re.compile(rf"\d[ \t]*({UNIT})(?!\w)")


def _dimension_of(unit: str) -> str:
    return NAMES.get(read_unit(unit)[1], "")


def _remedy(value: Measure, dimensions: Sequence[str]) -> str:
    """Return how to write a value of other dimensions: a rate by its unit, others in theirs."""
    rate = DIMENSIONS[value.dimension] / TIME
    if NAMES.get(rate) in dimensions:
        return f"write {value.text}/s"
    units = [_DEGREES.get(dimension, unit_of(dimension)) for dimension in dimensions]
    return f"write it in {enumerate_words(units, 'or')}"


def _in_words(dimension: str) -> str:
    """Return ``a length``, ``an angle``; stiffness and damping have no article."""
    countless = dimension.endswith(("stiffness", "damping"))
    return dimension if countless else with_article(dimension)
