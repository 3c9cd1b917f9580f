"""From the bus to the ledger: requests are queued for the ledger's threads, done there, answered.

Zenoh's callbacks only enqueue. A request is validated by the thread that does it; whatever is wrong
with it is its error reply, never more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import zenoh

from daemon.batch import bus
from daemon.batch.errors import DaemonError, Refused
from daemon.batch.security import strip_control_characters
from daemon.batch.server._revoked_keys import RevokedKeys, split_key
from daemon.batch.server._runtime import EventLog
from daemon.batch.server._threads import BUSY, JobQueue, LedgerJob
from daemon.model.verbs import VERBS, AnyVerb, ServerThread
from grammars.text import codec

_LONGEST_PROBLEM: Final = 4000
_LONGEST_KEY: Final = 200


@dataclass(frozen=True, slots=True)
class VerbHandler:
    """What is done about a verb: ``act`` gets what the verb's thread owns of the ledger.

    Its second argument is the request. What takes long and needs no ledger a thread for that does
    first: then ``prepare`` makes of the request, as it came, what ``act`` gets.
    """

    act: Callable[[Any, Any], object]
    prepare: Callable[[bytes], object] | None = None


@dataclass(frozen=True, slots=True)
class RequestDispatcher:
    """Queues requests for the threads that do what they ask for.

    Who finds a full queue is told so by ``overload``; who floods that too hears nothing.
    """

    handlers: Mapping[AnyVerb, VerbHandler]
    log: EventLog
    queues: Mapping[ServerThread, JobQueue]
    preparer: JobQueue
    overload: JobQueue
    revoked: RevokedKeys

    def on_query(self, query: zenoh.Query) -> None:
        """Find the thread and enqueue: the callback of the queryable."""
        # Nothing is parsed or refused here: Zenoh calls from the thread that reads its sockets,
        # and whatever takes long in it delays everybody, heartbeats included.
        name, word = split_key(str(query.key_expr))
        no = self.revoked.problem(name)
        verb = VERBS.get(word)
        if no is not None:
            # Not in the log, which a flood would fill.
            self.overload.offer(LedgerJob(lambda _: no, partial(_refuse, query, str(no))))
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
        # The requester waits until the query is closed, whatever was replied.
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
        versions = bus.version_problem(query.attachment, "whoever asks")
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
    """The request as it came; raises :class:`Refused` when it is too large."""
    payload = query.payload
    if payload is not None and len(payload) > verb.largest:
        raise Refused(f"the request has {len(payload)} bytes, at most {verb.largest} are taken")
    return b"{}" if payload is None else payload.to_bytes()


def read_request(verb: AnyVerb, payload: bytes) -> object:
    """The request, validated; raises :class:`Refused`."""
    try:
        kind: Any = verb.request
        request: object = codec.from_json(kind, strip_control_characters(payload), exactly=True)
    except ValueError as error:
        raise Refused(f"the request is malformed: {error}") from error
    return request


def _answer(verb: AnyVerb, handler: VerbHandler, ledger: object, request: object) -> bytes:
    # In the thread that did it: the answer is of the same snapshot, and bytes when it is passed on.
    return codec.to_json(handler.act(ledger, request), verb.answer)
