"""Results of a campaign: its runs and what they were asked, from a ledger, a daemon or a folder.

Commands load this that never draw: nothing here may import numpy or the oracles.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from daemon.batch.errors import Refused, TraceUnavailable
from daemon.batch.stores import ByteProgress, trace_file
from daemon.model.assessments import AssessmentRules
from daemon.model.run_state import RunState
from daemon.model.spec import RunSpec, UnixTime
from daemon.model.status import CampaignRow, RunRow
from daemon.model.submission import CampaignOrigin, Submission
from daemon.model.verbs import CampaignSource, DaemonClient
from daemon.trace import TraceError, read_spec
from grammars.model.behaviour import Trigger
from grammars.model.geometry import Ring
from grammars.text import codec

NOTE: Final = "campaign.json"
"""The file that `scenario run` leaves beside its traces."""


@dataclass(frozen=True, slots=True)
class Results:
    """The runs of a campaign, ``records``, in order, and the specification of each, ``specs``.

    ``id`` is empty for a folder of traces; ``where`` is the folder, the state directory or the
    endpoint of the daemon. ``unread`` are files that are no usable traces, with the reason.
    ``submitted_at`` and ``finished_at`` are seconds since the epoch, ``None`` where unknown.
    ``machine`` executed the runs that have no result yet.
    """

    id: str
    name: str
    about: str
    where: str
    declared: AssessmentRules
    records: tuple[RunRow, ...]
    specs: tuple[RunSpec, ...]
    unread: tuple[tuple[str, str], ...] = ()
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)
    submitted_at: UnixTime | None = None
    finished_at: UnixTime | None = None
    machine: str = ""

    @property
    def oracles(self) -> tuple[str, ...]:
        """The texts of all oracles, each once."""
        return tuple(dict.fromkeys(oracle.text for spec in self.specs for oracle in spec.oracles))

    @property
    def footprints(self) -> tuple[Ring, ...]:
        """The footprints of all robots, each once."""
        return tuple(dict.fromkeys(spec.robot.footprint for spec in self.specs))

    @property
    def watches(self) -> tuple[Trigger, ...]:
        """The triggers of all scenarios: of each joint the first one at each distance."""
        triggers: dict[tuple[str, float], Trigger] = {}
        for spec in self.specs:
            for behaviour in spec.behaviours:
                if isinstance(behaviour, Trigger):
                    triggers.setdefault((behaviour.joint, behaviour.distance), behaviour)
        return tuple(triggers.values())


def campaign_results(source: CampaignSource, row: CampaignRow, where: str) -> Results:
    """Return a campaign with all its runs, also those without a result; traces stay there."""
    records = source.all_runs(row.id, results=True)
    return Results(
        row.id,
        row.name,
        row.about,
        where,
        source.declared(row.id),
        records,
        # A record holds verdicts, not what was specified: oracles and triggers are in the latter.
        tuple(source.run(record.id).spec for record in records),
        origin=source.origin(row.id),
        submitted_at=row.submitted_at,
        finished_at=row.finished_at,
    )


def bring_traces(
    results: Results,
    source: DaemonClient | None = None,
    *,
    progress: ByteProgress = lambda _: None,
) -> Results:
    """Return results whose traces are files of this machine, by :func:`trace_file`.

    A trace that cannot be had is left out, with the reason in its record.
    """

    def local(record: RunRow) -> RunRow:
        if not record.trace:
            return record
        try:
            return replace(record, trace=str(trace_file(record, source, progress=progress)))
        except TraceUnavailable as error:
            return replace(record, trace="", reason=f"{record.reason} {error}".strip())

    return replace(results, records=tuple(map(local, results.records)))


def folder_results(folder: Path) -> Results:
    """Return the traces below ``folder`` as runs nobody has judged yet, in the order of names.

    Raises :class:`daemon.batch.errors.Refused` when there are none, or none that can be read.
    """
    records: list[RunRow] = []
    specs: list[RunSpec] = []
    unread: list[tuple[str, str]] = []
    for trace in sorted(folder.rglob("*.mcap")):
        try:
            spec = read_spec(trace)
        except TraceError as error:
            # Said on the page: a report that silently leaves a run out lies.
            unread.append((str(trace), error.findings[0].message))
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
    return Results(
        "",
        note.name,
        note.about,
        str(folder),
        note.declared,
        tuple(records),
        tuple(specs),
        tuple(unread),
        origin=note.origin,
        submitted_at=note.submitted_at,
        machine=note.machine,
    )


@dataclass(frozen=True, slots=True)
class CampaignNote:
    """A campaign beside its traces: its name, what it declares, where it was written.

    Also when and on what ``machine`` it was executed.
    """

    name: str
    about: str
    declared: AssessmentRules
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)
    submitted_at: UnixTime | None = None
    machine: str = ""


def write_campaign_note(
    folder: Path, submission: Submission, *, at: float | None = None, machine: str = ""
) -> None:
    """Write into a folder of traces what their campaign declares, for reports about them.

    ``at`` is when its runs are executed [s since the epoch], ``machine`` what executes them.
    """
    note = CampaignNote(
        submission.name, submission.about, submission.declared, submission.origin, at, machine
    )
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
