"""Requests and answers of the bus that people never see: questions, leases, completions.

Values for people are in :mod:`daemon.model.status`, verbs in :mod:`daemon.model.verbs`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Final

from pydantic import Base64Bytes, Field

from daemon.model.ids import IdText, NonNegativeInt, Seconds, ShortText
from daemon.model.spec import ENGINE_VERSION, LARGEST_TRACE, RunResult, RunSpec
from daemon.model.status import Preparation

PROTOCOL: Final = 3
"""Version of the messages; raise it with every incompatible change."""
PREFIX: Final = "scenario/v1"
"""Prefix of every key on the bus; incompatible messages would get another one."""
ASK: Final = f"{PREFIX}/ask"
"""Requests go to ``ASK/<name>/<verb>``, under the name of the requester's key."""
EVENTS: Final = f"{PREFIX}/event"
LIVE: Final = f"{PREFIX}/live"
"""Snapshots are published at ``LIVE/<name>/<worker>``, those of one run below that."""
JUDGED: Final = "judged"
"""Judgements of a running run are published at ``LIVE/<name>/<worker>/<run>/judged``."""
ALIVE: Final = f"{PREFIX}/alive"
"""Workers are alive at ``ALIVE/<name>/<worker>``."""
OWNER: Final = "owner"
"""Name in keys of clients without a key: the daemon's owner, and everybody over plain TCP."""
WORK: Final = f"{PREFIX}/work"
"""Published without content when runs become available or unwanted; workers also poll."""

LARGEST_SUBMISSION: Final = 64 * 2**20
"""Bytes; a hundred thousand runs of a whole building are a few MiB packed."""
LARGEST_REQUEST: Final = 4 * 2**20
LARGEST_EXTENSION: Final = 16 * 2**20
"""Bytes of runs added to a search, or of its answer; a scene of a whole building is a few MiB."""
LARGEST_PAGE: Final = 1000
LARGEST_PAGE_BYTES: Final = 4 * 2**20
"""Results and reasons may be long: a page ends at this size."""
PART: Final = 256 * 2**10
"""Bytes of one part of a file."""
HIGHEST_PRIORITY: Final = 1000
LONGEST_TROUBLE: Final = 2000
"""Characters."""
MOST_PROGRESS: Final = 512
"""Most runs in a worker's progress report: enough to know their speed."""

WorkerId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,99}$")]
Sha256Text = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
FileBytes = Annotated[Base64Bytes, Field(max_length=PART)]


class Rejection(StrEnum):
    """Reasons for which a result is never accepted, however often it is delivered.

    Only these let a worker discard a finished run. After any other answer, or none, the worker
    keeps the run and delivers it later. ``unknown-run``: the run was deleted.
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
    """Kind of an error reply.

    ``refused``: the request is invalid. ``unavailable``: the daemon cannot serve it now.
    ``failed``: the daemon met an error of its own. ``other-ledger``: the request belongs to
    another ledger than the daemon's.
    """

    REFUSED = "refused"
    UNAVAILABLE = "unavailable"
    FAILED = "failed"
    OTHER_LEDGER = "other-ledger"


@dataclass(frozen=True, slots=True)
class ErrorReply:
    """An error reply: a problem in words, and its kind.

    A ``rejection`` is in the reply to a result that is never accepted.
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

    ``beginning`` is a prefix of the id. ``unfinished`` selects those with waiting or running runs.
    """

    id: IdText = ""
    name: IdText = ""
    beginning: IdText = ""
    unfinished: bool = False
    offset: NonNegativeInt = 0
    limit: Annotated[int, Field(ge=0, le=LARGEST_PAGE)] = LARGEST_PAGE


@dataclass(frozen=True, slots=True)
class DeleteRequest:
    """Remove campaigns for good, all or none; ``dry`` only reports what would be removed."""

    campaigns: Annotated[tuple[IdText, ...], Field(min_length=1, max_length=100)]
    dry: bool = False


@dataclass(frozen=True, slots=True)
class RunQuery:
    """A page of runs: empty strings filter nothing; ``sort`` names a column of the row.

    With ``results`` the rows have their results and proposals.
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
    """Pause or resume a campaign, or change its priority; ``None`` keeps the value."""

    campaign: IdText
    paused: bool | None = None
    priority: Annotated[int, Field(ge=-HIGHEST_PRIORITY, le=HIGHEST_PRIORITY)] | None = None


@dataclass(frozen=True, slots=True)
class RunProgress:
    """Progress of a run: ``simulated`` seconds in ``elapsed`` seconds of wall time."""

    run: IdText
    simulated: Seconds
    elapsed: Seconds


@dataclass(frozen=True, slots=True)
class WorkerInfo:
    """Description of a worker, sent with every request so that a new daemon knows it at once.

    ``trouble`` is the reason why it cannot work, such as a full disk. ``preparation`` is its
    activity before leased runs can start. ``era`` is that of its :class:`WelcomeReply`, empty
    before. ``notice`` is a hint for people although it works. ``cpu``, ``memory`` and
    ``memory_total`` are as in :class:`daemon.model.status.WorkerRow`. ``progress`` is that of
    started runs.
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
    """First answer to a worker: the state directory, and the period of renewals [s].

    ``identity`` names the state directory for good. ``era`` names the time since this daemon began
    to keep its ledger: a worker that reads it in the daemon's directory shares its file system.
    The ledger lists all its eras, so it recognises requests that belong to another ledger, or to a
    later state of a ledger restored from a copy.
    """

    state: str
    renew: float
    identity: str
    era: str


@dataclass(frozen=True, slots=True)
class LeaseRequest:
    """Ask for up to ``count`` runs, except of kinds of systems under test it ``lacks``."""

    worker: WorkerInfo
    count: Annotated[int, Field(ge=0, le=1024)]
    lacks: Annotated[tuple[ShortText, ...], Field(max_length=64)] = ()


@dataclass(frozen=True, slots=True)
class Lease:
    """One leased run: ``token`` fences it, ``trace`` names its trace in the state directory.

    With ``leads`` its result must have leading margins, which a search learns from. ``era`` is that
    of the ledger that granted it.
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
    """Runs to execute; ``draining``: the daemon stops and sends no more.

    Names on the bus, such as ``grants``, never change, so that daemons and workers of different
    versions understand each other.
    """

    grants: tuple[Lease, ...]
    draining: bool = False


@dataclass(frozen=True, slots=True)
class LeaseRef:
    """A lease that a worker believes to hold."""

    run: IdText
    token: NonNegativeInt


@dataclass(frozen=True, slots=True)
class RenewRequest:
    """All leases a worker holds, finished but unacknowledged runs included."""

    worker: WorkerInfo
    holds: Annotated[tuple[LeaseRef, ...], Field(max_length=4096)]


@dataclass(frozen=True, slots=True)
class RenewReply:
    """Leases whose runs the worker must stop.

    They have a result, are cancelled, or were never leased under the requester's name.
    """

    gone: tuple[LeaseRef, ...]


@dataclass(frozen=True, slots=True)
class Completion:
    """A finished run; its trace was sent before, under the same lease.

    ``era`` is that of the lease, as in all requests under a lease.
    """

    worker: WorkerId
    run: IdText
    attempt: NonNegativeInt
    token: NonNegativeInt
    result: RunResult
    era: ShortText = ""


class LedgerAnswer(StrEnum):
    """Answer of the ledger to a completion, a release or a renewal.

    ``recorded``: this is the result. ``known``: the ledger has the same result. ``differs``: it has
    another one, a nondeterminism alarm. ``redundant``: it has another one of a system that is not
    repeatable, or this run was executed before a retry was requested. ``dropped``: the run is
    cancelled. ``stale``: the lease is over. ``missing``: the trace is missing, so nothing was
    recorded: send it again. ``done``: the request was carried out.
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
    """A run returned without a result; ``blame`` counts it against the run's attempts.

    ``damaged`` is the digest of a scene or file of the daemon with wrong content. ``died``: the
    run belonged to another worker, which died.
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
    """A part of a file for the daemon, at ``offset``.

    ``sha256`` and ``size`` are those of the whole file. Without ``data`` it asks for the size
    received so far. The trace of a run has its ``lease`` and ``era``, files of submissions do not.
    """

    sha256: Sha256Text
    size: Annotated[int, Field(ge=0, le=LARGEST_TRACE)]
    offset: NonNegativeInt = 0
    data: FileBytes = b""
    lease: LeaseRef | None = None
    era: ShortText = ""


@dataclass(frozen=True, slots=True)
class GetRequest:
    """Ask for a part of a file by its digest, from ``offset`` on; a trace also has its ``run``."""

    sha256: Sha256Text
    offset: NonNegativeInt = 0
    run: IdText = ""


@dataclass(frozen=True, slots=True)
class FilePart:
    """A part of a file; ``size`` is that of the whole file [B]."""

    size: Annotated[int, Field(ge=0, le=LARGEST_TRACE)]
    data: FileBytes
