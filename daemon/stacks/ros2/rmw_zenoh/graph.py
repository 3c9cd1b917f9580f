"""The graph of a stack as one participant sees it, and what in it does not fit that participant.

Zenoh connects what has the same key, and the type and its hash are part of the key: endpoints that
differ in either do not meet, and nothing says so. Here it is said.
"""

from __future__ import annotations

from typing import Final

from daemon.stacks.ros2.link import Graph, GraphEndpoint
from daemon.stacks.ros2.rmw_zenoh.interfaces import NO_HASH, distributions_with
from daemon.stacks.ros2.rmw_zenoh.wire import Role, Token

_HASH_SHOWN: Final = len("RIHS01_") + 12

_ROLE_NAMES: Final[dict[Role, str]] = {
    "publisher": "a publisher",
    "subscription": "a subscription",
    "server": "a server",
    "client": "a client",
}


class ZenohGraph:
    """Nodes and endpoints of others, by their tokens; not safe for threads by itself."""

    def __init__(self, domain: int, distribution: str) -> None:
        self._domain = domain
        self._distribution = distribution
        self._tokens: dict[Token, None] = {}
        self._wanted: dict[tuple[Role, str], dict[str, str]] = {}

    def change(self, token: Token, here: bool) -> None:
        """Take in that a token came, or went."""
        if here:
            self._tokens[token] = None
        else:
            self._tokens.pop(token, None)

    def want(self, role: Role, name: str, kind: str, type_hash: str) -> None:
        """Say of which type and hash an endpoint has to be that is to be talked to."""
        self._wanted.setdefault((role, name), {})[kind] = type_hash

    def kinds(self, role: Role, name: str) -> tuple[str, ...]:
        """Return the types of the endpoints of that role and name, oldest first."""
        return tuple(
            token.kind for token in self._here() if token.role == role and token.name == name
        )

    def graph(self) -> Graph:
        """Return everything in sight."""
        tokens = self._here()
        endpoints = tuple(
            GraphEndpoint(
                token.name,
                token.kind,
                token.node,
                token.role,
                token.qos.reliable,
                token.qos.transient_local,
                token.qos.depth,
            )
            for token in tokens
            if token.role in ("publisher", "subscription")
        )
        nodes = {token.node for token in tokens if token.role == "node"}
        services = {token.name for token in tokens if token.role == "server"}
        return Graph(endpoints, tuple(sorted(nodes)), tuple(sorted(services)))

    def problems(self) -> tuple[str, ...]:
        """Return a sentence for everything that would be silent: what differs and what to do."""
        found = {problem for token in self._tokens if (problem := self._problem(token))}
        return tuple(sorted(found))

    def _here(self) -> tuple[Token, ...]:
        return tuple(token for token in self._tokens if token.domain == self._domain)

    def _problem(self, token: Token) -> str:
        if token.domain != self._domain:
            return (
                f"the node {token.node} is in the domain {token.domain}, the run in "
                f"{self._domain}: they do not hear each other. Leave ROS_DOMAIN_ID to the run"
            )
        wanted = self._wanted.get((token.role, token.name))
        if wanted is None or token.hash == wanted.get(token.kind):
            return ""
        theirs = f"{token.name}: {token.node} has {_ROLE_NAMES[token.role]} of type {token.kind}"
        if token.kind not in wanted:
            return (
                f"{theirs}, here it is {' or '.join(wanted)}: nothing would arrive. Name another "
                "topic in the SUT file, or make the stack use this type"
            )
        return (
            f"{theirs} with the type hash {_shown(token.hash)}, here it is "
            f"{_shown(wanted[token.kind])} ({self._distribution}): the definitions differ, nothing "
            f"would arrive. {self._advice(token)}"
        )

    def _advice(self, token: Token) -> str:
        known = list(distributions_with(token.kind, token.hash))
        if token.hash == NO_HASH:
            known = ["humble"]
        if known and self._distribution not in known:
            names = " or ".join(f"distribution: {name}" for name in known)
            return f"It is that of {' and '.join(known)}: write {names}"
        return (
            "Name the distribution of the stack (distribution:), or a folder with its interface "
            "definitions (definitions:)"
        )


def _shown(type_hash: str) -> str:
    return f"{type_hash[:_HASH_SHOWN]}…" if type_hash.startswith("RIHS01_") else type_hash
