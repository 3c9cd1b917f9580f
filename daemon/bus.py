"""The bus: Zenoh sessions as this project uses them, and question and answer over them.

A router session inside the daemon listens; everybody else is a client of it. Loopback only
unless told otherwise, no multicast, no gossip, no shared memory (its transport optimisation
drops queries when a receiver is not scheduled for ~100 ms, eclipse-zenoh/zenoh#2628).
"""

from __future__ import annotations

import json
import time
from typing import Final, TypeVar

import zenoh

from daemon.errors import DaemonError, Refused, Troubled, Unreachable
from daemon.messages import ASK, LARGEST_SUBMISSION, Problem, Verb
from daemon.places import is_endpoint
from grammars import codec

T = TypeVar("T")

_LINK_LEASE_MS: Final = 4000
"""A peer that is silent for this long is gone (a killed one is noticed at once)."""

_PATIENCE: Final = 0.5
"""Seconds to ask again when nobody answers: a restarting daemon needs a moment."""


def open_router(listen: str) -> zenoh.Session:
    """Open the daemon's session, listening at ``listen``.

    Raises :class:`DaemonError` when the endpoint is malformed or taken.
    """
    try:
        return zenoh.open(_config("router", {"listen/endpoints": [_checked(listen)]}))
    except zenoh.ZError as error:
        raise DaemonError(f"cannot listen at {listen}: {_last_words(error)}") from error


def open_client(endpoint: str) -> zenoh.Session:
    """Open a session connected to the daemon at ``endpoint``; it reconnects by itself.

    Raises :class:`Unreachable` when nothing listens there.
    """
    retry = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}
    settings: dict[str, object] = {
        "connect/endpoints": [_checked(endpoint)],
        "connect/retry": retry,
    }
    try:
        return zenoh.open(_config("client", settings))
    except zenoh.ZError as error:
        raise unreachable(endpoint) from error


def unreachable(endpoint: str) -> Unreachable:
    """Say that nobody answers at ``endpoint`` and what to do about it."""
    return Unreachable(
        f"no daemon answers at {endpoint}: start one with `scenario daemon`, "
        "or name another with --connect or SCENARIO_CONNECT"
    )


def _checked(endpoint: str) -> str:
    if not is_endpoint(endpoint):
        raise DaemonError(f"{endpoint!r} is not an endpoint: write tcp/<host>:<port>")
    return endpoint


def _config(mode: str, settings: dict[str, object]) -> zenoh.Config:
    config = zenoh.Config()
    common = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # else opening a router waits half a second, deaf but connectable
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": _LINK_LEASE_MS,
        "transport/link/rx/max_message_size": LARGEST_SUBMISSION + 2**20,
    }
    for key, value in (common | settings).items():
        config.insert_json5(key, json.dumps(value))
    return config


def _last_words(error: zenoh.ZError) -> str:
    return str(error).split(" at /")[0].strip()


def ask(
    session: zenoh.Session,
    endpoint: str,
    verb: Verb,
    request: object,
    kind: type[T],
    timeout: float,
) -> T:
    """Ask the daemon and return its validated answer.

    No reply at all is no answer: after a moment of patience it is :class:`Unreachable`, as is a
    timeout. An error reply is :class:`Refused` with the daemon's words.
    """
    payload = codec.to_json(request)
    if len(payload) > LARGEST_SUBMISSION:
        raise Refused(
            f"{verb}: {len(payload) / 2**20:.0f} MiB is too much for one request, the daemon takes "
            f"{LARGEST_SUBMISSION / 2**20:.0f} MiB: split the campaign"
        )
    deadline = time.monotonic() + min(timeout, _PATIENCE)
    while True:
        for reply in session.get(
            f"{ASK}/{verb}",
            payload=payload,
            timeout=timeout,
            consolidation=zenoh.ConsolidationMode.NONE,
        ):
            if reply.ok is not None:
                return _answer(kind, reply.ok.payload.to_bytes())
            words = b"" if reply.err is None else reply.err.payload.to_bytes()
            raise _complaint(words, endpoint, timeout)
        if time.monotonic() > deadline:
            raise unreachable(endpoint)
        time.sleep(0.02)


def _answer(kind: type[T], payload: bytes) -> T:
    try:
        return codec.from_json(kind, payload)
    except ValueError as error:
        raise Refused(f"the daemon's answer is not understood, versions differ? {error}") from error


def _complaint(payload: bytes, endpoint: str, timeout: float) -> DaemonError:
    try:
        problem = codec.from_json(Problem, payload)
    except ValueError:
        # Zenoh's own error replies (its timeout) are plain text, never one of our problems.
        return Unreachable(f"the daemon at {endpoint} did not answer within {timeout:g} s")
    return (Troubled if problem.passing else Refused)(problem.problem)
