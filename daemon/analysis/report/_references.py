"""Reference values in figures: which of them is about what a figure shows, and how it is marked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from daemon.analysis.report._input import ReportInput
from daemon.analysis.report._safety_buffer import SafetyBuffer
from daemon.judging.assessment import reference_comparisons
from daemon.model.assessments import DURATION, Assessment, ReferenceComparison, ReferenceValue
from grammars.oracle import Amount, Oracle, Signal, Statistic, parse_oracle
from grammars.text.diagnostics import InputError, Where
from grammars.text.expressions import Comparison, Number


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


def mark(reference: ReferenceValue, factor: float = 1.0) -> ReferenceMark:
    """Return the mark of a reference value, whose unit is ``factor`` times that of the figure."""
    low, high = reference.low, reference.high
    if reference.deviation is not None:
        low, high = reference.value - reference.deviation, reference.value + reference.deviation
    words = "" if reference.statistic in ("mean", "rate") else f" {reference.statistic}"
    return ReferenceMark(
        label=f"{reference.name}{words} {reference.text}",
        value=factor * reference.value,
        low=None if low is None else factor * low,
        high=None if high is None else factor * high,
        source=", ".join(part for part in (reference.source, reference.note) if part),
    )


def cell_marks(
    chosen: ReportInput, assessment: Assessment, buffer: SafetyBuffer, texts: Mapping[str, str]
) -> dict[tuple[str, str], dict[str, list[ReferenceMark]]]:
    """Return the marks of each cell, (scenario, SUT), by the measure of the report they are of.

    ``texts`` are the oracles of the campaign by name: what a measure is called is the business of
    whoever wrote the campaign, what it measures stands in its text.
    """
    found: dict[tuple[str, str], dict[str, list[ReferenceMark]]] = {}
    for compared in compared_references(chosen, assessment):
        reference = compared.reference
        if not compared.scenario or reference.statistic == "rate":
            continue
        measured = _report_measure(reference.oracle, texts, buffer)
        if measured is not None:
            name, factor = measured
            marks = found.setdefault((compared.scenario, compared.sut), {})
            marks.setdefault(name, []).append(mark(reference, factor))
    return found


def compared_references(
    chosen: ReportInput, assessment: Assessment
) -> tuple[ReferenceComparison, ...]:
    """Return every reference value of a campaign beside what was found."""
    return reference_comparisons(chosen.declared.references, assessment)


def reference_names(references: Iterable[ReferenceValue]) -> tuple[tuple[str, str], ...]:
    """Return the short names of references with their sources, each once."""
    return tuple(dict.fromkeys((r.name, r.source) for r in references))


def _report_measure(
    name: str, texts: Mapping[str, str], buffer: SafetyBuffer
) -> tuple[str, float] | None:
    """Return which measure of the report a measure of the campaign is, and the factor of units."""
    text = texts.get(name)
    if text is None:
        return ("duration", 1.0) if name == DURATION else None
    try:
        oracle = parse_oracle(name, text, Where("report"))
    except InputError:
        return None
    if oracle.guard is not None or oracle.leg is not None:
        return None
    return _measure_of(oracle, buffer)


def _measure_of(oracle: Oracle, buffer: SafetyBuffer) -> tuple[str, float] | None:
    match oracle.judgement:
        case Statistic("final", Signal("elapsed", ()), None):
            return "duration", 1.0
        case Statistic("final", Signal("path.length", ()), None):
            return "path length", 1.0
        case Statistic("min", Signal("clearance", ()), None):
            return "min clearance", 1.0
        case Statistic("mean" | "max" | "p95" as operator, Signal("loc.error", ()), None):
            return f"error {operator}", 1.0
        case Amount("fraction", Signal("loc.inside_2sigma", ()), None):
            return "inside 2 sigma", 100.0
        case Amount("time" | "longest" as operator, Comparison() as within, None):
            words = {"time": "time in buffer", "longest": "longest in buffer"}
            return (words[operator], 1.0) if _is_in_buffer(within, buffer) else None
        case _:
            return None


def _is_in_buffer(within: Comparison, buffer: SafetyBuffer) -> bool:
    """Whether a predicate says that something is inside the buffer the report looks at."""
    if within.operator not in ("<", "<=") or not isinstance(within.right, Number):
        return False
    match within.left:
        case Signal("clearance", (Number() as hx, Number() as hy)):
            return within.right.value == 0.0 and (hx.value, hy.value) == buffer.half
        case Signal("clearance", ()):
            return buffer.half is None and within.right.value == buffer.margin
        case _:
            return False


def comparison_marks(
    compared: Sequence[ReferenceComparison],
) -> dict[tuple[str, str], list[ReferenceMark]]:
    """Return the marks of the comparisons of a campaign, by comparison and SUT."""
    found: dict[tuple[str, str], list[ReferenceMark]] = {}
    for each in compared:
        if not each.scenario:
            found.setdefault((each.reference.oracle, each.sut), []).append(mark(each.reference))
    return found
