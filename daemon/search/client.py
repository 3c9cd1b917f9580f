"""A search run by its client: the program in this process, its runs in a daemon.

The program of a search is plain code that always runs from its beginning. A run is named by its
position alone. If the ledger already has a run at a position, from an earlier life of the same
search, the proposed run must be the same: everything after it depends on it.
"""

from __future__ import annotations

import os
import secrets
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Final, TypeAlias, TypeVar

from daemon.batch.client import Client
from daemon.batch.errors import DaemonError, Refused, Unreachable
from daemon.model.messages import RunQuery
from daemon.model.search import ExtendRequest, Phase, Proposal, SearchSubmission
from daemon.model.search_answer import (
    LONGEST_NOTE,
    SearchAnswer,
    SearchProgress,
    SearchQuery,
    SearchRow,
    SearchState,
)
from daemon.model.spec import RunSpec
from daemon.model.status import ChangeEvent, RunRow
from daemon.model.submission import Submission
from daemon.model.verbs import EXTEND, PROGRESS, RUNS, SEARCH, SEARCHES, Verb
from daemon.model.verdicts import RunState
from grammars.text.diagnostics import InputError

if TYPE_CHECKING:
    # It loads the code that runs and judges; only its name is needed here.
    from daemon.analysis.blame import Candidate

A = TypeVar("A")

_SETTLED: Final = frozenset({"done", "lost", "cancelled", "deleted"})
"""States in events after which a run may be settled, or the search over."""
_LOOK_EVERY: Final = 2.0
"""Seconds between two checks of an awaited run: events may be lost."""
_REPORT_EVERY: Final = 1.0
_SPEAK_EVERY: Final = 5.0
"""Seconds after which the last report is repeated: the daemon takes a silent client for gone."""
_FIRST_PAUSE: Final = 0.1
_LONGEST_PAUSE: Final = 5.0
"""Seconds between two questions to a daemon that does not answer."""
_PAGE: Final = 500
"""Rows of the ledger that one request reads."""
_TURN_EVERY: Final = 0.5
"""Seconds between two checks whether another client still runs the search."""
_LAST_MOMENT: Final = 5.0
"""Longest wait [s] for the program to reach its next question after :meth:`SearchClient.leave`."""


class SearchStoppedError(Exception):
    """The search executes no more runs: it was cancelled or deleted, or its client leaves.

    :func:`daemon.search.program.run_search` adds the ``answer`` so far.
    """

    answer: SearchAnswer | None = None


class SearchDivergedError(Exception):
    """The search proposes a different run than before: its files or the software have changed."""


class PatientClient:
    """Asks a daemon until it answers, and prints the reason for delays to standard error."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self._problem = ""

    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Return the answer; raises :class:`daemon.batch.errors.Refused`."""
        return self._patiently(lambda: self.client.ask(verb, request))

    def send_files(self, runs: tuple[RunSpec, ...]) -> None:
        """Send files of runs that exist here and are missing in the daemon."""
        self._patiently(lambda: self.client.send_files(runs))

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


class DaemonRuns:
    """The runs of one search, for its program; positions count them from 0, without a gap.

    ``client`` names the process to the daemon, ``submitted_at`` is the time of the submission [s
    since the epoch].
    """

    def __init__(
        self, daemon: PatientClient, campaign: str, client: str, submitted_at: float
    ) -> None:
        self._daemon = daemon
        self._campaign = campaign
        self._began = time.monotonic() - max(0.0, time.time() - submitted_at)
        self._rows: list[RunRow] = []
        self._earlier = 0
        self._sent: set[str] = set()
        self._changed = threading.Event()
        self._leaving = False
        self._reached = -1
        self._progress = SearchProgress(campaign, client, "explore")
        self._is_reported = True
        self._reported_at = time.monotonic()

    def load(self) -> None:
        """Read the runs of earlier lives of the search."""
        while page := self._page(len(self._rows), _PAGE):
            self._rows.extend(page)
        self._earlier = len(self._rows)

    def note_event(self, event: ChangeEvent) -> None:
        """Check runs again soon if an event reports an end; any thread may call this."""
        if event.campaign == self._campaign and event.state in _SETTLED:
            self._changed.set()

    def leave(self) -> None:
        """Stop the program at its next question; any thread may call this."""
        self._leaving = True
        self._changed.set()

    def issued(self, position: int) -> Proposal | None:
        """Return the proposal of an earlier life of this search at a position, if any."""
        return self._rows[position].proposal if position < self._earlier else None

    def issue(self, proposal: Proposal, candidate: Candidate) -> None:
        """Submit a run for execution, unless it is already at its position.

        Raises :class:`SearchStoppedError` as :meth:`result` does, and :class:`SearchDivergedError`
        if a different run is at its position.
        """
        if proposal.position < self._earlier:
            row = self._rows[proposal.position]
            if row.digest != candidate.spec.digest:
                raise SearchDivergedError(
                    f"run {proposal.position} of the search differs from the recorded one"
                    f" ({row.label}): the software has changed: start it again with --fresh"
                )
            return
        spec, files = candidate.spec, set(candidate.spec.files)
        if not files <= self._sent:
            self._daemon.send_files((spec,))
        try:
            self._extend(proposal, candidate, with_scene=spec.scene not in self._sent)
        except Refused:
            self._require_ours()
            # The daemon may have deleted a scene that was sent long ago.
            self._extend(proposal, candidate, with_scene=True)
        self._sent.update(files, (spec.scene,))

    def result(self, position: int) -> RunRow:
        """Wait for an issued run and return it, settled.

        Raises :class:`SearchStoppedError` if the search is over, or its client leaves.
        """
        self._reached = position
        while position >= len(self._rows) or not _has_result(self._rows[position]):
            # Clear before reading: later changes set it again.
            self._changed.clear()
            if self._leaving:
                raise SearchStoppedError(f"the search {self._campaign} is left")
            self._refresh(position)
            if _has_result(self._rows[position]):
                break
            if self._rows[position].state is RunState.CANCELLED:
                self._require_ours()
            self._send_report()
            self._changed.wait(_LOOK_EVERY)
        return self._rows[position]

    def report(self, phase: Phase, note: str, answer: SearchAnswer) -> None:
        """Report the progress of the search, once a second at most."""
        before = self._progress
        self._progress = replace(before, phase=phase, note=note[:LONGEST_NOTE], answer=answer)
        # While earlier runs are replayed, an earlier life has already reported more.
        self._is_reported = self._reached + 1 < self._earlier
        if phase != before.phase:
            self._reported_at = 0.0
        self._send_report()

    def end(self, state: SearchState, note: str, answer: SearchAnswer | None) -> None:
        """Report how the search ended, or that it waits for another client.

        Raises :class:`daemon.batch.errors.Refused` if another client runs it by now.
        """
        answer = answer or self._progress.answer
        self._daemon.ask(
            PROGRESS,
            replace(self._progress, state=state, note=note[:LONGEST_NOTE], answer=answer),
        )

    def elapsed(self) -> float:
        """Return the wall clock time since the submission of the search [s]."""
        return time.monotonic() - self._began

    def _send_report(self) -> None:
        now = time.monotonic()
        silent = now - self._reported_at
        if silent < (_SPEAK_EVERY if self._is_reported else _REPORT_EVERY):
            return
        self._is_reported, self._reported_at = True, now
        self._ask(PROGRESS, self._progress)

    def _ask(self, verb: Verb[..., A], request: object) -> A:
        """Send a request about the search.

        Raises :class:`SearchStoppedError` if the daemon refuses because the search is over or
        belongs to another client.
        """
        try:
            return self._daemon.ask(verb, request)
        except Refused:
            self._require_ours()
            raise

    def _require_ours(self) -> None:
        rows = self._daemon.ask(SEARCHES, SearchQuery(self._campaign))
        # A restarted daemon, or one that dropped a slow client, has no client: this one may report.
        ours = ("", self._progress.client)
        if not any(row.client in ours and not row.ended for row in rows):
            raise SearchStoppedError(f"the search {self._campaign} is over")

    def _page(self, offset: int, limit: int) -> tuple[RunRow, ...]:
        query = RunQuery(self._campaign, offset=offset, limit=limit, results=True)
        return self._ask(RUNS, query).rows

    def _refresh(self, position: int) -> None:
        """Read rows from the first unsettled one on again, up to a position at least."""
        unsettled = (n for n, row in enumerate(self._rows) if not _has_result(row))
        start, end = next(unsettled, len(self._rows)), max(len(self._rows), position + 1)
        while start < end:
            page = self._page(start, min(_PAGE, end - start))
            if not page:
                self._require_ours()
                message = f"run {start} of the search is no longer in the ledger"
                raise SearchDivergedError(message)
            self._rows[start : start + len(page)] = page
            start += len(page)

    def _extend(self, proposal: Proposal, candidate: Candidate, *, with_scene: bool) -> None:
        """Enter a run into the ledger; the daemon keeps scenes and files that it has."""
        scenes = (candidate.scene,) if with_scene else ()
        runs = Submission.of(self._campaign, (candidate.spec,), scenes)
        self._daemon.ask(EXTEND, ExtendRequest(self._progress.client, (proposal,), runs))
        self._reported_at = time.monotonic()


def _has_result(row: RunRow) -> bool:
    """Return whether a run is at its end; a cancelled one is queued again later."""
    return row.settled and row.state is not RunState.CANCELLED


SearchProgram: TypeAlias = Callable[[DaemonRuns], SearchAnswer]


def client_name() -> str:
    """Return a unique name of this process for daemons."""
    return f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"


class SearchClient(threading.Thread):
    """Runs the program of a search that has begun, as soon as no other client does.

    This thread calls ``program`` and closes the connection to the ``daemon`` at the end. The ledger
    then contains the ending of the search.
    """

    def __init__(self, daemon: Client, search: SearchSubmission, program: SearchProgram) -> None:
        super().__init__(name=f"search {search.campaign}", daemon=True)
        self._daemon = daemon
        self._search = search
        self._program = program
        self._runs: DaemonRuns | None = None
        self._leaving = threading.Event()

    def leave(self) -> None:
        """Let the search wait for another client; any other thread may call this."""
        self._leaving.set()
        if self._runs is not None:
            self._runs.leave()
        self.join(_LAST_MOMENT)

    def run(self) -> None:
        """Wait until no other client runs the search, and run it to its end."""
        with self._daemon as client:
            daemon = PatientClient(client)
            row = self._wait_for_turn(daemon)
            if row is None:
                return
            self._runs = runs = DaemonRuns(daemon, row.campaign, row.client, row.submitted_at)
            if self._leaving.is_set():
                runs.leave()
            with client.events(runs.note_event):
                ending = self._run_program(runs)
            # It may have been ended or deleted at this moment.
            with suppress(Refused):
                runs.end(*ending)

    def _wait_for_turn(self, daemon: PatientClient) -> SearchRow | None:
        while True:
            rows = daemon.ask(SEARCHES, SearchQuery(self._search.campaign))
            if not rows or rows[0].ended:
                return None
            if rows[0].client == self._search.client:
                return rows[0]
            if self._leaving.is_set():
                return None
            if rows[0].state == "waiting":
                daemon.ask(SEARCH, self._search)
            else:
                self._leaving.wait(_TURN_EVERY)

    def _run_program(self, runs: DaemonRuns) -> tuple[SearchState, str, SearchAnswer | None]:
        """Return how the search ended, the reason of a failure, and the answer."""
        try:
            runs.load()
            return "finished", "", self._program(runs)
        except SearchStoppedError as stopped:
            return "waiting" if self._leaving.is_set() else "cancelled", "", stopped.answer
        except (InputError, SearchDivergedError, DaemonError) as error:
            return "failed", str(error), None
        except Exception as error:
            # A new attempt would meet the same problem.
            traceback.print_exc()
            return "failed", f"the search broke: {type(error).__name__}: {error}", None
