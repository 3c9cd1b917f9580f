"""Status records for people: campaigns, runs, workers and the disk.

All are JSON made and validated by :mod:`grammars.text.codec`. Times named ``..._at`` are wall
clock seconds since the epoch: they inform people and leases, never a run. Fields added since the
first version have defaults, so that older data can still be read.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from daemon.model.search import Proposal
from daemon.model.spec import LeadingMargin, RunResult, RunSpec, Snapshot
from daemon.model.verdicts import UNFINISHED_STATES, Outcome, RunState, Verdict, join_notes

NONDETERMINISTIC: Final = "nondeterministic"
"""State of an alarm among the events, and a searchable word of the run's ``reason``."""


class TroubleCause(StrEnum):
    """Cause of a trouble, which decides the remedy.

    ``space``: the disk is full, or the quota is used up. ``worker``: a worker's environment.
    ``input``: a scene or file is missing. ``other``: see the logs.
    """

    SPACE = "space"
    WORKER = "worker"
    INPUT = "input"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Trouble:
    """A problem that blocks runs or workers, in words, and its cause."""

    words: str
    cause: TroubleCause


@dataclass(frozen=True, slots=True)
class SubmissionReceipt:
    """Answer to a submission, sent after the ledger has committed it.

    ``cached`` runs had a result already, which is reused.
    """

    campaign: str
    runs: int
    known: bool
    cached: int = 0


@dataclass(frozen=True, slots=True)
class HandedOver:
    """Answer of the daemon to a campaign, and its endpoint."""

    receipt: SubmissionReceipt
    endpoint: str


@dataclass(frozen=True, slots=True)
class RunCounts:
    """Numbers of runs in each state and with each outcome."""

    queued: int
    running: int
    done: int
    lost: int
    cancelled: int
    passed: int
    failed: int
    inconclusive: int
    errors: int


_COUNTED: Final = {
    "pass": "passed", "fail": "failed", "inconclusive": "inconclusive", "error": "errors",
}  # fmt: skip
"""The names of counts by outcomes."""


def count_runs(tallied: Iterable[tuple[str, str, int]]) -> dict[str, Any]:
    """Return the fields of :class:`RunCounts` from states, outcomes and numbers of runs."""
    counts = dict.fromkeys((*map(str, RunState), *_COUNTED.values()), 0)
    for state, outcome, runs in tallied:
        for name in (state, _COUNTED[outcome] if state == RunState.DONE and outcome else ""):
            if name in counts:  # repeats in reserve count nowhere
                counts[name] += runs
    return counts


@dataclass(frozen=True, slots=True)
class CampaignRow(RunCounts):
    """A campaign and the counts of its runs; ``cached`` counts results of earlier campaigns.

    A ``paused`` campaign starts no more runs; higher ``priority`` starts first. ``search`` is the
    state of a search (``running``, ``waiting`` for a client, ``finished``, ``cancelled``,
    ``failed``), empty for all other campaigns; a running search adds runs. ``seconds_left`` is the
    expected time of waiting and running runs, ``None`` if unknown or idle. ``acknowledged``: a
    person has seen the bad runs, and there were no new ones and no retries since.
    """

    id: str
    name: str
    about: str
    submitted_at: float
    finished_at: float | None
    total: int
    cached: int = 0
    paused: bool = False
    priority: int = 0
    search: str = ""
    seconds_left: float | None = None
    acknowledged: bool = False

    @property
    def ended(self) -> int:
        """Number of ended runs, including lost ones, without cancelled ones."""
        return self.total - self.queued - self.running - self.cancelled

    @property
    def finished(self) -> bool:
        """True if no run is waiting or running, and none will be added."""
        return self.queued == self.running == 0 and self.search not in ("running", "waiting")


@dataclass(frozen=True, slots=True)
class DeletedCampaign:
    """A deleted campaign: numbers of its runs and traces, and the ``bytes`` of the traces here."""

    campaign: str
    runs: int
    traces: int
    bytes: int


@dataclass(frozen=True, slots=True)
class Deletion:
    """Deleted campaigns, or with ``dry_run`` those that would be deleted."""

    dry_run: bool
    campaigns: tuple[DeletedCampaign, ...]


@dataclass(frozen=True, slots=True)
class RunRow:
    """Row of a run in a list.

    ``oracle`` decides the outcome (the first failing one, otherwise the one with the smallest
    margin); ``margin`` in ``unit`` is its margin. ``trace`` is the path of the trace on the machine
    that keeps it, empty without one. ``cached`` is the earlier run whose result is reused, empty
    for an executed run. A system that is not ``repeatable`` gives another result each time.
    ``reason`` explains why a run was returned, lost or cancelled. ``nondeterministic``: an earlier
    execution gave another result; ``reason`` has the difference. ``digest`` is that of its
    specification. Runs of two campaigns with equal ``seed`` can be paired. On request ``result`` is
    the result, if any, and ``proposal`` that of a run of a search.
    """

    id: str
    campaign: str
    index: int
    scenario: str
    sut: str
    repeat: int
    state: RunState
    attempt: int = 0
    worker: str = ""
    outcome: Outcome | None = None
    oracle: str = ""
    margin: float | None = None
    unit: str = ""
    simulated: float = 0.0
    limit: float = 0.0
    wall: float = 0.0
    trace: str = ""
    reason: str = ""
    cached: str = ""
    repeatable: bool = True
    nondeterministic: bool = False
    digest: str = ""
    seed: int = 0
    result: RunResult | None = None
    proposal: Proposal | None = None

    @property
    def label(self) -> str:
        """A short name for people: ``S1/pilot/3``."""
        return f"{self.scenario}/{self.sut}/{self.repeat}"

    @property
    def settled(self) -> bool:
        """True if it has a result or never will."""
        return self.state not in UNFINISHED_STATES

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """The verdicts of its result, empty without one."""
        return self.result.verdicts if self.result is not None else ()

    @property
    def leads(self) -> tuple[LeadingMargin, ...]:
        """The leading margins of its result, empty without one."""
        return self.result.leads if self.result is not None else ()

    @property
    def ended(self) -> str:
        """Its end as in :class:`daemon.model.spec.RunResult`; empty without a result."""
        return self.result.ended if self.result is not None else ""

    @property
    def note(self) -> str:
        """The notes of its result and of the ledger."""
        return join_notes(self.result.note if self.result is not None else "", self.reason)

    def verdict(self, oracle: str) -> Verdict | None:
        """Return the verdict of an oracle, ``None`` if it did not judge this run."""
        return next((v for v in self.verdicts if v.oracle == oracle), None)


@dataclass(frozen=True, slots=True)
class RunPage:
    """A page of run rows; ``total`` counts all rows that match the filter."""

    rows: tuple[RunRow, ...]
    total: int


@dataclass(frozen=True, slots=True)
class RunDetail:
    """All data of the daemon about one run, including its result."""

    row: RunRow
    spec: RunSpec


class PreparationPhase(StrEnum):
    """Activity of a worker before its runs can start.

    ``starting``: the worker itself is starting. ``compiling``: it compiles kernels, or waits for
    another process that does.
    """

    STARTING = "starting"
    COMPILING = "compiling"


@dataclass(frozen=True, slots=True)
class Preparation:
    """The preparation of a worker for runs; it has compiled ``done`` kernels so far."""

    phase: PreparationPhase
    done: int = 0

    @property
    def words(self) -> str:
        """The preparation in words for people."""
        match self.phase:
            case PreparationPhase.STARTING:
                return "starting the worker on this machine: loading the simulator"
            case PreparationPhase.COMPILING:
                so_far = f": {self.done} so far" if self.done else ""
                return f"compiling kernels, once on this machine{so_far}"


@dataclass(frozen=True, slots=True)
class WorkerRow:
    """A worker of the daemon: ``busy`` of its ``slots`` execute a run.

    One that is ``away`` has lost its connection or is silent, but keeps its runs. ``trouble`` is
    the reason why it cannot work, if any; ``preparation`` its activity before runs can start. It
    and its children use ``cpu`` of the machine's processors, from 0 to 1, and ``memory`` of its
    ``memory_total`` bytes; shared pages count once. ``runs`` are the ids of its runs.
    """

    id: str
    host: str
    pid: int
    version: str
    slots: int
    busy: int
    connected_at: float
    last_seen_at: float
    away: bool = False
    trouble: str = ""
    preparation: Preparation | None = None
    cpu: float = 0.0
    memory: int = 0
    memory_total: int = 0
    runs: tuple[str, ...] = ()

    @property
    def preparing(self) -> str:
        """The preparation in words, empty without one."""
        return self.preparation.words if self.preparation else ""


@dataclass(frozen=True, slots=True)
class DiskUsage:
    """Sizes of the state directory's file system, the ledger and the traces [B].

    ``quota`` limits ``traces``, if it is not 0.
    """

    total: int
    free: int
    ledger: int
    traces: int = 0
    quota: int = 0


@dataclass(frozen=True, slots=True)
class DaemonOverview(RunCounts):
    """Overview of a daemon; ``rate`` is the recent number of runs finished per minute,
    ``seconds_left`` the expected time of waiting and running runs, ``None`` if unknown.

    ``searched`` counts failures in searches, which look for them; ``failed`` counts all others.
    ``troubles`` has all troubles, including those of single workers and of missing inputs. While
    ``halted`` no run can start, for the first of these: the daemon's own worker broke, the disk is
    full, or every worker is in trouble.
    """

    version: str
    state: str
    started_at: float
    now: float
    campaigns: int
    workers: int
    rate: float
    seconds_left: float | None
    searched: int = 0
    halted: bool = False
    troubles: tuple[Trouble, ...] = ()
    preparation: Preparation | None = None

    @property
    def preparing(self) -> str:
        """The preparation in words, empty without one."""
        return self.preparation.words if self.preparation else ""

    @property
    def trouble(self) -> str:
        """The reason why no run can start, empty if runs can."""
        return self.troubles[0].words if self.halted else ""


@dataclass(frozen=True, slots=True)
class ChangeEvent:
    """A change. ``seq`` grows by one each; after a gap, query everything again.

    ``kind``: ``campaign`` (submitted, paused, resumed, prioritised, acknowledged, cancelled,
    retried, finished, deleted), ``run`` (state changed), ``worker`` (came, gone), ``alarm``
    (another attempt of the run gave another result), ``lease`` (superseded: another attempt of the
    run was first), ``search`` (progress; ``state`` is its phase). ``id`` names the subject.
    """

    seq: int
    kind: str
    id: str
    campaign: str = ""
    state: str = ""


@dataclass(frozen=True, slots=True)
class LiveSnapshot:
    """A snapshot of a running run (telemetry: may be lost)."""

    run: str
    snapshot: Snapshot
