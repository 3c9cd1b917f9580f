"""New judgement of recorded runs, by other oracles or the same ones.

A trace is read and never written. Its verdicts are compared with those in the ledger if it belongs
to a state directory, otherwise with those of its own oracles.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

from pydantic import computed_field

from daemon.analysis.parallel_map import parallel_map
from daemon.batch.errors import DaemonError
from daemon.batch.ledger import LedgerReader
from daemon.batch.paths import StatePaths
from daemon.judging import oracles
from daemon.model.spec import OracleText, RunResult
from daemon.model.verdicts import Outcome, Verdict
from daemon.trace import TraceError, read_trace

VerdictOrigin = Literal["ledger", "trace"]


@dataclass(frozen=True, slots=True)
class RejudgedTrace:
    """A trace judged again: ``before`` are its earlier verdicts, from ``origin``.

    ``problem`` says why it could not be judged; everything else is empty then.
    """

    trace: str
    run: str = ""
    digest: str = ""
    outcome: Outcome = Outcome.ERROR
    verdicts: tuple[Verdict, ...] = ()
    outcome_before: Outcome | None = None
    before: tuple[Verdict, ...] = ()
    origin: VerdictOrigin = "trace"
    problem: str = ""

    @computed_field  # type: ignore[prop-decorator]
    @property
    def changes(self) -> tuple[OracleChange, ...]:
        """Oracles with another verdict now, in their order; new and dropped ones at the end."""
        now, then = ({v.oracle: v for v in side} for side in (self.verdicts, self.before))
        names = (*now, *(name for name in then if name not in now))
        pairs = (OracleChange(name, then.get(name), now.get(name)) for name in names)
        return tuple(sorted((c for c in pairs if c.kind != "same"), key=lambda c: c.rank))


@dataclass(frozen=True, slots=True)
class OracleChange:
    """One oracle's verdict before and now; ``None`` if it was, or is, not judged."""

    oracle: str
    before: Verdict | None
    now: Verdict | None

    @computed_field  # type: ignore[prop-decorator]
    @property
    def kind(self) -> Literal["same", "verdict", "margin", "new", "dropped"]:
        """Kind of the change: of the verdict, only its margin or value, or of the oracles."""
        if self.before is None:
            return "new"
        if self.now is None:
            return "dropped"
        if self.before.outcome is not self.now.outcome:
            return "verdict"
        here, there = (
            (v.lower, v.upper, v.unit, v.evidence.value) for v in (self.before, self.now)
        )
        return "same" if here == there else "margin"

    @property
    def rank(self) -> int:
        """Order for people: changed verdicts first."""
        return ("verdict", "margin", "new", "dropped", "same").index(self.kind)


@dataclass(frozen=True, slots=True)
class Rejudgement:
    """Traces judged by a layer of ``oracles``, otherwise by their own."""

    oracles: str
    traces: tuple[RejudgedTrace, ...]


def rejudge(
    traces: Sequence[Path],
    layer: Sequence[OracleText] | None,
    *,
    places: StatePaths,
    processes: int | None = None,
) -> Iterator[RejudgedTrace]:
    """Judge ``traces`` by the oracles of a ``layer`` (``None``: those in each trace), in order.

    The work is spread over ``processes`` (default: one per core). An unreadable trace gives a
    :class:`RejudgedTrace` with its ``problem``. Raises :class:`DaemonError` if a judging process
    dies.
    """
    oracles.warm_up()
    task = partial(_judge_file, None if layer is None else tuple(layer))
    judged_files = parallel_map(task, traces, doing="that judges", processes=processes)
    for path, judged in zip(traces, judged_files, strict=True):
        yield _compare_with_ledger(places, path, judged)


def _judge_file(layer: tuple[OracleText, ...] | None, path: Path) -> RejudgedTrace:
    """Judge one file by a layer and by its own oracles; the signals are computed once."""
    try:
        trace = read_trace(path)
    except TraceError as error:
        return RejudgedTrace(str(path), problem=error.findings[0].message)
    own = trace.spec.oracles
    # Judge by its own oracles too: a trace of another machine is in no ledger here.
    judged = oracles.judge(trace, (*(layer or ()), *own))
    before = judged[len(layer or ()) :]
    verdicts = before if layer is None else judged[: len(layer)]
    return RejudgedTrace(
        trace=str(path),
        run=trace.spec.label,
        digest=trace.spec.digest,
        outcome=oracles.overall_outcome(trace, verdicts),
        verdicts=verdicts,
        outcome_before=oracles.overall_outcome(trace, before),
        before=before,
    )


def _compare_with_ledger(places: StatePaths, path: Path, judged: RejudgedTrace) -> RejudgedTrace:
    """Return ``judged`` with the verdicts the ledger has of the run, if it has any."""
    result = _recorded_result(places, path) if not judged.problem else None
    if result is None or result.spec != judged.digest:
        return judged
    return replace(judged, before=result.verdicts, outcome_before=result.outcome, origin="ledger")


def _recorded_result(places: StatePaths, path: Path) -> RunResult | None:
    trace, folder = path.resolve(), places.traces.resolve()
    if not places.ledger.is_file() or not trace.is_relative_to(folder):
        return None
    try:
        # Open it for each trace: SQLite connections do not survive the fork of judging processes.
        with LedgerReader.open(places) as ledger:
            return ledger.result_of_trace(trace.relative_to(folder).as_posix())
    except (DaemonError, ValueError):
        # A ledger of another version is unreadable; the trace itself still has its oracles.
        return None
