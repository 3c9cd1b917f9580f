"""Bounds of signals before a run, and the parts of oracles that they decide.

A comparison that holds never, or always, judges nothing. Bounds are generous: objects may push the
robot, and a pushed joint may exceed its limits a little.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

from grammars.model.behaviour import Behaviour, Hold, Walk
from grammars.model.mission import Mission
from grammars.model.movers import is_mover
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.oracle._model import (
    Amount,
    Oracle,
    Reached,
    Response,
    Signal,
    Temporal,
    Until,
    thing_of,
)
from grammars.oracle._references import JointReference, object_signals
from grammars.oracle._signals import SIGNALS
from grammars.text.diagnostics import Finding, Severity
from grammars.text.expressions import (
    Arithmetic,
    Comparison,
    Expression,
    Function,
    Number,
    fold,
    render,
    walk,
)
from grammars.text.words import count_noun

_YIELD: Final = 0.05
"""Distance by which a pushed joint may exceed its limits [rad or m]."""
_PUSH: Final = 1.0
"""Speed [m/s] that loose objects may add to that of a robot."""
_LEVER: Final = 2.0
"""Length [m] of a leaf that pushes."""
_LEAF: Final = 5.0
"""Largest way [m] from the foot of an object to its parts."""
_MOST_NAMES: Final = 3
"""Signals that a message explains at most."""
_NOT_NEGATIVE: Final = frozenset(
    {"loc.error", "loc.sigma.x", "loc.sigma.y", "loc.sigma.yaw", "speed.angular", "latency"}
    | {"contact.depth", "estimate.particles", "bt.recoveries", "count"}
)
"""Signals and amounts without another bound."""


class _Bound(NamedTuple):
    """Bounds of a signal or quantity in ``unit``, and their reason."""

    low: float = -math.inf
    high: float = math.inf
    unit: str = "1"
    reason: str = ""
    slack: float = 0.0

    def __str__(self) -> str:
        factor = math.degrees(1.0) if self.unit == "rad" else 1.0
        unit = {"rad": " deg", "1": ""}.get(self.unit, f" {self.unit}")
        # + 0.0 makes 0 of -0.
        least, most = (f"{end * factor + 0.0:.4g}{unit}" for end in self[:2])
        if math.isinf(self.high):
            return f"is at least {least}"
        ends = f"is always {least}" if self.low == self.high else f"goes from {least} to {most}"
        return f"{ends} ({self.reason})" if self.reason else ends


@dataclass(frozen=True)
class RunOutline:
    """The parts of a run that are known before it and bound its signals.

    ``speed`` is the top speed [m/s] of the robot and its systems, infinite if unlimited;
    ``behaviours`` are those of one repeat.
    """

    scene: Scene
    robot: Robot
    mission: Mission
    limit: float
    speed: float = math.inf
    behaviours: tuple[Behaviour, ...] = ()

    @cached_property
    def joints(self) -> dict[str, JointReference]:
        """The signals of objects, with their joints."""
        return object_signals(self.scene)

    @cached_property
    def fastest(self) -> float:
        """The highest speed [m/s] of the robot, also if something pushes it."""
        pushes = (
            b.speed if isinstance(b, Walk) else _LEVER * getattr(b.motion, "rate", math.inf)
            for b in self.behaviours
            if not isinstance(b, Hold)
        )
        return 2.0 * (self.speed + max(pushes, default=0.0)) + _PUSH

    @cached_property
    def span(self) -> tuple[float, str]:
        """The longest distance [m] between the robot and a part of the building, and the reason."""
        import shapely

        start = shapely.Point(self.mission.start.x, self.mission.start.y)
        rings = [one.polygon for one in self.scene.solids if one.z_min < self.robot.height]
        # Mitred corners take a third of the time of round ones.
        parts = shapely.buffer([shapely.Polygon(r) for r in rings], _YIELD, join_style="mitre")
        walls = shapely.union_all(parts)
        regions = [shapely.Polygon(one.outline) for one in self.scene.regions]
        objects = [shapely.Point(one.pose.x, one.pose.y) for one in self.scene.objects]
        x0, y0, x1, y1 = shapely.total_bounds([walls, start, *regions, *objects])
        size = math.hypot(x1 - x0, y1 - y0) + _LEAF
        holes = (ring for part in shapely.get_parts(walls) for ring in part.interiors)
        if any(shapely.Polygon(ring).contains(start) for ring in holes):
            return size, "no way leads out of the building"
        way = self.fastest * self.limit
        return size + way, f"{self.robot.name} drives at most {way:.0f} m in a run"


def check_bounds(oracle: Oracle, run: RunOutline) -> tuple[Finding, ...]:
    """Return a warning for each part of an oracle that no run of this kind can change.

    These are comparisons that can never hold or never fail, divisors that are always 0, and times
    beyond the end of the run. :func:`check_references` reports unknown names.
    """
    return tuple(
        Finding(oracle.place(part.column), message, hint, Severity.WARNING)
        for part, message, hint in _decided(oracle, run)
    )


def _decided(oracle: Oracle, run: RunOutline) -> Iterator[tuple[Expression, str, str]]:
    """Yield the decided parts of an oracle, with a message and a hint."""
    expressions = [judged for judged, _ in oracle.judged()]
    match oracle.judgement:
        case Temporal(within=within) | Until(within=within) | Response(within=within):
            if within is not None and within.value > run.limit:
                message = f"within {within.text} has no effect: a run ends after {run.limit:g} s"
                yield within, message, "use a shorter time, or a longer limit"
        case Amount(operator=operator, limit=limit) if limit is not None:
            amount = Signal(operator, column=limit.number.column)
            expressions.append(Comparison(limit.operator, amount, limit.number))
        case Reached(tolerance=tolerance) if oracle.guard is None:
            start = (run.mission.start.x, run.mission.start.y)
            farthest = max(math.dist(start, (w.x, w.y)) for w in run.mission.waypoints)
            if farthest <= tolerance.value:
                message = (
                    f"this can never fail: each waypoint is within {farthest:.2f} m of the start"
                )
                yield tolerance, message, "use a smaller tolerance"
    if oracle.guard is not None:
        expressions.append(oracle.guard)
    for part in (part for expression in expressions for part in walk(expression)):
        if isinstance(part, Arithmetic) and part.operator == "/":
            if _quantity(part.right, run)[:2] == (0.0, 0.0):
                message = f"{render(part.right)} is always 0, and divides"
                yield part.right, message, "the quotient is unknown"
        elif isinstance(part, Comparison):
            sides = _quantity(part.left, run), _quantity(part.right, run)
            if verdict := _verdict(part.operator, *sides):
                signals = {render(s): s for s in walk(part) if isinstance(s, Signal)}
                bounds = {name: signal_bound(signal, run) for name, signal in signals.items()}
                why = [f"{name} {one}" for name, one in bounds.items() if math.isfinite(one.low)]
                reasons = " and ".join(why[:_MOST_NAMES]) or "it compares constants"
                first = next(iter(signals.values()), part.left)
                hint = "write a limit that a run can meet and miss"
                name = render(first)
                is_angle = name in run.joints and name.endswith(".angle")
                if is_angle and run.joints[name].object.mirrored:
                    hint = f"the object is mirrored, which reverses the sign: write abs({name})"
                message = f"{render(part)} can never {verdict}: {reasons}"
                yield first, message, hint


def _verdict(operator: str, left: _Bound, right: _Bound) -> str:
    """Return ``hold`` or ``fail`` for what ``left operator right`` can never do, else empty."""
    # The bounds of the margin, which is negative if the comparison does not hold.
    low, high = left.low - right.high, left.high - right.low
    if operator in ("<=", "<"):
        low, high = -high, -low
    elif operator in ("==", "!="):
        near = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
        far = max(abs(low), abs(high))
        low, high = (-far, -near) if operator == "==" else (near, far)
    # A strict comparison of equal sides does not hold.
    strict = operator in ("<", ">", "!=")
    if high < 0.0 or (strict and high == 0.0):
        return "hold"
    return "fail" if low > 0.0 or (low == 0.0 and not strict) else ""


def _quantity(expression: Expression, run: RunOutline) -> _Bound:
    """Return the bounds of a quantity."""

    def visit(part: Expression, sides: Sequence[_Bound]) -> _Bound:
        match part:
            case Number(value=value):
                return _Bound(value, value)
            case Signal():
                bound = signal_bound(part, run)
                return _Bound(bound.low - bound.slack, bound.high + bound.slack)
            case Function(name="-"):
                return _Bound(-sides[0].high, -sides[0].low)
            case Function(name="abs"):
                low, high = sides[0][:2]
                least = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
                return _Bound(least, max(abs(low), abs(high)))
            case Function(name=name):
                extreme = min if name == "min" else max
                return _Bound(extreme(s.low for s in sides), extreme(s.high for s in sides))
            case Arithmetic(operator=operator):
                return _calculate(operator, *sides)
        return _Bound()

    return fold(expression, visit)


def _calculate(operator: str, a: _Bound, b: _Bound) -> _Bound:
    match operator:
        case "+":
            return _Bound(a.low + b.low, a.high + b.high)
        case "-":
            return _Bound(a.low - b.high, a.high - b.low)
        case "/" if b.low <= 0.0 <= b.high:
            return _Bound()
        case "/":
            b = _Bound(1.0 / b.high, 1.0 / b.low)
    # An unlimited value times 0 is 0.
    ends = [x * y if x and y else 0.0 for x in a[:2] for y in b[:2]]
    return _Bound(min(ends), max(ends))


def signal_bound(signal: Signal, run: RunOutline) -> _Bound:
    """Return the bounds of a signal in every run of this kind; generous where things may push."""
    name, count = signal.name, len(run.mission.waypoints)
    waypoints = f"mission {run.mission.name} has {count_noun(count, 'waypoint')}"
    drives = f"{run.robot.name} drives at most {run.speed:.2f} m/s"
    if name in run.joints and not name.endswith(".distance"):
        return _joint_bound(run.joints[name], run.behaviours)
    match name:
        case "loc.error.yaw" | "estimate.yaw" | "pose.yaw":
            return _Bound(-math.pi, math.pi, "rad")
        case "elapsed" | "mission.leg.elapsed":
            return _Bound(0.0, round(run.limit, 2), "s", "the limit of the run")
        case "fraction":
            return _Bound(0.0, 1.0)
        case "time" | "longest":
            return _Bound(0.0, run.limit, "s", "the limit of the run")
        case "mission.leg" if count:
            return _Bound(1.0, count, "1", waypoints)
        case "mission.reached" | "mission.remaining":
            return _Bound(0.0, count, "1", waypoints)
        case "speed":
            return _Bound(0.0, run.fastest, "m/s", drives)
        case "speed.forward" | "speed.sideways" if math.isfinite(run.fastest):
            return _Bound(-run.fastest, run.fastest, "m/s", drives)
        case "path.length":
            return _Bound(0.0, run.fastest * run.limit, "m", drives)
        case _ if name in _NOT_NEGATIVE:
            return _Bound(0.0, math.inf, SIGNALS[name].unit if name in SIGNALS else "1")
        case "clearance" | "distance" | "mission.distance":
            return _distance_bound(signal, run)
    return _distance_bound(signal, run) if name in run.joints else _Bound()


def _distance_bound(signal: Signal, run: RunOutline) -> _Bound:
    """Return the bounds of a distance of the robot [m]."""
    low, (far, reason), thing = 0.0, run.span, thing_of(signal)
    if signal.name == "clearance":
        half = [a.value for a in signal.arguments if isinstance(a, Number)]
        low = -min(
            half or [(max(c) - min(c)) / 2.0 for c in zip(*run.robot.footprint, strict=True)]
        )
    owner = (signal if thing is None else thing).name.partition(".")[0]
    # A mover may be anywhere; without walls a clearance has no limit.
    roams = any(one.name == owner and is_mover(one.joints) for one in run.scene.objects)
    return _Bound(low, far if run.scene.solids and not roams else math.inf, "m", reason)


def _joint_bound(reference: JointReference, behaviours: Sequence[Behaviour]) -> _Bound:
    """Return the bounds of the position of a joint [rad or m]."""
    body, joint = reference.object, reference.joint
    low, high, reason = joint.lower, joint.upper, ""
    if body.frozen:
        low = high = body.initial[body.joints.index(joint)]
        reason = f"{body.name} is frozen"
    for one in behaviours:
        if isinstance(one, Hold) and one.joint == f"{body.name}.{joint.name}":
            low, high, reason = one.position, one.position, "its behaviour holds it"
    return _Bound(low, high, "rad" if joint.kind == "revolute" else "m", reason, _YIELD)
