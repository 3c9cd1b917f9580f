"""Execution of candidates: a few at a time, each once, within a budget."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, TypeAlias

from daemon.analysis.blame._case import Candidate
from daemon.analysis.blame._elements import TestOutcome
from daemon.analysis.child_runs import ExecuteRun, run_in_children
from daemon.model.verdicts import Evidence, Outcome, Verdict
from daemon.run import execute

SLOTS: Final = 2
"""Candidates that run at the same time. The answer depends on this number, so it must be the same
on every machine, for any number of cores."""


class BudgetSpentError(Exception):
    """The search needs another run, and the budget is spent."""


@dataclass(frozen=True, slots=True)
class CandidateResult:
    """Outcome of a candidate by the oracle in question."""

    word: TestOutcome
    verdict: Verdict


RunnerWatch: TypeAlias = Callable[["CandidateRunner"], None]
CandidateExecutor: TypeAlias = Callable[[Sequence[Candidate]], list[tuple[CandidateResult, ...]]]
"""Executes a batch of candidates; returns the results of each by each of its oracles, in order."""


@dataclass(slots=True)
class CandidateRunner:
    """Executes runs and remembers their results by their digests.

    ``runs`` counts executed runs, ``cached`` those with a known result. ``watch`` is called after
    each batch. The default ``executor`` is :func:`execute_candidates`, with a process for each run.
    """

    budget: int
    watch: RunnerWatch | None = None
    executor: CandidateExecutor | None = None
    runs: int = 0
    cached: int = 0
    started: float = field(default_factory=time.monotonic)
    _ends: dict[str, CandidateResult] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """Wall clock since the beginning [s]."""
        return time.monotonic() - self.started

    def recall(self, candidate: Candidate) -> CandidateResult | None:
        """Return the known result of a run, if any."""
        return self._ends.get(candidate.spec.digest)

    def remember(self, candidate: Candidate, result: CandidateResult) -> None:
        """Remember the result of a run."""
        self._ends[candidate.spec.digest] = result

    def judge_all(self, candidate: Candidate) -> tuple[CandidateResult, ...]:
        """Execute one run and return its results by each of its oracles."""
        if self.runs >= self.budget:
            raise BudgetSpentError
        self.runs += 1
        (endings,) = self._endings([candidate])
        return endings

    def results(self, candidates: Sequence[Candidate | None]) -> list[CandidateResult | None]:
        """Return the result of each run, after executing new ones; ``None`` stands for no run."""
        runs = [candidate for candidate in candidates if candidate is not None]
        for start in range(0, len(runs), SLOTS):
            self._execute(runs[start : start + SLOTS])
        return [None if one is None else self._ends[one.spec.digest] for one in candidates]

    def first_failing(self, candidates: Sequence[Candidate | None]) -> int | None:
        """Return the index of the first failing candidate; a ``None`` among them is not run.

        Candidates are executed in order, :data:`SLOTS` at a time, up to the batch of the first
        failing one. Raises :class:`BudgetSpentError` if the budget does not suffice.
        """
        for start in range(0, len(candidates), SLOTS):
            for index, end in enumerate(self.results(candidates[start : start + SLOTS]), start):
                if end is not None and end.word == "fail":
                    return index
        return None

    def _execute(self, candidates: Sequence[Candidate]) -> None:
        new = {c.spec.digest: c for c in candidates if c.spec.digest not in self._ends}
        self.cached += len(candidates) - len(new)
        # Run a whole batch or none: with half of one the answer would depend on the budget.
        if self.runs + len(new) > self.budget:
            raise BudgetSpentError
        if new:
            endings = self._endings(list(new.values()))
            self._ends |= {digest: one for digest, (one,) in zip(new, endings, strict=True)}
            self.runs += len(new)
        if self.watch is not None:
            self.watch(self)

    def _endings(self, candidates: Sequence[Candidate]) -> list[tuple[CandidateResult, ...]]:
        return (self.executor or execute_candidates)(candidates)


def execute_candidates(
    candidates: Sequence[Candidate], execute_run: ExecuteRun = execute
) -> list[tuple[CandidateResult, ...]]:
    """Execute runs at the same time, each in a child, and judge each by its oracles.

    A process that dies, is killed or takes too long leaves its run unresolved.
    """
    with tempfile.TemporaryDirectory(prefix="scenario-blame-") as folder:
        runs = [(one.spec, one.scene) for one in candidates]
        ended = run_in_children(runs, Path(folder), execute_run=execute_run)
    return [
        unresolved_candidate(candidate, one.problem)
        if one.result is None
        else tuple(judge_verdict(verdict, one.result.ended) for verdict in one.result.verdicts)
        for candidate, one in zip(candidates, ended, strict=True)
    ]


def unresolved_candidate(candidate: Candidate, note: str) -> tuple[CandidateResult, ...]:
    """Return the unresolved results of a run by each of its oracles; ``note`` says why."""
    evidence = Evidence(note=note)
    verdicts = (
        Verdict(oracle.name, oracle.text, Outcome.ERROR, None, None, "", evidence)
        for oracle in candidate.spec.oracles
    )
    return tuple(CandidateResult("unresolved", verdict) for verdict in verdicts)


def judge_verdict(verdict: Verdict, ended: str) -> CandidateResult:
    """Return the result of a run by one oracle; an untrustworthy run is unresolved.

    So is a crash of the system under test, which is another failure than the one to explain.
    """
    words: dict[Outcome, TestOutcome] = {Outcome.PASS: "pass", Outcome.FAIL: "fail"}
    word = "unresolved" if ended == "crashed" else words.get(verdict.outcome, "unresolved")
    return CandidateResult(word, verdict)
