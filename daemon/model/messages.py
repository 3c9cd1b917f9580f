"""Requests and answers of the bus that people never see: questions, leases, completions.

The values people see are in :mod:`daemon.model.status`, what can be asked in
:mod:`daemon.model.verbs`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Final

from pydantic import Base64Bytes, Field

from daemon.model.ranges import IdText, NonNegativeInt, Seconds, ShortText
from daemon.model.spec import ENGINE_VERSION, LARGEST_TRACE, RunResult, RunSpec
from daemon.model.status import Preparation

PROTOCOL: Final = 3
"""Raise it when a message changes so that others do not understand it any more."""
PREFIX: Final = "scenario/v1"
"""Of every key on the bus; another one would be for messages that this version cannot read."""
ASK: Final = f"{PREFIX}/ask"
"""Questions are asked at ``ASK/<name>/<verb>``, under the name of the requester's key."""
EVENTS: Final = f"{PREFIX}/event"
LIVE: Final = f"{PREFIX}/live"
"""Snapshots are published at ``LIVE/<name>/<worker>``, those of one run below that."""
JUDGED: Final = "judged"
"""What a running run is judged by now is published at ``LIVE/<name>/<worker>/<run>/judged``."""
ALIVE: Final = f"{PREFIX}/alive"
"""Workers are alive at ``ALIVE/<name>/<worker>``."""
OWNER: Final = "owner"
"""The name in keys of who has no key: the daemon's owner, and everybody over plain TCP."""
WORK: Final = f"{PREFIX}/work"
"""Published without content when runs become available or unwanted: a hint, workers also poll."""

LARGEST_SUBMISSION: Final = 64 * 2**20
"""Bytes; a hundred thousand runs of a whole building are a few MiB packed."""
LARGEST_REQUEST: Final = 4 * 2**20
LARGEST_EXTENSION: Final = 16 * 2**20
"""Bytes of runs added to a search, or of its answer; a scene of a whole building is a few MiB."""
LARGEST_PAGE: Final = 1000
LARGEST_PAGE_BYTES: Final = 4 * 2**20
"""Of what runs have that may be long, results and reasons: a page of them ends there."""
PART: Final = 256 * 2**10
"""Bytes of a file that travel at a time."""
HIGHEST_PRIORITY: Final = 1000
LONGEST_TROUBLE: Final = 2000
"""Characters."""
MOST_PROGRESS: Final = 512
"""Runs whose progress a worker tells: enough to know their speed."""

WorkerId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,99}$")]
Sha256Text = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
FileBytes = Annotated[Base64Bytes, Field(max_length=PART)]


class Rejection(StrEnum):
    """The reasons for which a result is never taken, however often it is delivered.

    These alone let a worker discard a finished run. Every other answer, and no answer, means that
    the worker keeps the run and delivers it later. ``unknown-run``: the run was deleted.
    ``unknown-lease``: the run was never leased under that token. ``other-specification``: the
    result is of another run. ``damaged``: result and trace do not fit together. ``too-large``: the
    result exceeds its limit.
    """

    UNKNOWN_RUN = "unknown-run"
    UNKNOWN_LEASE = "unknown-lease"
    OTHER_SPECIFICATION = "other-specification"
    DAMAGED = "damaged"
    TOO_LARGE = "too-large"


class ErrorKind(StrEnum):
    """What an error reply is about.

    ``refused``: the request is no good. ``unavailable``: the daemon cannot just now.
    ``failed``: an error of the daemon's own kept it from doing what was asked. ``other-ledger``:
    the request belongs to another ledger than the daemon's.
    """

    REFUSED = "refused"
    UNAVAILABLE = "unavailable"
    FAILED = "failed"
    OTHER_LEDGER = "other-ledger"


@dataclass(frozen=True, slots=True)
class ErrorReply:
    """An error reply: a problem in words, and what it is about.

    A ``rejection`` is in the reply to a result that is never taken.
    """

    problem: str
    kind: ErrorKind = ErrorKind.REFUSED
    rejection: Rejection | None = None


@dataclass(frozen=True, slots=True)
class Empty:
    """A request or an answer without content."""


@dataclass(frozen=True, slots=True)
class IdRequest:
    """A request about one campaign, run or scene."""

    id: IdText


@dataclass(frozen=True, slots=True)
class Count:
    """An answer that counts something."""

    count: int


@dataclass(frozen=True, slots=True)
class CampaignQuery:
    """A page of campaigns, the newest first; empty strings filter nothing.

    ``beginning`` is that of the id. With ``unfinished`` only those of which runs wait or run.
    """

    id: IdText = ""
    name: IdText = ""
    beginning: IdText = ""
    unfinished: bool = False
    offset: NonNegativeInt = 0
    limit: Annotated[int, Field(ge=0, le=LARGEST_PAGE)] = LARGEST_PAGE


@dataclass(frozen=True, slots=True)
class DeleteRequest:
    """Remove campaigns for good, all or none; a ``dry`` one only asks what would go."""

    campaigns: Annotated[tuple[IdText, ...], Field(min_length=1, max_length=100)]
    dry: bool = False


@dataclass(frozen=True, slots=True)
class RunQuery:
    """A page of runs: empty strings filter nothing; ``sort`` names a column of the row.

    With ``results`` the rows have theirs, and their proposals.
    """

    campaign: IdText = ""
    state: ShortText = ""
    outcome: ShortText = ""
    text: ShortText = ""
    sort: ShortText = "index"
    descending: bool = False
    offset: NonNegativeInt = 0
    limit: Annotated[int, Field(ge=0, le=LARGEST_PAGE)] = 200
    scenario: ShortText = ""
    sut: ShortText = ""
    results: bool = False


@dataclass(frozen=True, slots=True)
class RetryRequest:
    """Queue runs again: those lost, cancelled, or with one of these outcomes."""

    campaign: IdText
    only: tuple[ShortText, ...]


@dataclass(frozen=True, slots=True)
class SteerRequest:
    """Pause a campaign or go on with it, or give it another priority; ``None`` changes nothing."""

    campaign: IdText
    paused: bool | None = None
    priority: Annotated[int, Field(ge=-HIGHEST_PRIORITY, le=HIGHEST_PRIORITY)] | None = None


@dataclass(frozen=True, slots=True)
class RunProgress:
    """Progress of a run: so many ``simulated`` seconds in ``elapsed`` seconds of wall time."""

    run: IdText
    simulated: Seconds
    elapsed: Seconds


@dataclass(frozen=True, slots=True)
class WorkerInfo:
    """Who a worker is, sent with every request so that a new daemon knows it at once.

    ``trouble`` says what keeps it from working: its disk is full, it cannot start processes;
    ``preparation`` is what it does before runs that it has leased can start. ``era`` is that of its
    :class:`WelcomeReply`, empty before. ``notice`` is something people should know although it
    works. ``cpu``, ``memory`` and ``memory_total`` are as in
    :class:`daemon.model.status.WorkerRow`. ``progress`` is that of runs that have begun.
    """

    id: WorkerId
    host: ShortText
    pid: NonNegativeInt
    version: ShortText
    slots: NonNegativeInt
    busy: NonNegativeInt
    engine: ShortText = ENGINE_VERSION
    trouble: Annotated[str, Field(max_length=LONGEST_TROUBLE)] = ""
    preparation: Preparation | None = None
    era: ShortText = ""
    notice: ShortText = ""
    cpu: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    memory: NonNegativeInt = 0
    memory_total: NonNegativeInt = 0
    progress: Annotated[tuple[RunProgress, ...], Field(max_length=MOST_PROGRESS)] = ()


@dataclass(frozen=True, slots=True)
class WelcomeReply:
    """What a worker must know before it starts: where to keep things, how often to renew.

    ``identity`` names the state directory for good. ``era`` names the time since this daemon began
    to keep its ledger: the worker that reads it in the daemon's directory shares its file system.
    The ledger knows all of its eras. So it recognises requests that belong to another ledger, or to
    a later state than the one it is a copy of.
    """

    state: str
    renew: float
    identity: str
    era: str


@dataclass(frozen=True, slots=True)
class LeaseRequest:
    """Ask for up to ``count`` runs, but none of a kind of system under test it ``lacks``."""

    worker: WorkerInfo
    count: Annotated[int, Field(ge=0, le=1024)]
    lacks: Annotated[tuple[ShortText, ...], Field(max_length=64)] = ()


@dataclass(frozen=True, slots=True)
class Lease:
    """One leased run: ``token`` fences it, ``trace`` names its trace in the state directory.

    With ``leads`` its result is to have leading margins: a search learns of them. ``era`` is that
    of the ledger in which it was granted.
    """

    run: str
    campaign: str
    attempt: int
    token: int
    trace: str
    spec: RunSpec
    leads: bool = False
    era: str = ""


@dataclass(frozen=True, slots=True)
class LeaseReply:
    """Runs to execute; ``draining`` says that none will come, the daemon is leaving.

    The field is called ``grants`` since a lease is granted: names on the bus stay as they are, so
    that daemons and workers of different days talk to each other, if only to say so.
    """

    grants: tuple[Lease, ...]
    draining: bool = False


@dataclass(frozen=True, slots=True)
class LeaseRef:
    """A lease a worker believes to hold."""

    run: IdText
    token: NonNegativeInt


@dataclass(frozen=True, slots=True)
class RenewRequest:
    """All leases a worker holds, finished but unacknowledged runs included."""

    worker: WorkerInfo
    holds: Annotated[tuple[LeaseRef, ...], Field(max_length=4096)]


@dataclass(frozen=True, slots=True)
class RenewReply:
    """Leases whose runs are not wanted any more: stop those runs.

    They have a result, are cancelled, or were never leased under the name of who asks.
    """

    gone: tuple[LeaseRef, ...]


@dataclass(frozen=True, slots=True)
class Completion:
    """A finished run; its trace has come before, under the same lease.

    ``era`` is that of the lease, here and in the other requests that come under one.
    """

    worker: WorkerId
    run: IdText
    attempt: NonNegativeInt
    token: NonNegativeInt
    result: RunResult
    era: ShortText = ""


class LedgerAnswer(StrEnum):
    """What the ledger made of a completion, a release or a renewal.

    ``recorded``: this is the result. ``known``: the same result was there. ``differs``: another
    result was there, a nondeterminism alarm. ``redundant``: another result was there of a system
    that is not repeatable, and one is enough; or it was executed before somebody asked for another
    one. ``dropped``: the run is cancelled. ``stale``: the lease is over. ``missing``: nothing was
    recorded, since the trace is not there: bring it again. ``done``: as asked.
    """

    RECORDED = "recorded"
    KNOWN = "known"
    DIFFERS = "differs"
    REDUNDANT = "redundant"
    DROPPED = "dropped"
    STALE = "stale"
    MISSING = "missing"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class LedgerAcknowledgement:
    """Answer to a completion or a release, sent after the ledger has committed it."""

    answer: LedgerAnswer


@dataclass(frozen=True, slots=True)
class ReleaseRequest:
    """A run given back without a result; ``blame`` counts it against the run's attempts.

    ``damaged`` is the digest of a scene or file of the daemon's that is not what its name says.
    With ``died`` another worker had it, and died.
    """

    worker: WorkerId
    run: IdText
    token: NonNegativeInt
    reason: Annotated[str, Field(max_length=20_000)]
    blame: bool
    damaged: Annotated[str, Field(pattern=r"^([0-9a-f]{64})?$")] = ""
    era: ShortText = ""
    died: bool = False


@dataclass(frozen=True, slots=True)
class PutRequest:
    """A part of a file on its way to the daemon, at ``offset``.

    ``sha256`` and ``size`` are those of the whole. Without ``data`` it asks how much is there. The
    trace of a run comes under its ``lease`` of that ``era``, files of submissions come without.
    """

    sha256: Sha256Text
    size: Annotated[int, Field(ge=0, le=LARGEST_TRACE)]
    offset: NonNegativeInt = 0
    data: FileBytes = b""
    lease: LeaseRef | None = None
    era: ShortText = ""


@dataclass(frozen=True, slots=True)
class GetRequest:
    """Ask for a part of a file by its digest, from ``offset`` on; a trace is that of a ``run``."""

    sha256: Sha256Text
    offset: NonNegativeInt = 0
    run: IdText = ""


@dataclass(frozen=True, slots=True)
class FilePart:
    """A part of a file; ``size`` is that of the whole, in bytes."""

    size: Annotated[int, Field(ge=0, le=LARGEST_TRACE)]
    data: FileBytes
