"""Dispatch of requests from the bus to the ledger's threads, which serve and answer them.

Zenoh's callbacks only enqueue. The thread that serves a request validates it; an invalid one gets
an error reply, and has no other effect.

A request comes at ``ASK/<name>/<verb>``, and Zenoh lets each certificate use only its own name
(:mod:`daemon.batch.security`). Clients of the socket, or over plain TCP, are the owner.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

import zenoh

from daemon.batch import bus
from daemon.batch.errors import DaemonError, KeysUnusable, Refused
from daemon.batch.security import (
    DaemonCredentials,
    KeyRegister,
    load_register,
    strip_control_characters,
)
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._threads import BUSY, JobQueue, LedgerJob
from daemon.model.messages import ASK, OWNER
from daemon.model.verbs import VERBS, AnyVerb, ServerThread
from grammars.text import codec

_LONGEST_PROBLEM: Final = 4000
_LONGEST_KEY: Final = 200
_LOOK_EVERY: Final = 1.0


@dataclass(slots=True)
class RevokedKeys:
    """Revoked keys, including those since the start; without ``keys`` only the owner is admitted.

    Zenoh's callbacks read it; the daemon's own thread reads the register.
    """

    log: EventLog
    keys: DaemonCredentials | None = None
    clock: Callable[[], float] = time.monotonic
    _admitted: frozenset[str] = field(init=False, default=frozenset())
    _revoked: frozenset[str] = field(init=False, default=frozenset())
    _is_read: bool = field(init=False, default=True)
    _look_at: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        if self.keys is not None:
            self._take(self.keys.register)
            self._admitted = frozenset(one.name for one in self.keys.register.issued)

    def problem(self, name: str) -> Refused | None:
        """Return the objection to a request under this name, if any."""
        if name == OWNER:
            return None
        if name not in self._admitted:
            return Refused(f'this daemon does not know the key "{name[:100]}"')
        if name in self._revoked:
            return Refused(f'the key "{name}" was revoked: ask the owner of the daemon for another')
        return None

    def look(self) -> None:
        """Check for revoked keys; call it often, it reads the register once a second."""
        now = self.clock()
        if self.keys is None or now < self._look_at:
            return
        self._look_at = now + _LOOK_EVERY
        try:
            self._take(load_register(self.keys.folder))
            self._is_read = True
        except KeysUnusable as error:
            # Admitted keys stay admitted: the register may be in the middle of a copy.
            if self._is_read:
                self.log.write("register not read", problem=str(error))
            self._is_read = False

    def _take(self, register: KeyRegister) -> None:
        revoked = frozenset(one.name for one in register.issued if one.revoked_at is not None)
        # Revocation is final: a copy of the register may be older than the one read before.
        for name in sorted(revoked - self._revoked):
            self.log.write("key revoked", key=name)
        self._revoked |= revoked


@dataclass(frozen=True, slots=True)
class VerbHandler:
    """Handler of a verb: ``act`` gets the ledger access of the verb's thread, and the request.

    Long work without the ledger runs in the preparer's thread: ``prepare`` then turns the raw
    request into the second argument of ``act``.
    """

    act: Callable[[Any, Any], object]
    prepare: Callable[[bytes], object] | None = None


@dataclass(frozen=True, slots=True)
class RequestDispatcher:
    """Queues requests for the threads that serve them.

    ``overload`` answers requests to a full queue; if it is full too, there is no answer.
    """

    handlers: Mapping[AnyVerb, VerbHandler]
    log: EventLog
    queues: Mapping[ServerThread, JobQueue]
    preparer: JobQueue
    overload: JobQueue
    revoked: RevokedKeys

    def on_query(self, query: zenoh.Query) -> None:
        """Enqueue a request for its thread: the callback of the queryable."""
        # Do not parse or refuse here: Zenoh calls from the thread that reads its sockets, and long
        # work in it delays everything, including heartbeats.
        name, _, word = str(query.key_expr).removeprefix(f"{ASK}/").partition("/")
        denial = self.revoked.problem(name)
        verb = VERBS.get(word)
        if denial is not None:
            # Not logged, since a flood would fill the log.
            self.overload.offer(LedgerJob(lambda _: denial, partial(_refuse, query, str(denial))))
        elif verb is None:
            self._queue(self.queues[ServerThread.READER], query, lambda _: _refuse_unknown(query))
        else:
            self._ask(verb, self.handlers[verb], query)

    def _ask(self, verb: AnyVerb, handler: VerbHandler, query: zenoh.Query) -> None:
        last, prepare = self.queues[verb.thread], handler.prepare
        if prepare is None:

            def act(ledger: object) -> bytes:
                return _answer(verb, handler, ledger, read_request(verb, _payload(verb, query)))

            self._queue(last, query, act)
            return

        def go_on(value: object) -> None:
            if isinstance(value, Exception):
                self._reply(query, value)
            else:
                self._queue(last, query, partial(_answer, verb, handler, request=value))

        self._queue(self.preparer, query, lambda _: prepare(_payload(verb, query)), go_on)

    def _queue(
        self,
        jobs: JobQueue,
        query: zenoh.Query,
        act: Callable[[Any], object],
        done: Callable[[object], None] | None = None,
    ) -> None:
        reply = partial(self._reply, query)
        if not jobs.offer(LedgerJob(act, done or reply)):
            self.overload.offer(LedgerJob(lambda _: BUSY, reply))

    def _reply(self, query: zenoh.Query, value: object) -> None:
        # The requester waits until the query is closed, even after a reply.
        with query:
            try:
                if isinstance(value, bytes):
                    query.reply(query.key_expr, value, attachment=bus.speaker())
                else:
                    words = self._error_text(query, value)
                    query.reply_err(codec.to_json(bus.error_reply(words, value)))
            except zenoh.ZError as error:
                self.log.write("unanswered", key=str(query.key_expr), problem=str(error))

    def _error_text(self, query: zenoh.Query, value: object) -> str:
        if not isinstance(value, DaemonError):
            self.log.write("failure", key=str(query.key_expr), problem=repr(value))
            return f"the daemon failed: {value!r}"[:_LONGEST_PROBLEM]
        versions = bus.version_problem(query.attachment, "the requester")
        words = "; ".join(filter(None, (str(value)[:_LONGEST_PROBLEM], versions)))
        self.log.write("refused", key=str(query.key_expr)[:_LONGEST_KEY], problem=words[:400])
        return words


def _refuse(query: zenoh.Query, words: str, problem: object) -> None:
    with query, suppress(zenoh.ZError):
        query.reply_err(codec.to_json(bus.error_reply(words, problem)))


def _refuse_unknown(query: zenoh.Query) -> object:
    key = str(query.key_expr)[:_LONGEST_KEY]
    raise Refused(f"this daemon does not know how to {key}")


def _payload(verb: AnyVerb, query: zenoh.Query) -> bytes:
    """Return the raw request; raises :class:`Refused` if it is too large."""
    payload = query.payload
    if payload is not None and len(payload) > verb.largest:
        raise Refused(f"the request has {len(payload)} bytes, the limit is {verb.largest}")
    return b"{}" if payload is None else payload.to_bytes()


def read_request(verb: AnyVerb, payload: bytes) -> object:
    """Return the validated request; raises :class:`Refused`."""
    try:
        kind: Any = verb.request
        request: object = codec.from_json(kind, strip_control_characters(payload), exactly=True)
    except ValueError as error:
        raise Refused(f"the request is malformed: {error}") from error
    return request


def _answer(verb: AnyVerb, handler: VerbHandler, ledger: object, request: object) -> bytes:
    # Serialised in the serving thread, within the same snapshot.
    return codec.to_json(handler.act(ledger, request), verb.answer)
