"""What people see of what they hand in: campaigns, runs, workers and the disk.

Everything is JSON made and validated by :mod:`grammars.text.codec`. Times named ``..._at`` are wall
clock seconds since the epoch: they inform people and leases, never a run. Fields added since the
first version have defaults, so that what was written before can still be read.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from daemon.model.proposals import Proposal
from daemon.model.run_state import UNFINISHED_STATES, RunState
from daemon.model.spec import LeadingMargin, RunResult, RunSpec, Snapshot
from daemon.model.verdicts import Outcome, Verdict, join_notes

NONDETERMINISTIC: Final = "nondeterministic"
"""The state of an alarm among the events, and a word of the run's ``reason``, to look for it by."""


class TroubleCause(StrEnum):
    """The cause of a trouble, by which there is something to do about it.

    ``space``: the disk is full, or the quota is used up. ``worker``: a worker's surroundings.
    ``input``: a scene or file is gone. ``other``: only the logs can tell.
    """

    SPACE = "space"
    WORKER = "worker"
    INPUT = "input"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Trouble:
    """Something that keeps runs or workers from going on, in words, and its cause."""

    words: str
    cause: TroubleCause


@dataclass(frozen=True, slots=True)
class SubmissionReceipt:
    """Answer to a submission, sent after the ledger has committed it.

    ``cached`` runs had a result already, which is used again.
    """

    campaign: str
    runs: int
    known: bool
    cached: int = 0


@dataclass(frozen=True, slots=True)
class HandedOver:
    """The answer of the daemon to a campaign, and where it listens."""

    receipt: SubmissionReceipt
    endpoint: str


@dataclass(frozen=True, slots=True)
class RunCounts:
    """How runs stand: how many are in each state, and how many gave each outcome."""

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
    """A campaign and how its runs stand; ``cached`` counts results taken from earlier campaigns.

    While it is ``paused`` no more runs start; those of higher ``priority`` start first. ``search``
    says how a search stands (``running``, ``waiting`` for a client, ``finished``, ``cancelled``,
    ``failed``) and is empty for all other campaigns. More runs come while it is running.
    ``seconds_left`` is how long what waits and runs probably takes, ``None`` while that is not
    known or nothing goes on. With ``acknowledged`` somebody knows what went wrong in it, and there
    is no news since: no run has settled badly, and none is executed again.
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
        """How many runs have come to their end, those that were given up included.

        Cancelled ones never came to it.
        """
        return self.total - self.queued - self.running - self.cancelled

    @property
    def finished(self) -> bool:
        """Whether no run of the campaign is waiting or running, and none will come."""
        return self.queued == self.running == 0 and self.search not in ("running", "waiting")


@dataclass(frozen=True, slots=True)
class DeletedCampaign:
    """What goes with a campaign: its runs, and traces of so many ``bytes`` here."""

    campaign: str
    runs: int
    traces: int
    bytes: int


@dataclass(frozen=True, slots=True)
class Deletion:
    """Campaigns that are gone, or would be (``dry_run``)."""

    dry_run: bool
    campaigns: tuple[DeletedCampaign, ...]


@dataclass(frozen=True, slots=True)
class RunRow:
    """One run as a list shows it.

    ``oracle`` and ``margin`` name the oracle that decides the outcome (the first failing one,
    else the one with the smallest margin) and its margin in ``unit``. ``trace`` is the path of
    the trace on the machine that keeps it, empty while there is none. ``cached`` is the earlier
    run whose result this is, empty when it was executed itself. Of a system that is not
    ``repeatable`` the same run gives something else each time. ``reason`` says why a queued run
    was given back, and why one was lost or cancelled. A ``nondeterministic`` one came out
    differently when the same was executed before; ``reason`` says how. ``digest`` is that of its
    specification; ``seed`` tells whether runs of two campaigns can be paired. Where results were
    asked for, ``result`` is that of a run that has one, ``proposal`` that of a run of a search.
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
        """Whether nothing more comes of it: it has a result, or none ever will."""
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
        """Why it ended, as in :class:`daemon.model.spec.RunResult`; empty without a result."""
        return self.result.ended if self.result is not None else ""

    @property
    def note(self) -> str:
        """Everything there is to say of it: by its result, and by the ledger."""
        return join_notes(self.result.note if self.result is not None else "", self.reason)

    def verdict(self, oracle: str) -> Verdict | None:
        """Return the verdict of an oracle, ``None`` when it did not judge this run."""
        return next((v for v in self.verdicts if v.oracle == oracle), None)


@dataclass(frozen=True, slots=True)
class RunPage:
    """A page of run rows; ``total`` counts all rows the filter admits."""

    rows: tuple[RunRow, ...]
    total: int


@dataclass(frozen=True, slots=True)
class RunDetail:
    """Everything the daemon knows about one run, its result included."""

    row: RunRow
    spec: RunSpec


class PreparationPhase(StrEnum):
    """Something that a worker does before runs can start there.

    ``starting``: the worker itself is not there yet. ``compiling``: it compiles kernels, or waits
    for another process that does.
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
                return f"compiling kernels, once on this machine: {self.done} so far"


@dataclass(frozen=True, slots=True)
class WorkerRow:
    """A worker the daemon knows: ``busy`` of ``slots`` are running something.

    One that is ``away`` has lost its connection or is silent; what it runs is still its own.
    ``trouble`` says what keeps it from working, and is empty when nothing does; ``preparation`` is
    what it does before runs can start there. It and its children use ``cpu`` of the machine's
    processors, from 0 to 1, and ``memory`` of its ``memory_total`` bytes. Pages that several share
    count once. ``runs`` are the ids of those it executes.
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
        """The preparation in words, empty when there is none."""
        return self.preparation.words if self.preparation else ""


@dataclass(frozen=True, slots=True)
class DiskUsage:
    """The file system of the state directory and what the ledger takes of it, in bytes.

    ``traces`` take at most ``quota`` of it, if that is not 0.
    """

    total: int
    free: int
    ledger: int
    traces: int = 0
    quota: int = 0


@dataclass(frozen=True, slots=True)
class DaemonOverview(RunCounts):
    """The line that answers "is it fine?"; ``rate`` is runs finished per minute lately,
    ``seconds_left`` how long what waits and runs probably takes, ``None`` while nobody knows.

    ``searched`` are failures of runs of searches, which look for them: ``failed`` has those of all
    others. ``troubles`` are all there are, also those of single workers and of inputs that runs
    wait for. While it is ``halted`` no run can start, as the first of them says: the daemon's own
    worker broke, the disk is full, every worker is in trouble.
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
        """The preparation in words, empty when there is none."""
        return self.preparation.words if self.preparation else ""

    @property
    def trouble(self) -> str:
        """Why no run can start, empty when some can."""
        return self.troubles[0].words if self.halted else ""


@dataclass(frozen=True, slots=True)
class ChangeEvent:
    """Something changed: ``seq`` grows by one each; a gap means: ask for the whole again.

    ``kind``: ``campaign`` (submitted, paused, resumed, prioritised, acknowledged, cancelled,
    retried, finished, deleted), ``run`` (state changed), ``worker`` (came, gone), ``alarm``
    (another attempt of the run gave another result), ``lease`` (superseded: an attempt of the run
    is not needed any more, another one was first), ``search`` (there is more to say of it;
    ``state`` is its phase).
    ``id`` names it.
    """

    seq: int
    kind: str
    id: str
    campaign: str = ""
    state: str = ""


@dataclass(frozen=True, slots=True)
class LiveSnapshot:
    """A running run's snapshot, published while it runs (telemetry: may be lost)."""

    run: str
    snapshot: Snapshot
