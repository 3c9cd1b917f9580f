"""Oracles as values: what a line of the oracle language says about expressions of signals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

from grammars.text.diagnostics import SourceText, Where
from grammars.text.expressions import (
    Comparison,
    ComparisonOperator,
    Expression,
    Name,
    Number,
    walk,
)

ROBOT: Final = "robot"
"""What oracles and recorded contacts call the robot."""

Signal: TypeAlias = Name
"""A recorded or derived signal, some with arguments: ``clearance(0.35 m, 0.2 m)``.

An object named as an argument, ``clearance(door_17)``, is a :class:`Signal` of that name; so is the
robot in ``distance(robot, door_17)``, and a node in ``bt.node(Spin)``.
"""


def thing_of(signal: Signal) -> Signal | None:
    """Return the thing a signal is about: its first argument, or the one behind the robot."""
    named = [a for a in signal.arguments[:2] if isinstance(a, Signal) and not a.arguments]
    if not named or named[0] is not signal.arguments[0]:
        return None
    return named[1] if named[0].name == ROBOT and len(named) > 1 else named[0]


@dataclass(frozen=True, slots=True)
class Limit:
    """Limit of a judged value."""

    operator: ComparisonOperator
    number: Number


@dataclass(frozen=True, slots=True)
class Temporal:
    """``always``, ``never`` or ``eventually`` a predicate; ``within`` [s] of the run's start."""

    operator: Literal["always", "never", "eventually"]
    predicate: Expression
    within: Number | None = None


@dataclass(frozen=True, slots=True)
class Until:
    """``always`` or ``never`` a predicate before the first sample at which ``release`` holds.

    ``release`` must come, ``within`` [s] if given. The guard says where the predicate is judged,
    not when the release counts.
    """

    operator: Literal["always", "never"]
    predicate: Expression
    release: Expression
    within: Number | None = None


@dataclass(frozen=True, slots=True)
class Amount:
    """Amount by which a predicate held.

    ``fraction`` of the judged time, total ``time`` [s], ``longest`` unbroken time [s] or the
    ``count`` of times it became true. Without a limit: a measure.
    """

    operator: Literal["fraction", "time", "longest", "count"]
    predicate: Expression
    limit: Limit | None = None


@dataclass(frozen=True, slots=True)
class Statistic:
    """A number that sums up a signal; ``mean``, ``median`` and ``p95`` weigh by time.

    Without a limit: a measure.
    """

    operator: Literal["max", "min", "mean", "median", "final", "p95"]
    signal: Expression
    limit: Limit | None = None


@dataclass(frozen=True, slots=True)
class Reached:
    """All waypoints visited in strict order within ``tolerance`` [m]; headings are not judged."""

    tolerance: Number


@dataclass(frozen=True, slots=True)
class CustomCall:
    """An oracle of one's own, from the entry points ``scenario.oracles``."""

    name: str
    arguments: tuple[Number, ...] = ()


Judgement: TypeAlias = Temporal | Until | Amount | Statistic | Reached | CustomCall


@dataclass(frozen=True, slots=True)
class Leg:
    """The part of a run in which one waypoint is approached, as the system under test reports.

    Named by ``number`` (from 1) or, when that is 0, by the waypoint's id.
    """

    number: int
    waypoint: str
    column: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"leg {self.waypoint or self.number}"


@dataclass(frozen=True, slots=True)
class Oracle:
    """A named oracle: its judgement, during ``leg`` and where ``guard`` holds (``None``: all)."""

    name: str
    text: str
    where: Where
    judgement: Judgement
    guard: Expression | None = None
    leg: Leg | None = None

    @property
    def is_measure(self) -> bool:
        """True for an oracle without a limit: it measures and is never red."""
        return isinstance(self.judgement, Amount | Statistic) and self.judgement.limit is None

    def judged(self) -> Iterator[tuple[Expression, bool | None]]:
        """Yield what is judged, in the order written, and whether it is to hold at each sample.

        ``None``: no single sample decides. A statistic with a limit is a comparison of its signal.
        """
        match self.judgement:
            case Temporal(operator=operator, predicate=predicate):
                yield predicate, None if operator == "eventually" else operator == "always"
            case Until(operator=operator, predicate=predicate, release=release):
                yield predicate, operator == "always"
                yield release, None
            case Amount(predicate=predicate, limit=limit):
                yield predicate, None if limit is None else limit.operator in (">=", ">")
            case Statistic(signal=signal, limit=None):
                yield signal, None
            case Statistic(operator=operator, signal=signal, limit=Limit() as limit):
                compared = Comparison(limit.operator, signal, limit.number, signal.column)
                yield compared, True if operator in ("max", "min") else None

    def signals(self) -> Iterator[Signal]:
        """Yield every signal the oracle reads, in the order written."""
        guard = () if self.guard is None else (self.guard,)
        for expression in (*(judged for judged, _ in self.judged()), *guard):
            yield from (part for part in walk(expression) if isinstance(part, Signal))

    def place(self, column: int) -> Where:
        """Return the place of the character at offset ``column`` of the text."""
        return SourceText(self.text, self.where.file, within=self.where).where(column)
