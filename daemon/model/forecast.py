"""What is known of runs before they are submitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """A run by the ``digest`` of its specification; only ``repeatable`` ones reuse results."""

    digest: str
    scenario: str
    sut: str
    repeatable: bool = True


@dataclass(frozen=True, slots=True)
class Forecast:
    """For each run whether it has a result already, and how long it takes a worker [s].

    The time is that of executed runs of the same scenario and system, else of the same system;
    ``None`` when there was no run of it.
    """

    cached: Sequence[bool]
    seconds: Sequence[float | None]
