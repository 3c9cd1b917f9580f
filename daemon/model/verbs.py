"""Everything the daemon can be asked, declared once: name, request, answer, who may, who does it.

From its declaration follow a verb's method of the client (:class:`DaemonClient`, and so of the
client that tests pretend), the access rules of the bus (:mod:`daemon.batch.security`), how large a
request may be, the thread of the daemon that does it (:mod:`daemon.batch.server`), and its line in
``docs/security.md``. What is done is the handler of the verb's name in
``daemon/batch/server/_handlers.py``; a daemon with a verb and no handler does not start.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import Any, Concatenate, Final, Generic, ParamSpec, Protocol, TypeAlias, TypeVar

from daemon.model.assessments import AssessmentRules
from daemon.model.live_judgement import LiveJudgement
from daemon.model.messages import (
    LARGEST_EXTENSION,
    LARGEST_PAGE,
    LARGEST_REQUEST,
    LARGEST_SUBMISSION,
    PART,
    CampaignQuery,
    Completion,
    Count,
    DeleteRequest,
    Empty,
    FilePart,
    GetRequest,
    IdRequest,
    LeaseReply,
    LeaseRequest,
    LedgerAcknowledgement,
    PutRequest,
    ReleaseRequest,
    RenewReply,
    RenewRequest,
    RetryRequest,
    RunQuery,
    SteerRequest,
    WelcomeReply,
    WorkerInfo,
)
from daemon.model.proposals import ExtendRequest
from daemon.model.search import SearchSubmission
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
    """What a key is for; the first part of the common name of its certificate."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    WORKER = "worker"
    DAEMON = "daemon"


VIEWING: Final = frozenset({Role.VIEWER, Role.OPERATOR})
STEERING: Final = frozenset({Role.OPERATOR})
WORKING: Final = frozenset({Role.WORKER})


class ServerThread(Enum):
    """Threads of the daemon that do something; requests to others never wait for them.

    Only the writer changes the ledger. The carrier reads like the readers, but moves megabytes:
    nobody's question has to wait for a trace that somebody fetches.
    """

    READER = "reader"
    WRITER = "writer"
    CARRIER = "carrier"


READER, WRITER, CARRIER = ServerThread.READER, ServerThread.WRITER, ServerThread.CARRIER

# Enough for ids and a few texts of at most 400 characters, which is what most requests are.
_SMALL: Final = 16 * 2**10


# Compared and hashed by identity: there is one of each, and tables are keyed by them.
@dataclass(frozen=True, slots=True, eq=False)
class Verb(Generic[P, A]):
    """Something the daemon can be asked: ``name`` is the last part of the request's key.

    Who may ask it has no default: what nobody thought about must not be everybody's. ``request``
    makes the request (its parameters are those of the client's method), ``largest`` are the bytes
    it may have, and ``advice`` says what to do about one that is larger. A ``slow`` one may take
    long, with 200,000 runs say; its answer is waited for as long as the daemon is there.
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
OVERVIEW: Final = Verb("overview", Empty, DaemonOverview,
    "How everything stands, in one line.", VIEWING)
CAMPAIGNS: Final = Verb("campaigns", CampaignQuery, tuple[CampaignRow, ...],
    "A page of at most 1000 campaigns, the newest first.", VIEWING)
RUNS: Final = Verb("runs", RunQuery, RunPage,
    "A page of at most 1000 runs; ``text`` is looked for in label, oracle, reason and id.",
    VIEWING, slow=True)
RUN: Final = Verb("run", IdRequest, RunDetail, "Everything about one run.", VIEWING)
DECLARED: Final = Verb("declared", IdRequest, AssessmentRules,
    "What a campaign declares about its results: policy, comparisons, expectations.", VIEWING)
ORIGIN: Final = Verb("origin", IdRequest, CampaignOrigin,
    "Which file a campaign was written in, and at which commit.", VIEWING)
WORKERS: Final = Verb("workers", Empty, tuple[WorkerRow, ...],
    "The workers that are here, and those that are away and have leases.", VIEWING)
DISK: Final = Verb("disk", Empty, DiskUsage,
    "How much space there is where the daemon keeps things.", VIEWING)
GET: Final = Verb("get", GetRequest, FilePart,
    "A part of a trace, a scene or a file of a system under test.",
    VIEWING | WORKING, CARRIER, slow=True)
PUT: Final = Verb("put", PutRequest, Count,
    "Take a part of a trace or of a file of a submission; returns how many bytes are there.",
    STEERING | WORKING, CARRIER, 2 * PART, slow=True)
SUBMIT: Final = Verb("submit", Submission, SubmissionReceipt,
    "Take a campaign; the receipt says that it is safely in the ledger.",
    STEERING, WRITER, LARGEST_SUBMISSION, slow=True, advice="split the campaign")
CANCEL: Final = Verb("cancel", IdRequest, Count,
    "Cancel what is queued or running; returns the number of runs.", STEERING, WRITER, slow=True)
RETRY: Final = Verb("retry", RetryRequest, Count,
    "Queue runs again; returns how many.", STEERING, WRITER, slow=True)
ACKNOWLEDGE: Final = Verb("acknowledge", IdRequest, Count,
    "Note that somebody knows what went wrong in a campaign, until there is news. Returns how many"
    " runs did not pass.", STEERING, WRITER)
STEER: Final = Verb("steer", SteerRequest, Count,
    "Start no more runs of a campaign, or go on; let it go before those of lower priority. Returns"
    " how many wait. What is running goes on.",
    STEERING, WRITER)
DELETE: Final = Verb("delete", DeleteRequest, tuple[DeletedCampaign, ...],
    "Remove campaigns of which nothing waits or runs, with results and traces; returns what goes.",
    STEERING, WRITER, 2 * _SMALL, slow=True)
SHUTDOWN: Final = Verb("shutdown", Empty, Empty,
    "Ask the daemon to leave; what is running gets a while to finish.", STEERING)
SEARCH: Final = Verb("search", SearchSubmission, Empty,
    "Take a search; one that is known goes on. One client at a time makes its proposals.",
    STEERING, WRITER, LARGEST_REQUEST)
SEARCHES: Final = Verb("searches", SearchQuery, tuple[SearchRow, ...],
    "At most 1000 searches, the newest first; the files of answers only where one is asked for.",
    VIEWING)
EXTEND: Final = Verb("extend", ExtendRequest, Count,
    "Add runs to a search; returns how many of them are new.",
    STEERING, WRITER, LARGEST_EXTENSION, slow=True, advice="send fewer at a time")
PROGRESS: Final = Verb("progress", SearchProgress, Empty,
    "Say how far a search is, and what it has found.", STEERING, WRITER, LARGEST_EXTENSION)
WELCOME: Final = Verb("welcome", WorkerInfo, WelcomeReply,
    "What a worker must know before it starts.", WORKING)
LEASE: Final = Verb("lease", LeaseRequest, LeaseReply,
    "Runs to execute, leased.", WORKING, WRITER, 8 * _SMALL)
RENEW: Final = Verb("renew", RenewRequest, RenewReply,
    "Renew all leases of a worker; returns those that it lost.", WORKING, WRITER, LARGEST_REQUEST)
COMPLETE: Final = Verb("complete", Completion, LedgerAcknowledgement,
    "Record the result of a run.", WORKING, WRITER, LARGEST_REQUEST)
RELEASE: Final = Verb("release", ReleaseRequest, LedgerAcknowledgement,
    "Take a run back that has no result.", WORKING, WRITER, 16 * _SMALL)
# fmt: on

VERBS: Final = {found.name: found for found in list(vars().values()) if isinstance(found, Verb)}
"""All of them by name, in the order of their declarations."""


def _question(verb: Verb[P, A]) -> Callable[Concatenate[CampaignSource, P], A]:
    """Make the client's method of a verb: it takes the fields of the request."""

    def method(self: CampaignSource, /, *args: P.args, **fields: P.kwargs) -> A:
        return self.ask(verb, verb.request(*args, **fields))

    method.__name__, method.__doc__ = verb.name, verb.about
    return method


def _counting(verb: Verb[P, Count]) -> Callable[Concatenate[CampaignSource, P], int]:
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
"""Runs asked for at once when all of them are wanted."""


class CampaignSource(ABC):
    """Anything that answers about campaigns, runs and searches: a daemon, its ledger, a folder.

    ``where`` is the endpoint, the state directory or the folder. Of a folder of traces, ``unread``
    are the files that are no usable traces, with the reason, and ``machine`` executed the runs.
    """

    where: str = ""
    unread: tuple[tuple[str, str], ...] = ()
    machine: str = ""

    @abstractmethod
    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Return the answer to a question.

        Raises :class:`daemon.batch.errors.Unreachable` when nobody answers and
        :class:`daemon.batch.errors.Refused` when the answer is no.
        """

    campaign_page = _question(CAMPAIGNS)
    runs = _question(RUNS)
    run = _question(RUN)
    declared = _question(DECLARED)
    origin = _question(ORIGIN)

    def campaigns(self) -> tuple[CampaignRow, ...]:
        """All campaigns, the newest first.

        There may be thousands: who wants one or a few asks for a page.
        """
        found: list[CampaignRow] = []
        while True:
            page = self.campaign_page(offset=len(found), limit=LARGEST_PAGE)
            # One that came meanwhile has moved the others on.
            known = {row.id for row in found}
            found.extend(row for row in page if row.id not in known)
            if len(page) < LARGEST_PAGE:
                return tuple(found)

    def campaign(self, id: str) -> CampaignRow | None:
        """The campaign of an id, if there is one."""
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
        """Return every run of a campaign the filter admits from ``offset`` on, in order."""
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
            # One that is shorter than asked for is not the last: bytes are limited, too.
            if not page.rows or offset + len(rows) >= page.total:
                return tuple(rows)

    def searches(self, campaign: str = "", *, unfinished: bool = False) -> tuple[SearchRow, ...]:
        """Searches, the newest first; all of them, or one, or those that have not ended."""
        return self.ask(SEARCHES, SearchQuery(campaign, unfinished))

    def search_row(self, campaign: str) -> SearchRow | None:
        """The search of an id, if there is one, with all of its answer."""
        found = self.searches(campaign)
        return found[0] if found else None


class DaemonClient(CampaignSource):
    """Questions and orders for a daemon: a method for each verb, and what needs several of them.

    :class:`daemon.batch.client.Client` asks over the bus.
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
        """A compiled scene, by its digest; raises ``ValueError`` for one that is damaged."""
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
        """Queue runs again; returns how many.

        ``only`` lists, separated by ``|``: ``lost``, ``cancelled``, an outcome, or ``all``. A run
        that has a result keeps it: executing it again checks that it comes out the same.
        """
        words = tuple(word.strip() for word in only.split("|") if word.strip())
        return self.ask(RETRY, RetryRequest(campaign, words)).count

    def begin_search(self, search: SearchSubmission) -> SearchRow:
        """Begin a search, or go on with it; return how it stands then.

        It is the client's whose name it has: another one may make its proposals already.
        """
        self.ask(SEARCH, search)
        return self.searches(search.campaign)[0]

    @abstractmethod
    def submit(self, submission: Submission) -> SubmissionReceipt:
        """Hand over a campaign; the receipt says that it is safely in the ledger.

        Submitting the same again (after :class:`Unreachable`, say) is harmless. Files that its
        systems under test need go first, from :func:`daemon.model.attachments.user_files_folder`.
        """

    @abstractmethod
    def events(
        self,
        on_event: Callable[[ChangeEvent], None],
        on_live: Callable[[LiveSnapshot], None] | None = None,
    ) -> Closeable:
        """Call back on every event, and on snapshots of running runs.

        The calls come from other threads, one per kind, in order. Events may be lost when calls
        take long or the connection breaks: then ``seq`` has a gap, and asking again is right.
        """

    @abstractmethod
    def watch(
        self,
        run: str,
        on_live: Callable[[LiveSnapshot], None],
        on_judged: Callable[[LiveJudgement], None] | None = None,
    ) -> Closeable:
        """Call back on detailed snapshots of one run while it runs, up to ten a second.

        ``on_judged`` is called with what the run would be judged by now, at most once a second.
        Whoever executes it makes either only while somebody watches. Calls come from other
        threads, one per kind.
        """


ClientOpener: TypeAlias = Callable[[], AbstractContextManager[DaemonClient]]
"""Opens a client of a daemon that may be away."""
