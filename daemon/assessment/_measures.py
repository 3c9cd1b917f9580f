"""Measured quantities over the repeats of a cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from daemon.assessment._types import MeasureCell, RunRecord
from daemon.statistics import mean_interval
from daemon.verdict import Outcome

DURATION: Final = "duration"
"""The measure every run has: the simulated time it took [s]."""


def measured(record: RunRecord, name: str) -> float | None:
    """Return what the measure ``name`` found in a run, ``None`` when there is nothing to trust."""
    if record.outcome is None or record.ended == "crashed":
        return None
    verdict = record.verdict(name)
    if verdict is None:
        return duration(record) if name == DURATION else None
    return verdict.evidence.value if verdict.outcome is Outcome.MEASURE else None


def duration(record: RunRecord) -> float | None:
    """Return the simulated time a run took [s]."""
    return None if record.timing is None else record.timing.simulated


def measures_of(records: Sequence[RunRecord]) -> tuple[MeasureCell, ...]:
    """Return every measure of one cell that has values, the duration last."""
    units: dict[str, str] = {}
    for record in records:
        for verdict in record.verdicts:
            if verdict.outcome is Outcome.MEASURE:
                units.setdefault(verdict.oracle, verdict.unit)
    if DURATION not in {v.oracle for r in records for v in r.verdicts}:
        units[DURATION] = "s"
    cells = (_cell(name, unit, records) for name, unit in units.items())
    return tuple(cell for cell in cells if cell is not None)


def _cell(name: str, unit: str, records: Sequence[RunRecord]) -> MeasureCell | None:
    found = [(r.repeat, value) for r in records if (value := measured(r, name)) is not None]
    if not found:
        return None
    repeats, values = zip(*found, strict=True)
    interval = mean_interval(values)
    return MeasureCell(
        scenario=records[0].scenario,
        sut=records[0].sut,
        oracle=name,
        unit=unit,
        repeats=repeats,
        values=values,
        mean=interval.mean,
        std=interval.std,
        low=interval.low,
        high=interval.high,
    )
