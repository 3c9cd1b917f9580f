"""What the daemon does when it is asked about searches."""

from __future__ import annotations

import time
from dataclasses import replace

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._searches import (
    StagedSearch,
    read_extension,
    stage_search,
)
from daemon.model.bundles import read_bundle
from daemon.model.messages import Count, Empty, IdRequest
from daemon.model.proposals import ExtendRequest, ProposalQuery, ProposalRow
from daemon.model.search import SearchSubmission
from daemon.model.search_answer import SearchProgress, SearchQuery, SearchRow
from daemon.model.status import SubmissionReceipt
from grammars.text import codec


class SearchHandlers:
    """The methods of the verbs about searches, as those of :class:`Handlers` are."""

    paths: StatePaths
    log: EventLog

    def searches(self, ledger: LedgerReader, query: SearchQuery) -> tuple[SearchRow, ...]:
        return ledger.searches(query)

    def proposals(self, ledger: LedgerReader, query: ProposalQuery) -> tuple[ProposalRow, ...]:
        return ledger.proposals(query)

    def bundle(self, ledger: LedgerReader, request: IdRequest) -> SearchSubmission:
        asked = ledger.search_submission(request.id)
        try:
            return replace(asked, files=read_bundle(self.paths.search(request.id)))
        except OSError as error:
            words = f"the files of {request.id} cannot be read: {error.strerror}"
            raise Refused(words) from error

    def _admit_search(self, payload: bytes) -> StagedSearch:
        return stage_search(payload, self.paths)

    def search(self, ledger: LedgerWriter, staged: StagedSearch) -> SubmissionReceipt:
        def place(same: bool) -> None:
            staged.place(self.paths, same=same)

        try:
            now = time.time()
            receipt = ledger.submit_search(staged.asked, staged.digest, place, now)
        finally:
            staged.remove()
        self.log.write("search submitted", **codec.to_plain(receipt))
        return receipt

    def _admit_extension(self, payload: bytes) -> ExtendRequest:
        return read_extension(payload, self.paths)

    def extend(self, ledger: LedgerWriter, request: ExtendRequest) -> Count:
        return Count(ledger.extend(request.proposals, request.runs, time.time()))

    def progress(self, ledger: LedgerWriter, progress: SearchProgress) -> Empty:
        ledger.note_progress(progress, time.time())
        if progress.state != "running":
            self.log.write(
                "search ended",
                campaign=progress.campaign,
                state=progress.state,
                note=progress.note[:400],
            )
        return Empty()
