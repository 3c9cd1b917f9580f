"""The runs of a search in a daemon: issued into its ledger, waited for, and told of.

Positions are all that names a run. What the ledger has at a position already, of an earlier life of
the same search, must be the run that is proposed: everything that follows was learnt from it.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Final, TypeVar

from daemon.batch.client import Client
from daemon.batch.errors import Refused, Unreachable
from daemon.model.messages import LARGEST_EXTENSION, CampaignQuery
from daemon.model.proposals import ExtendRequest, Phase, Proposal, ProposalQuery, ProposalRow
from daemon.model.run_state import RunState
from daemon.model.search_answer import (
    LONGEST_NOTE,
    SearchAnswer,
    SearchProgress,
    SearchQuery,
    SearchRow,
)
from daemon.model.spec import RunSpec
from daemon.model.status import ChangeEvent
from daemon.model.submission import Submission
from daemon.model.verbs import CAMPAIGNS, EXTEND, PROGRESS, PROPOSALS, SEARCHES, Verb
from daemon.search.execution.runs import SearchStoppedError
from grammars.model.scene import Scene
from grammars.text import codec

if TYPE_CHECKING:
    # With all that runs and judges, of which only its name is needed here.
    from daemon.analysis.blame import Candidate

A = TypeVar("A")

_SETTLED: Final = frozenset({"done", "lost", "cancelled", "deleted", "retried"})
"""States of events after which a run may be settled, or the search over."""
_LOOK_EVERY: Final = 2.0
"""Seconds between two looks at a run that is waited for: events may be lost."""
_REPORT_EVERY: Final = 1.0
_FIRST_PAUSE: Final = 0.1
_LONGEST_PAUSE: Final = 5.0
"""Seconds between two questions to a daemon that does not answer."""
_MOST_UNSENT: Final = 64
_PAGE: Final = 500


class SearchDivergedError(Exception):
    """The search proposes another run than it did before: what it is made of has changed."""


class PatientClient:
    """Asks a daemon until it answers: without it there is nothing to do.

    Writes to standard error why it does not, each reason once in a row.
    """

    def __init__(self, client: Client) -> None:
        self.client = client
        self._problem = ""

    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Return the answer; raises :class:`daemon.batch.errors.Refused`."""
        return self._patiently(lambda: self.client.ask(verb, request))

    def _patiently(self, act: Callable[[], A]) -> A:
        pause = _FIRST_PAUSE
        while True:
            try:
                return act()
            except Unreachable as error:
                if str(error) != self._problem:
                    print(error, file=sys.stderr, flush=True)
                self._problem = str(error)
                time.sleep(pause)
                pause = min(2 * pause, _LONGEST_PAUSE)

    def send_files(self, runs: tuple[RunSpec, ...]) -> None:
        """Send the files that runs need, as far as they are here and the daemon lacks them."""
        self._patiently(lambda: self.client.send_files(runs))

    def running_searches(self) -> tuple[SearchRow, ...]:
        """The searches that run."""
        return self.ask(SEARCHES, SearchQuery(running=True))

    def is_running(self, search: SearchRow) -> bool:
        """Whether a search is there and runs, and is not another one of that id.

        It may have been deleted and submitted again.
        """
        # Its row as a campaign: that as a search has all of its answer.
        rows = self.ask(CAMPAIGNS, CampaignQuery(search.campaign, limit=1))
        return any(
            row.search == "running" and row.submitted_at == search.submitted_at for row in rows
        )

    def report(self, progress: SearchProgress) -> None:
        """Say how far a search is; without the files of its answer where these are too large."""
        self.ask(PROGRESS, within_bounds(progress))


def within_bounds(progress: SearchProgress) -> SearchProgress:
    """Return a report of at most so many bytes as the daemon takes: as it is, or without files."""
    shrunk = None if progress.answer is None else progress.answer.shrunk
    if progress.answer is None or shrunk is None or not shrunk.files:
        return progress
    if len(codec.to_json(progress)) <= LARGEST_EXTENSION:
        return progress
    without = replace(progress.answer, shrunk=replace(shrunk, files=()))
    note = f"{progress.note}; " if progress.note else ""
    note += "the files of the shrunk scenario are too large to be kept"
    return replace(progress, answer=without, note=note[:LONGEST_NOTE])


class DaemonRuns:
    """The runs of one search: what its program gets, in the thread of that program."""

    def __init__(self, client: PatientClient, row: SearchRow) -> None:
        self._client = client
        self._search = row
        self._campaign = row.campaign
        self._began = time.monotonic() - max(0.0, time.time() - row.submitted_at)
        self._rows: list[ProposalRow] = []
        self._earlier = 0
        self._unsent: list[tuple[Proposal, Candidate]] = []
        self._unsettled = 0
        self._sent: set[str] = set()
        self._changed = threading.Event()
        self._reached = -1
        self._unsaid: SearchProgress | None = None
        self._said_at = 0.0
        self.phase: Phase = "explore"

    def load(self) -> None:
        """Read what an earlier life of the search has left."""
        while page := self._page(len(self._rows), _PAGE):
            self._rows.extend(page)
        self._earlier = len(self._rows)
        self._skip_settled()

    def _page(self, offset: int, limit: int) -> tuple[ProposalRow, ...]:
        try:
            return self._client.ask(PROPOSALS, ProposalQuery(self._campaign, offset, limit))
        except Refused:
            self._require_running()  # else it was deleted
            raise

    def _known_page(self, offset: int, limit: int) -> tuple[ProposalRow, ...]:
        """Return a page of runs that the ledger has."""
        page = self._page(offset, limit)
        if not page:
            self._require_running()
            raise SearchDivergedError(f"run {offset} of the search is not in the ledger any more")
        return page

    def note_event(self, event: ChangeEvent) -> None:
        """Look again soon if an event of the search is about an end; called by any thread."""
        if event.state in _SETTLED:
            self._changed.set()

    def issued(self, position: int) -> Proposal | None:
        """Return what an earlier life of this search has issued at a position."""
        return self._rows[position].proposal if position < self._earlier else None

    def issue(self, proposal: Proposal, candidate: Candidate) -> None:
        """Have a run executed; one that is there already at its position is left as it is.

        It is in the ledger at the latest when a result is waited for.
        """
        if proposal.position < len(self._rows):
            known = self._rows[proposal.position].run
            if known.digest != candidate.spec.digest:
                raise SearchDivergedError(
                    f"run {proposal.position} of the search is another one than it was before"
                    f" ({known.label}): the software was changed"
                    " meanwhile: start it again with --fresh"
                )
            return
        expected = len(self._rows) + len(self._unsent)
        if proposal.position != expected:
            raise ValueError(f"run {proposal.position} was issued where {expected} is the next")
        self._unsent.append((proposal, candidate))
        if len(self._unsent) >= _MOST_UNSENT:
            self._send()

    def result(self, position: int) -> ProposalRow:
        """Wait for a run that was issued and return it, settled.

        Raises :class:`SearchStoppedError` when the search is over, or was deleted.
        """
        self._reached = max(self._reached, position)
        if self._unsent:
            self._send()
        told = True
        while not _has_result(self._rows[position]):
            # Before the look: what happens from now on is an event.
            self._changed.clear()
            self._refresh()
            row = self._rows[position]
            if _has_result(row):
                break
            if row.run.state is RunState.CANCELLED or not told:
                self._require_running()
            self._say()
            told = self._changed.wait(_LOOK_EVERY)
        return self._rows[position]

    def report(self, phase: Phase, note: str, answer: SearchAnswer) -> None:
        """Tell people how far the search is, once a second at most."""
        self._unsaid = SearchProgress(self._campaign, phase, note[:LONGEST_NOTE], "running", answer)
        # What was said before the process was started again was about more than this.
        if self._reached + 1 < self._earlier:
            return
        if phase != self.phase:
            self._said_at = 0.0
        self.phase = phase
        self._say()

    def elapsed(self) -> float:
        """Return the wall clock since the search was asked for [s]."""
        return time.monotonic() - self._began

    def _say(self) -> None:
        now = time.monotonic()
        progress = self._unsaid
        if progress is None or now - self._said_at < _REPORT_EVERY:
            return
        self._unsaid, self._said_at = None, now
        try:
            self._client.report(progress)
        except Refused:
            self._require_running()
            raise

    def is_wanted(self) -> bool:
        """Whether the search is still there and runs."""
        return self._client.is_running(self._search)

    def _require_running(self) -> None:
        if not self.is_wanted():
            raise SearchStoppedError(f"the search {self._campaign} is over")

    def _refresh(self) -> None:
        """Read again what is not settled."""
        start, end = self._unsettled, len(self._rows)
        while start < end:
            page = self._known_page(start, min(_PAGE, end - start))
            self._rows[start : start + len(page)] = page
            start += len(page)
        self._skip_settled()

    def _skip_settled(self) -> None:
        while self._unsettled < len(self._rows) and _has_result(self._rows[self._unsettled]):
            self._unsettled += 1

    def _send(self) -> None:
        """Have what is unsent entered into the ledger, in parts that are not too large."""
        while self._unsent:
            count = self._fitting()
            part = self._unsent[:count]
            try:
                self._extend(part, self._new_scenes(part))
            except Refused:
                self._require_running()
                # The daemon may have cleared away scenes that were sent long ago.
                self._extend(part, _scenes(part))
            del self._unsent[:count]
            first = len(self._rows)
            while len(self._rows) < first + count:
                missing = first + count - len(self._rows)
                self._rows.extend(self._known_page(len(self._rows), missing))

    def _fitting(self) -> int:
        """How many of the unsent runs fit into one request, one at least."""
        size, counted = 0, set[str]()
        for count, (_, candidate) in enumerate(self._unsent):
            size += len(codec.to_json(candidate.spec))
            if candidate.spec.scene not in counted:
                counted.add(candidate.spec.scene)
                size += len(codec.to_json(candidate.scene))
            if count and size > LARGEST_EXTENSION // 2:
                return count
        return len(self._unsent)

    def _new_scenes(self, part: list[tuple[Proposal, Candidate]]) -> dict[str, Scene]:
        return {key: scene for key, scene in _scenes(part).items() if key not in self._sent}

    def _extend(self, part: list[tuple[Proposal, Candidate]], scenes: dict[str, Scene]) -> None:
        specs = tuple(candidate.spec for _, candidate in part)
        files = {digest for spec in specs for digest in spec.files}
        if not files <= self._sent:
            self._client.send_files(specs)
        runs = Submission.of(self._campaign, specs, scenes.values())
        proposals = tuple(proposal for proposal, _ in part)
        self._client.ask(EXTEND, ExtendRequest(self._campaign, proposals, runs))
        self._sent.update(files, scenes)


def _has_result(row: ProposalRow) -> bool:
    """Whether a run has told what it can; a cancelled one is queued again if the search goes on."""
    return row.run.settled and row.run.state is not RunState.CANCELLED


def _scenes(part: list[tuple[Proposal, Candidate]]) -> dict[str, Scene]:
    """Return the scenes of runs by their digests, which the runs have: making one takes a while."""
    return {candidate.spec.scene: candidate.scene for _, candidate in part}
