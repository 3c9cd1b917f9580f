"""Who may ask what: one table of verbs, roles and sizes, from which everything else is derived.

The access control of the bus, the sentence a person reads when a key is not enough, the size a
request may have and the tables of ``docs/security.md`` all come from :data:`RULES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from daemon.messages import LARGEST_REQUEST, LARGEST_SUBMISSION, Verb


class Role(StrEnum):
    """What a key is for; the first part of the common name of its certificate."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    WORKER = "worker"
    DAEMON = "daemon"


CLIENTS: Final = (Role.VIEWER, Role.OPERATOR, Role.WORKER)
"""The roles that connect; the daemon is what they connect to."""


@dataclass(frozen=True, slots=True)
class Rule:
    """Who may use a verb, and how many bytes a request may have."""

    roles: frozenset[Role]
    largest: int


_SMALL: Final = 16 * 2**10
_LOOK: Final = frozenset({Role.VIEWER, Role.OPERATOR})
_STEER: Final = frozenset({Role.OPERATOR})
_WORK: Final = frozenset({Role.WORKER})

RULES: Final[Mapping[Verb, Rule]] = MappingProxyType(
    {
        Verb.OVERVIEW: Rule(_LOOK, _SMALL),
        Verb.CAMPAIGNS: Rule(_LOOK, _SMALL),
        Verb.RUNS: Rule(_LOOK, _SMALL),
        Verb.RUN: Rule(_LOOK, _SMALL),
        Verb.DECLARED: Rule(_LOOK, _SMALL),
        Verb.RECORDS: Rule(_LOOK, _SMALL),
        Verb.SCENE: Rule(_LOOK | _WORK, _SMALL),
        Verb.WORKERS: Rule(_LOOK, _SMALL),
        Verb.DISK: Rule(_LOOK, _SMALL),
        Verb.FETCH: Rule(_LOOK, _SMALL),
        Verb.FILE: Rule(_WORK, _SMALL),
        Verb.KEEP: Rule(_STEER, LARGEST_REQUEST),
        Verb.SUBMIT: Rule(_STEER, LARGEST_SUBMISSION),
        Verb.CANCEL: Rule(_STEER, _SMALL),
        Verb.RETRY: Rule(_STEER, _SMALL),
        Verb.PAUSE: Rule(_STEER, _SMALL),
        Verb.RESUME: Rule(_STEER, _SMALL),
        Verb.PRIORITISE: Rule(_STEER, _SMALL),
        Verb.SHUTDOWN: Rule(_STEER, _SMALL),
        Verb.WELCOME: Rule(_WORK, _SMALL),
        Verb.LEASE: Rule(_WORK, 8 * _SMALL),
        Verb.RENEW: Rule(_WORK, LARGEST_REQUEST),
        Verb.COMPLETE: Rule(_WORK, LARGEST_REQUEST),
        Verb.RELEASE: Rule(_WORK, 16 * _SMALL),
        Verb.UPLOAD: Rule(_WORK, LARGEST_REQUEST),
    }
)

_MAY: Final = {
    Role.VIEWER: "it may look, not steer or work",
    Role.OPERATOR: "it may look, submit and steer, not work",
    Role.WORKER: "it may execute runs, not look or steer",
    Role.DAEMON: "it is the daemon's own and asks nothing",
}


def allowed(role: Role) -> tuple[Verb, ...]:
    """Return the verbs a role may use."""
    return tuple(verb for verb, rule in RULES.items() if role in rule.roles)


def denial(name: str, role: Role, verb: Verb) -> str:
    """Say why the key ``name`` is not enough for ``verb``; empty when it is."""
    rule = RULES[verb]
    if role in rule.roles:
        return ""
    wanted = " or ".join(_a(one) for one in sorted(rule.roles))
    return (
        f'{verb}: the key "{name}" is that of {_a(role)}: {_MAY[role]}; '
        f"ask whoever keeps the daemon for the key of {wanted} (`scenario keys issue`)"
    )


def _a(role: Role) -> str:
    return f"{'an' if role is Role.OPERATOR else 'a'} {role}"
