"""Standard measures: oracles without a limit that every run of a report is judged by.

The same engine computes them and the measures that a campaign declares. A declared measure with the
meaning of a standard one shares its column and its figures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final

from daemon.analysis.report._safety_buffer import SafetyBuffer
from daemon.judging.oracles import written_oracle
from daemon.model.assessments import DURATION
from daemon.model.spec import OracleText
from daemon.model.verdicts import Verdict

SPEED_AT_TRIGGER: Final = "speed at trigger"
"""The only measure that oracles cannot express: it averages over events of the log."""


@dataclass(frozen=True, slots=True)
class RunMeasure:
    """A number of a run: its name, unit and meaning, and the ``text`` of its oracle.

    In :data:`MEASURES` the text names the predicate of the safety buffer ``{in_buffer}``.
    ``declared`` are the campaign's own names. Each ``group`` has a table of its own: 0 about the
    run, 1 about the estimated pose, 2 declared by the campaign alone.
    """

    name: str
    unit: str
    about: str
    text: str = ""
    group: int = 0
    declared: tuple[str, ...] = ()


MEASURES: Final = (
    RunMeasure("duration", "s", "simulated time from start to end of the run", "final(elapsed)"),
    RunMeasure("path length", "m", "length of the true path", "final(path.length)"),
    RunMeasure(
        "min clearance", "m", "smallest distance of an obstacle to the box around the footprint",
        "min(clearance)",
    ),
    RunMeasure(
        "time in buffer", "s", "time with an obstacle inside the safety buffer",
        "time({in_buffer})",
    ),
    RunMeasure(
        "longest in buffer", "s", "longest such time without a break", "longest({in_buffer})"
    ),
    RunMeasure(
        "error mean", "m", "localisation error, mean over time", "mean(loc.error)", 1
    ),
    RunMeasure(
        "error median", "m", "localisation error, half of the time below", "median(loc.error)", 1
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
        "max(speed) when {in_buffer}",
    ),
    RunMeasure(
        "recoveries", "1", "recoveries of Nav2, if its behaviour tree is recorded",
        "final(bt.recoveries)",
    ),
)  # fmt: skip
"""The measures of every run. One without a value in a run (no estimate, no door) has no entry."""


def standard_measures(buffer: SafetyBuffer) -> tuple[RunMeasure, ...]:
    """Return :data:`MEASURES` with oracle texts for a safety buffer."""
    return tuple(
        replace(measure, text=measure.text.format(in_buffer=buffer.predicate))
        for measure in MEASURES
    )


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
