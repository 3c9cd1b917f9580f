"""Verbs of the daemon, each declared once: name, request, answer, roles, thread.

A declaration gives the client's method (:class:`DaemonClient`, and its fake in tests), the access
rules of the bus (:mod:`daemon.batch.security`), the size limit of requests, the thread of the
daemon (:mod:`daemon.batch.server`), and the line in ``docs/security.md``. The handlers are in
``daemon/batch/server/_handlers.py``; a daemon that lacks one does not start.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import Any, Concatenate, Final, Generic, ParamSpec, Protocol, TypeAlias, TypeVar

from daemon.model import messages
from daemon.model.assessments import AssessmentRules
from daemon.model.live_judgement import LiveJudgement
from daemon.model.search import ExtendRequest, SearchSubmission
from daemon.model.search_answer import SearchProgress, SearchQuery, SearchRow
from daemon.model.status import (
    CampaignRow,
    ChangeEvent,
    DaemonOverview,
    DeletedCampaign,
    DiskUsage,
    LiveSnapshot,
    RunDetail,
    RunPage,
    RunRow,
    SubmissionReceipt,
    WorkerRow,
)
from daemon.model.submission import CampaignOrigin, Submission
from grammars.model.scene import Scene
from grammars.text import codec

P = ParamSpec("P")
A = TypeVar("A")


class Role(StrEnum):
    """Role of a key, the first part of the common name of its certificate."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    WORKER = "worker"
    DAEMON = "daemon"


VIEWING: Final = frozenset({Role.VIEWER, Role.OPERATOR})
STEERING: Final = frozenset({Role.OPERATOR})
WORKING: Final = frozenset({Role.WORKER})


class ServerThread(Enum):
    """Threads of the daemon that serve requests, without waiting for each other.

    Only the writer changes the ledger. The carrier reads like the readers, but moves megabytes, so
    that questions need not wait for traces.
    """

    READER = "reader"
    WRITER = "writer"
    CARRIER = "carrier"


READER, WRITER, CARRIER = ServerThread.READER, ServerThread.WRITER, ServerThread.CARRIER

# Enough for most requests: ids and a few texts of at most 400 characters.
_SMALL: Final = 16 * 2**10


# Compared and hashed by identity: each exists once, and is a key of tables.
@dataclass(frozen=True, slots=True, eq=False)
class Verb(Generic[P, A]):
    """A request type of the daemon: ``name`` is the last part of the request's key.

    ``roles`` has no default, so that every verb gets a decision. ``request`` makes the request (its
    parameters are those of the client's method), ``largest`` is its size limit [B], ``advice`` the
    remedy for a larger one. A ``slow`` verb may take long, such as with 200,000 runs; clients wait
    for its answer as long as the daemon is alive.
    """

    name: str
    request: Callable[P, object]
    answer: type[A]
    about: str
    roles: frozenset[Role]
    thread: ServerThread = READER
    largest: int = _SMALL
    slow: bool = False
    advice: str = ""

    def __str__(self) -> str:
        return self.name


AnyVerb: TypeAlias = Verb[..., Any]

# fmt: off
OVERVIEW: Final = Verb("overview", messages.Empty, DaemonOverview,
    "The state of the daemon in one line.", VIEWING)
CAMPAIGNS: Final = Verb("campaigns", messages.CampaignQuery, tuple[CampaignRow, ...],
    "A page of at most 1000 campaigns, the newest first.", VIEWING)
RUNS: Final = Verb("runs", messages.RunQuery, RunPage,
    "A page of at most 1000 runs; ``text`` is searched in label, oracle, reason and id.",
    VIEWING, slow=True)
RUN: Final = Verb("run", messages.IdRequest, RunDetail, "Everything about one run.", VIEWING)
DECLARED: Final = Verb("declared", messages.IdRequest, AssessmentRules,
    "The rules of a campaign for its results: policy, comparisons, expectations.", VIEWING)
ORIGIN: Final = Verb("origin", messages.IdRequest, CampaignOrigin,
    "The file of a campaign, and its commit.", VIEWING)
WORKERS: Final = Verb("workers", messages.Empty, tuple[WorkerRow, ...],
    "The connected workers, and absent ones with leases.", VIEWING)
DISK: Final = Verb("disk", messages.Empty, DiskUsage,
    "The space on the disk of the state directory.", VIEWING)
GET: Final = Verb("get", messages.GetRequest, messages.FilePart,
    "A part of a trace, a scene or a file of a system under test.",
    VIEWING | WORKING, CARRIER, slow=True)
PUT: Final = Verb("put", messages.PutRequest, messages.Count,
    "Take a part of a trace or of a file of a submission; returns the bytes received so far.",
    STEERING | WORKING, CARRIER, 2 * messages.PART, slow=True)
SUBMIT: Final = Verb("submit", Submission, SubmissionReceipt,
    "Take a campaign; the receipt says that it is safely in the ledger.",
    STEERING, WRITER, messages.LARGEST_SUBMISSION, slow=True, advice="split the campaign")
CANCEL: Final = Verb("cancel", messages.IdRequest, messages.Count,
    "Cancel queued and running runs; returns their number.", STEERING, WRITER, slow=True)
RETRY: Final = Verb("retry", messages.RetryRequest, messages.Count,
    "Queue runs again; returns their number.", STEERING, WRITER, slow=True)
ACKNOWLEDGE: Final = Verb("acknowledge", messages.IdRequest, messages.Count,
    "Acknowledge the bad runs of a campaign, until there are new ones. Returns the number of runs"
    " that did not pass.", STEERING, WRITER)
STEER: Final = Verb("steer", messages.SteerRequest, messages.Count,
    "Pause or resume a campaign, or change its priority. Returns the number of waiting runs."
    " Running ones go on.",
    STEERING, WRITER)
DELETE: Final = Verb("delete", messages.DeleteRequest, tuple[DeletedCampaign, ...],
    "Remove finished campaigns with results and traces; returns the removed ones.",
    STEERING, WRITER, 2 * _SMALL, slow=True)
SHUTDOWN: Final = Verb("shutdown", messages.Empty, messages.Empty,
    "Stop the daemon; running runs get some time to finish.", STEERING)
SEARCH: Final = Verb("search", SearchSubmission, messages.Empty,
    "Begin or resume a search. One client at a time makes its proposals.",
    STEERING, WRITER, messages.LARGEST_REQUEST)
SEARCHES: Final = Verb("searches", SearchQuery, tuple[SearchRow, ...],
    "At most 1000 searches, the newest first; only a query for one includes the answer's files.",
    VIEWING)
EXTEND: Final = Verb("extend", ExtendRequest, messages.Count,
    "Add runs to a search; returns the number of new ones.",
    STEERING, WRITER, messages.LARGEST_EXTENSION, slow=True, advice="send fewer at a time")
PROGRESS: Final = Verb("progress", SearchProgress, messages.Empty,
    "Report the progress and results of a search.", STEERING, WRITER, messages.LARGEST_EXTENSION)
WELCOME: Final = Verb("welcome", messages.WorkerInfo, messages.WelcomeReply,
    "The state directory and the period of renewals, for a new worker.", WORKING)
LEASE: Final = Verb("lease", messages.LeaseRequest, messages.LeaseReply,
    "Runs to execute, leased.", WORKING, WRITER, 8 * _SMALL)
RENEW: Final = Verb("renew", messages.RenewRequest, messages.RenewReply,
    "Renew all leases of a worker; returns those it has lost.", WORKING, WRITER,
    messages.LARGEST_REQUEST)
COMPLETE: Final = Verb("complete", messages.Completion, messages.LedgerAcknowledgement,
    "Record the result of a run.", WORKING, WRITER, messages.LARGEST_REQUEST)
RELEASE: Final = Verb("release", messages.ReleaseRequest, messages.LedgerAcknowledgement,
    "Return a run without a result.", WORKING, WRITER, 16 * _SMALL)
# fmt: on

VERBS: Final = {verb.name: verb for verb in list(vars().values()) if isinstance(verb, Verb)}
"""All verbs by name, in the order of their declarations."""


def _question(verb: Verb[P, A]) -> Callable[Concatenate[CampaignSource, P], A]:
    """Make the client's method of a verb: it takes the fields of the request."""

    def method(self: CampaignSource, /, *args: P.args, **fields: P.kwargs) -> A:
        return self.ask(verb, verb.request(*args, **fields))

    method.__name__, method.__doc__ = verb.name, verb.about
    return method


def _counting(verb: Verb[P, messages.Count]) -> Callable[Concatenate[CampaignSource, P], int]:
    """Make the client's method of a verb that answers with a number."""

    def method(self: CampaignSource, /, *args: P.args, **fields: P.kwargs) -> int:
        return self.ask(verb, verb.request(*args, **fields)).count

    method.__name__, method.__doc__ = verb.name, verb.about
    return method


class Closeable(Protocol):
    """A running subscription to events and telemetry."""

    def close(self) -> None:
        """Stop listening."""


_RUNS_PER_PAGE: Final = 500
"""Size of a page when all runs are read."""


class CampaignSource(ABC):
    """A source of campaigns, runs and searches: a daemon, its ledger, a folder.

    ``where`` is the endpoint, the state directory or the folder. For a folder of traces, ``unread``
    has the unusable files with the reason, and ``machine`` the machine that executed the runs.
    """

    where: str = ""
    unread: tuple[tuple[str, str], ...] = ()
    machine: str = ""

    @abstractmethod
    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Return the answer to a request.

        Raises :class:`daemon.batch.errors.Unreachable` without an answer and
        :class:`daemon.batch.errors.Refused` after a refusal.
        """

    campaign_page = _question(CAMPAIGNS)
    runs = _question(RUNS)
    run = _question(RUN)
    declared = _question(DECLARED)
    origin = _question(ORIGIN)

    def campaigns(self) -> tuple[CampaignRow, ...]:
        """Return all campaigns, the newest first; ask for a page if a few are enough."""
        rows: list[CampaignRow] = []
        while True:
            page = self.campaign_page(offset=len(rows), limit=messages.LARGEST_PAGE)
            # A campaign submitted between two pages moves the others on.
            ids = {row.id for row in rows}
            rows.extend(row for row in page if row.id not in ids)
            if len(page) < messages.LARGEST_PAGE:
                return tuple(rows)

    def campaign(self, id: str) -> CampaignRow | None:
        """Return the campaign of an id, if any."""
        page = self.campaign_page(id=id, limit=1)
        return page[0] if page else None

    def all_runs(
        self,
        campaign: str,
        *,
        scenario: str = "",
        sut: str = "",
        outcome: str = "",
        text: str = "",
        offset: int = 0,
        results: bool = False,
    ) -> tuple[RunRow, ...]:
        """Return every run of a campaign that matches the filter, from ``offset`` on, in order."""
        rows: list[RunRow] = []
        while True:
            page = self.runs(
                campaign,
                scenario=scenario,
                sut=sut,
                outcome=outcome,
                text=text,
                offset=offset + len(rows),
                limit=_RUNS_PER_PAGE,
                results=results,
            )
            rows.extend(page.rows)
            # A short page need not be the last: its bytes are limited too.
            if not page.rows or offset + len(rows) >= page.total:
                return tuple(rows)

    def searches(self, campaign: str = "", *, unfinished: bool = False) -> tuple[SearchRow, ...]:
        """Return all searches, one, or the unfinished ones; the newest first."""
        return self.ask(SEARCHES, SearchQuery(campaign, unfinished))

    def search_row(self, campaign: str) -> SearchRow | None:
        """Return the search of an id, if any, with its whole answer."""
        rows = self.searches(campaign)
        return rows[0] if rows else None


class DaemonClient(CampaignSource):
    """Requests to a daemon: a method for each verb, and combinations of several.

    :class:`daemon.batch.client.Client` sends them over the bus.
    """

    overview = _question(OVERVIEW)
    workers = _question(WORKERS)
    disk = _question(DISK)
    get = _question(GET)
    put = _counting(PUT)
    cancel = _counting(CANCEL)
    acknowledge = _counting(ACKNOWLEDGE)
    steer = _counting(STEER)
    delete = _question(DELETE)
    shutdown = _question(SHUTDOWN)

    def scene(self, digest: str) -> Scene:
        """Return a compiled scene by its digest; raises ``ValueError`` for a damaged one."""
        part = self.get(digest)
        data = part.data
        while part.data and len(data) < part.size:
            part = self.get(digest, len(data))
            data += part.data
        scene = codec.from_json(Scene, data)
        if scene.digest != digest:
            raise ValueError(f"the scene {digest} is damaged")
        return scene

    def retry(self, campaign: str, *, only: str = "lost|cancelled") -> int:
        """Queue runs again; return their number.

        ``only`` lists, separated by ``|``: ``lost``, ``cancelled``, an outcome, or ``all``. A run
        with a result keeps it: the new execution checks that it comes out the same.
        """
        words = tuple(word.strip() for word in only.split("|") if word.strip())
        return self.ask(RETRY, messages.RetryRequest(campaign, words)).count

    def begin_search(self, search: SearchSubmission) -> SearchRow:
        """Begin or resume a search; return its state.

        ``client`` of the row is its owner: another client may make the proposals already.
        """
        self.ask(SEARCH, search)
        return self.searches(search.campaign)[0]

    @abstractmethod
    def submit(self, submission: Submission) -> SubmissionReceipt:
        """Submit a campaign; the receipt says that it is safely in the ledger.

        Repeating it, such as after :class:`Unreachable`, is harmless. Files of its systems under
        test are sent first, from :func:`daemon.model.attachments.user_files_folder`.
        """

    @abstractmethod
    def events(
        self,
        on_event: Callable[[ChangeEvent], None],
        on_live: Callable[[LiveSnapshot], None] | None = None,
    ) -> Closeable:
        """Call back on every event, and on snapshots of running runs.

        The calls come from other threads, one per kind, in order. Slow calls or a broken connection
        may lose events: ``seq`` then has a gap, and the caller must query again.
        """

    @abstractmethod
    def watch(
        self,
        run: str,
        on_live: Callable[[LiveSnapshot], None],
        on_judged: Callable[[LiveJudgement], None] | None = None,
    ) -> Closeable:
        """Call back on detailed snapshots of one run while it runs, up to ten a second.

        ``on_judged`` is called with the verdicts so far, at most once a second. Workers make both
        only while somebody watches. Calls come from other threads, one per kind.
        """


ClientOpener: TypeAlias = Callable[[], AbstractContextManager[DaemonClient]]
"""Opener of a client; the daemon may be away."""
