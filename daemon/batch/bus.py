"""The bus: Zenoh sessions, and requests and answers over them.

A router session inside the daemon listens; all others are its clients. On one machine they meet at
a socket in the state directory, across machines over TLS with keys on both sides
(:mod:`daemon.batch.security`). Data for the ledger always travels as a request, answered after the
commit; publications (events, snapshots, hints) may be lost.
"""

from __future__ import annotations

import functools
import json
import os
import time
from collections.abc import Sequence
from typing import Final, TypeVar

import zenoh

from daemon.batch import errors
from daemon.batch.paths import (
    INSECURE_VARIABLE,
    endpoint_text,
    is_encrypted,
    is_endpoint,
    is_local,
    socket_path,
)
from daemon.batch.security import (
    Credentials,
    DaemonCredentials,
    access_control,
    denial_text,
    handshake_problem,
)
from daemon.model.messages import ASK, LARGEST_SUBMISSION, OWNER, PROTOCOL, ErrorKind, ErrorReply
from daemon.model.spec import own_version
from daemon.model.verbs import Verb
from grammars.text import codec

A = TypeVar("A")

_LINK_LEASE_MS: Final = 4000
"""Silence after which a peer counts as gone [ms].

Measured: a killed peer is noticed in 2 ms, a frozen one in 3.8 s (in 9.8 s with Zenoh's 10 s).
"""

_LARGEST_MESSAGE: Final = 2 * LARGEST_SUBMISSION
"""Largest message of the bus [B]; larger ones are dropped unread. Smaller ones above the limit of
their verb are refused with a reason."""

_LONGEST_VERSION: Final = 200
_PATIENCE: Final = 0.5
"""Time of retries without an answer [s], for a restarting daemon.

Without a daemon Zenoh ends a query at once (0.14 ms), with no reply.
"""


def open_router(listen: Sequence[str], keys: DaemonCredentials | None = None) -> zenoh.Session:
    """Open the daemon's session, listening at every endpoint of ``listen``.

    With ``keys`` it admits the holders of keys, each with the rights of its role. Raises
    :class:`DaemonError` when an endpoint is malformed or in use.
    """
    settings: dict[str, object] = {"listen/endpoints": [_checked(one) for one in listen]}
    if keys is not None:
        settings["transport/link/tls"] = keys.credentials.listening
        settings["access_control"] = access_control(keys.register)
    try:
        return zenoh.open(_config("router", settings))
    except zenoh.ZError as error:
        where = " and ".join(map(endpoint_text, listen))
        # After the reason Zenoh names one of its source files.
        reason = str(error).split(" at /")[0].strip()
        raise errors.PlaceUnusable(f"cannot listen at {where}: {reason}") from error


def open_client(endpoint: str, credentials: Credentials | None = None) -> zenoh.Session:
    """Open a session connected to the daemon at ``endpoint``; it reconnects by itself.

    ``credentials`` are the key for an encrypted endpoint. Raises :class:`Unreachable` when nothing
    listens there, and :class:`DaemonError` for an untrusted endpoint.
    """
    # Zenoh's own period grows to 4 s: a client would miss a restarted daemon for that long.
    retry = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}
    settings: dict[str, object] = {
        "connect/endpoints": [_checked_trust(_checked(endpoint))],
        "connect/retry": retry,
    }
    if credentials is not None:
        settings["transport/link/tls"] = credentials.connecting
    try:
        return zenoh.open(_config("client", settings))
    except zenoh.ZError:
        raise unreachable_error(endpoint, credentials) from None


def unreachable_error(endpoint: str, credentials: Credentials | None = None) -> errors.Unreachable:
    """Return the error for an endpoint without an answer, with the reason and the remedy."""
    if credentials is not None and (words := handshake_problem(endpoint, credentials)):
        return errors.Unreachable(f"{endpoint}: {words}")
    return errors.Unreachable(
        f"no daemon answers at {endpoint_text(endpoint)}: start one with `scenario daemon`, "
        "or name another with --connect or SCENARIO_CONNECT"
    )


def _checked(endpoint: str) -> str:
    if not is_endpoint(endpoint):
        raise errors.DaemonError(
            f"{endpoint!r} is not an endpoint: write tcp/<host>:<port> or tls/<host>:<port>"
        )
    return endpoint


def _checked_trust(endpoint: str) -> str:
    """Refuse endpoints where others may listen, or may take the daemon's place.

    We make the folder of a socket private, but --connect may name any path, and the owner of a
    socket there receives everything submitted.
    """
    path = socket_path(endpoint)
    if path is not None and path.exists() and path.stat().st_uid != os.getuid():
        raise errors.DaemonError(f"{path} belongs to somebody else: a daemon there is not yours")
    trusted = path is not None or is_encrypted(endpoint) or is_local(endpoint)
    if not trusted and not os.environ.get(INSECURE_VARIABLE):
        raise errors.DaemonError(
            f"{endpoint} is neither encrypted nor authenticated: use tls/ with keys "
            f"(`scenario keys`), or set {INSECURE_VARIABLE}=1 in a network you trust"
        )
    return endpoint


def _config(mode: str, settings: dict[str, object]) -> zenoh.Config:
    config = zenoh.Config()
    common = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # otherwise a new router is deaf for half a second
        # Shared memory silently drops queries above 3 kB when their receiver is not scheduled for
        # ~100 ms (eclipse-zenoh/zenoh#2628), as on a machine full of runs.
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": _LINK_LEASE_MS,
        "transport/link/rx/max_message_size": _LARGEST_MESSAGE,
    }
    for key, value in (common | settings).items():
        config.insert_json5(key, json.dumps(value))
    return config


@functools.cache
def speaker() -> bytes:
    """Return the version of this process and of its messages, attached to every message."""
    return f"{own_version()}, protocol {PROTOCOL}".encode()


def version_problem(attachment: zenoh.ZBytes | None, who: str) -> str:
    """Return the difference between our version and the sender's; empty if they are equal."""
    theirs = b"an older version" if attachment is None else attachment.to_bytes()
    if theirs == speaker():
        return ""
    words = theirs[:_LONGEST_VERSION].decode(errors="replace")
    return f"versions differ: {who} has {words}, this is {speaker().decode()}"


_RAISED: Final[dict[ErrorKind, type[errors.DaemonError]]] = {
    ErrorKind.REFUSED: errors.Refused,
    ErrorKind.FAILED: errors.Failed,
    ErrorKind.OTHER_LEDGER: errors.OtherLedger,
    ErrorKind.UNAVAILABLE: errors.Unavailable,  # last, since the two before are subclasses
}


def error_reply(words: str, error: object) -> ErrorReply:
    """Return the reply, with ``words``, to a request that raised ``error``."""
    rejection = error.rejection if isinstance(error, errors.Rejected) else None
    kinds = (kind for kind, raised in _RAISED.items() if isinstance(error, raised))
    # Unexpected errors say nothing about the request.
    return ErrorReply(words, next(kinds, ErrorKind.FAILED), rejection)


def ask(
    session: zenoh.Session,
    endpoint: str,
    verb: Verb[..., A],
    request: object,
    timeout: float,
    credentials: Credentials | None = None,
) -> A:
    """Ask the daemon and return its validated answer.

    Raises :class:`Unreachable` after :data:`_PATIENCE` without a reply, and after a timeout. An
    error reply raises the exception of its kind, with the daemon's words.
    Raises :class:`Refused` if the key of the ``credentials`` lacks the right: the bus would drop
    the request silently.
    """
    # Check before sending: the silence of the bus would look like a missing daemon.
    denial = "" if credentials is None else denial_text(credentials.name, credentials.role, verb)
    if denial:
        raise errors.Refused(denial)
    payload = codec.to_json(request)
    if len(payload) > verb.largest:
        raise errors.Refused(
            f"{verb}: {len(payload) / 2**20:.1f} MiB is too much for one request, the daemon takes "
            f"{verb.largest / 2**20:.1f} MiB{verb.advice and f': {verb.advice}'}"
        )
    deadline = time.monotonic() + min(timeout, _PATIENCE)
    while True:
        for reply in session.get(
            f"{ASK}/{key_name(credentials)}/{verb}",
            payload=payload,
            attachment=speaker(),
            timeout=timeout,
            # By default Zenoh holds replies back until the last; there is only one.
            consolidation=zenoh.ConsolidationMode.NONE,
        ):
            if reply.ok is not None:
                return _validated_answer(verb.answer, reply.ok)
            words = b"" if reply.err is None else reply.err.payload.to_bytes()
            raise _error_reply(words, endpoint, timeout)
        if time.monotonic() > deadline:
            raise _no_answer_error(session, endpoint, credentials)
        time.sleep(0.02)


def key_name(credentials: Credentials | None) -> str:
    """Return the name for keys of the bus: that of the certificate, or the owner's."""
    return OWNER if credentials is None else credentials.name


def _no_answer_error(
    session: zenoh.Session, endpoint: str, credentials: Credentials | None
) -> errors.Unreachable:
    # Without a connection the daemon has not seen the key.
    if credentials is None or not session.info.routers_zid():
        return unreachable_error(endpoint, credentials)
    return errors.Unreachable(
        f'the daemon at {endpoint} does not answer to the key "{credentials.name}": it is starting '
        "or stopping, or it started before the key was made, or the key was revoked "
        "(`scenario keys list`)"
    )


def _validated_answer(kind: type[A], answer: zenoh.Sample) -> A:
    try:
        return codec.from_json(kind, answer.payload.to_bytes())
    except ValueError as error:
        # On one line: of several lines people see the last, which is pydantic's address.
        words = " ".join(str(error).split())
        versions = version_problem(answer.attachment, "the daemon")
        problem = "the daemon's answer is not understood"
        raise errors.Refused("; ".join(filter(None, (problem, versions, words)))) from error


def _error_reply(payload: bytes, endpoint: str, timeout: float) -> errors.DaemonError:
    try:
        reply = codec.from_json(ErrorReply, payload)
    except ValueError:
        # Zenoh's own error replies (its timeout) are plain text, never one of our problems.
        where = endpoint_text(endpoint)
        return errors.Unreachable(f"the daemon at {where} did not answer within {timeout:g} s")
    if reply.rejection is not None:
        return errors.Rejected(reply.problem, reply.rejection)
    return _RAISED[reply.kind](reply.problem)
