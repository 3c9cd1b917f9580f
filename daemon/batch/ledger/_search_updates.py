"""Changes of searches in the ledger: begin, extend, progress, end.

A search begins without runs. Its client appends them a few at a time, by position, and repeats this
after a crash: runs at occupied positions must then be equal.
"""

from __future__ import annotations

import hashlib
import sqlite3

from daemon.batch.errors import Refused
from daemon.batch.ledger._entry import enter_campaign, enter_runs
from daemon.batch.ledger._leases import RETRY, RunUpdates
from daemon.batch.ledger._results import reuse_results
from daemon.batch.ledger._searches import no_search, search_state
from daemon.model.assessments import AssessmentRules
from daemon.model.proposals import Proposal
from daemon.model.search import MOST_SEARCH_RUNS, SearchSubmission
from daemon.model.search_answer import SearchProgress
from daemon.model.submission import Submission
from grammars.text import codec
from grammars.text.words import command_line


class SearchUpdates(RunUpdates):
    """Changes of searches, on request of their clients."""

    def begin_search(self, search: SearchSubmission, now: float) -> None:
        """Enter a search, or resume a known one; a finished one stays unchanged."""
        campaign, task = search.campaign, codec.to_json(search.task)
        row = self._db.execute(
            "SELECT task, state FROM campaign LEFT JOIN search ON campaign = id WHERE id = ?",
            (campaign,),
        ).fetchone()
        if row is not None:
            if row[0] is None:
                raise Refused(f"campaign id {campaign} belongs to another campaign")
            if row[0] != task:
                raise Refused(f"{campaign} has other options: go on with it without options")
            if row[1] in ("cancelled", "failed"):
                self._go_on(campaign, now)
            return
        digest = hashlib.sha256(task).hexdigest()
        enter_campaign(self._db, search, digest, AssessmentRules(), now)
        progress = SearchProgress(campaign, search.client, "explore")
        self._db.execute(
            "INSERT INTO search (campaign, task, file, progress) VALUES (?, ?, ?, ?)",
            (campaign, task, search.file, codec.to_json(progress)),
        )
        self.record_event(now, "campaign", campaign, campaign, "submitted")

    def extend(self, proposals: tuple[Proposal, ...], runs: Submission, now: float) -> int:
        """Add runs to a search, one for each proposal; return the number of new ones.

        Refuses runs that differ from those at their positions, and gaps between positions.
        """
        campaign, specs = runs.campaign, runs.specs
        state = search_state(self._db, campaign)
        if state != "waiting":
            raise Refused(f"the search {campaign} is {state}" if state else no_search(campaign))
        first, total = proposals[0].position, self._total(campaign)
        if first > total or first + len(proposals) > MOST_SEARCH_RUNS:
            raise Refused(
                f"{campaign} has {total} runs of at most {MOST_SEARCH_RUNS}:"
                f" {len(proposals)} cannot be added at {first}"
            )
        (parameters,) = self._db.execute(
            "SELECT json_array_length(CAST(task AS TEXT), '$.parameters') FROM search"
            " WHERE campaign = ?",
            (campaign,),
        ).fetchone()
        if any(len(proposal.values) != parameters for proposal in proposals):
            raise Refused(f"the runs do not have the {parameters} parameters of {campaign}")
        rows = self._db.execute(
            "SELECT digest FROM run WHERE campaign = ? AND position >= ? ORDER BY position LIMIT ?",
            (campaign, first, len(proposals)),
        ).fetchall()
        if any(spec.digest != digest for spec, (digest,) in zip(specs, rows, strict=False)):
            raise Refused(f"the runs of {campaign} from {first} on differ from those proposed")
        new = proposals[len(rows) :]
        if new:
            try:
                enter_runs(self._db, Submission.of(campaign, specs[len(rows) :], ()))
            except sqlite3.IntegrityError as error:
                raise Refused(f"{campaign} has a run of that scenario and repeat") from error
            self._db.executemany(
                "INSERT INTO proposal (run, body) VALUES (?, ?)",
                ((f"{campaign}.{one.position}", codec.to_json(one)) for one in new),
            )
            reuse_results(self._db, campaign, total)
            self.record_event(now, "campaign", campaign, campaign, "extended")
        return len(new)

    def note_progress(self, progress: SearchProgress, now: float) -> None:
        """Record the progress or the end of a search.

        After its end, the client that ended it may still send the answer.
        """
        campaign = progress.campaign
        before = search_state(self._db, campaign)
        if not before:
            raise Refused(no_search(campaign))
        after = "waiting" if progress.state == "running" else progress.state
        if before not in ("waiting", after):
            raise Refused(f"the search {campaign} is {before}")
        if before == "waiting" and after == "cancelled":
            # Somebody has resumed it before this last message came.
            raise Refused(f"the search {campaign} goes on")
        changed = self._db.execute(
            "UPDATE search SET state = ?1, progress = ?2"
            " WHERE campaign = ?3 AND (state <> ?1 OR progress <> ?2)",
            (after, codec.to_json(progress), campaign),
        ).rowcount
        if changed:
            self.record_event(now, "search", campaign, campaign, progress.phase, progress.note)
        if before != after:
            self._close_if_finished(campaign, now)

    def _cancel_search(self, campaign: str, now: float) -> None:
        ended = self._db.execute(
            "UPDATE search SET state = 'cancelled' WHERE campaign = ? AND state = 'waiting'",
            (campaign,),
        ).rowcount
        if ended:
            self.record_event(now, "search", campaign, campaign, "cancelled")

    def _go_on(self, campaign: str, now: float) -> None:
        """Resume a cancelled or failed search: queue its cancelled runs.

        Lost runs stay: the search has used them, and must propose the same after any crash.
        """
        self._db.execute("UPDATE search SET state = 'waiting' WHERE campaign = ?", (campaign,))
        self._db.execute("UPDATE campaign SET finished_at = NULL WHERE id = ?", (campaign,))
        rows = self._db.execute(
            "SELECT id FROM run WHERE campaign = ? AND state = 'cancelled'", (campaign,)
        ).fetchall()
        self._db.executemany(RETRY, rows)
        self.record_event(now, "campaign", campaign, campaign, "retried")

    def _refuse_unfinished_search(self, campaign: str) -> None:
        """Refuse to retry runs of a search that its client has not finished."""
        row = self._db.execute(
            "SELECT file FROM search WHERE campaign = ? AND state <> 'finished'", (campaign,)
        ).fetchone()
        if row is not None:
            command = command_line("search", row[0], campaign)
            raise Refused(f"{campaign} is a search: `{command}` goes on with it")
