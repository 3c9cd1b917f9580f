"""Oracles that the start or a waypoint of the mission decides before a run."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from typing import Final

from grammars.model.geometry import Point2
from grammars.oracle._bounds import RunOutline
from grammars.oracle._model import Judgement, Oracle, Signal, Statistic, Temporal, thing_of
from grammars.text.diagnostics import Finding, Severity
from grammars.text.expressions import Comparison, Expression, Logic, Not, Number, render

_BORDER: Final = 0.05
"""Distance from the border of a place [m] within which the start may count as inside or not."""
_ARRIVAL: Final = 0.5
"""The same at waypoints, which systems do not reach exactly."""
_AT_REST: Final = frozenset({"speed", "speed.forward", "speed.sideways", "speed.angular"})
_ZERO: Final = _AT_REST | {"elapsed", "path.length", "mission.reached"}
_COMPARISONS: Final[dict[str, Callable[[float, float], bool]]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def check_spots(oracle: Oracle, run: RunOutline) -> tuple[Finding, ...]:
    """Return warnings about an oracle that the start, or reaching a waypoint, decides."""
    if oracle.guard is not None or oracle.leg is not None:
        return ()
    return tuple(
        Finding(oracle.place(part.column), message, hint, Severity.WARNING)
        for part, message, hint in _decided(oracle, run)
    )


def _decided(oracle: Oracle, run: RunOutline) -> Iterator[tuple[Expression, str, str]]:
    judgement, start = oracle.judgement, (run.mission.start.x, run.mission.start.y)
    if isinstance(judgement, Temporal) and judgement.operator == "eventually":
        if _holds(judgement.predicate, run, start, _BORDER) is True:
            message = f"{render(judgement.predicate)} can never fail: it is true at the start"
            yield judgement.predicate, message, "ask for something that the run has to bring about"
        return
    if not isinstance(judgement, Temporal) and not _is_bound(judgement):
        return
    for part, must_hold in oracle.judged():
        if must_hold is None:
            continue
        answer = "false" if must_hold else "true"
        if _holds(part, run, start, _BORDER) is (not must_hold):
            message = f"this can never hold: {render(part)} is {answer} at the start"
            yield part, message, "add a guard (when …), or another limit"
            continue
        for waypoint in run.mission.waypoints:
            if _holds(part, run, (waypoint.x, waypoint.y), _ARRIVAL, moves=True) is (not must_hold):
                message = f"{render(part)} is {answer} at waypoint {waypoint.id}"
                yield part, message, "a run that reaches it fails: add a guard, or another waypoint"
                break


def _is_bound(judgement: Judgement) -> bool:
    """Return whether a statistic with its limit is about each sample, such as ``max(x) <= 3 m``."""
    if not isinstance(judgement, Statistic) or judgement.limit is None:
        return False
    signs = {"max": ("<", "<="), "min": (">", ">=")}.get(judgement.operator, ())
    return judgement.limit.operator in signs


def _holds(
    expression: Expression, run: RunOutline, point: Point2, border: float, *, moves: bool = False
) -> bool | None:
    """Return whether a predicate holds with the robot at ``point`` [m]; ``None`` if unknown.

    Without ``moves`` the robot is at rest at the start of the run.
    """
    match expression:
        case Not(operand=operand):
            answer = _holds(operand, run, point, border, moves=moves)
            return None if answer is None else not answer
        case Logic(operator=word, operands=operands):
            answers = [_holds(one, run, point, border, moves=moves) for one in operands]
            deciding = word == "or"
            if deciding in answers:
                return deciding
            return None if None in answers else not deciding
        case Signal(name="in") if (place := thing_of(expression)) is not None:
            return _is_in(place.name, run, point, border)
        case Comparison(operator=sign, left=Signal() as signal, right=Number(value=value)):
            if sign in _COMPARISONS and not moves:
                low, high = _at_start(signal, run, point)
                first, second = (_COMPARISONS[sign](end, value) for end in (low, high))
                return first if first is second else None
    return None


def _is_in(place: str, run: RunOutline, point: Point2, border: float) -> bool | None:
    from shapely.geometry import Point, Polygon

    scene = run.scene
    rings = {region.name: region.outline for region in scene.regions}
    rings |= {doorway.name: doorway.footprint for doorway in scene.doorways}
    outline = Polygon(rings[place])
    if outline.boundary.distance(Point(point)) <= border:
        return None
    return bool(outline.contains(Point(point)))


def _at_start(signal: Signal, run: RunOutline, point: Point2) -> tuple[float, float]:
    """Return the bounds of a signal at the first sample."""
    if signal.name in _ZERO and not signal.arguments:
        return 0.0, 0.0
    if signal.name == "clearance" and not signal.arguments:
        import shapely
        from shapely.geometry import Point, Polygon

        walls = [Polygon(s.polygon) for s in run.scene.solids if s.z_min < run.robot.height]
        if walls:
            return -math.inf, float(shapely.distance(Point(point), walls).min())
    return -math.inf, math.inf
