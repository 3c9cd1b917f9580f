"""Who composes the runs of a search, and who executes them, as the search sees both."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from daemon.model.proposals import Phase, Proposal, ProposalRow
from daemon.model.search import Point, SearchTask
from daemon.model.search_answer import SearchAnswer
from daemon.model.trials import Trial

if TYPE_CHECKING:
    from daemon.analysis.blame import Candidate, RunCase


class SearchStoppedError(Exception):
    """Nothing more is executed: the search is cancelled, or whoever executes it ends.

    ``answer`` is what was found until then, once :func:`daemon.search.program.run_search` knows.
    """

    answer: SearchAnswer | None = None


class Case(Protocol):
    """A search with all that its points are composed of.

    ``candidate`` and ``run_case`` raise :class:`grammars.text.diagnostics.InputError` for a point
    that no run can be made of, such as one that the geometry refuses.
    """

    @property
    def task(self) -> SearchTask:
        """What is searched."""

    def candidate(self, point: Point, number: int, repeat: int = 0) -> Candidate:
        """Return the run of a point: ``repeat`` of the scenario of this number."""

    def run_case(self, point: Point, number: int) -> RunCase:
        """Return the run of a point taken apart."""

    def found_text(self, result: Trial, *, comment: str, why: str = "") -> str:
        """Return a campaign file for the folder of the campaign, with the run of a point.

        Its failure is expected there; ``why`` says what it is.
        """


class Runs(Protocol):
    """Executes the runs of a search; positions count them from 0, without a gap.

    ``result`` and ``issue`` raise :class:`SearchStoppedError` when nothing more is executed.
    """

    def issue(self, proposal: Proposal, candidate: Candidate) -> None:
        """Have a run executed; one that is there already at its position is left as it is."""

    def issued(self, position: int) -> Proposal | None:
        """Return what an earlier life of this search has issued at a position."""

    def result(self, position: int) -> ProposalRow:
        """Wait for a run that was issued and return it, settled."""

    def report(self, phase: Phase, note: str, answer: SearchAnswer) -> None:
        """Tell people how far the search is."""

    def elapsed(self) -> float:
        """Return the wall clock since the search was asked for [s]."""
