"""Who may ask what: one table of verbs, roles and sizes, from which everything else is derived.

The access control of the bus, the sentence a person reads when a key is not enough, the size a request may have and the tables of ``docs/security.md`` all come from :data:`VERB_RULES`. No text of a request keeps its control characters.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from daemon.model.messages import LARGEST_REQUEST, LARGEST_SUBMISSION, Verb


class Role(StrEnum):
    """What a key is for; the first part of the common name of its certificate."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    WORKER = "worker"
    DAEMON = "daemon"


CLIENT_ROLES: Final = (Role.VIEWER, Role.OPERATOR, Role.WORKER)
"""The roles that connect; the daemon is what they connect to."""


@dataclass(frozen=True, slots=True)
class VerbRule:
    """Who may use a verb, and how many bytes a request may have."""

    roles: frozenset[Role]
    largest: int


_SMALL: Final = 16 * 2**10
_VIEWING: Final = frozenset({Role.VIEWER, Role.OPERATOR})
_STEERING: Final = frozenset({Role.OPERATOR})
_WORKING: Final = frozenset({Role.WORKER})

VERB_RULES: Final[Mapping[Verb, VerbRule]] = MappingProxyType(
    {
        Verb.OVERVIEW: VerbRule(_VIEWING, _SMALL),
        Verb.CAMPAIGNS: VerbRule(_VIEWING, _SMALL),
        Verb.RUNS: VerbRule(_VIEWING, _SMALL),
        Verb.RUN: VerbRule(_VIEWING, _SMALL),
        Verb.DECLARED: VerbRule(_VIEWING, _SMALL),
        Verb.RECORDS: VerbRule(_VIEWING, _SMALL),
        Verb.SCENE: VerbRule(_VIEWING | _WORKING, _SMALL),
        Verb.WORKERS: VerbRule(_VIEWING, _SMALL),
        Verb.DISK: VerbRule(_VIEWING, _SMALL),
        Verb.FETCH: VerbRule(_VIEWING, _SMALL),
        Verb.FILE: VerbRule(_WORKING, _SMALL),
        Verb.KEEP: VerbRule(_STEERING, LARGEST_REQUEST),
        Verb.SUBMIT: VerbRule(_STEERING, LARGEST_SUBMISSION),
        Verb.CANCEL: VerbRule(_STEERING, _SMALL),
        Verb.RETRY: VerbRule(_STEERING, _SMALL),
        Verb.PAUSE: VerbRule(_STEERING, _SMALL),
        Verb.RESUME: VerbRule(_STEERING, _SMALL),
        Verb.PRIORITISE: VerbRule(_STEERING, _SMALL),
        Verb.SHUTDOWN: VerbRule(_STEERING, _SMALL),
        Verb.WELCOME: VerbRule(_WORKING, _SMALL),
        Verb.LEASE: VerbRule(_WORKING, 8 * _SMALL),
        Verb.RENEW: VerbRule(_WORKING, LARGEST_REQUEST),
        Verb.COMPLETE: VerbRule(_WORKING, LARGEST_REQUEST),
        Verb.RELEASE: VerbRule(_WORKING, 16 * _SMALL),
        Verb.UPLOAD: VerbRule(_WORKING, LARGEST_REQUEST),
    }
)

_PERMISSIONS: Final = {
    Role.VIEWER: "it may look, not steer or work",
    Role.OPERATOR: "it may look, submit and steer, not work",
    Role.WORKER: "it may execute runs, not look or steer",
    Role.DAEMON: "it is the daemon's own and asks nothing",
}


def allowed_verbs(role: Role) -> tuple[Verb, ...]:
    """Return the verbs a role may use."""
    return tuple(verb for verb, rule in VERB_RULES.items() if role in rule.roles)


def denial_text(name: str, role: Role, verb: Verb) -> str:
    """Say why the key ``name`` is not enough for ``verb``; empty when it is."""
    rule = VERB_RULES[verb]
    if role in rule.roles:
        return ""
    wanted = " or ".join(_with_article(one) for one in sorted(rule.roles))
    return (
        f'{verb}: the key "{name}" is that of {_with_article(role)}: {_PERMISSIONS[role]}; '
        f"ask whoever keeps the daemon for the key of {wanted} (`scenario keys issue`)"
    )


def _with_article(role: Role) -> str:
    return f"{'an' if role is Role.OPERATOR else 'a'} {role}"


# Every alternative begins with a letter of its own: so the search skips what has none of them.
_CONTROL_CHARACTERS: Final = re.compile(
    rb'\\["\\/nrt](?:\\["\\/nrt])*'
    rb"|\\[bf]"
    rb"|\\u00(?:0[0-8bBcCeEfF]|1[0-9a-fA-F]|7[fF]|[89][0-9a-fA-F])"
    rb"|\x7f"
    rb"|\xc2[\x80-\x9f]"
)
_HARMLESS: Final = frozenset(rb'"\/nrt')
_REPLACEMENT: Final = "\N{REPLACEMENT CHARACTER}".encode()


def strip_control_characters(document: bytes) -> bytes:
    r"""Return a JSON document without control characters in its texts, save ``\n \r \t``.

    They move cursors, rename windows and worse; each becomes U+FFFD. JSON allows them only as
    escapes (RFC 8259, section 7), save DEL and the C1 controls, so all can be found without
    parsing.
    """
    return _CONTROL_CHARACTERS.sub(_replacement, document)


def _replacement(found: re.Match[bytes]) -> bytes:
    text = found[0]
    # Passed over rather than not found, so that an escaped backslash begins no other escape.
    return text if text[0] == 0x5C and text[1] in _HARMLESS else _REPLACEMENT
