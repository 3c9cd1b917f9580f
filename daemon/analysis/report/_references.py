"""Reference values in figures: the measure that each one is about, and its mark."""

from __future__ import annotations

from dataclasses import dataclass

from daemon.analysis.report._data import ReportData
from daemon.analysis.report._measures import standard_names
from daemon.model.assessments import ReferenceValue


@dataclass(frozen=True, slots=True)
class ReferenceMark:
    """A reference value as a figure shows it.

    ``value``, ``low`` and ``high`` in the unit of the figure; the latter are its deviation to both
    sides, or its range. ``label`` is said beside it, ``source`` where there is room.
    """

    label: str
    value: float
    low: float | None
    high: float | None
    source: str


def cell_marks(data: ReportData) -> dict[tuple[str, str], dict[str, list[ReferenceMark]]]:
    """Return the marks of each cell, (scenario, SUT), by the measure of the report they are of.

    A reference belongs to the measure that means the same as its oracle, whatever the campaign
    calls it.
    """
    standard = standard_names(data.oracle_texts, data.buffer)
    cells: dict[tuple[str, str], dict[str, list[ReferenceMark]]] = {}
    for compared in data.references:
        name = standard.get(compared.reference.oracle)
        if name and compared.scenario and compared.reference.statistic != "rate":
            marks = cells.setdefault((compared.scenario, compared.sut), {})
            marks.setdefault(name, []).append(_mark(compared.reference))
    return cells


def comparison_marks(data: ReportData) -> dict[tuple[str, str], list[ReferenceMark]]:
    """Return the marks of the comparisons of a campaign, by comparison and SUT."""
    marks: dict[tuple[str, str], list[ReferenceMark]] = {}
    for compared in data.references:
        if not compared.scenario:
            key = (compared.reference.oracle, compared.sut)
            marks.setdefault(key, []).append(_mark(compared.reference))
    return marks


def _mark(reference: ReferenceValue) -> ReferenceMark:
    """Return the mark of a reference value."""
    low, high = reference.low, reference.high
    if reference.deviation is not None:
        low, high = reference.value - reference.deviation, reference.value + reference.deviation
    words = "" if reference.statistic in ("mean", "rate") else f" {reference.statistic}"
    return ReferenceMark(
        label=f"{reference.name}{words} {reference.text}",
        value=reference.value,
        low=low,
        high=high,
        source=", ".join(part for part in (reference.source, reference.note) if part),
    )
