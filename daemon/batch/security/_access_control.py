"""Who may do what on the bus, from the verbs' declarations; default deny.

The access control of Zenoh, the sentence a person reads when a key is not enough, and what no text
of a request keeps: control characters.
"""

from __future__ import annotations

import re
from typing import Final, TypeAlias

from daemon.batch.security._keys import KeyRegister
from daemon.model.messages import ALIVE, ASK, EVENTS, LIVE, WORK
from daemon.model.verbs import VERBS, AnyVerb, Role

CLIENT_ROLES: Final = (Role.VIEWER, Role.OPERATOR, Role.WORKER)
"""The roles that connect; the daemon is what they connect to."""

ZenohSetting: TypeAlias = dict[str, object]

_ALL_MESSAGES: Final = (
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
)  # fmt: skip
_LIVE_KEYS: Final = f"{LIVE}/**"


def access_control(register: KeyRegister) -> ZenohSetting:
    """Return Zenoh's ``access_control``: each name of the register may what its role may.

    Questions, liveliness and telemetry are let in below the name of their sender only: what the
    daemon reads there is what the certificate says.

    Whoever comes through the socket in the state directory may everything: the file system has
    let in nobody but the daemon's owner. Nobody may answer questions but the daemon itself.
    """
    rules = [
        _rule("owner", "ingress", _ALL_MESSAGES, "**"),
        _rule("to", "egress", _ALL_MESSAGES, "**"),
    ]
    subjects: list[ZenohSetting] = [{"id": "owner", "link_protocols": ["unixsock-stream"]}]
    policies: list[ZenohSetting] = [{"rules": ["owner", "to"], "subjects": ["owner"]}]
    # Zenoh matches common names exactly and knows no patterns: every valid name stands here, and a
    # daemon does not know those that are issued after its start.
    for role in CLIENT_ROLES:
        for issued in register.valid(role):
            made = _key_rules(issued.name, role)
            rules += made
            subjects.append({"id": issued.name, "cert_common_names": [issued.name]})
            policies.append({"rules": [one["id"] for one in made], "subjects": [issued.name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _key_rules(name: str, role: Role) -> list[ZenohSetting]:
    questions = [f"{ASK}/{name}/{verb}" for verb in allowed_verbs(role)]
    # What comes in and what goes out are ruled apart: without the second rule a question is
    # answered and the answer dropped on its way.
    made = [
        _rule(f"{name} asks", "ingress", ("query",), *questions),
        _rule(f"{name} is answered", "egress", ("reply",), *questions),
    ]
    if role is Role.WORKER:
        return [
            *made,
            _rule(f"{name} lives", "ingress", ("liveliness_token",), f"{ALIVE}/{name}/*"),
            _rule(f"{name} reports", "ingress", ("put",), f"{LIVE}/{name}/**"),
            # It publishes only while it knows that somebody listens.
            _rule(f"{name} is watched", "egress", ("declare_subscriber",), _LIVE_KEYS),
            _rule(f"{name} listens", "ingress", ("declare_subscriber",), WORK),
            _rule(f"{name} is told", "egress", ("put",), WORK),
        ]
    return [
        *made,
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
    Role.DAEMON: "it is the daemon's own and asks nothing",
}


def allowed_verbs(role: Role) -> tuple[str, ...]:
    """Return the names of the verbs a role may use."""
    return tuple(name for name, verb in VERBS.items() if role in verb.roles)


def denial_text(name: str, role: Role, verb: AnyVerb) -> str:
    """Say why the key ``name`` is not enough for ``verb``; empty when it is."""
    if role in verb.roles:
        return ""
    wanted = " or ".join(_with_article(one) for one in sorted(verb.roles))
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
