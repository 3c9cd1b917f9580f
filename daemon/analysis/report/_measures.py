"""Standard measures: oracles without a limit that every run of a report is judged by.

The same engine computes them and the measures that a campaign declares. A declared measure with the
meaning of a standard one shares its column and its figures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from daemon.judging.oracles import footprint_box, written_oracle
from daemon.model.assessments import DURATION
from daemon.model.spec import OracleText
from daemon.model.verdicts import Verdict
from grammars.model.geometry import Point2, Ring
from grammars.oracle import Signal
from grammars.text.expressions import Comparison, Expression, Number, walk

DEFAULT_MARGIN: Final = 0.2
"""Default distance [m] to obstacles, if no oracle names one: the paper's (section 4.3.1)."""
SPEED_AT_TRIGGER: Final = "speed at trigger"
"""The only measure that oracles cannot express: it averages over events of the log."""


@dataclass(frozen=True, slots=True)
class RunMeasure:
    """A number of a run: its name, unit and meaning, and the ``text`` of its oracle.

    Each ``group`` has a table of its own: 0 about the run, 1 about the estimated pose, 2 declared
    by the campaign alone.
    """

    name: str
    unit: str
    about: str
    text: str = ""
    group: int = 0


def standard_measures(buffer: SafetyBuffer) -> tuple[RunMeasure, ...]:
    """Return the measures of every run.

    A measure without a value in a run (no estimate, no door) has no entry there.
    """
    in_buffer = buffer.predicate
    return (
        RunMeasure(
            "duration", "s", "simulated time from start to end of the run", "final(elapsed)"
        ),
        RunMeasure("path length", "m", "length of the true path", "final(path.length)"),
        RunMeasure(
            "min clearance", "m",
            "smallest distance of an obstacle to the box around the footprint",
            "min(clearance)",
        ),
        RunMeasure(
            "time in buffer", "s", "time with an obstacle inside the safety buffer",
            f"time({in_buffer})",
        ),
        RunMeasure(
            "longest in buffer", "s", "longest such time without a break", f"longest({in_buffer})"
        ),
        RunMeasure(
            "error mean", "m", "localisation error, mean over time", "mean(loc.error)", 1
        ),
        RunMeasure(
            "error median", "m", "localisation error, half of the time below",
            "median(loc.error)", 1
        ),
        RunMeasure(
            "error p95", "m", "localisation error, 95 % of the time below", "p95(loc.error)", 1
        ),
        RunMeasure("error max", "m", "largest localisation error", "max(loc.error)", 1),
        RunMeasure(
            "inside 2 sigma", "1", "share of time with the true position within two deviations",
            "fraction(loc.inside_2sigma)", 1,
        ),
        RunMeasure(
            SPEED_AT_TRIGGER, "m/s", "speed when a door was triggered, mean over the triggers"
        ),
        RunMeasure(
            "max speed in buffer", "m/s", "highest speed with an obstacle inside the buffer",
            f"max(speed) when {in_buffer}",
        ),
        RunMeasure(
            "recoveries", "1", "recoveries of Nav2, if its behaviour tree is recorded",
            "final(bt.recoveries)",
        ),
    )  # fmt: skip


def standard_oracles(buffer: SafetyBuffer) -> tuple[OracleText, ...]:
    """Return the standard measures as oracles, to judge together with those of a run."""
    return tuple(OracleText(m.name, m.text) for m in standard_measures(buffer) if m.text)


def measured_values(verdicts: Iterable[Verdict]) -> dict[str, float]:
    """Return the finite values of measures by name."""
    values = ((verdict.oracle, verdict.evidence.value) for verdict in verdicts)
    return {name: v for name, v in values if v is not None and math.isfinite(v)}


def standard_names(texts: Mapping[str, str], buffer: SafetyBuffer) -> dict[str, str]:
    """Return the standard measure of each oracle with the same meaning, by names.

    ``texts`` are oracles by name. The name does not count, except for the duration, which every
    campaign has without an oracle.
    """
    standard = {_meaning(m.text): m.name for m in standard_measures(buffer) if m.text}
    same = {DURATION: DURATION} | {n: standard.get(_meaning(t), "") for n, t in texts.items()}
    return {name: measure for name, measure in same.items() if measure}


def _meaning(text: str) -> object:
    oracle = written_oracle(OracleText("report", text))
    # Without text and place: two oracles are equal if they judge the same.
    return oracle and (oracle.judgement, oracle.guard, oracle.leg)


@dataclass(frozen=True, slots=True)
class SafetyBuffer:
    """The safety buffer of a report: a box in the base frame, half extents [m].

    Without ``half`` it is the box around the footprint with ``margin`` [m] more on every side.
    ``source`` names its origin in words.
    """

    half: Point2 | None
    margin: float
    source: str

    @property
    def size(self) -> str:
        """The size in words: ``1.1 m × 0.866 m`` or ``0.2 m``."""
        if self.half is None:
            return f"{self.margin:g} m"
        return f"{2 * self.half[0]:g} m × {2 * self.half[1]:g} m"

    @property
    def predicate(self) -> str:
        """The predicate of the oracle language that holds while an obstacle is inside."""
        if self.half is None:
            return f"clearance < {self.margin!r} m"
        return f"clearance({self.half[0]!r} m, {self.half[1]!r} m) < 0 m"

    def box(self, footprint: Ring) -> tuple[Point2, Point2]:
        """Return centre and half extents [m] around a robot with ``footprint``, base frame."""
        if self.half is not None:
            return (0.0, 0.0), self.half
        centre, (hx, hy) = footprint_box(footprint)
        return centre, (hx + self.margin, hy + self.margin)


def safety_buffer(texts: Iterable[str], footprints: Iterable[Ring] = ()) -> SafetyBuffer:
    """Return the largest box ``clearance(hx, hy)`` in oracles.

    Without one, use the largest limit of a plain ``clearance``, otherwise the paper's 0.2 m. A
    buffer is room around the robot, so a box must reach beyond one of the ``footprints`` on every
    side; otherwise it is a collision box (that of section 4.2.3 is narrower than the robot).
    """
    boxes: dict[Point2, str] = {}
    limits: dict[float, str] = {}
    for text in sorted(set(texts)):
        for part, _ in _judged_parts(text):
            match part:
                case Signal(name="clearance", arguments=(Number() as hx, Number() as hy)):
                    boxes.setdefault((hx.value, hy.value), text)
                case Comparison(left=Signal(name="clearance", arguments=()), right=Number() as n):
                    limits.setdefault(n.value, text)
    rings = tuple(footprints)
    boxes = {half: text for half, text in boxes.items() if not rings or _is_around(half, rings)}
    if boxes:
        half = max(boxes, key=lambda box: box[0] * box[1])
        size = f"{2 * half[0]:g} m × {2 * half[1]:g} m"
        return SafetyBuffer(half, 0.0, f"the box of {size} around the robot in “{boxes[half]}”")
    positive = [limit for limit in limits if limit > 0.0]
    if positive:
        return SafetyBuffer(
            None, max(positive), f"{max(positive):g} m as in “{limits[max(positive)]}”"
        )
    source = f"{DEFAULT_MARGIN:g} m around the robot, since no oracle names a clearance"
    return SafetyBuffer(None, DEFAULT_MARGIN, source)


def _is_around(half: Point2, footprints: Iterable[Ring]) -> bool:
    """Return whether a box leaves room on every side of one of the footprints."""
    return any(
        all(abs(x) < half[0] and abs(y) < half[1] for x, y in footprint) for footprint in footprints
    )


def _judged_parts(text: str) -> Iterator[tuple[Expression, bool | None]]:
    """Yield each judged part of an oracle, and whether it must hold at each sample."""
    oracle = written_oracle(OracleText("report", text))
    for judged, holds in () if oracle is None else oracle.judged():
        yield from ((part, holds) for part in walk(judged))


def error_limit(texts: Iterable[str]) -> float | None:
    """Return the smallest limit [m] of the localisation error that holds at each sample, if any."""
    limits = [
        number.value
        for text in texts
        for part, holds in _judged_parts(text)
        if holds
        and isinstance(part, Comparison)
        and isinstance(number := part.right, Number)
        and part.left == Signal("loc.error")
        and part.operator in ("<=", "<")
    ]
    return min(limits, default=None)
