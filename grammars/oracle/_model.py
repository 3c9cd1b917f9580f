"""Oracles as values: what a line of the oracle language says.

Every expression carries ``column``, the offset of its first character in the oracle's text.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from grammars.diagnostics import Where
from grammars.oracle._dimension import Dimension

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
    """A recorded or derived signal, some with arguments: ``clearance(0.35 m, 0.2 m)``."""

    name: str
    arguments: tuple[Expression, ...] = ()
    column: int = 0


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


Judgement: TypeAlias = Temporal | Amount | Statistic | Reached


@dataclass(frozen=True, slots=True)
class Oracle:
    """A named oracle: its judgement, on the samples where ``guard`` holds (``None``: all)."""

    name: str
    text: str
    where: Where
    judgement: Judgement
    guard: Expression | None = None

    @property
    def is_measure(self) -> bool:
        """Whether it only measures: no limit, so never red."""
        return isinstance(self.judgement, Amount | Statistic) and self.judgement.limit is None

    def place(self, column: int) -> Where:
        """Where the character at offset ``column`` of the text stands in its file."""
        return shift(self.where, self.text, column)


def shift(where: Where, text: str, column: int) -> Where:
    """Return the place of ``text[column]`` when ``text`` starts at ``where``."""
    if "\n" in text:
        return where
    return Where(where.file, where.line, (where.column or 1) + column)
