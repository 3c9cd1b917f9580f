"""A campaign outside any daemon: a folder of traces, one trace, or a file of results.

It answers the same questions as a daemon. The campaign's id is the path that people typed, a run's
id is the path of its trace. Both can be typed again.
"""

from __future__ import annotations

import filecmp
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias, TypeVar, cast

from daemon.analysis.results import CampaignNote, read_campaign_note, traces_below
from daemon.batch.errors import Refused
from daemon.judging.assessment import Expectations, assess, find_marks
from daemon.model import verbs
from daemon.model.assessments import AssessmentRules
from daemon.model.messages import CampaignQuery, IdRequest, RunQuery
from daemon.model.spec import RunEnding, RunResult, RunSpec, Timing, TraceInfo
from daemon.model.status import CampaignRow, RunDetail, RunPage, RunRow, count_runs
from daemon.model.submission import CampaignOrigin
from daemon.model.verdicts import Outcome, RunState, deciding_verdict
from grammars.text import codec
from grammars.text.diagnostics import Finding, InputError, Where

if TYPE_CHECKING:
    from daemon.judging.oracles import SignalSampler
    from daemon.trace import Trace

A = TypeVar("A")

RESULTS_SCHEMA: Final = "scenario/results/1"
"""The field ``schema`` of a file of results, which `scenario results --json` writes."""
Progress: TypeAlias = Callable[
    [str, int, Literal["traces", "bytes"]], AbstractContextManager[Callable[[int], None]]
]
"""Shows the progress of a task with a total amount of a unit; the function that it yields is called
with each further amount."""


@dataclass(slots=True)
class RecordedCampaign(verbs.CampaignSource):
    """One campaign in memory; ``specs`` are those of its runs, by id; ``copies`` do not count.

    With ``progress``, requested runs without a result are judged from their traces.
    """

    row: CampaignRow
    rows: tuple[RunRow, ...]
    note: CampaignNote
    where: str
    specs: Mapping[str, RunSpec] = field(default_factory=dict)
    unread: tuple[tuple[str, str], ...] = ()
    machine: str = ""
    progress: Progress | None = None
    copies: int = 0

    def ask(self, verb: verbs.Verb[..., A], request: object) -> A:
        """Answer a question to a :class:`CampaignSource`."""
        answers: dict[verbs.AnyVerb, Callable[[Any], Any]] = {
            verbs.CAMPAIGNS: self._campaigns,
            verbs.RUNS: self._runs,
            verbs.RUN: self._run,
            verbs.DECLARED: lambda _: self.note.declared or AssessmentRules(),
            verbs.ORIGIN: lambda _: self.note.origin,
            verbs.SEARCHES: lambda _: (),
        }
        answer: A = answers[verb](request)
        return answer

    def _campaigns(self, query: CampaignQuery) -> tuple[CampaignRow, ...]:
        row = self.row
        is_meant = query.id in ("", row.id) and query.name in ("", row.name)
        is_meant &= row.id.startswith(query.beginning) and not query.unfinished
        return (row,)[query.offset : query.limit] if is_meant else ()

    def _runs(self, query: RunQuery) -> RunPage:
        self._judge(self.rows)
        rows = [
            row
            for row in self.rows
            if query.scenario in ("", row.scenario)
            and query.sut in ("", row.sut)
            and query.state in ("", row.state)
            and query.outcome in ("", row.outcome)
            and query.text.lower() in " ".join((row.label, row.oracle, row.reason, row.id)).lower()
        ]
        rows.sort(key=partial(_sort_key, query.sort), reverse=query.descending)
        page = rows[query.offset : query.offset + query.limit]
        return RunPage(tuple(page), len(rows))

    def _run(self, request: IdRequest) -> RunDetail:
        row = next((one for one in self.rows if one.id == request.id), None)
        if row is None:
            raise Refused(f"there is no run {request.id} in {self.row.id}")
        if row.id not in self.specs:
            raise Refused(
                f"{self.row.id} holds results alone, and no specification of {row.id}: "
                "name the campaign or a folder of its traces"
            )
        self._judge((row,))
        (row,) = (one for one in self.rows if one.id == request.id)
        return RunDetail(row, self.specs[row.id])

    def _judge(self, rows: Sequence[RunRow]) -> None:
        """Judge runs without a result by the oracles in their traces."""
        waiting = [row for row in rows if row.outcome is None and row.trace]
        if self.progress is None or not waiting:
            return
        from daemon.analysis.parallel_map import parallel_map
        from daemon.judging import oracles

        oracles.warm_up()
        task = partial(_judged_file, machine=self.machine)
        judged: dict[str, RunRow] = {}
        with self.progress("judging traces", len(waiting), "traces") as advance:
            for row in parallel_map(task, waiting, doing="that judges traces"):
                judged[row.id] = row
                advance(1)
        self.rows = tuple(judged.get(row.id, row) for row in self.rows)


def _sort_key(name: str, row: RunRow) -> tuple[bool, Any]:
    value = getattr(row, name)
    return value is None, "" if value is None else value


def _judged_file(row: RunRow, machine: str) -> RunRow:
    """Return a run with the verdicts of its trace; an error for an unreadable one."""
    from daemon.trace import TraceError, read_trace

    try:
        trace = read_trace(Path(row.trace))
    except TraceError as error:
        return replace(row, outcome=Outcome.ERROR, reason=error.findings[0].message)
    return judge_row(row, trace, machine)


def judge_row(
    row: RunRow, trace: Trace, machine: str, sampler: SignalSampler | None = None
) -> RunRow:
    """Return a run judged by the oracles in its ``trace``; ``machine`` executed it.

    A ``sampler`` of that trace spares computing the signals again.
    """
    from daemon.judging import oracles

    verdicts = oracles.judge(trace, trace.spec.oracles, sampler=sampler)
    ended = cast(RunEnding, trace.ended or "")  # a recording that was cut off has no end
    timing = Timing(0.0, 0.0, trace.valid_until)
    outcome = oracles.overall_outcome(trace, verdicts)
    info = TraceInfo("", Path(row.trace).stat().st_size, 0)
    result = RunResult(
        row.digest, outcome, verdicts, ended, info, timing, trace.note, machine=machine
    )
    decisive = deciding_verdict(verdicts)
    row = replace(row, outcome=outcome, result=result, simulated=timing.simulated)
    if decisive is None:
        return row
    return replace(row, oracle=decisive.oracle, margin=decisive.margin, unit=decisive.unit)


def read_traces(name: str, *, progress: Progress | None = None) -> RecordedCampaign:
    """Return the traces below the folder ``name``, in the order of names, or the trace of a file.

    With a ``progress`` they are judged on demand. Raises :class:`daemon.batch.errors.Refused` if no
    trace is readable.
    """
    from daemon.trace import TraceError, read_spec

    path = Path(name)
    folder = path if path.is_dir() else path.parent
    rows: list[RunRow] = []
    specs: dict[str, RunSpec] = {}
    unread: list[tuple[str, str]] = []
    first: dict[tuple[str, int], Path] = {}
    copies = 0
    for trace in traces_below(path) if path.is_dir() else (path,):
        try:
            spec = read_spec(trace)
        except TraceError as error:
            # Reported with the results: no run is left out silently.
            unread.append((str(trace), error.findings[0].message))
            continue
        twin = first.setdefault((spec.digest, trace.stat().st_size), trace)
        if twin != trace and filecmp.cmp(twin, trace, shallow=False):
            copies += 1
            continue
        # The id of a single trace is its path as typed.
        run = str(trace) if path.is_dir() else name
        specs[run] = spec
        rows.append(
            RunRow(
                id=run,
                campaign=name,
                index=len(rows),
                scenario=spec.scenario,
                sut=spec.sut.name,
                repeat=spec.repeat,
                state=RunState.DONE,
                limit=spec.limit,
                trace=str(trace),
                repeatable=spec.sut.repeatable,
                digest=spec.digest,
                seed=spec.seed,
            )
        )
    if not rows:
        why = f": {unread[0][0]}: {unread[0][1]}" if unread else " (.mcap files)"
        raise Refused(f"{name} has no readable traces{why}")
    campaigns = dict.fromkeys(spec.campaign for spec in specs.values())
    note = read_campaign_note(folder, ", ".join(campaigns))
    row = CampaignRow(
        **count_runs([(RunState.DONE, "", len(rows))]),
        id=name,
        name=note.name,
        about=note.about,
        submitted_at=note.submitted_at or 0.0,  # unknown
        finished_at=None,
        total=len(rows),
    )
    return RecordedCampaign(
        row, tuple(rows), note, str(folder), specs, tuple(unread), note.machine, progress, copies
    )


def read_results_file(name: str) -> RecordedCampaign:
    """Return the campaign in a file of `scenario results --json`.

    Raises :class:`grammars.text.diagnostics.InputError` for any other file.
    """
    where = Where(name)
    try:
        body = json.loads(Path(name).read_text(encoding="utf-8"))
        if body["schema"] != RESULTS_SCHEMA:
            raise ValueError(f"it holds {body['schema']}")
        declared = codec.from_plain(AssessmentRules, body["declared"])
        rows = codec.from_plain(tuple[RunRow, ...], body["runs"])
        row = codec.from_plain(CampaignRow, body["campaign"])
        # Files of earlier versions do not have an origin.
        origin = codec.from_plain(CampaignOrigin, body.get("origin") or {})
    except OSError as error:
        message = f"cannot be read: {error.strerror}"
        raise InputError(Finding(where, message)) from None
    except (ValueError, KeyError, TypeError):
        hint = "write one with: scenario results CAMPAIGN --json"
        raise InputError(Finding(where, "is not a file of results", hint)) from None
    note = CampaignNote(row.name, row.about, declared, origin, row.submitted_at)
    return RecordedCampaign(replace(row, id=name), rows, note, name)


def read_marks(source: verbs.CampaignSource, row: RunRow) -> Expectations | None:
    """Return the marks of a run among the repeats of its cell.

    ``None`` if the expectations of its campaign are unknown, as for a run of a search.
    """
    note = source.note if isinstance(source, RecordedCampaign) else None
    if (note and note.declared is None) or source.search_row(row.campaign) is not None:
        return None
    declared = source.declared(row.campaign)
    if note is None:
        rows = source.all_runs(row.campaign, scenario=row.scenario, sut=row.sut, results=True)
    else:
        # The other repeats of a trace are unknown, and may be the expected ones.
        rows = (row, replace(row, id="", state=RunState.QUEUED, outcome=None, result=None))
    return find_marks(declared, assess(declared, rows), (row,))
