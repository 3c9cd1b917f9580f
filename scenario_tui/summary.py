"""A campaign in a few lines: one cell per scenario and system under test, and what went wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from daemon.errors import Refused
from daemon.protocol import RunDetail, RunRow
from daemon.verdict import Evidence, Outcome, Verdict
from scenario_tui.asking import Daemon
from scenario_tui.wording import SEVERITY, word_of

PROBLEMS: Final = ("fail", "error", "lost", "inconclusive")
"""Words of runs worth a line of their own, the worst first."""


@dataclass(frozen=True, slots=True)
class Cell:
    """All repeats of one scenario with one system under test, in order."""

    scenario: str
    sut: str
    rows: tuple[RunRow, ...]

    @property
    def words(self) -> dict[str, int]:
        """How many repeats there are of each word, what matters most first."""
        found = Counter(word_of(row) for row in self.rows)
        return {word: found[word] for word in SEVERITY if found[word]}

    @property
    def worst(self) -> RunRow | None:
        """The repeat to look at first.

        Of those judged, the gravest word decides, then the oracle that decides most of those
        repeats (margins of different oracles have different units, so only margins of one are
        compared), then the smallest margin.
        """
        judged = [row for row in self.rows if row.outcome is not None] or list(self.rows)
        if not judged:
            return None
        word = min((word_of(row) for row in judged), key=SEVERITY.index)
        grave = [row for row in judged if word_of(row) == word]
        oracle = Counter(row.oracle for row in grave).most_common(1)[0][0]
        return min((row for row in grave if row.oracle == oracle), key=_by_margin)


def _by_margin(row: RunRow) -> tuple[bool, float, int]:
    return (row.margin is None, row.margin if row.margin is not None else 0.0, row.index)


def cells(rows: Iterable[RunRow]) -> tuple[Cell, ...]:
    """Group runs by scenario and system under test, in the order they first appear."""
    grouped: dict[tuple[str, str], list[RunRow]] = {}
    for row in rows:
        grouped.setdefault((row.scenario, row.sut), []).append(row)
    return tuple(
        Cell(scenario, sut, tuple(sorted(found, key=lambda r: r.repeat)))
        for (scenario, sut), found in grouped.items()
    )


def problems(rows: Iterable[RunRow]) -> tuple[RunRow, ...]:
    """Return the runs that did not pass, the gravest first, cancelled ones left out."""
    found = [row for row in rows if word_of(row) in PROBLEMS]
    return tuple(sorted(found, key=lambda r: (PROBLEMS.index(word_of(r)), r.index)))


@dataclass(frozen=True, slots=True)
class Report:
    """What the end of a campaign is told from; ``details`` has the runs worth a closer look."""

    rows: tuple[RunRow, ...]
    cells: tuple[Cell, ...]
    details: dict[str, RunDetail]

    def evidence(self, row: RunRow) -> Evidence:
        """Return the decisive moment of a run, empty when it is not known here."""
        verdict = self.verdict(row)
        return verdict.evidence if verdict else Evidence()

    def verdict(self, row: RunRow) -> Verdict | None:
        """Return the verdict of the oracle that decides a run."""
        found = verdicts(self.details.get(row.id))
        return next((v for v in found if v.oracle == row.oracle), None)


def verdicts(detail: RunDetail | None) -> tuple[Verdict, ...]:
    """Return the verdicts of a run, none while it has no result."""
    return detail.result.verdicts if detail is not None and detail.result is not None else ()


def against(detail: RunDetail | None) -> tuple[Verdict, ...]:
    """Return the verdicts that keep a run from passing, failures first."""
    bad = (Outcome.FAIL, Outcome.ERROR, Outcome.INCONCLUSIVE)
    found = [v for v in verdicts(detail) if v.outcome in bad]
    return tuple(sorted(found, key=lambda v: bad.index(v.outcome)))


def report(daemon: Daemon, rows: tuple[RunRow, ...], *, closer: int = 50) -> Report:
    """Gather the details of each cell's worst run and of the first ``closer`` problems."""
    found = cells(rows)
    wanted = [cell.worst for cell in found]
    wanted.extend(problems(rows)[:closer])
    details: dict[str, RunDetail] = {}
    for row in wanted:
        if row is not None and row.outcome is not None and row.id not in details:
            try:
                details[row.id] = daemon.run(row.id)
            except Refused:
                # Only possible when the ledger was changed meanwhile: the row still says enough.
                continue
    return Report(rows, found, details)
