"""Leading margins before any run: their unit, their scale, and whether they lead.

A *leading margin* is a signed margin that falls towards a failure even where the verdict's margin
is flat (:mod:`daemon.judging.oracles._leading`). True-or-false signals lead if a length stands
behind them; plug-in signals do not.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.model.search import OracleScale
from grammars.model.robot import Robot
from grammars.oracle import (
    Amount,
    CustomCall,
    Judgement,
    Oracle,
    Reached,
    Response,
    Signal,
    Statistic,
    Temporal,
    Until,
    kind_of,
    unit_of,
)
from grammars.text.expressions import Comparison, Expression, Function, Logic, Not, Number, render

LEADING_FLAGS: Final = frozenset({"contact", "in", "loc.inside_2sigma"})
"""True-or-false signals that follow a length [m]: the clearance, the way to the border of the
place, the remainder of two standard deviations."""
SHARE: Final = "1"
"""Unit of joined margins whose own units differ: each is a share of its scale."""

_CLEAR: Final = "always(clearance >= 0 m)"
_ARRIVES: Final = "reached(mission, 0.25 m)"


def why_flat(oracle: Oracle) -> tuple[str, str] | None:
    """Return why a search cannot follow a checked oracle, and a better one; ``None`` if it can.

    Raises ``ValueError`` if it names a plug-in that is no longer usable.
    """
    judgement, unit = oracle.judgement, leading_unit(oracle)
    if oracle.is_measure:
        return "it has no limit: it measures and never fails", _limited(judgement)
    match judgement:
        case Temporal(operator=operator, predicate=predicate) if not unit:
            return _bare(render(predicate)), _ARRIVES if operator == "eventually" else _CLEAR
        case Until(predicate=predicate) | Response(predicate=predicate) if not unit:
            return _bare(render(predicate)), _CLEAR
        case CustomCall(name=name) if not unit:
            return _bare(name), f"{_CLEAR} or {_ARRIVES}"
    return None


def leading_unit(oracle: Oracle) -> str:
    """Return the unit of a checked oracle's leading margin; empty for a bare yes or no.

    Raises ``ValueError`` if it names a plug-in that is no longer usable.
    """
    match oracle.judgement:
        case Temporal() | Until() | Response() as judgement:
            return predicate_unit(judgement.predicate)
    return unit_of(oracle)


def oracle_scale(oracle: Oracle, robot: Robot) -> OracleScale:
    """Return the divisor that makes the margin of ``oracle`` comparable with other margins.

    This is the magnitude of its limit, unless that is 0; for ``reached`` the tolerance; for
    contacts the inscribed radius of the robot; otherwise 1.
    """
    match oracle.judgement:
        case Temporal() | Until() | Response() as judgement:
            scale = predicate_scale(judgement.predicate, robot)
        case Amount(limit=limit) | Statistic(limit=limit) if limit is not None:
            scale = abs(limit.number.value) or 1.0
        case Reached(tolerance=tolerance):
            scale = tolerance.value
        case _:
            scale = 1.0
    return OracleScale(oracle.name, scale, leading_unit(oracle))


def clauses_of(predicate: Expression) -> Iterator[Expression]:
    """Yield the comparisons and the true-or-false signals of a predicate, in their order."""
    match predicate:
        case Not(operand=operand):
            yield from clauses_of(operand)
        case Logic(operands=operands):
            for operand in operands:
                yield from clauses_of(operand)
        case _:
            yield predicate


def predicate_unit(predicate: Expression) -> str:
    """Return the unit of a predicate's leading margin, :data:`SHARE` if its clauses differ in unit.

    Empty if every clause is only true or false.
    """
    units = {_clause_unit(clause) for clause in clauses_of(predicate)}
    return units.pop() if len(units) == 1 else SHARE


def has_unlike_units(predicate: Expression) -> bool:
    """Return whether the clauses of a predicate are measured in different units."""
    return len({_clause_unit(clause) for clause in clauses_of(predicate)}) > 1


def predicate_scale(predicate: Expression, robot: Robot) -> float:
    """Return the scale of a predicate's leading margin, from its first clause that has one."""
    if has_unlike_units(predicate):
        return 1.0
    scales = (_own_scale(clause, robot) for clause in clauses_of(predicate))
    return next((scale for scale in scales if scale), 1.0)


def clause_scale(clause: Expression, robot: Robot) -> float:
    """Return the magnitude of a clause's limit, 1 if there is none or it is 0."""
    return _own_scale(clause, robot) or 1.0


def _own_scale(clause: Expression, robot: Robot) -> float:
    match clause:
        case Comparison(left=left, right=right):
            return abs(_constant(right) or _constant(left))
        case Signal(name="contact"):
            # This loads shapely, which the check of other oracles does not need.
            from grammars.model.free_space import inscribed_radius

            return inscribed_radius(robot.footprint)
    return 0.0


def _constant(expression: Expression) -> float:
    """Return the value of a number, otherwise 0."""
    match expression:
        case Number(value=value):
            return value
        case Function(operands=(operand,)):
            return _constant(operand)
    return 0.0


def _clause_unit(clause: Expression) -> str:
    if isinstance(clause, Comparison):
        kind = kind_of(clause.left)
        return kind.unit if kind is not None else ""
    return "m" if isinstance(clause, Signal) and clause.name in LEADING_FLAGS else ""


def _bare(subject: str) -> str:
    return f"{subject} is true or false: no run is nearer to failing than another"


def _limited(judgement: Judgement) -> str:
    """Return a measure with a limit."""
    match judgement:
        case Statistic(operator=operator, signal=signal):
            kind = kind_of(signal)
            unit = f" {kind.unit}" if kind is not None and kind.unit != "1" else ""
            sign = ">=" if operator == "min" else "<="
            return f"{operator}({render(signal)}) {sign} 1{unit}"
        case Amount(operator=operator, predicate=predicate):
            limits = {"fraction": "10 %", "count": "1"}
            return f"{operator}({render(predicate)}) <= {limits.get(operator, '1 s')}"
    return _CLEAR
