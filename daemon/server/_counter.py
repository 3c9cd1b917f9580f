"""The counter: takes requests off the bus, has clerks do them at the desk, replies.

Zenoh's callbacks only enqueue. Requests are validated by the clerk that does them; whatever is
wrong with one is its error reply, never more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import zenoh

from daemon.errors import DaemonError, Refused, Unreachable
from daemon.messages import Problem, Verb
from daemon.security import RULES, tamed
from daemon.server._clerks import Doorman, Job, Questions, Writer
from daemon.server._journal import Journal
from grammars import codec

_LONGEST_COMPLAINT: Final = 4000
_LONGEST_KEY: Final = 200


@dataclass(frozen=True, slots=True)
class Service:
    """What is done about a verb: by the reader, by the writer, or by the carrier of megabytes.

    ``act`` gets the side of the ledger its clerk owns, and the request. What takes long and needs
    no ledger, the carrier does before the writer: ``prepare`` makes of the request what ``act``
    gets. ``answer`` names the type of the answer when it is not its class.
    """

    request: Any
    act: Callable[[Any, Any], object]
    answer: Any = None
    writes: bool = False
    carries: bool = False
    prepare: Callable[[Any], object] | None = None


@dataclass(frozen=True, slots=True)
class Counter:
    """Queues requests for the clerks.

    Who finds a full queue is told so by the ``doorman``; who floods that too hears nothing.
    """

    services: Mapping[Verb, Service]
    journal: Journal
    writer: Writer
    questions: Questions
    carrier: Questions
    doorman: Doorman

    def receive(self, query: zenoh.Query) -> None:
        """Find the clerk and enqueue: the callback of the queryable."""
        verb = str(query.key_expr).rpartition("/")[2]
        service = self.services.get(verb)  # type: ignore[call-overload]
        if service is None:
            self._queue(self.questions, query, lambda _: _unknown(query))
        elif service.prepare is not None:
            self._prepare(service, service.prepare, verb, query)
        else:
            clerk: Writer | Questions = self.questions
            if service.writes or service.carries:
                clerk = self.writer if service.writes else self.carrier
            self._queue(
                clerk, query, lambda ledger: _act(service, ledger, _request(service, verb, query))
            )

    def _queue(
        self,
        clerk: Writer | Questions,
        query: zenoh.Query,
        act: Callable[[Any], object],
        done: Callable[[object], None] | None = None,
    ) -> None:
        size = 0 if query.payload is None else len(query.payload)
        job = Job(act, done or (lambda value: self._reply(query, value)), size)
        if not clerk.offer(job):
            self.doorman.offer(job)

    def _prepare(
        self, service: Service, prepare: Callable[[Any], object], verb: str, query: zenoh.Query
    ) -> None:
        def go_on(value: object) -> None:
            if isinstance(value, Exception):
                self._reply(query, value)
            else:
                self._queue(self.writer, query, lambda book: _act(service, book, value))

        self._queue(self.carrier, query, lambda _: prepare(_request(service, verb, query)), go_on)

    def _reply(self, query: zenoh.Query, value: object) -> None:
        with query:
            try:
                if isinstance(value, bytes):
                    query.reply(query.key_expr, value)
                else:
                    passing = isinstance(value, Unreachable)
                    problem = Problem(self._complaint(query, value), passing)
                    query.reply_err(codec.to_json(problem))
            except zenoh.ZError as error:
                self.journal.write("unanswered", key=str(query.key_expr), problem=str(error))

    def _complaint(self, query: zenoh.Query, value: object) -> str:
        if not isinstance(value, DaemonError):
            self.journal.write("failure", key=str(query.key_expr), problem=repr(value))
            return f"the daemon failed: {value!r}"[:_LONGEST_COMPLAINT]
        key = str(query.key_expr)[:_LONGEST_KEY]
        self.journal.write("refused", key=key, problem=str(value)[:400])
        return str(value)[:_LONGEST_COMPLAINT]


def _unknown(query: zenoh.Query) -> object:
    raise Refused(f"this daemon does not know how to {str(query.key_expr)[:_LONGEST_KEY]}")


def _request(service: Service, verb: str, query: zenoh.Query) -> object:
    """The request, validated; raises :class:`Refused`."""
    payload = query.payload
    limit = RULES[Verb(verb)].largest
    if payload is not None and len(payload) > limit:
        raise Refused(f"the request has {len(payload)} bytes, at most {limit} are taken")
    data = b"{}" if payload is None else payload.to_bytes()
    try:
        request: object = codec.from_json(service.request, tamed(data), exactly=True)
    except ValueError as error:
        raise Refused(f"the request is malformed: {error}") from error
    return request


def _act(service: Service, ledger: object, request: object) -> bytes:
    return codec.to_json(service.act(ledger, request), service.answer)
