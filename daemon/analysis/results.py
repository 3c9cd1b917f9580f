"""Results of a campaign, from whatever recorded it: a daemon, its ledger, a folder, a file.

Commands load this that never draw: nothing here may import numpy or the oracles.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
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
from daemon.model.run_state import RunState
from daemon.model.spec import UnixTime
from daemon.model.status import CampaignRow, RunRow, count_runs
from daemon.model.submission import CampaignOrigin, Submission
from daemon.model.verbs import CampaignSource
from grammars.text import codec

NOTE: Final = "campaign.json"
"""The file that `scenario run` leaves beside its traces."""


@dataclass(frozen=True, slots=True)
class CampaignResults:
    """Everything known about a campaign; ``rows`` are its runs with their results, in order.

    ``where`` is the folder, the state directory or the endpoint of the daemon that has them.
    ``unread`` are files that are no usable traces, with the reason. ``machine`` executed the runs
    that have no result yet. ``expectations`` mark news and known failures.
    """

    row: CampaignRow
    rows: tuple[RunRow, ...]
    declared: AssessmentRules
    assessment: Assessment
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)
    where: str = ""
    unread: tuple[tuple[str, str], ...] = ()
    machine: str = ""
    expectations: Expectations = field(init=False, repr=False, compare=False)
    _by_id: Mapping[str, RunRow] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_by_id", {row.id: row for row in self.rows})
        marks = find_marks(self.declared, self.assessment, self.rows)
        object.__setattr__(self, "expectations", marks)

    @property
    def judged(self) -> JudgedCampaign:
        """The campaign as others are compared with it."""
        return JudgedCampaign(self.row.id, self.declared, self.rows)

    @property
    def not_repeatable(self) -> tuple[str, ...]:
        """Systems under test of which the same run gives something else each time."""
        return tuple(dict.fromkeys(row.sut for row in self.rows if not row.repeatable))

    def runs_of(self, cell: CellAssessment) -> tuple[RunRow, ...]:
        """Return the runs of a cell."""
        return tuple(self._by_id[run] for run in cell.runs)

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
        """Runs that were given up or broke before anything could be judged."""
        return tuple(row for row in self.rows if row.state is RunState.LOST)

    @property
    def nondeterministic_runs(self) -> tuple[RunRow, ...]:
        """Runs that came out differently when the same was executed before."""
        return tuple(row for row in self.rows if row.nondeterministic)


@dataclass(frozen=True, slots=True)
class ComparedResults:
    """Everything about a campaign, with its baseline if any; ``runs`` may be some of it."""

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
        """Return results with what they were compared with."""
        declared, assessment = results.declared, results.assessment
        return cls(results.row, declared, assessment, results.rows, results.origin, comparison)

    @property
    def exit_code(self) -> int:
        """Exit code of the assessment; 1, that of a finding, when the results got worse."""
        # A regression is a finding also where everything still is as the campaign expects.
        is_worse = self.comparison is not None and self.comparison.regressed
        return 1 if is_worse else self.assessment.exit_code


def read_results(source: CampaignSource, row: CampaignRow) -> CampaignResults:
    """Ask for everything about a campaign and assess it."""
    rows, declared = source.all_runs(row.id, results=True), source.declared(row.id)
    counts = count_runs((run.state, str(run.outcome or ""), 1) for run in rows)
    return CampaignResults(
        # Counted anew: runs may have been judged or have ended since.
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
    """Return the traces below a folder, those in hidden folders if there are no others."""
    # A run that goes on has its traces in a hidden folder: beside those of an earlier run of the
    # campaign they would be counted twice.
    traces = sorted(folder.rglob("*.mcap"))
    visible = [one for one in traces if "/." not in f"/{one.relative_to(folder).as_posix()}"]
    return visible or traces


@dataclass(frozen=True, slots=True)
class CampaignNote:
    """A campaign beside its traces: its name, what it declares, where it was written.

    Also when and on what ``machine`` it was executed. ``declared`` is ``None`` where nothing says.
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
    """Write into a folder of traces what their campaign declares, for reports about them.

    ``at`` is when its runs are executed [s since the epoch], ``machine`` what executes them.
    """
    note = CampaignNote(
        submission.name, submission.about, submission.declared, submission.origin, at, machine
    )
    (folder / NOTE).write_bytes(codec.to_json(note))


def read_campaign_note(folder: Path, otherwise: str = "") -> CampaignNote:
    """Read what :func:`write_campaign_note` wrote, or what the ledger that keeps the traces says.

    Without either it is a note with a name alone. Raises :class:`daemon.batch.errors.Refused` for
    nonsense.
    """
    path = folder / NOTE
    if not path.is_file():
        return _note_of_ledger(folder.resolve()) or CampaignNote(otherwise, "", None)
    try:
        return codec.from_json(CampaignNote, path.read_bytes())
    except ValueError as error:
        raise Refused(
            f"{path} is not what `scenario run` leaves: delete it ({codec.reading_error(error)})"
        ) from error


def _note_of_ledger(folder: Path) -> CampaignNote | None:
    """Return the note of a campaign whose traces lie in a state directory, ``None`` elsewhere."""
    from daemon.batch.ledger import LedgerReader

    paths = StatePaths(folder.parent.parent)
    if folder.parent != paths.traces or not paths.ledger.is_file():
        return None
    # Of a ledger of another version nothing is known; the traces can be read all the same.
    with suppress(DaemonError), LedgerReader.open(paths) as ledger:
        row = ledger.campaign(folder.name)
        if row is not None:
            declared = None if row.search else ledger.declared(row.id)
            origin = ledger.origin(row.id)
            return CampaignNote(row.name, row.about, declared, origin, row.submitted_at)
    return None
