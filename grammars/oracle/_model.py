"""Oracles as values: judgements of expressions over signals."""

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

OPERATORS: Final = (
    *("always", "never", "eventually", "whenever", "fraction", "time", "longest", "count"),
    *("max", "min", "mean", "median", "final", "p95", "reached"),
)
"""Words with which the oracles of the language begin."""
RESPONSE_FORM: Final = "whenever contact then speed <= 0.1 m/s within 2 s"
ROBOT: Final = "robot"
"""Name of the robot in oracles and recorded contacts."""

Signal: TypeAlias = Name
"""A recorded or derived signal, possibly with arguments: ``clearance(0.35 m, 0.2 m)``.

Objects as arguments, ``clearance(door_17)``, are also a :class:`Signal`, as are the robot in
``distance(robot, door_17)`` and the node in ``bt.node(Spin)``.
"""


def thing_of(signal: Signal) -> Signal | None:
    """Return the subject of a signal: its first argument, or the one after the robot."""
    names = [a for a in signal.arguments[:2] if isinstance(a, Signal) and not a.arguments]
    if not names or names[0] is not signal.arguments[0]:
        return None
    return names[1] if names[0].name == ROBOT and len(names) > 1 else names[0]


@dataclass(frozen=True, slots=True)
class Limit:
    """Limit of a judged value."""

    operator: ComparisonOperator
    number: Number


@dataclass(frozen=True, slots=True)
class Temporal:
    """``always``, ``never`` or ``eventually`` a predicate, ``within`` [s] of the run's start."""

    operator: Literal["always", "never", "eventually"]
    predicate: Expression
    within: Number | None = None


@dataclass(frozen=True, slots=True)
class Until:
    """``always`` or ``never`` a predicate before the first sample at which ``release`` holds.

    ``release`` must hold at some time, ``within`` [s] if given. The guard applies to the predicate,
    not to the release.
    """

    operator: Literal["always", "never"]
    predicate: Expression
    release: Expression
    within: Number | None = None


@dataclass(frozen=True, slots=True)
class Response:
    """``predicate`` at some time within ``within`` [s] of each time that ``occasion`` becomes true.

    Guard and leg apply to that moment. The time after an occasion may end with the run: then it
    counts only if ``predicate`` held before.
    """

    occasion: Expression
    predicate: Expression
    within: Number


@dataclass(frozen=True, slots=True)
class Amount:
    """Amount of time or number of times that a predicate holds; without a limit, a measure.

    ``fraction`` of the judged time, total ``time`` [s], ``longest`` unbroken time [s] or the
    ``count`` of times it became true.
    """

    operator: Literal["fraction", "time", "longest", "count"]
    predicate: Expression
    limit: Limit | None = None


@dataclass(frozen=True, slots=True)
class Statistic:
    """A statistic of a signal; without a limit, a measure.

    ``mean``, ``median`` and ``p95`` are weighted by time.
    """

    operator: Literal["max", "min", "mean", "median", "final", "p95"]
    signal: Expression
    limit: Limit | None = None


@dataclass(frozen=True, slots=True)
class Reached:
    """Visit of all waypoints in strict order within ``tolerance`` [m], ignoring headings."""

    tolerance: Number


@dataclass(frozen=True, slots=True)
class CustomCall:
    """Call of a plug-in oracle (entry points ``scenario.oracles``)."""

    name: str
    arguments: tuple[Number, ...] = ()


Judgement: TypeAlias = Temporal | Until | Response | Amount | Statistic | Reached | CustomCall


@dataclass(frozen=True, slots=True)
class Leg:
    """The part of a run with one waypoint as goal, as reported by the system under test.

    Identified by ``number`` (from 1) or, if that is 0, by the id of the waypoint.
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
        """True for an oracle without a limit, which measures and never fails."""
        return isinstance(self.judgement, Amount | Statistic) and self.judgement.limit is None

    def judged(self) -> Iterator[tuple[Expression, bool | None]]:
        """Yield judged expressions in source order, with whether they must hold at each sample.

        ``None``: no single sample decides. A statistic with a limit is a comparison of its signal.
        """
        match self.judgement:
            case Temporal(operator=operator, predicate=predicate):
                yield predicate, None if operator == "eventually" else operator == "always"
            case Until(operator=operator, predicate=predicate, release=release):
                yield predicate, operator == "always"
                yield release, None
            case Response(occasion=occasion, predicate=predicate):
                yield occasion, None
                yield predicate, None
            case Amount(predicate=predicate, limit=limit):
                yield predicate, None if limit is None else limit.operator in (">=", ">")
            case Statistic(signal=signal, limit=None):
                yield signal, None
            case Statistic(operator=operator, signal=signal, limit=Limit() as limit):
                comparison = Comparison(limit.operator, signal, limit.number, signal.column)
                yield comparison, True if operator in ("max", "min") else None

    def signals(self) -> Iterator[Signal]:
        """Yield all signals of the oracle in source order."""
        guard = () if self.guard is None else (self.guard,)
        for expression in (*(judged for judged, _ in self.judged()), *guard):
            yield from (part for part in walk(expression) if isinstance(part, Signal))

    def place(self, column: int) -> Where:
        """Return the place of the character at offset ``column`` of the text."""
        return SourceText(self.text, self.where.file, within=self.where).where(column)
