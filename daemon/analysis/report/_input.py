"""What a report is about: a campaign of a state directory, or a folder of traces.

Loaded by commands that never draw: nothing here may import numpy, matplotlib or the oracles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from daemon.batch.errors import PlaceUnusable, Refused, TraceUnavailable
from daemon.batch.ledger import LedgerReader
from daemon.batch.paths import StatePaths
from daemon.batch.stores import TraceReference, is_url, local_copy, trace_reference
from daemon.model.assessments import AssessmentRules
from daemon.model.run_state import RunState
from daemon.model.spec import RunSpec, UnixTime
from daemon.model.status import CampaignRow, RunRow
from daemon.model.submission import CampaignOrigin, Submission
from daemon.trace import TraceError, read_spec
from grammars.model.behaviour import Trigger
from grammars.model.geometry import Ring
from grammars.text import codec


@dataclass(frozen=True, slots=True)
class ReportInput:
    """A campaign chosen for a report.

    ``id`` is empty for a folder of traces, ``where`` says which folder or state directory.
    ``oracles`` are the texts of all oracles, ``watches`` the triggers of all scenarios and
    ``footprints`` those of all robots, each once. ``unread`` are files that are no usable traces,
    with the reason. ``submitted_at`` and ``finished_at`` are seconds since the epoch, ``None``
    where nobody noted them. ``machine`` executed the runs that have no result yet.
    """

    id: str
    name: str
    about: str
    where: str
    declared: AssessmentRules
    records: tuple[RunRow, ...]
    oracles: tuple[str, ...] = ()
    watches: tuple[Trigger, ...] = ()
    unread: tuple[tuple[str, str], ...] = ()
    footprints: tuple[Ring, ...] = ()
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)
    submitted_at: float | None = None
    finished_at: float | None = None
    machine: str = ""


NOTE: Final = "campaign.json"
"""What `scenario run` leaves beside its traces."""


@dataclass(frozen=True, slots=True)
class CampaignNote:
    """What a campaign says about itself and its results, where it was written, and when and on
    what ``machine`` it was executed.
    """

    name: str
    about: str
    declared: AssessmentRules
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)
    submitted_at: UnixTime | None = None
    machine: str = ""


@contextmanager
def open_ledger(paths: StatePaths) -> Iterator[LedgerReader]:
    """Open the ledger of a state directory for questions; no daemon is needed for that.

    Raises :class:`daemon.batch.errors.DaemonError` when there is none, or none this version reads.
    """
    if not paths.ledger.is_file():
        raise PlaceUnusable(
            f"{paths.state} is no state directory: name a folder of traces, or choose another "
            "directory with --state"
        )
    with LedgerReader.open(paths) as reader:
        yield reader


def ledger_input(reader: LedgerReader, row: CampaignRow, paths: StatePaths) -> ReportInput:
    """Return a campaign of a state directory with all its runs, also those without a result."""
    records: Sequence[RunRow] = reader.all_runs(row.id, results=True)
    # A record holds verdicts, not what was specified: oracles and triggers are in the latter.
    specs = [reader.run(record.id).spec for record in records]
    records = [
        local_record(record, local_copy) if is_url(record.trace) else record for record in records
    ]
    said = (reader.declared(row.id), reader.origin(row.id))
    return campaign_input(row, str(paths.state), said, records, specs)


def local_record(record: RunRow, copy: Callable[[TraceReference], Path]) -> RunRow:
    """Return a record whose trace is a file of this machine, as ``copy`` makes one.

    One that cannot be had is left out, with the reason.
    """
    try:
        return replace(record, trace=str(copy(trace_reference(record))))
    except TraceUnavailable as error:
        return replace(record, trace="", reason=f"{record.reason} {error}".strip())


def campaign_input(
    row: CampaignRow,
    where: str,
    said: tuple[AssessmentRules, CampaignOrigin],
    records: Sequence[RunRow],
    specs: Sequence[RunSpec],
) -> ReportInput:
    """Return a campaign with its runs in order, whose traces are files of this machine.

    ``said`` is what it declares about its results and where it was written.
    """
    declared, origin = said
    chosen = ReportInput(
        row.id,
        row.name,
        row.about,
        where,
        declared,
        tuple(records),
        origin=origin,
        submitted_at=row.submitted_at,
        finished_at=row.finished_at,
    )
    return _add_specs(chosen, specs)


def write_campaign_note(
    folder: Path, submission: Submission, *, at: float | None = None, machine: str = ""
) -> None:
    """Write into a folder of traces what their campaign declares, for reports about them.

    ``at`` is when its runs are executed [s since the epoch], ``machine`` what executes them.
    """
    said = (submission.name, submission.about, submission.declared, submission.origin)
    note = CampaignNote(*said, at, machine)
    (folder / NOTE).write_bytes(codec.to_json(note))


def read_campaign_note(folder: Path, otherwise: str = "") -> CampaignNote:
    """Read what :func:`write_campaign_note` wrote; without it, a note with a name alone.

    Raises :class:`daemon.batch.errors.Refused` for nonsense.
    """
    path = folder / NOTE
    if not path.is_file():
        return CampaignNote(otherwise, "", AssessmentRules())
    try:
        return codec.from_json(CampaignNote, path.read_bytes())
    except ValueError as error:
        raise Refused(
            f"{path} is not what `scenario run` leaves: delete it ({codec.reading_error(error)})"
        ) from error


def folder_input(folder: Path) -> ReportInput:
    """Return the traces below ``folder`` as runs nobody has judged yet, in the order of names.

    Raises :class:`daemon.batch.errors.Refused` when there are none, or none that can be read.
    """
    traces = sorted(folder.rglob("*.mcap"))
    records: list[RunRow] = []
    specs: list[RunSpec] = []
    unread: list[tuple[str, str]] = []
    for trace in traces:
        try:
            spec = read_spec(trace)
        except TraceError as error:
            # Said on the page: a report that silently leaves a run out lies.
            unread.append((str(trace), error.diagnostics[0].message))
            continue
        specs.append(spec)
        records.append(
            RunRow(
                id=trace.relative_to(folder).as_posix(),
                campaign="",
                index=len(records),
                scenario=spec.scenario,
                sut=spec.sut.name,
                repeat=spec.repeat,
                state=RunState.DONE,
                trace=str(trace),
                repeatable=spec.sut.repeatable,
                digest=spec.digest,
                seed=spec.seed,
            )
        )
    if not records:
        why = f": {unread[0][0]}: {unread[0][1]}" if unread else " (.mcap files)"
        raise Refused(f"{folder} holds no traces that can be read{why}")
    note = read_campaign_note(folder, ", ".join(dict.fromkeys(spec.campaign for spec in specs)))
    chosen = ReportInput(
        "",
        note.name,
        note.about,
        str(folder),
        note.declared,
        tuple(records),
        unread=tuple(unread),
        origin=note.origin,
        submitted_at=note.submitted_at,
        machine=note.machine,
    )
    return _add_specs(chosen, specs)


def _add_specs(chosen: ReportInput, specs: Sequence[RunSpec]) -> ReportInput:
    """Return ``chosen`` with the oracles, triggers and robots of all its runs, each once."""
    footprints = dict.fromkeys(spec.robot.footprint for spec in specs)
    oracles = dict.fromkeys(oracle.text for spec in specs for oracle in spec.oracles)
    watches: dict[tuple[str, float], Trigger] = {}
    for spec in specs:
        for behaviour in spec.behaviours:
            if isinstance(behaviour, Trigger):
                watches.setdefault((behaviour.joint, behaviour.distance), behaviour)
    return replace(
        chosen,
        oracles=tuple(oracles),
        watches=tuple(watches.values()),
        footprints=tuple(footprints),
    )
