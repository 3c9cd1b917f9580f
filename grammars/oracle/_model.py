"""Oracles as values: what a line of the oracle language says, with the dimensions of its numbers.

Every expression carries ``column``, the offset of its first character in the oracle's text;
:func:`render` writes one as text again, for messages that name a part of an oracle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from grammars.text.diagnostics import Where
from grammars.text.units import Dimension

ROBOT: Final = "robot"
"""What oracles and recorded contacts call the robot."""

ComparisonOperator: TypeAlias = Literal["<=", "<", ">=", ">", "==", "!="]


@dataclass(frozen=True, slots=True)
class Number:
    """A constant: SI ``value`` of ``dimension``, and how it was written."""

    value: float
    dimension: Dimension
    text: str
    column: int = 0


@dataclass(frozen=True, slots=True)
class Signal:
    """A recorded or derived signal, some with arguments: ``clearance(0.35 m, 0.2 m)``.

    An object named as an argument, ``clearance(door_17)``, is a :class:`Signal` of that name; so is
    the robot in ``distance(robot, door_17)``, and a node in ``bt.node(Spin)``.
    """

    name: str
    arguments: tuple[Expression, ...] = ()
    column: int = 0

    @property
    def object(self) -> Signal | None:
        """The thing in the scene it is about, named as its first argument or behind the robot."""
        named = [a for a in self.arguments[:2] if isinstance(a, Signal) and not a.arguments]
        if not named or named[0] is not self.arguments[0]:
            return None
        return named[1] if named[0].name == ROBOT and len(named) > 1 else named[0]


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """``left operator right``, sample by sample."""

    operator: Literal["+", "-", "*", "/"]
    left: Expression
    right: Expression
    column: int = 0


@dataclass(frozen=True, slots=True)
class Function:
    """A function of one expression: sign change or magnitude."""

    name: Literal["-", "abs"]
    operand: Expression
    column: int = 0


@dataclass(frozen=True, slots=True)
class Comparison:
    """``left operator right``: true or false at each sample."""

    operator: ComparisonOperator
    left: Expression
    right: Expression
    column: int = 0


@dataclass(frozen=True, slots=True)
class Not:
    """True where the operand is false."""

    operand: Expression
    column: int = 0


@dataclass(frozen=True, slots=True)
class Logic:
    """``and`` or ``or`` of at least two predicates."""

    operator: Literal["and", "or"]
    operands: tuple[Expression, ...]
    column: int = 0


Expression: TypeAlias = Number | Signal | Arithmetic | Function | Comparison | Not | Logic


@dataclass(frozen=True, slots=True)
class Limit:
    """What the judged value is compared with."""

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
    """How much a predicate held.

    ``fraction`` of the judged time, total ``time`` [s], ``longest`` unbroken time [s] or the
    ``count`` of times it became true. Without a limit: a measure.
    """

    operator: Literal["fraction", "time", "longest", "count"]
    predicate: Expression
    limit: Limit | None = None


@dataclass(frozen=True, slots=True)
class Statistic:
    """A number that sums up a signal; ``mean`` and ``p95`` weigh by time.

    Without a limit: a measure.
    """

    operator: Literal["max", "min", "mean", "final", "p95"]
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
    column: int = 0

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
        """Whether it only measures: no limit, so never red."""
        return isinstance(self.judgement, Amount | Statistic) and self.judgement.limit is None

    def place(self, column: int) -> Where:
        """Where the character at offset ``column`` of the text stands in its file."""
        return shift_place(self.where, self.text, column)


def shift_place(where: Where, text: str, column: int) -> Where:
    """Return the place of ``text[column]`` when ``text`` starts at ``where``.

    A line without a column is all that is known of a text that is laid out otherwise in its file.
    """
    if "\n" in text or (where.line and not where.column):
        return where
    return Where(where.file, where.line, (where.column or 1) + column)


def walk(expression: Expression) -> Iterator[Expression]:
    """Yield an expression and everything in it, in the order written; arguments are not parts."""
    yield expression
    match expression:
        case Not(operand=inner) | Function(operand=inner):
            yield from walk(inner)
        case Comparison(left=left, right=right) | Arithmetic(left=left, right=right):
            yield from walk(left)
            yield from walk(right)
        case Logic(operands=operands):
            for inner in operands:
                yield from walk(inner)


def signals_of(oracle: Oracle) -> Iterator[Signal]:
    """Yield every signal the oracle reads, in the order written."""
    judged: tuple[Expression, ...] = ()
    match oracle.judgement:
        case Temporal(predicate=predicate) | Amount(predicate=predicate):
            judged = (predicate,)
        case Statistic(signal=signal):
            judged = (signal,)
        case Until(predicate=predicate, release=release):
            judged = (predicate, release)
    guard = () if oracle.guard is None else (oracle.guard,)
    for expression in (*judged, *guard):
        yield from (part for part in walk(expression) if isinstance(part, Signal))


def render(expression: Expression) -> str:
    """Return ``expression`` in the oracle language; compound parts in parentheses."""
    match expression:
        case Number():
            return expression.text
        case Signal(name=name, arguments=arguments):
            return f"{name}({', '.join(map(render, arguments))})" if arguments else name
        case Function(name="abs", operand=operand):
            return f"abs({render(operand)})"
        case Function(operand=operand):
            return f"-{_part(operand)}"
        case Not(operand=operand):
            return f"not {_part(operand)}"
        case Logic(operator=word, operands=operands):
            return f" {word} ".join(map(_part, operands))
        case Arithmetic(operator=sign, left=left, right=right):
            return f"{_part(left)} {sign} {_part(right)}"
        case Comparison(operator=sign, left=left, right=right):
            return f"{render(left)} {sign} {render(right)}"


def _part(expression: Expression) -> str:
    text = render(expression)
    return text if isinstance(expression, Number | Signal) else f"({text})"
