"""Access control of the bus, from the verbs' declarations; default deny.

The settings of Zenoh, the message for a key without a right, and the removal of control characters
from the texts of requests.
"""

from __future__ import annotations

import re
from typing import Final, TypeAlias

from daemon.batch.security._keys import KeyRegister
from daemon.model.messages import ALIVE, ASK, EVENTS, LIVE, WORK
from daemon.model.verbs import VERBS, AnyVerb, Role

CLIENT_ROLES: Final = (Role.VIEWER, Role.OPERATOR, Role.WORKER)
"""Roles of clients, which connect to the daemon."""

ZenohSetting: TypeAlias = dict[str, object]

_ALL_MESSAGES: Final = (
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
)  # fmt: skip
_LIVE_KEYS: Final = f"{LIVE}/**"


def access_control(register: KeyRegister) -> ZenohSetting:
    """Return Zenoh's ``access_control``: each name of the register has the rights of its role.

    Requests, liveliness and telemetry are admitted only below the name of their sender, so the
    daemon can trust the name in a key.

    Clients of the socket in the state directory have all rights: the file system admits only the
    daemon's owner. Only the daemon itself may answer requests.
    """
    rules = [
        _rule("owner", "ingress", _ALL_MESSAGES, "**"),
        _rule("to", "egress", _ALL_MESSAGES, "**"),
    ]
    subjects: list[ZenohSetting] = [{"id": "owner", "link_protocols": ["unixsock-stream"]}]
    policies: list[ZenohSetting] = [{"rules": ["owner", "to"], "subjects": ["owner"]}]
    # Zenoh matches common names exactly, without patterns: every valid name is listed here, and a
    # daemon does not know names issued after its start.
    for role in CLIENT_ROLES:
        for issued in register.valid(role):
            own = _key_rules(issued.name, role)
            rules += own
            subjects.append({"id": issued.name, "cert_common_names": [issued.name]})
            policies.append({"rules": [one["id"] for one in own], "subjects": [issued.name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _key_rules(name: str, role: Role) -> list[ZenohSetting]:
    requests = [f"{ASK}/{name}/{verb}" for verb in allowed_verbs(role)]
    # Ingress and egress have separate rules: without the second one the answer would be dropped.
    rules = [
        _rule(f"{name} asks", "ingress", ("query",), *requests),
        _rule(f"{name} is answered", "egress", ("reply",), *requests),
    ]
    if role is Role.WORKER:
        return [
            *rules,
            _rule(f"{name} lives", "ingress", ("liveliness_token",), f"{ALIVE}/{name}/*"),
            _rule(f"{name} reports", "ingress", ("put",), f"{LIVE}/{name}/**"),
            # It publishes only while somebody listens.
            _rule(f"{name} is watched", "egress", ("declare_subscriber",), _LIVE_KEYS),
            _rule(f"{name} listens", "ingress", ("declare_subscriber",), WORK),
            _rule(f"{name} is told", "egress", ("put",), WORK),
        ]
    return [
        *rules,
        _rule(f"{name} listens", "ingress", ("declare_subscriber",), EVENTS, _LIVE_KEYS),
        _rule(f"{name} is told", "egress", ("put",), EVENTS, _LIVE_KEYS),
    ]


def _rule(name: str, flow: str, messages: tuple[str, ...], *keys: str) -> ZenohSetting:
    return {
        "id": name,
        "permission": "allow",
        "flows": [flow],
        "messages": list(messages),
        "key_exprs": list(keys),
    }


_PERMISSIONS: Final = {
    Role.VIEWER: "it may look, not steer or work",
    Role.OPERATOR: "it may look, submit and steer, not work",
    Role.WORKER: "it may execute runs, not look or steer",
    Role.DAEMON: "it is for the daemon itself and sends no requests",
}


def allowed_verbs(role: Role) -> tuple[str, ...]:
    """Return the names of the verbs a role may use."""
    return tuple(name for name, verb in VERBS.items() if role in verb.roles)


def denial_text(name: str, role: Role, verb: AnyVerb) -> str:
    """Return why the key ``name`` may not use ``verb``; empty if it may."""
    if role in verb.roles:
        return ""
    roles = " or ".join(_with_article(one) for one in sorted(verb.roles))
    return (
        f'{verb}: the key "{name}" is that of {_with_article(role)}: {_PERMISSIONS[role]}; '
        f"ask the owner of the daemon for the key of {roles} (`scenario keys issue`)"
    )


def _with_article(role: Role) -> str:
    return f"{'an' if role is Role.OPERATOR else 'a'} {role}"


# Every alternative begins with its own letter, so the search can skip all other text.
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
    r"""Return a JSON document without control characters in its texts, except ``\n \r \t``.

    They move cursors, rename windows and worse; each becomes U+FFFD. JSON allows them only as
    escapes (RFC 8259, section 7), except DEL and the C1 controls, so no parsing is needed.
    """
    return _CONTROL_CHARACTERS.sub(_replacement, document)


def _replacement(match: re.Match[bytes]) -> bytes:
    text = match[0]
    # Matched and kept, so that an escaped backslash does not begin another escape.
    return text if text[0] == 0x5C and text[1] in _HARMLESS else _REPLACEMENT
