"""What an operator finds on a trace, before it becomes a verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from daemon.verdict import Evidence, Outcome


@dataclass(frozen=True, slots=True)
class Finding:
    """An interval of signed margin (infinite where unbounded) and the evidence for it.

    A measure has no interval, only evidence.
    """

    lower: float
    upper: float
    evidence: Evidence = field(default_factory=Evidence)
    measured: bool = False

    @property
    def outcome(self) -> Outcome:
        """The verdict that falls out of the interval."""
        if self.measured:
            return Outcome.MEASURE
        if self.lower >= 0.0:
            return Outcome.PASS
        return Outcome.FAIL if self.upper < 0.0 else Outcome.INCONCLUSIVE


def unknown(note: str, *, measured: bool = False) -> Finding:
    """Return the finding of an oracle that had nothing to judge."""
    return Finding(-math.inf, math.inf, Evidence(note=note), measured)


def sentence(*notes: str) -> str:
    """Join notes for people, leaving out empty ones."""
    return "; ".join(note for note in notes if note)
