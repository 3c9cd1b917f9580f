"""Reference values beside the values of a campaign's runs; they judge nothing."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from typing import Final

from daemon.judging.assessment._cell_verdicts import matches_scenario, matches_sut
from daemon.judging.statistics import mean_interval, proportion_interval
from daemon.model.assessments import (
    Assessment,
    CellAssessment,
    CellVerdict,
    ReferenceComparison,
    ReferenceValue,
)

_STATISTICS: Final[dict[str, Callable[[Sequence[float]], float]]] = {
    "median": statistics.median,
    "min": min,
    "max": max,
}


def reference_comparisons(
    references: Sequence[ReferenceValue], assessment: Assessment
) -> tuple[ReferenceComparison, ...]:
    """Return every reference value beside the value of the runs, in the order of the file.

    There is one comparison for each executed scenario and system under test that it names.
    """
    return tuple(one for r in references for one in _compared(r, assessment))


def _compared(reference: ReferenceValue, assessment: Assessment) -> Iterator[ReferenceComparison]:
    if not reference.scenario:
        for verdict in assessment.comparisons:
            if verdict.comparison == reference.oracle and matches_sut(reference.suts, verdict.sut):
                yield _of_values(reference, "", verdict.sut, verdict.differences)
        return
    for cell in assessment.cells:
        if not matches_sut(reference.suts, cell.sut):
            continue
        if not matches_scenario(reference.scenario, cell.scenario):
            continue
        if reference.statistic == "rate":
            verdicts = (oracle for oracle in cell.oracles if oracle.oracle == reference.oracle)
            yield from (_of_verdict(reference, verdict) for verdict in verdicts)
        else:
            values = _measured(cell, reference.oracle)
            yield _of_values(reference, cell.scenario, cell.sut, values)


def _measured(cell: CellAssessment, name: str) -> tuple[float, ...]:
    return next((m.values for m in cell.measures if m.oracle == name), ())


def _of_verdict(reference: ReferenceValue, verdict: CellVerdict) -> ReferenceComparison:
    # As everywhere, a run without a verdict may have passed or failed.
    low = proportion_interval(verdict.passed, verdict.n)[0]
    high = proportion_interval(verdict.n - verdict.failed, verdict.n)[1]
    rate = verdict.passed / verdict.n if verdict.n else None
    return ReferenceComparison(
        reference, verdict.scenario, verdict.sut, verdict.n, rate, None, low, high
    )


def _of_values(
    reference: ReferenceValue, scenario: str, sut: str, values: Sequence[float]
) -> ReferenceComparison:
    if not values:
        return ReferenceComparison(reference, scenario, sut, 0, None)
    interval = mean_interval(values)
    if reference.statistic == "mean":
        return ReferenceComparison(
            reference, scenario, sut, interval.n,
            interval.mean, interval.std, interval.low, interval.high,
        )  # fmt: skip
    value = _STATISTICS[reference.statistic](values)
    return ReferenceComparison(reference, scenario, sut, len(values), value, interval.std)
