"""Finding what a report is about: a campaign of a state directory, or a folder of traces."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from daemon.assessment import Declared, RunRecord
from daemon.errors import DaemonError, NotAtHand, Refused
from daemon.ledger import Reader, connect_reader
from daemon.messages import LARGEST_PAGE, RecordQuery
from daemon.places import Places
from daemon.protocol import CampaignRow, Submission
from daemon.report._types import Chosen, Watch
from daemon.spec import RunSpec
from daemon.store import is_url, local_copy
from daemon.trace import TraceError, read_spec
from grammars import codec
from grammars.behaviour import Trigger

NOTE: Final = "campaign.json"
"""What `scenario run` leaves beside its traces."""


@dataclass(frozen=True, slots=True)
class Note:
    """What a campaign says about itself and its results."""

    name: str
    about: str
    declared: Declared


@contextmanager
def open_ledger(places: Places) -> Iterator[Reader]:
    """Open the ledger of a state directory for questions; no daemon is needed for that.

    Raises :class:`daemon.errors.DaemonError` when there is none, or none this version can read.
    """
    if not places.ledger.is_file():
        raise DaemonError(
            f"{places.state} is no state directory: name a folder of traces, or choose another "
            "directory with --state"
        )
    with closing(connect_reader(places.ledger)) as connection:
        try:
            yield Reader(connection, places)
        except sqlite3.DatabaseError as error:
            message = f"{places.ledger} is not a usable ledger: {error}"
            raise DaemonError(message) from error


def recorded(reader: Reader, row: CampaignRow, places: Places) -> Chosen:
    """Return a campaign of a state directory with all its runs, also those without a result."""
    records: list[RunRecord] = []
    while True:
        page = reader.records(RecordQuery(row.id, len(records), LARGEST_PAGE))
        records += page
        if len(page) < LARGEST_PAGE:
            break
    specs = [reader.run(record.id).spec for record in records]
    records = [_at_hand(reader, record) for record in records]
    return assembled(row, str(places.state), reader.declared(row.id), records, specs)


def _at_hand(reader: Reader, record: RunRecord) -> RunRecord:
    """Return a record whose trace is a file of this machine, also when it lies in a store."""
    if record.trace is None or not is_url(record.trace):
        return record
    try:
        return replace(record, trace=str(local_copy(reader.trace(record.id))))
    except NotAtHand as error:
        return replace(record, trace=None, note=f"{record.note} {error}".strip())


def assembled(
    row: CampaignRow,
    where: str,
    declared: Declared,
    records: Sequence[RunRecord],
    specs: Sequence[RunSpec],
) -> Chosen:
    """Return a campaign with its runs in order, whose traces are files of this machine."""
    chosen = Chosen(row.id, row.name, row.about, where, declared, tuple(records))
    return _with_specs(chosen, specs)


def leave_note(folder: Path, submission: Submission) -> None:
    """Write into a folder of traces what their campaign declares, for reports about them."""
    note = Note(submission.name, submission.about, submission.declared)
    (folder / NOTE).write_bytes(codec.to_json(note))


def _note(folder: Path, otherwise: str) -> Note:
    """Read what :func:`leave_note` wrote; raises :class:`daemon.errors.Refused` for nonsense."""
    path = folder / NOTE
    if not path.is_file():
        return Note(otherwise, "", Declared())
    try:
        return codec.from_json(Note, path.read_bytes())
    except ValueError as error:
        raise Refused(f"{path} is not what `scenario run` leaves: delete it ({error})") from error


def folder_of_traces(folder: Path) -> Chosen:
    """Return the traces below ``folder`` as runs nobody has judged yet, in the order of names.

    Raises :class:`daemon.errors.Refused` when there are none, or none that can be read.
    """
    traces = sorted(folder.rglob("*.mcap"))
    records: list[RunRecord] = []
    specs: list[RunSpec] = []
    unread: list[tuple[str, str]] = []
    for trace in traces:
        try:
            spec = read_spec(trace)
        except TraceError as error:
            unread.append((str(trace), "; ".join(d.message for d in error.diagnostics)))
            continue
        specs.append(spec)
        records.append(
            RunRecord(
                id=trace.relative_to(folder).as_posix(),
                scenario=spec.scenario,
                sut=spec.sut.name,
                repeat=spec.repeat,
                digest=spec.digest,
                outcome=None,
                trace=str(trace),
                seed=spec.seed,
            )
        )
    if not records:
        why = f": {unread[0][0]}: {unread[0][1]}" if unread else " (.mcap files)"
        raise Refused(f"{folder} holds no traces that can be read{why}")
    note = _note(folder, ", ".join(dict.fromkeys(spec.campaign for spec in specs)))
    chosen = Chosen(
        "", note.name, note.about, str(folder), note.declared, tuple(records), unread=tuple(unread)
    )
    return _with_specs(chosen, specs)


def _with_specs(chosen: Chosen, specs: Sequence[RunSpec]) -> Chosen:
    """Return ``chosen`` with the oracles and triggers of all its runs, each once."""
    oracles = dict.fromkeys(oracle.text for spec in specs for oracle in spec.oracles)
    watches: dict[tuple[str, float], Watch] = {}
    for spec in specs:
        for behaviour in spec.behaviours:
            if isinstance(behaviour, Trigger):
                watches.setdefault((behaviour.joint, behaviour.distance), Watch(behaviour))
    return replace(chosen, oracles=tuple(oracles), watches=tuple(watches.values()))
