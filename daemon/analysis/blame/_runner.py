"""Executing candidates: a few at a time, each once, within a budget."""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from multiprocessing.context import ForkProcess
from pathlib import Path
from typing import Final, TypeAlias

from daemon.analysis.blame._case import Candidate
from daemon.analysis.blame._elements import TestOutcome
from daemon.analysis.forked_child import prepare_child
from daemon.model.execution import RunLimits
from daemon.model.spec import RunResult
from daemon.model.verdicts import Evidence, Outcome, Verdict
from daemon.run import execute, load_kernels
from daemon.supervision.guardian import end_guarded
from grammars.text import codec
from grammars.text.files import write_atomically

SLOTS: Final = 2
"""Candidates that run at the same time; what is found depends on it, not on who is faster.

So it is no number of cores: the same question has the same answer on every machine."""


class BudgetSpentError(Exception):
    """Another run was needed and none is left."""


@dataclass(frozen=True, slots=True)
class CandidateResult:
    """End of a candidate by the oracle in question."""

    word: TestOutcome
    verdict: Verdict


RunnerWatch: TypeAlias = Callable[["CandidateRunner"], None]
CandidateExecutor: TypeAlias = Callable[[Sequence[Candidate]], list[tuple[CandidateResult, ...]]]
"""Executes a batch of candidates; returns how each ended by each of its oracles, in order."""


@dataclass(slots=True)
class CandidateRunner:
    """Has runs executed and remembers how they ended, by their digests.

    ``runs`` counts what was executed, ``cached`` what was known already. ``watch`` is called
    after each batch. Without an ``executor`` runs are executed here, in processes of their own
    (:func:`execute_candidates`).
    """

    budget: int
    watch: RunnerWatch | None = None
    executor: CandidateExecutor | None = None
    runs: int = 0
    cached: int = 0
    started: float = field(default_factory=time.monotonic)
    _known: dict[str, CandidateResult] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """Wall clock since the beginning [s]."""
        return time.monotonic() - self.started

    def known(self, candidate: Candidate) -> CandidateResult | None:
        """Return how a run ended that was executed before."""
        return self._known.get(candidate.spec.digest)

    def remember(self, candidate: Candidate, ended: CandidateResult) -> None:
        """Take it as known how a run ends."""
        self._known[candidate.spec.digest] = ended

    def judge_all(self, candidate: Candidate) -> tuple[CandidateResult, ...]:
        """Execute one run and return how it ended by each of its oracles."""
        if self.runs >= self.budget:
            raise BudgetSpentError
        self.runs += 1
        (endings,) = self._endings([candidate])
        return endings

    def results(self, candidates: Sequence[Candidate | None]) -> list[CandidateResult | None]:
        """Return how each ends, executing what is not known yet; ``None`` cannot be run."""
        runs = [candidate for candidate in candidates if candidate is not None]
        for start in range(0, len(runs), SLOTS):
            self._execute(runs[start : start + SLOTS])
        return [None if one is None else self._known[one.spec.digest] for one in candidates]

    def first_failing(self, candidates: Sequence[Candidate | None]) -> int | None:
        """Return the index of the first candidate that fails; ``None`` in it cannot be run.

        Candidates are executed in order, :data:`SLOTS` at a time, up to the batch of the first
        one that fails. Raises :class:`BudgetSpentError` when the budget does not last so far.
        """
        for start in range(0, len(candidates), SLOTS):
            batch = candidates[start : start + SLOTS]
            self._execute([candidate for candidate in batch if candidate is not None])
            for index, candidate in enumerate(batch, start):
                if candidate is not None and self._known[candidate.spec.digest].word == "fail":
                    return index
        return None

    def _execute(self, candidates: Sequence[Candidate]) -> None:
        new = {c.spec.digest: c for c in candidates if c.spec.digest not in self._known}
        self.cached += len(candidates) - len(new)
        # A whole batch or none: half of one would make the answer depend on the budget.
        if self.runs + len(new) > self.budget:
            raise BudgetSpentError
        if new:
            endings = self._endings(list(new.values()))
            self._known |= {digest: one for digest, (one,) in zip(new, endings, strict=True)}
            self.runs += len(new)
        if self.watch is not None:
            self.watch(self)

    def _endings(self, candidates: Sequence[Candidate]) -> list[tuple[CandidateResult, ...]]:
        return (self.executor or execute_candidates)(candidates)


def execute_candidates(
    candidates: Sequence[Candidate], execute_run: Callable[..., RunResult] = execute
) -> list[tuple[CandidateResult, ...]]:
    """Execute runs at the same time, each in a forked process, and judge each by its oracles.

    A process that dies, is killed or takes too long leaves its run unresolved. Whatever is
    raised here, Ctrl-C included, no process survives it, and none that a run has started.
    """
    return [
        judge_candidate(candidate, result)
        for candidate, result in zip(candidates, run_forked(candidates, execute_run), strict=True)
    ]


def run_forked(
    candidates: Sequence[Candidate], execute_run: Callable[..., RunResult] = execute
) -> list[RunResult | None]:
    """Execute runs at the same time, each in a forked process.

    Of a process that does not end well there is no result. Whatever is raised here, no process
    survives it.
    """
    # Forked from here and not from a worker's zygote: this process is warm already, has no
    # Zenoh session, and the candidate need not be written to a file and read again.
    for candidate in candidates:
        load_kernels(candidate.spec, candidate.scene)
    with tempfile.TemporaryDirectory(prefix="scenario-blame-") as parent:
        folders = [Path(parent) / str(index) for index in range(len(candidates))]
        context = multiprocessing.get_context("fork")
        processes = [
            context.Process(target=_run_candidate, args=(one, folder, execute_run), daemon=True)
            for one, folder in zip(candidates, folders, strict=True)
        ]
        try:
            for process in processes:
                process.start()
            _await(processes, max(RunLimits().wall_of(c.spec.limit) for c in candidates))
        finally:
            for process in processes:
                if process.pid is not None:
                    end_guarded(process)
        return [_read_result(folder) for folder in folders]


def _await(processes: Sequence[ForkProcess], seconds: float) -> None:
    end = time.monotonic() + seconds
    waiting = {process.sentinel for process in processes}
    while waiting and (left := end - time.monotonic()) > 0.0:
        waiting -= set(wait(list(waiting), left))


def _run_candidate(
    candidate: Candidate, folder: Path, execute_run: Callable[..., RunResult]
) -> None:
    prepare_child()
    folder.mkdir()
    result = execute_run(candidate.spec, candidate.scene, trace_path=folder / "trace.mcap")
    write_atomically(folder / "result.json", codec.to_json(result))


def _read_result(folder: Path) -> RunResult | None:
    file = folder / "result.json"
    return codec.from_json(RunResult, file.read_bytes()) if file.is_file() else None


def judge_candidate(candidate: Candidate, result: RunResult | None) -> tuple[CandidateResult, ...]:
    """Return how a run ended by each of its oracles; without a result, nobody knows."""
    if result is None:
        return unresolved_candidate(candidate, "its process did not end well")
    return tuple(judge_verdict(verdict, result.ended) for verdict in result.verdicts)


def unresolved_candidate(candidate: Candidate, note: str) -> tuple[CandidateResult, ...]:
    """Return what there is to say of a run without a result: ``note``."""
    evidence = Evidence(note=note)
    return tuple(
        CandidateResult(
            "unresolved", Verdict(o.name, o.text, Outcome.ERROR, None, None, "", evidence)
        )
        for o in candidate.spec.oracles
    )


def judge_verdict(verdict: Verdict, ended: str) -> CandidateResult:
    """Return how a run ended by one oracle; a run that cannot be trusted is unresolved.

    A crash of the system under test is one too: another failure than the one that is looked for.
    """
    trusted = ended != "crashed" and verdict.outcome in (Outcome.PASS, Outcome.FAIL)
    if not trusted:
        return CandidateResult("unresolved", verdict)
    return CandidateResult("fail" if verdict.outcome is Outcome.FAIL else "pass", verdict)
