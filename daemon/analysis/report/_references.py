"""Reference values in figures: their measures and their marks."""

from __future__ import annotations

from dataclasses import dataclass

from daemon.analysis.report._data import ReportData
from daemon.analysis.report._measures import standard_names
from daemon.model.assessments import ReferenceValue


@dataclass(frozen=True, slots=True)
class ReferenceMark:
    """Mark of a reference value in a figure.

    ``value``, ``low`` and ``high`` have the unit of the figure; ``low`` and ``high`` are its
    deviation to both sides, or its range. ``label`` stands beside it, ``source`` is for tooltips.
    """

    label: str
    value: float
    low: float | None
    high: float | None
    source: str


def cell_marks(data: ReportData) -> dict[tuple[str, str], dict[str, list[ReferenceMark]]]:
    """Return the marks of each cell, (scenario, SUT), by measures of the report.

    A reference belongs to the measure with the meaning of its oracle, under any name.
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
