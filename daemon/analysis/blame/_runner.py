"""Execution of candidates: a few at a time, each once, within a budget."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, TypeAlias

from daemon.analysis.blame._case import Candidate
from daemon.analysis.child_runs import ExecuteRun, run_in_children
from daemon.model.verdicts import Evidence, Outcome, Verdict
from daemon.run import execute

SLOTS: Final = 2
"""Candidates that run at the same time. The answer depends on this number, so it must be the same
on every machine, for any number of cores."""


class BudgetSpentError(Exception):
    """The search needs another run, and the budget is spent."""


RunnerWatch: TypeAlias = Callable[["CandidateRunner"], None]
CandidateExecutor: TypeAlias = Callable[[Sequence[Candidate]], list[tuple[Verdict, ...]]]
"""Executes a batch of candidates; returns the verdicts on each by its oracles, in order."""


@dataclass(slots=True)
class CandidateRunner:
    """Executes runs and remembers the verdicts on them by their digests.

    ``runs`` counts executed runs, ``cached`` those with a known result. ``watch`` is called after
    each batch. The default ``executor`` is :func:`execute_candidates`, with a process for each run.
    """

    budget: int
    watch: RunnerWatch | None = None
    executor: CandidateExecutor | None = None
    runs: int = 0
    cached: int = 0
    started: float = field(default_factory=time.monotonic)
    _verdicts: dict[str, tuple[Verdict, ...]] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """Wall clock since the beginning [s]."""
        return time.monotonic() - self.started

    def recall(self, candidate: Candidate) -> Verdict | None:
        """Return the known verdict on a run, if any."""
        return self._verdicts.get(candidate.spec.digest, (None,))[0]

    def remember(self, candidate: Candidate, verdict: Verdict) -> None:
        """Remember the verdict on a run with one oracle."""
        self._verdicts[candidate.spec.digest] = (verdict,)

    def verdicts(self, candidate: Candidate) -> tuple[Verdict, ...]:
        """Return the verdicts on a run by all of its oracles, after executing it."""
        self._execute([candidate])
        return self._verdicts[candidate.spec.digest]

    def results(self, candidates: Sequence[Candidate | None]) -> list[Verdict | None]:
        """Return the verdict on each run, after executing new ones; ``None`` stands for no run."""
        runs = [candidate for candidate in candidates if candidate is not None]
        for start in range(0, len(runs), SLOTS):
            self._execute(runs[start : start + SLOTS])
        return [None if one is None else self.recall(one) for one in candidates]

    def first_failing(self, candidates: Sequence[Candidate | None]) -> int | None:
        """Return the index of the first failing candidate; a ``None`` among them is not run.

        Candidates are executed in order, :data:`SLOTS` at a time, up to the batch of the first
        failing one. Raises :class:`BudgetSpentError` if the budget does not suffice.
        """
        for start in range(0, len(candidates), SLOTS):
            for index, end in enumerate(self.results(candidates[start : start + SLOTS]), start):
                if end is not None and end.outcome is Outcome.FAIL:
                    return index
        return None

    def _execute(self, candidates: Sequence[Candidate]) -> None:
        new = {c.spec.digest: c for c in candidates if c.spec.digest not in self._verdicts}
        self.cached += len(candidates) - len(new)
        # Run a whole batch or none: with half of one the answer would depend on the budget.
        if self.runs + len(new) > self.budget:
            raise BudgetSpentError
        if new:
            verdicts = (self.executor or execute_candidates)(list(new.values()))
            self._verdicts |= dict(zip(new, verdicts, strict=True))
            self.runs += len(new)
        if self.watch is not None:
            self.watch(self)


def execute_candidates(
    candidates: Sequence[Candidate], execute_run: ExecuteRun = execute
) -> list[tuple[Verdict, ...]]:
    """Execute runs at the same time, each in a child, and return the verdicts on each.

    A process that dies, is killed or takes too long leaves its run unresolved.
    """
    with tempfile.TemporaryDirectory(prefix="scenario-blame-") as folder:
        runs = [(one.spec, one.scene) for one in candidates]
        ended = run_in_children(runs, Path(folder), execute_run=execute_run)
    return [
        candidate_verdicts(candidate, one.result.verdicts, one.result.ended)
        if one.result is not None
        else candidate_verdicts(candidate, (), note=one.problem)
        for candidate, one in zip(candidates, ended, strict=True)
    ]


def candidate_verdicts(
    candidate: Candidate, verdicts: Sequence[Verdict], ended: str = "", note: str = ""
) -> tuple[Verdict, ...]:
    """Return the verdicts on a run, errors without one of each oracle; ``note`` says why.

    After a crash of the system under test, which is another failure than the one to explain, all
    are errors too.
    """
    oracles = candidate.spec.oracles
    if len(verdicts) != len(oracles):
        evidence = Evidence(note=note)
        return tuple(
            Verdict(oracle.name, oracle.text, Outcome.ERROR, None, None, "", evidence)
            for oracle in oracles
        )
    if ended == "crashed":
        return tuple(replace(verdict, outcome=Outcome.ERROR) for verdict in verdicts)
    return tuple(verdicts)
