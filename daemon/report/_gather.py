"""Reading the traces of a campaign in parallel, and judging runs nobody has judged yet."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

from daemon import oracles
from daemon.assessment import Assessment, RunRecord, assess
from daemon.coverage import Contribution, Coverage, contribution, summed
from daemon.oracles import Sampler
from daemon.report._buffer import buffer_of
from daemon.report._series import driven
from daemon.report._types import Buffer, Chosen, Driven, Watch
from daemon.spec import Timing
from daemon.spread import spread
from daemon.trace import TraceError, read_trace

_SAMPLES: Final = 36_000
"""Samples drawn in all figures of one kind together: what keeps a report small."""
_FEWEST, _MOST = 90, 600
"""Samples drawn of one run."""

Watched: TypeAlias = Callable[[Iterable["Gathered"], int], Iterable["Gathered"]]


@dataclass(frozen=True, slots=True)
class Gathered:
    """A run, judged, and what its trace says."""

    record: RunRecord
    driven: Driven
    covered: Contribution | None = None


@dataclass(frozen=True, slots=True)
class Material:
    """Everything a report is written from."""

    chosen: Chosen
    runs: tuple[Gathered, ...]
    assessment: Assessment
    buffer: Buffer
    coverage: Coverage


def gather(
    chosen: Chosen, *, processes: int | None = None, watched: Watched | None = None
) -> Material:
    """Read all traces and assess the campaign; ``watched`` may show how far it is.

    Runs that are not judged yet are judged by the oracles inside of their traces. A trace that is
    missing or damaged leaves a run without tracks, never without its verdicts.
    """
    buffer = buffer_of(chosen.oracles)
    points = max(_FEWEST, min(_MOST, _SAMPLES // max(len(chosen.records), 1)))
    oracles.warm_up()
    task = partial(_read, buffer=buffer, watches=chosen.watches, points=points)
    found: Iterable[Gathered] = spread(
        task, chosen.records, doing="that reads traces", processes=processes
    )
    runs = tuple(found if watched is None else watched(found, len(chosen.records)))
    assessment = assess(chosen.declared, (run.record for run in runs))
    coverage = summed([run.covered for run in runs if run.covered is not None])
    return Material(chosen, runs, assessment, buffer, coverage)


def _read(
    record: RunRecord, *, buffer: Buffer, watches: tuple[Watch, ...], points: int
) -> Gathered:
    if record.trace is None:
        return Gathered(record, Driven(record.id, problem=record.note or "there is no trace"))
    try:
        trace = read_trace(Path(record.trace), scans=True)
    except TraceError as error:
        problem = "; ".join(found.message for found in error.diagnostics)
        return Gathered(record, Driven(record.id, problem=problem))
    invalid = oracles.problems_of(trace)
    sampler = None if invalid else Sampler(trace)
    if record.outcome is None and record.state == "done":
        verdicts = oracles.judge(trace, trace.spec.oracles, sampler=sampler)
        record = replace(
            record,
            outcome=oracles.overall(trace, verdicts),
            verdicts=verdicts,
            ended=trace.ended or "",
            timing=Timing(0.0, 0.0, trace.valid_until),
            note=trace.note,
        )
    if sampler is None:
        return Gathered(record, Driven(record.id, problem="; ".join(invalid)))
    covered = contribution(trace, record.verdicts)
    return Gathered(record, driven(record.id, trace, sampler, buffer, watches, points), covered)
