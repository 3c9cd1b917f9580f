"""Results of a campaign, from a daemon, its ledger, a folder or a file.

Commands that never draw load this module, so it must not import numpy or the oracles.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError, Refused
from daemon.batch.paths import StatePaths
from daemon.judging.assessment import (
    CampaignDifference,
    Expectations,
    JudgedCampaign,
    assess,
    find_marks,
)
from daemon.model.assessments import (
    Assessment,
    AssessmentRules,
    CellAssessment,
    CellVerdict,
    ExpectationStatus,
)
from daemon.model.spec import UnixTime
from daemon.model.status import CampaignRow, RunRow, count_runs
from daemon.model.submission import CampaignOrigin, Submission
from daemon.model.verbs import CampaignSource
from daemon.model.verdicts import RunState
from grammars.text import codec

NOTE: Final = "campaign.json"
"""The file that `scenario run` leaves beside its traces."""


@dataclass(frozen=True)
class CampaignResults:
    """Everything known about a campaign; ``rows`` are its runs with their results, in order.

    ``where`` is the folder, the state directory or the endpoint of the daemon that has them.
    ``unread`` are unusable traces, with the reason. ``machine`` executed the runs that have no
    result yet.
    """

    row: CampaignRow
    rows: tuple[RunRow, ...]
    declared: AssessmentRules
    assessment: Assessment
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)
    where: str = ""
    unread: tuple[tuple[str, str], ...] = ()
    machine: str = ""

    @cached_property
    def expectations(self) -> Expectations:
        """The marks of news and known failures."""
        return find_marks(self.declared, self.assessment, self.rows)

    @property
    def judged(self) -> JudgedCampaign:
        """The campaign for comparisons."""
        return JudgedCampaign(self.row.id, self.declared, self.rows)

    @property
    def not_repeatable(self) -> tuple[str, ...]:
        """Systems under test whose runs are not repeatable."""
        return tuple(dict.fromkeys(row.sut for row in self.rows if not row.repeatable))

    def runs_of(self, cell: CellAssessment) -> tuple[RunRow, ...]:
        """Return the runs of a cell."""
        return tuple(self._by_id[run] for run in cell.runs)

    @cached_property
    def _by_id(self) -> dict[str, RunRow]:
        return {row.id: row for row in self.rows}

    @property
    def undecided(self) -> tuple[CellVerdict, ...]:
        """Open oracles of cells that have all their runs."""
        return tuple(
            oracle
            for cell in self.assessment.cells
            for oracle in cell.oracles
            if oracle.status is ExpectationStatus.OPEN and not oracle.missing
        )

    @property
    def lost_runs(self) -> tuple[RunRow, ...]:
        """Runs that were given up or broke before a judgement."""
        return tuple(row for row in self.rows if row.state is RunState.LOST)

    @property
    def nondeterministic_runs(self) -> tuple[RunRow, ...]:
        """Runs with a different result than an earlier execution of the same run."""
        return tuple(row for row in self.rows if row.nondeterministic)


@dataclass(frozen=True, slots=True)
class ComparedResults:
    """Everything about a campaign, compared with its baseline, if any; ``runs`` may be a subset."""

    campaign: CampaignRow
    declared: AssessmentRules
    assessment: Assessment
    runs: tuple[RunRow, ...]
    origin: CampaignOrigin
    comparison: CampaignDifference | None = None

    @classmethod
    def of(
        cls, results: CampaignResults, comparison: CampaignDifference | None = None
    ) -> ComparedResults:
        """Return results with their comparison, if any."""
        declared, assessment = results.declared, results.assessment
        return cls(results.row, declared, assessment, results.rows, results.origin, comparison)

    @property
    def exit_code(self) -> int:
        """Exit code of the assessment; 1, that of a finding, if the results got worse."""
        # A regression is a finding even if everything is still as expected.
        is_worse = self.comparison is not None and self.comparison.regressed
        return 1 if is_worse else self.assessment.exit_code


def read_results(source: CampaignSource, row: CampaignRow) -> CampaignResults:
    """Read everything about a campaign and assess it."""
    rows, declared = source.all_runs(row.id, results=True), source.declared(row.id)
    counts = count_runs((run.state, str(run.outcome or ""), 1) for run in rows)
    return CampaignResults(
        # Count again: runs may have been judged or have ended since.
        replace(row, total=len(rows), **counts),
        rows,
        declared,
        assess(declared, rows),
        source.origin(row.id),
        source.where,
        source.unread,
        source.machine,
    )


def traces_below(folder: Path) -> list[Path]:
    """Return the traces below a folder; those in hidden folders only if there are no others."""
    # An unfinished `scenario run` has its traces in a hidden folder; together with those of an
    # earlier one they would count twice.
    traces = sorted(folder.rglob("*.mcap"))
    visible = [one for one in traces if "/." not in f"/{one.relative_to(folder).as_posix()}"]
    return visible or traces


@dataclass(frozen=True, slots=True)
class CampaignNote:
    """A campaign beside its traces: its name, its declarations, its origin.

    Also the time and the ``machine`` of its execution. ``declared`` is ``None`` if unknown.
    """

    name: str
    about: str
    declared: AssessmentRules | None
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)
    submitted_at: UnixTime | None = None
    machine: str = ""


def write_campaign_note(
    folder: Path, submission: Submission, *, at: float | None = None, machine: str = ""
) -> None:
    """Write the declarations of a campaign into its folder of traces, for reports.

    ``at`` is the time of execution [s since the epoch], ``machine`` executes the runs.
    """
    note = CampaignNote(
        submission.name, submission.about, submission.declared, submission.origin, at, machine
    )
    (folder / NOTE).write_bytes(codec.to_json(note))


def read_campaign_note(folder: Path, otherwise: str = "") -> CampaignNote:
    """Read the note of :func:`write_campaign_note`, or make one from the ledger of the traces.

    Without either the note has only a name. Raises :class:`daemon.batch.errors.Refused` for an
    unreadable note.
    """
    path = folder / NOTE
    if not path.is_file():
        return _note_of_ledger(folder.resolve()) or CampaignNote(otherwise, "", None)
    try:
        return codec.from_json(CampaignNote, path.read_bytes())
    except ValueError as error:
        raise Refused(
            f"{path} is not a note of `scenario run`: delete it ({codec.reading_error(error)})"
        ) from error


def _note_of_ledger(folder: Path) -> CampaignNote | None:
    """Return the note of a campaign whose traces lie in a state directory, ``None`` elsewhere."""
    from daemon.batch.ledger import LedgerReader

    paths = StatePaths(folder.parent.parent)
    if folder.parent != paths.traces or not paths.ledger.is_file():
        return None
    # A ledger of another version is unreadable, but the traces are not.
    with suppress(DaemonError), LedgerReader.open(paths) as ledger:
        row = ledger.campaign(folder.name)
        if row is not None:
            declared = None if row.search else ledger.declared(row.id)
            origin = ledger.origin(row.id)
            return CampaignNote(row.name, row.about, declared, origin, row.submitted_at)
    return None
