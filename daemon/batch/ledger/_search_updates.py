"""What the ledger does about searches: entered, given more runs, reported on, ended.

The runs of a search are not known when it is submitted. Whoever makes its proposals adds them a few
at a time, by position, and does so again after a crash: what is there already must be the same.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterable
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.ledger._entry import enter_runs
from daemon.batch.ledger._leases import LeaseUpdates
from daemon.batch.ledger._results import reuse_results
from daemon.batch.ledger._searches import insert_proposal, read_task, search_state
from daemon.batch.ledger.transitions import Retried
from daemon.batch.paths import StatePaths
from daemon.model.assessments import AssessmentRules
from daemon.model.ids import trace_name
from daemon.model.proposals import Proposal
from daemon.model.search import MOST_SEARCH_RUNS, SearchSubmission
from daemon.model.search_answer import SearchProgress
from daemon.model.spec import RunSpec
from daemon.model.status import SubmissionReceipt
from daemon.model.submission import Submission
from grammars.text import codec

_LIVE: Final = ("cancelled", "failed")
"""Searches that go on when somebody asks for it."""


class SearchUpdates(LeaseUpdates):
    """What may be done with searches; ``paths`` are those of the state directory."""

    def __init__(
        self,
        connection: sqlite3.Connection,
        *,
        attempts: int = 3,
        paths: StatePaths | None = None,
    ) -> None:
        super().__init__(connection, attempts=attempts)
        self._paths = paths
        self._deleted: list[str] = []

    def submit_search(
        self, search: SearchSubmission, digest: str, place: Callable[[bool], None], now: float
    ) -> SubmissionReceipt:
        """Enter a search whose content has that ``digest``, or go on with one that is known.

        ``place`` puts its files where they belong, before the commit: without them it could never
        run, and files of no search are cleared away. It is told whether those that are there are
        the same, and may be in use.
        """
        campaign = search.campaign
        row = self._db.execute(
            "SELECT digest, total FROM campaign WHERE id = ?", (campaign,)
        ).fetchone()
        if row is not None:
            if row[0] != digest:
                raise Refused(f"campaign id {campaign} is taken by another campaign")
            place(True)
            if search_state(self._db, campaign) in _LIVE:
                self._go_on(campaign, now)
            return SubmissionReceipt(campaign, row[1], known=True)
        named = (campaign, search.name, search.about, search.source, digest)
        declared = codec.to_json(AssessmentRules())
        self._db.execute(
            "INSERT INTO campaign (id, name, about, source, digest, total, submitted_at, declared,"
            " fresh) VALUES (?, ?, ?, ?, ?, 0, ?, ?, ?)",
            (*named, now, declared, search.fresh),
        )
        self._db.execute(
            "INSERT INTO search (campaign, task, file, updated_at) VALUES (?, ?, ?, ?)",
            (campaign, codec.to_json(search.task), search.file, now),
        )
        place(False)
        self.record_event(now, "campaign", campaign, campaign, "submitted")
        return SubmissionReceipt(campaign, 0, known=False)

    def extend(self, proposals: tuple[Proposal, ...], runs: Submission, now: float) -> int:
        """Add runs to a search, one for each proposal; returns how many are new.

        Refuses others than are there at their positions, and what leaves positions out.
        """
        campaign, specs = runs.campaign, runs.specs
        self._require_running(campaign)
        first, total = proposals[0].position, self._total(campaign)
        if first > total:
            raise Refused(f"{campaign} has {total} runs: none can be added at {first}")
        known = min(total - first, len(proposals))
        self._check_proposals(campaign, proposals, specs)
        self._compare(campaign, specs, first)
        if first + len(proposals) > MOST_SEARCH_RUNS:
            raise Refused(f"a search has at most {MOST_SEARCH_RUNS} runs")
        self._refuse_twice(campaign, specs[known:])
        added = len(proposals) - known
        if added:
            enter_runs(self._db, Submission.of(campaign, specs[known:], ()))
            for proposal in proposals[known:]:
                insert_proposal(self._db, campaign, proposal)
            reuse_results(self._db, campaign, total)
            self.record_event(now, "campaign", campaign, campaign, "extended")
        return added

    def _require_running(self, campaign: str) -> None:
        self._require_campaign(campaign)
        state = search_state(self._db, campaign)
        if state != "running":
            raise Refused(
                f"the search {campaign} is {state}" if state else f"{campaign} is no search"
            )

    def _check_proposals(
        self, campaign: str, proposals: tuple[Proposal, ...], specs: tuple[RunSpec, ...]
    ) -> None:
        """Refuse runs that are not what their proposals say."""
        task, _ = read_task(self._db, campaign)
        for proposal, spec in zip(proposals, specs, strict=True):
            # A building that is drawn stands behind its name: S.3@1204.
            if spec.scenario.partition("@")[0] != task.scenario_of(proposal.number):
                raise Refused(f"{spec.scenario!r} is not proposal {proposal.number} of {campaign}")
            if len(proposal.values) != len(task.parameters):
                raise Refused(
                    f"proposal {proposal.number} has {len(proposal.values)} values, the search"
                    f" has {len(task.parameters)} parameters"
                )

    def _compare(self, campaign: str, specs: tuple[RunSpec, ...], first: int) -> None:
        """Refuse other runs than are there: the same search must propose the same again."""
        rows = self._db.execute(
            "SELECT position, digest FROM run WHERE campaign = ? AND position >= ?"
            " ORDER BY position LIMIT ?",
            (campaign, first, len(specs)),
        )
        for position, known in rows:
            if known != specs[position - first].digest:
                raise Refused(
                    f"{campaign}.{position} is another run than is proposed: what was proposed"
                    " before, or what it gave, is not what it was"
                )

    def _refuse_twice(self, campaign: str, specs: tuple[RunSpec, ...]) -> None:
        """Refuse new runs of a name that another one has."""
        for spec in specs:
            name = trace_name(campaign, spec.scenario, spec.sut.name, spec.repeat)
            row = self._db.execute("SELECT id FROM run WHERE trace_name = ?", (name,)).fetchone()
            if row is not None:
                raise Refused(f"{spec.scenario}, repeat {spec.repeat}, is there already: {row[0]}")

    def note_progress(self, progress: SearchProgress, now: float) -> None:
        """Write down how far a search is, or how it ended.

        Of one that has ended only the answer may still come, from whoever has ended it.
        """
        campaign = progress.campaign
        read_task(self._db, campaign)
        before = search_state(self._db, campaign)
        if before not in ("running", progress.state):
            raise Refused(f"the search {campaign} is {before}")
        if before == "running" and progress.state == "cancelled":
            # Somebody let it go on before its last word came.
            raise Refused(f"the search {campaign} goes on")
        answer = b"" if progress.answer is None else codec.to_json(progress.answer)
        self._db.execute(
            "UPDATE search SET state = ?1, phase = ?2, note = ?3, updated_at = ?4,"
            " answer = CASE ?5 WHEN x'' THEN answer ELSE ?5 END WHERE campaign = ?6",
            (progress.state, progress.phase, progress.note, now, answer, campaign),
        )
        self.record_event(now, "search", campaign, campaign, progress.phase, progress.note)
        if before == "running" and progress.state != "running":
            self._close_if_finished(campaign, now)

    def fail_searches(self, note: str, now: float) -> int:
        """End all searches that run as failed, for a reason; returns how many."""
        running = self.running_searches()
        for campaign in running:
            self._end_search(campaign, "failed", note, now)
            self._close_if_finished(campaign, now)
        return len(running)

    def running_searches(self) -> dict[str, int]:
        """Return the searches that run, and how many runs each has."""
        rows = self._db.execute(
            "SELECT id, total FROM search JOIN campaign ON campaign.id = search.campaign"
            " WHERE search.state = 'running'"
        )
        return dict(rows.fetchall())

    def _end_search(self, campaign: str, state: str, note: str, now: float) -> None:
        ended = self._db.execute(
            "UPDATE search SET state = ?, note = ?, updated_at = ?"
            " WHERE campaign = ? AND state = 'running'",
            (state, note, now, campaign),
        ).rowcount
        if ended:
            self.record_event(now, "search", campaign, campaign, state, note)

    def _go_on(self, campaign: str, now: float) -> int:
        """Let a search go on that was cancelled or has failed; returns how many runs are queued.

        Those that were cancelled have taught it nothing yet. What a lost one lacks it has learnt,
        and so that stays: the same search proposes the same after any crash.
        """
        self._db.execute(
            "UPDATE search SET state = 'running', note = '', updated_at = ? WHERE campaign = ?",
            (now, campaign),
        )
        self._db.execute("UPDATE campaign SET finished_at = NULL WHERE id = ?", (campaign,))
        rows = self._db.execute(
            "SELECT id FROM run WHERE campaign = ? AND state = 'cancelled' ORDER BY position",
            (campaign,),
        ).fetchall()
        for (run,) in rows:
            self._apply(run, Retried(), now, quiet=True)
        self.record_event(now, "campaign", campaign, campaign, "retried")
        return len(rows)

    def _retry_search(self, campaign: str, words: Iterable[str], now: float) -> int | None:
        """Let a search go on, if that is what a retry of a campaign means; else ``None``."""
        state = search_state(self._db, campaign)
        if state in ("", "finished"):
            return None
        if not {"cancelled", "all"} & set(words):
            raise Refused(
                f"{campaign} is a search that is not finished: what it has learnt stays as it is, "
                "only what was cancelled can run again (--only cancelled)"
            )
        return 0 if state == "running" else self._go_on(campaign, now)
