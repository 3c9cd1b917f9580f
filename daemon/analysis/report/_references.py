"""Reference values in figures: which of them is about what a figure shows, and how it is marked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from daemon.analysis.report._measures import standard_names
from daemon.analysis.report._safety_buffer import SafetyBuffer
from daemon.analysis.results import Results
from daemon.judging.assessment import reference_comparisons
from daemon.model.assessments import Assessment, ReferenceComparison, ReferenceValue


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


def mark(reference: ReferenceValue) -> ReferenceMark:
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


def cell_marks(
    chosen: Results, assessment: Assessment, buffer: SafetyBuffer, texts: Mapping[str, str]
) -> dict[tuple[str, str], dict[str, list[ReferenceMark]]]:
    """Return the marks of each cell, (scenario, SUT), by the measure of the report they are of.

    ``texts`` are the oracles of the campaign by name. A reference belongs to the measure that means
    the same as its oracle, whatever the campaign calls it.
    """
    standard = standard_names(texts, buffer)
    found: dict[tuple[str, str], dict[str, list[ReferenceMark]]] = {}
    for compared in compared_references(chosen, assessment):
        reference = compared.reference
        name = standard.get(reference.oracle)
        if name and compared.scenario and reference.statistic != "rate":
            marks = found.setdefault((compared.scenario, compared.sut), {})
            marks.setdefault(name, []).append(mark(reference))
    return found


def compared_references(chosen: Results, assessment: Assessment) -> tuple[ReferenceComparison, ...]:
    """Return every reference value of a campaign beside what was found."""
    return reference_comparisons(chosen.declared.references, assessment)


def reference_names(references: Iterable[ReferenceValue]) -> tuple[tuple[str, str], ...]:
    """Return the short names of references with their sources, each once."""
    return tuple(dict.fromkeys((r.name, r.source) for r in references))


def comparison_marks(
    compared: Sequence[ReferenceComparison],
) -> dict[tuple[str, str], list[ReferenceMark]]:
    """Return the marks of the comparisons of a campaign, by comparison and SUT."""
    found: dict[tuple[str, str], list[ReferenceMark]] = {}
    for each in compared:
        if not each.scenario:
            found.setdefault((each.reference.oracle, each.sut), []).append(mark(each.reference))
    return found
