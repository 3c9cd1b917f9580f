"""Handlers of searches, and the clients that run these."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server._dispatcher import read_request
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._submissions import admit_submission
from daemon.model.ids import is_id
from daemon.model.messages import Count, Empty
from daemon.model.proposals import ExtendRequest
from daemon.model.search import SearchSubmission
from daemon.model.search_answer import SearchProgress, SearchQuery, SearchRow, SearchState
from daemon.model.verbs import EXTEND, SEARCHES

_SILENT: Final = 15.0
"""Silence after which a client counts as gone [s]; a waiting one reports every five."""


class SearchClients:
    """The clients that make the proposals of searches, one for each, by their latest report.

    Kept in memory, by a monotonic clock. After its start the daemon waits for the permitted silence
    of a client before it reports a search as waiting.
    """

    def __init__(self) -> None:
        self._started = time.monotonic()
        self._words: dict[str, tuple[str, float]] = {}

    def client(self, campaign: str) -> str:
        """Return the client of a search, empty without one."""
        client, at = self._words.get(campaign, ("", 0.0))
        return client if time.monotonic() - at < _SILENT else ""

    def state(self, campaign: str) -> SearchState:
        """Return the state of an unfinished search: ``running`` or ``waiting``."""
        fresh = campaign not in self._words and time.monotonic() - self._started < _SILENT
        return "running" if fresh or self.client(campaign) else "waiting"

    def claim(self, campaign: str, client: str) -> bool:
        """Record a report of a client; return whether the search is its own."""
        if self.client(campaign) not in ("", client):
            return False
        self._words[campaign] = (client, time.monotonic())
        return True

    def require(self, campaign: str, client: str) -> None:
        """Record a report of a client; refuse any but that of the search."""
        if not self.claim(campaign, client):
            raise Refused(f"{self.client(campaign)} makes the proposals of {campaign}")

    def leave(self, campaign: str) -> None:
        """Let a search wait for another client."""
        self._words[campaign] = ("", 0.0)


def read_extension(payload: bytes, paths: StatePaths) -> ExtendRequest:
    """Check new runs of a search, and store their scenes.

    Raises :class:`Refused` with the problems, and :class:`daemon.batch.errors.Unavailable` for
    errors such as a full disk.
    """
    request = read_request(EXTEND, payload)
    assert isinstance(request, ExtendRequest)
    problems = list(_extension_problems(request))
    if problems:
        raise Refused("\n".join(problems[:10]))
    admit_submission(request.runs, paths)
    return request


def _extension_problems(request: ExtendRequest) -> Iterator[str]:
    proposals, runs = request.proposals, request.runs
    if len(runs.runs) != len(proposals) or runs.reserve:
        yield f"there are {len(runs.runs)} runs for {len(proposals)} proposals"
        return
    for place, (proposal, run) in enumerate(zip(proposals, runs.runs, strict=True)):
        if proposal.position != proposals[0].position + place:
            yield f"the position {proposal.position} of a proposal does not follow the one before"
        if proposal.repeat != run.repeat:
            yield f"repeat {run.repeat} was proposed as repeat {proposal.repeat}"


class SearchHandlers:
    """Handlers of the verbs of searches, as in :class:`Handlers`."""

    log: EventLog
    clients: SearchClients

    def searches(self, ledger: LedgerReader, query: SearchQuery) -> tuple[SearchRow, ...]:
        return tuple(
            replace(
                row,
                state=self.clients.state(row.campaign),
                client=self.clients.client(row.campaign),
            )
            if row.state == "waiting"
            else row
            for row in ledger.ask(SEARCHES, query)
        )

    def search(self, ledger: LedgerWriter, request: SearchSubmission) -> Empty:
        campaign = request.campaign
        if not is_id(campaign):
            words = f"{campaign!r} is not a campaign id: use up to 100 of A-Z a-z 0-9 _ -"
            raise Refused(words)
        ledger.begin_search(request, time.time())
        if request.client and self.clients.claim(campaign, request.client):
            self.log.write("search", campaign=campaign, client=request.client)
        return Empty()

    def extend(self, ledger: LedgerWriter, request: ExtendRequest) -> Count:
        self.clients.require(request.runs.campaign, request.client)
        return Count(ledger.extend(request.proposals, request.runs, time.time()))

    def progress(self, ledger: LedgerWriter, progress: SearchProgress) -> Empty:
        campaign = progress.campaign
        self.clients.require(campaign, progress.client)
        ledger.note_progress(progress, time.time())
        if progress.state != "running":
            self.clients.leave(campaign)
            state, note = progress.state, progress.note[:400]
            self.log.write("search left", campaign=campaign, state=state, note=note)
        return Empty()
