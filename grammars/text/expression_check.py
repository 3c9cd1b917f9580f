"""Dimension checks of expressions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Final, Literal, Protocol, TypeAlias

from grammars.text.diagnostics import (
    Finding,
    Findings,
    InputError,
    SourceText,
    Where,
    did_you_mean,
)
from grammars.text.expressions import (
    Arithmetic,
    Comparison,
    Expression,
    ExpressionLanguage,
    Function,
    Logic,
    Name,
    Not,
    Number,
    fold,
    parts_of,
    read_expression,
    render,
    walk,
)
from grammars.text.units import RATIO, Dimension, read_unit


class Unknown(Enum):
    """Kind of an undefined name, and of expressions with it; an error has been added."""

    UNKNOWN = "unknown"


Kind: TypeAlias = Dimension | None
"""Dimension of an expression; ``None`` for a predicate."""
MaybeKind: TypeAlias = Kind | Literal[Unknown.UNKNOWN]


class Placed(Protocol):
    """A part of a text that begins at ``column``."""

    @property
    def column(self) -> int:
        """Offset of its first character."""


@dataclass(frozen=True, slots=True)
class DimensionCheck:
    """Computes the dimensions of the expressions of a text and reports mismatches.

    ``kind_of_name`` reports unknown names itself. With ``bare``, a number without a unit next to a
    value of that dimension has it too, and 0 fits any dimension.
    """

    source: SourceText
    findings: Findings
    kind_of_name: Callable[[Name], MaybeKind]
    bare: Dimension = RATIO

    def error(self, place: Placed, message: str, hint: str = "") -> None:
        """Add an error at the place of an expression."""
        self.findings.error(self.source.where(place.column), message, hint)

    def kind(self, expression: Expression) -> MaybeKind:
        """Return the dimension of an expression, or ``None`` for a predicate."""
        return fold(expression, self._visit)

    def quantity(self, expression: Expression) -> Dimension | None:
        """Return the dimension of a quantity; otherwise report a problem and return ``None``."""
        return self._quantity(expression, self.kind(expression))

    def predicate(self, expression: Expression) -> None:
        """Report an expression that is not a predicate."""
        self._predicate(expression, self.kind(expression))

    def compare(
        self, subject: Dimension, limit: Expression, dimension: Dimension, hint: str = ""
    ) -> None:
        """Report a ``limit`` whose ``dimension`` is not that of its ``subject``."""
        if isinstance(limit, Number):
            hint = with_unit(limit, subject) or hint
        elif dimension == RATIO:
            hint = f"write the limit in {subject.unit}"
        self.error(limit, f"compares {_named(subject)} with {_named(dimension)}", hint)

    def _visit(self, part: Expression, kinds: Sequence[MaybeKind]) -> MaybeKind:
        operands = list(zip(parts_of(part), kinds, strict=True))
        match part:
            case Number(dimension=dimension):
                return dimension
            case Name():
                return self.kind_of_name(part)
            case Not() | Logic():
                for operand, kind in operands:
                    self._predicate(operand, kind)
                return None
        dimensions = [self._quantity(operand, kind) for operand, kind in operands]
        result: Dimension | None = dimensions[0]
        for operand, other in zip(parts_of(part)[1:], dimensions[1:], strict=True):
            if result is None or other is None:
                result = None
            else:
                result = self._joined(part, result, operand, other)
        if isinstance(part, Comparison):
            return None
        if isinstance(part, Function) and part.name == "abs" and len(operands) > 1:
            self.error(part, "abs takes one number")
        return Unknown.UNKNOWN if result is None else result

    def _joined(
        self, part: Expression, result: Dimension, operand: Expression, other: Dimension
    ) -> Dimension | None:
        """Return the dimension of ``part`` with one more operand; ``None`` after a report."""
        if isinstance(part, Arithmetic) and part.operator in ("*", "/"):
            return result * other if part.operator == "*" else result / other
        if result == other:
            return result
        first = parts_of(part)[0]
        for own, against, one in ((result, other, first), (other, result, operand)):
            zero = isinstance(one, Number) and one.value == 0.0
            if self.bare != RATIO and own == RATIO and (against == self.bare or zero):
                return against
        if isinstance(part, Arithmetic):
            verb = "adds" if part.operator == "+" else "subtracts"
            bare, kind = (operand, result) if other == RATIO else (first, other)
            hint = with_unit(bare, kind) if isinstance(bare, Number) else ""
            self.error(part, f"{verb} {_named(result)} and {_named(other)}", hint)
        else:
            self.compare(result, operand, other)
        return None

    def _quantity(self, expression: Expression, kind: MaybeKind) -> Dimension | None:
        if kind is None:
            hint = f"write it alone: {render(expression)}"
            self.error(expression, "this is true or false, not a quantity", hint)
        return kind if isinstance(kind, Dimension) else None

    def _predicate(self, expression: Expression, kind: MaybeKind) -> None:
        if isinstance(kind, Dimension):
            unit = "" if kind == RATIO else f" {kind.unit}"
            message = f"this is a quantity [{kind.unit}], not something true or false"
            self.error(expression, message, f"compare it with a limit, such as: <= 1{unit}")


def with_unit(number: Number, kind: Dimension) -> str:
    """Return a hint with the unit that a plain number lacks, empty if it has a unit."""
    if number.dimension != RATIO or not number.text[-1:].isdecimal():
        return ""  # it has a unit, perhaps %
    return f"write it in {kind.unit}: {number.text} {kind.unit}"


def _named(kind: Dimension) -> str:
    return "a number without unit" if kind == RATIO else kind.unit


_LONGEST: Final = 1000
"""Characters of a predicate at most: it is evaluated for thousands of points."""
_LANGUAGE: Final = ExpressionLanguage(Path(__file__).with_name("expressions.tx"), autokwd=True)


def read_predicate(text: str, units: Mapping[str, str], where: Where) -> Expression:
    """Read a predicate over the names in ``units``, a mapping to their units (empty for none).

    Raises :class:`InputError` with all its problems, at ``where``.
    """
    if len(text) > _LONGEST:
        message = f'"{text[:40]}…" is longer than {_LONGEST} characters'
        raise InputError.at(where, message, "write several predicates")
    source = SourceText(text, where.file)
    findings = Findings()

    def kind_of_name(name: Name) -> MaybeKind:
        if name.name in units and not name.arguments:
            return read_unit(units[name.name])[1]
        message = f'"{name.name}" is not varied here: vary it, or write its value'
        longer = [one for one in units if one.startswith(f"{name.name}/")]
        hint = f'write it in quotes: "{longer[0]}"' if longer else did_you_mean(name.name, units)
        check.error(name, message, hint)
        return Unknown.UNKNOWN

    check = DimensionCheck(source, findings, kind_of_name)
    try:
        predicate = read_expression(_LANGUAGE.parse(source), source)
        check.predicate(predicate)
        if not any(isinstance(part, Name) for part in walk(predicate)):
            check.error(predicate, "contains no varied name")
        findings.raise_errors()
    except InputError as error:
        raise InputError(
            Finding(where, f'"{text}": {one.message}', one.hint) for one in error.findings
        ) from error
    return predicate
