"""Access control of the bus: Zenoh's configuration, derived from the rules; default deny."""

from __future__ import annotations

from typing import Final, TypeAlias

from daemon.batch.security._keys import KeyRegister
from daemon.batch.security._rules import CLIENT_ROLES, Role, allowed_verbs
from daemon.model.messages import ALIVE, ASK, EVENTS, LIVE, WORK

ZenohSetting: TypeAlias = dict[str, object]

_ALL_MESSAGES: Final = (
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
)  # fmt: skip
_LIVE_KEYS: Final = f"{LIVE}/**"


def access_control(register: KeyRegister) -> ZenohSetting:
    """Return Zenoh's ``access_control``: each name of the register may what its role may.

    Whoever comes through the socket in the state directory may everything: the file system has
    let in nobody but the daemon's owner. Nobody may answer questions but the daemon itself.
    """
    rules = [
        _rule("owner", "ingress", _ALL_MESSAGES, "**"),
        _rule("to", "egress", _ALL_MESSAGES, "**"),
    ]
    subjects: list[ZenohSetting] = [{"id": "owner", "link_protocols": ["unixsock-stream"]}]
    policies: list[ZenohSetting] = [{"rules": ["owner", "to"], "subjects": ["owner"]}]
    for role in CLIENT_ROLES:
        names = [one.name for one in register.valid(role)]
        if names:
            made = _role_rules(role)
            rules += made
            subjects.append({"id": role.value, "cert_common_names": names})
            policies.append({"rules": [one["id"] for one in made], "subjects": [role.value]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _role_rules(role: Role) -> list[ZenohSetting]:
    questions = [f"{ASK}/{verb}" for verb in allowed_verbs(role)]
    made = [
        _rule(f"{role} asks", "ingress", ("query",), *questions),
        _rule(f"{role} is answered", "egress", ("reply",), *questions),
    ]
    if role is Role.WORKER:
        return [
            *made,
            _rule("worker lives", "ingress", ("liveliness_token",), f"{ALIVE}/*"),
            _rule("worker reports", "ingress", ("put",), _LIVE_KEYS),
            # It publishes only while it knows that somebody listens.
            _rule("worker is watched", "egress", ("declare_subscriber",), _LIVE_KEYS),
            _rule("worker listens", "ingress", ("declare_subscriber",), WORK),
            _rule("worker is told", "egress", ("put",), WORK),
        ]
    return [
        *made,
        _rule(f"{role} listens", "ingress", ("declare_subscriber",), EVENTS, _LIVE_KEYS),
        _rule(f"{role} is told", "egress", ("put",), EVENTS, _LIVE_KEYS),
    ]


def _rule(name: str, flow: str, messages: tuple[str, ...], *keys: str) -> ZenohSetting:
    return {
        "id": name,
        "permission": "allow",
        "flows": [flow],
        "messages": list(messages),
        "key_exprs": list(keys),
    }
