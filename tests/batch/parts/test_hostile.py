"""What anybody may send: for every verb dozens of messages that nobody of ours would send.

One daemon for all of it. Each message is refused with a reason, or answered without any effect;
afterwards the daemon lives, and its ledger and its files are what they were.
"""

import gzip
import hashlib
import json
import pickle
import sqlite3
from contextlib import closing
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import pytest

from daemon.batch import bus
from daemon.batch.paths import StatePaths
from daemon.model import messages as m
from daemon.model import verbs
from daemon.model.messages import ASK, LARGEST_SUBMISSION, OWNER, ErrorReply, LedgerAnswer
from daemon.model.search_answer import SearchProgress, SearchQuery
from daemon.model.spec import TraceInfo
from daemon.model.verbs import VERBS
from grammars.text import codec
from tests.make import make_extension, make_result, make_search, make_submission
from tests.parts import daemon_at, eventually

ME = m.WorkerInfo("hostile-1", "host", 1, version("scenario-tui"), 4, 0)
TRACE = b"no real trace"
INFO = TraceInfo(hashlib.sha256(TRACE).hexdigest(), len(TRACE), 0)
UP = "../../../../tmp/escaped"
MOST = 2**53
"""No number of a message is larger."""


class Target:
    """A daemon with a finished run, a leased one and a queued one, and all it keeps."""

    def __init__(self, daemon, client, session):
        self.daemon = daemon
        self.session = session
        client.submit(make_submission("camp", 3))
        self.me = replace(ME, era=self.ask(verbs.WELCOME, ME).era)
        self.done, self.leased = self.ask(verbs.LEASE, m.LeaseRequest(self.me, 2)).grants
        trace = StatePaths(daemon.state).trace(self.done.trace)
        trace.parent.mkdir(parents=True)
        trace.write_bytes(TRACE)
        answer = self.ask(verbs.COMPLETE, completion_of(self.done)).answer
        assert answer is LedgerAnswer.RECORDED
        tokens = (self.leased.token, 9, 2**53)
        holds = tuple(m.LeaseRef(self.leased.run, token) for token in tokens)
        gone = self.ask(verbs.RENEW, m.RenewRequest(self.me, holds)).gone
        assert {hold.token for hold in gone} == {9, 2**53}

    def ask(self, verb, request):
        return bus.ask(self.session, self.daemon.endpoint, verb, request, 60.0)

    def complaint(self, verb, body):
        """Send a message as it is; return the reason for which it was refused."""
        refused, words = self.send(verb, body)
        assert refused, (verb, body[:200], words[:200])
        return codec.from_json(ErrorReply, words).problem

    def send(self, verb, body):
        key = f"{ASK}/{OWNER}/{verb}"
        (reply,) = self.session.get(key, payload=body, attachment=bus.speaker(), timeout=60.0)
        if reply.err is not None:
            return True, reply.err.payload.to_bytes()
        return False, reply.ok.payload.to_bytes()

    def everything(self):
        """What the ledger says, statement by statement, and all files with their sizes."""
        places = StatePaths(self.daemon.state)
        with closing(sqlite3.connect(f"file:{places.ledger}?mode=ro", uri=True)) as ledger:
            dump = list(ledger.iterdump())
        kept = (places.scenes, places.traces, places.spool, places.incoming, places.files)
        paths = sorted(path for folder in kept for path in folder.rglob("*") if path.is_file())
        outside = [(str(path), 0) for path in sorted(places.state.parent.iterdir())]
        return dump, [*outside, *((str(path), path.stat().st_size) for path in paths)]


def completion_of(grant):
    result = make_result(grant.spec, trace=INFO)
    return m.Completion(ME.id, grant.run, grant.attempt, grant.token, result, era=grant.era)


def release_of(lease, token, reason):
    return m.ReleaseRequest(ME.id, lease.run, token, reason, blame=True, era=lease.era)


@pytest.fixture(scope="module")
def target(tmp_path_factory):
    with (
        daemon_at(tmp_path_factory.mktemp("hostile") / "state") as daemon,
        daemon.client() as client,
        bus.open_client(daemon.endpoint) as session,
    ):
        found = Target(daemon, client, session)
        rows, kept = found.everything()
        yield found
        statements, files = found.everything()
        assert [line for line in statements if line not in rows] == []
        assert (len(statements), files) == (len(rows), kept)
        assert daemon.process.poll() is None
        row = client.campaigns()[0]
        assert (row.done, row.running, row.queued) == (1, 1, 1)
        # A test holds the ledger's lock, on a busy machine for longer than the daemon waits for it.
        failures = [entry["problem"] for entry in daemon.noted("failure")]
        assert [problem for problem in failures if "database is locked" not in problem] == []


class Bomb:
    def __reduce__(self):
        return Path.touch, ("/tmp/never",)


ALIASES = "a: &a [x, x]\n" + "\n".join(
    f"{b}: &{b} [*{a}, *{a}]" for a, b in zip("abcdefg", "bcdefgh", strict=True)
)

ANYWHERE = (
    b"", b" ", b"{", b"}", b"{}}", b"{}{}", b"{},", b"[]", b"[[]]", b"[{}]", b"null", b"true", b"7",
    b"-0.0", b"1e999", b"NaN", b"-Infinity", b'"text"', b'"', b"\xff\xfe", b"\x00", b"{\x00}",
    b"{}\x00", b"{'a': 1}", b'{"a":1,}', b"{/**/}", b'{"a": undefined}', b'{"a": 01}',
    b'{"\\ud800": 1}', b'{"\xc3(": 1}', b'{"unknown": 1}', b'{"version": 99}',
    b'{"__class__": "os.system"}', b'{"__proto__": {"admin": true}}', b"\xef\xbb\xbf{}",
    "{}".encode("utf-16"), b"[" * 10_000, b'{"a":' * 3_000, b'{"a":[' * 2_000 + b"]}" * 2_000,
    b'{"a":' + b"9" * 10_000 + b"}", b'{"a":1e' + b"9" * 5_000 + b"}", pickle.dumps(Bomb()),
    gzip.compress(b" " * 10**6), ALIASES.encode(), b"!!python/object/apply:os.system ['true']",
    b"<?xml version='1.0'?><!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", b"'; DROP TABLE run; --",
    b"\x1b]0;title\x07", b"scenario/v1/ask/shutdown",
)  # fmt: skip
"""Never a request, whatever the verb."""


@pytest.mark.parametrize("verb", VERBS.values(), ids=str)
def test_what_is_no_request_is_refused_with_a_reason(target, verb):
    for body in ANYWHERE:
        words = target.complaint(verb, body)
        assert words.startswith("the request is malformed: "), (body[:80], words)
    if verb.largest < LARGEST_SUBMISSION:
        words = target.complaint(verb, b'{"a": "' + b"x" * verb.largest + b'"}')
        assert f"the limit is {verb.largest}" in words


@pytest.mark.parametrize("verb", [verbs.OVERVIEW, verbs.SUBMIT], ids=str)
def test_a_hundred_megabytes_are_refused_with_a_reason(target, verb):
    words = target.complaint(verb, b" " * 100_000_000)
    assert words == f"the request has 100000000 bytes, the limit is {verb.largest}"


WRONG = (
    None, True, -1, 0.5, 1e300, 2**53 + 1, 10**400, "", "\x00", UP, "a/b", "x" * 9000, "*",
    "camp.0\n", "ＣＡＭＰ", "\ud800", "/etc/passwd", "..", "camp\x00",
    [], {}, {"id": 1}, [None] * 100, [UP],
)  # fmt: skip
"""Values for a field that wants something else."""


def valid(target):
    """A request of each verb that has fields; sent as they are, these would do something."""
    lease = target.leased
    ref = m.LeaseRef(lease.run, lease.token)
    return {
        verbs.CAMPAIGNS: m.CampaignQuery("camp"),
        verbs.RUNS: m.RunQuery("camp"),
        verbs.RUN: m.IdRequest("camp.0"),
        verbs.DECLARED: m.IdRequest("camp"),
        verbs.ORIGIN: m.IdRequest("camp"),
        verbs.GET: m.GetRequest(INFO.sha256, 0, target.done.run),
        verbs.PUT: m.PutRequest("0" * 64, 4, 0, b"", ref, lease.era),
        verbs.SUBMIT: make_submission("new", 2),
        verbs.CANCEL: m.IdRequest("camp"),
        verbs.RETRY: m.RetryRequest("camp", ("pass",)),
        verbs.ACKNOWLEDGE: m.IdRequest("camp"),
        verbs.DELETE: m.DeleteRequest(("camp",)),
        verbs.STEER: m.SteerRequest("camp", True, 3),
        verbs.SEARCH: make_search("sought"),
        verbs.SEARCHES: SearchQuery("sought"),
        verbs.EXTEND: make_extension("sought", 0, 2),
        verbs.PROGRESS: SearchProgress("sought", "explore", "so far"),
        verbs.WELCOME: ME,
        verbs.LEASE: m.LeaseRequest(target.me, 1),
        verbs.RENEW: m.RenewRequest(target.me, ()),
        verbs.COMPLETE: completion_of(target.leased),
        verbs.RELEASE: release_of(lease, lease.token, "why"),
    }


OPTIONAL = {"lease", "paused", "priority"}
IDS = {"id", "campaign", "run", "scene", "sha256", "worker", "spec"}
"""Fields that name something: no other text names it."""


def spoilt(document, **how):
    """The request with one field spoilt: of another type, out of range, missing, or unknown."""
    for path, leaf in places(document):
        for wrong in WRONG:
            if not fits(wrong, leaf, path[-1], **how):
                yield dumped(replaced(document, path, wrong))
    for name in document:
        if how["ids"] and name in IDS:
            yield dumped({key: value for key, value in document.items() if key != name})
    yield dumped(document | {"extra": 1})


def fits(wrong, leaf, name, *, ids, numbers):
    """Whether a value may well do in place of ``leaf``, so that nothing says it is wrong."""
    if leaf is None or (wrong is None and name in OPTIONAL):
        return True
    if isinstance(leaf, str):
        known = isinstance(wrong, str) and not (ids and name in IDS)
        return known and "\ud800" not in wrong
    if isinstance(leaf, float) and not isinstance(wrong, bool):
        return isinstance(wrong, int | float)
    if type(leaf) is int and type(wrong) is int:
        return (name == "priority" and wrong == -1) or 0 <= wrong <= MOST or not numbers
    return type(wrong) is type(leaf)


def places(document, before=()):
    """Every place in a document, the first three levels deep, with what is there."""
    if isinstance(document, dict) and len(before) < 3:
        for key, value in document.items():
            yield (*before, key), value
            yield from places(value, (*before, key))


def replaced(document, path, value):
    if not path:
        return value
    return document | {path[0]: replaced(document[path[0]], path[1:], value)}


def dumped(document):
    return json.dumps(document).encode()


ANSWERED = (verbs.CAMPAIGNS, verbs.RUNS, verbs.SEARCHES)
"""Questions about what is not there that have an empty answer."""
SUBMITTED = (verbs.SUBMIT, verbs.SEARCH)
"""What a person wrote: its numbers are held to their ranges where campaigns are read."""
WITH_FIELDS = [verb for verb in VERBS.values() if verb.request is not m.Empty]


@pytest.mark.parametrize("verb", WITH_FIELDS, ids=str)
def test_a_request_with_one_spoilt_field_is_refused(target, verb):
    request = valid(target)[verb]
    assert type(request) is verb.request
    # What acts must name what there is.
    how = {"ids": verb not in ANSWERED, "numbers": verb not in SUBMITTED}
    bodies = list(spoilt(codec.to_plain(request), **how))
    assert len(bodies) >= 20
    for body in bodies:
        target.complaint(verb, body)


def test_keys_that_are_no_verbs_are_refused(target):
    for key in ("*", "evaluate", "Submit", "submit%20", "__init__", "x" * 5000, "ＳＵＢＭＩＴ"):
        assert "does not know how to" in target.complaint(key, b"{}")
    replies = []
    for key in ("../ask/submit", "a/b/c"):
        target.session.get(f"{ASK}/{key}", replies.append, payload=b"{}", timeout=60.0)
        # What is asked later is answered: nothing else will be.
        assert "does not know how to" in target.complaint("later", b"{}")
    assert replies == []


BUSY = "the daemon is busy, 2048 requests wait already"


def test_who_asks_faster_than_the_ledger_writes_is_told_to_wait(target):
    replies = []

    def problems():
        """What those say that have come so far."""
        bodies = [reply.err.payload.to_bytes() for reply in tuple(replies)]
        return [codec.from_json(ErrorReply, body) for body in bodies]

    ledger = StatePaths(target.daemon.state).ledger
    with closing(sqlite3.connect(ledger, isolation_level=None)) as lock:
        lock.execute("BEGIN IMMEDIATE")
        for _ in range(2300):
            target.session.get(
                f"{ASK}/{OWNER}/cancel", replies.append, payload=b'{"id":"no"}', timeout=3600.0
            )
        # On a busy machine the daemon may have given up on the lock for some before all have come.
        eventually(lambda: any(BUSY in problem.problem for problem in problems()))
        assert {problem.kind for problem in problems()} == {m.ErrorKind.UNAVAILABLE}
        with target.daemon.client() as client:
            assert client.overview().running == 1
        lock.execute("ROLLBACK")
    eventually(lambda: len(replies) == 2300)
    assert sum(BUSY not in problem.problem for problem in problems()) >= 2048
