"""States of runs, and verdicts of oracles about their traces, with the evidence.

An oracle maps a trace to an interval of signed margin in the unit of the judged quantity. The
verdict follows: pass when the whole interval is >= 0, fail when it is < 0, inconclusive when it is
neither, error without an interval.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final

from daemon.model.ids import Seconds, SignalValue

_MOMENT: Final = re.compile(r"\b(at|until|from) (\d+\.\d\d) s\b")
"""Pattern of a moment in a note of an oracle."""
LONGEST_EVIDENCE: Final = 200
"""Longest note or name of an object in shortened evidence [characters]."""


class RunState(StrEnum):
    """State of a run in the ledger; ``lost`` means no result after every attempt."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    LOST = "lost"
    CANCELLED = "cancelled"


UNFINISHED_STATES: Final = (RunState.RUNNING, RunState.QUEUED)
"""States of runs that may still have a result."""


class Outcome(StrEnum):
    """The four verdicts, and ``measure`` for an oracle without a limit (never red)."""

    PASS = "pass"
    FAIL = "fail"
    INCONCLUSIVE = "inconclusive"
    ERROR = "error"
    MEASURE = "measure"


@dataclass(frozen=True, slots=True)
class Evidence:
    """The decisive moment: ``time`` [s], the ``value`` and ``limit`` there, the object involved."""

    time: Seconds | None = None
    value: SignalValue | None = None
    limit: SignalValue | None = None
    object: str = ""
    note: str = ""

    @property
    def note_text(self) -> str:
        """The note for people, with moments in tenths of a second: ``first at 34.6 s``.

        The note itself is part of recorded traces and never changes.
        """
        return _MOMENT.sub(lambda match: f"{match[1]} {float(match[2]):.1f} s", self.note)


@dataclass(frozen=True, slots=True)
class Verdict:
    """One oracle's verdict on one trace.

    ``lower`` and ``upper`` bound the signed margin in ``unit`` (``None``: unbounded on that
    side). For a measure, ``evidence.value`` is the measured value.
    """

    oracle: str
    text: str
    outcome: Outcome
    lower: SignalValue | None
    upper: SignalValue | None
    unit: str
    evidence: Evidence = Evidence()

    @property
    def margin(self) -> float | None:
        """The decisive bound: the lower one, or ``None`` when the margin is unknown."""
        return self.lower if self.outcome is not Outcome.FAIL else self.upper

    @property
    def moment(self) -> float | None:
        """The simulated time that decided [s], ``None`` without such a moment."""
        return self.evidence.time

    @property
    def about(self) -> str:
        """The object that was nearest, touched, …; empty without one."""
        return self.evidence.object


def shorten_evidence(verdict: Verdict) -> Verdict:
    """Return a verdict with the texts of its evidence cut to :data:`LONGEST_EVIDENCE`."""
    evidence = verdict.evidence
    shorter = replace(
        evidence,
        object=evidence.object[:LONGEST_EVIDENCE],
        note=evidence.note[:LONGEST_EVIDENCE],
    )
    return replace(verdict, evidence=shorter)


def combine(verdicts: Iterable[Verdict], *, valid: bool = True) -> Outcome:
    """Combine the verdicts of one run: invalid > fail > error > inconclusive > pass.

    A suite that judged nothing is inconclusive; measures do not count.
    """
    if not valid:
        return Outcome.ERROR
    outcomes = {v.outcome for v in verdicts} - {Outcome.MEASURE}
    # A failure before an error: it counts even if another oracle could not be read.
    for outcome in (Outcome.FAIL, Outcome.ERROR, Outcome.INCONCLUSIVE, Outcome.PASS):
        if outcome in outcomes:
            return outcome
    return Outcome.INCONCLUSIVE


def deciding_verdict(verdicts: Iterable[Verdict]) -> Verdict | None:
    """Return the verdict to list for a run: the first failing one, else that of the least margin.

    Margins are compared without regard to units; measures do not count.
    """
    judged = [v for v in verdicts if v.outcome is not Outcome.MEASURE]
    for verdict in judged:
        if verdict.outcome is Outcome.FAIL:
            return verdict
    measured = [v for v in judged if v.margin is not None]
    return min(measured, key=lambda v: v.margin or 0.0, default=judged[0] if judged else None)


@dataclass(frozen=True, slots=True)
class MarginInterval:
    """An interval of signed margin (infinite where unbounded) and the evidence for it.

    A measure has no interval, only evidence.
    """

    lower: float
    upper: float
    evidence: Evidence = field(default_factory=Evidence)
    measured: bool = False

    @property
    def outcome(self) -> Outcome:
        """The verdict that follows from the interval."""
        if self.measured:
            return Outcome.MEASURE
        if self.lower >= 0.0:
            return Outcome.PASS
        return Outcome.FAIL if self.upper < 0.0 else Outcome.INCONCLUSIVE


def unknown_margin(note: str, *, measured: bool = False) -> MarginInterval:
    """Return the interval of an oracle that had nothing to judge."""
    return MarginInterval(-math.inf, math.inf, Evidence(note=note), measured)


def join_notes(*notes: str) -> str:
    """Join notes for people, leaving out empty ones."""
    return "; ".join(note for note in notes if note)
