"""A campaign as it is told to people: its runs, what it declares, how they are judged together."""

from __future__ import annotations

from dataclasses import dataclass

from daemon.assessment import Assessment, Cell, Declared, OracleCell, RunRecord, assess
from daemon.protocol import CampaignRow, RunRow
from daemon.verdict import Outcome
from scenario_tui.asking import Daemon, all_runs
from scenario_tui.wording import word_of

UNFINISHED: tuple[str, ...] = ("running", "queued", "lost", "cancelled")
"""Words of runs without a verdict, in the order a cell is named after them."""


@dataclass(frozen=True, slots=True)
class Results:
    """Everything known about a campaign; ``records`` are those of ``rows``, in order."""

    row: CampaignRow
    rows: tuple[RunRow, ...]
    records: tuple[RunRecord, ...]
    declared: Declared
    assessment: Assessment

    @property
    def words(self) -> tuple[str, ...]:
        """The word of each run."""
        return tuple(word_of(row) for row in self.rows)

    def records_of(self, cell: Cell) -> tuple[RunRecord, ...]:
        """Return the runs of a cell."""
        wanted = frozenset(cell.runs)
        return tuple(record for record in self.records if record.id in wanted)

    def word(self, cell: Cell) -> str:
        """Return the one word for a cell: a failure at once, else what it waits for or lacks."""
        if cell.verdict is Outcome.FAIL:
            return str(Outcome.FAIL)
        states = {record.state for record in self.records_of(cell)}
        return next((word for word in UNFINISHED if word in states), str(cell.verdict))

    @property
    def undecided(self) -> tuple[OracleCell, ...]:
        """What is neither as expected nor the opposite, of cells that have all their runs."""
        surprising = {(s.scenario, s.sut, s.oracle) for s in self.assessment.surprises}
        return tuple(
            oracle
            for cell in self.assessment.cells
            for oracle in cell.oracles
            if not oracle.met
            and not oracle.missing
            and (oracle.scenario, oracle.sut, oracle.oracle) not in surprising
        )

    @property
    def unexecuted(self) -> tuple[RunRow, ...]:
        """Runs that were given up or broke before anything could be judged."""
        return tuple(row for row in self.rows if word_of(row) == "lost")

    @property
    def doubtful(self) -> tuple[RunRow, ...]:
        """Runs that came out differently when the same was executed before."""
        return tuple(row for row in self.rows if row.reason.startswith("nondeterministic"))


def gather(daemon: Daemon, row: CampaignRow) -> Results:
    """Ask for everything about a campaign and judge it."""
    records, declared = daemon.records(row.id), daemon.declared(row.id)
    rows = all_runs(daemon, row.id)
    return Results(row, rows, records, declared, assess(declared, records))


def leading(cell: Cell) -> OracleCell | None:
    """Return the oracle that tells most about a cell.

    Of those with the cell's verdict one that is not as expected comes first, then the smallest
    margin: a tight pass is worth seeing.
    """
    found = [oracle for oracle in cell.oracles if oracle.verdict is cell.verdict]
    return min(found, key=_interest, default=None)


def _interest(oracle: OracleCell) -> tuple[bool, bool, float]:
    margin = oracle.worst.verdict.margin if oracle.worst else None
    return oracle.met, margin is None, margin or 0.0
