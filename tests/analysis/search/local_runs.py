"""The runs of a search executed here, in forked processes, without a daemon and its ledger."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from daemon.analysis.blame import SLOTS, Candidate
from daemon.analysis.child_runs import run_in_children
from daemon.model.proposals import Phase, Proposal
from daemon.model.run_state import RunState
from daemon.model.search_answer import SearchAnswer
from daemon.model.spec import RunResult
from daemon.model.status import RunRow
from daemon.run import execute
from tests.make import run_row

BatchExecutor = Callable[[Sequence[Candidate]], list[RunResult | None]]
"""Executes runs at the same time; ``None`` for one that left no result."""
ReportCallback = Callable[[Phase, str, SearchAnswer], None]


def execute_with_leads(candidates):
    """Execute runs at the same time, each in a forked process, with leading margins."""
    runs = [(one.spec, one.scene) for one in candidates]
    with tempfile.TemporaryDirectory() as folder:
        ended = run_in_children(runs, Path(folder), execute_run=partial(execute, leads=True))
    return [one.result for one in ended]


@dataclass(slots=True)
class LocalRuns:
    """Executes runs in the order of their positions, ``slots`` at a time.

    ``results`` are kept by digest and may be shared with another search, which then reuses them.
    What a search asks for does not depend on ``slots``.
    """

    slots: int = SLOTS
    results: dict[str, RunResult] = field(default_factory=dict)
    on_report: ReportCallback | None = None
    executor: BatchExecutor = execute_with_leads
    proposals: list[Proposal] = field(default_factory=list)
    digests: list[str] = field(default_factory=list)
    started: float = field(default_factory=time.monotonic)
    _waiting: list[tuple[int, Candidate]] = field(default_factory=list)
    _rows: dict[int, RunRow] = field(default_factory=dict)

    def issue(self, proposal, candidate):
        """Take a run into the queue, or the result that is there."""
        if proposal.position != len(self.proposals):
            raise ValueError(f"run {len(self.proposals)} comes before {proposal.position}")
        digest = candidate.spec.digest
        self.proposals.append(proposal)
        self.digests.append(digest)
        if digest in self.results:
            self._settle(proposal.position, candidate, self.results[digest], cached=True)
        else:
            self._waiting.append((proposal.position, candidate))

    def issued(self, position):
        """Return nothing: there was no life before this one."""
        return

    def result(self, position):
        """Execute what is before a run, and the run, and return it."""
        while position not in self._rows:
            batch, self._waiting = self._waiting[: self.slots], self._waiting[self.slots :]
            done = self.executor([candidate for _, candidate in batch])
            for (at, candidate), result in zip(batch, done, strict=True):
                if result is not None:
                    self.results[candidate.spec.digest] = result
                self._settle(at, candidate, result, cached=False)
        return self._rows[position]

    def report(self, phase, note, answer):
        """Hand it on to whoever wants to know."""
        if self.on_report is not None:
            self.on_report(phase, note, answer)

    def elapsed(self):
        """Return the wall clock since the beginning [s]."""
        return time.monotonic() - self.started

    def _settle(self, position, candidate, result, *, cached):
        spec, proposal = candidate.spec, self.proposals[position]
        self._rows[position] = run_row(
            f"{position:06d}", spec.scenario, spec.sut.name, spec.repeat, result,
            state=RunState.LOST if result is None else RunState.DONE,
            digest=self.digests[position], cached="earlier" if cached else "", proposal=proposal,
        )  # fmt: skip
