"""One ROS 2 node without ROS: publishers, subscriptions and clients on a Zenoh session.

What is heard is handed to functions that are called in the threads that receive, so that messages
of different topics keep their order: they must be short and ask nothing of Zenoh.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from typing import Any, Final

import zenoh
from zenoh import ext

from daemon.stacks.ros2.link import LinkLost
from daemon.stacks.ros2.rmw_zenoh.interfaces import Interfaces
from daemon.stacks.ros2.rmw_zenoh.wire import (
    GRAPH,
    QosProfile,
    Role,
    Token,
    attachment,
    gid,
    read_token,
    token_key,
    topic_key,
)

_HEARTBEAT: Final = 0.5
_SERVICES: Final = QosProfile()


class Publisher:
    """A publisher: every message waits for its place in the queue, none is dropped."""

    def __init__(self, declared: Any, sender: bytes) -> None:
        self._declared = declared
        self._sender = sender
        self._sequence = itertools.count(1)

    def publish(self, data: bytes) -> None:
        """Publish CDR; raises :class:`LinkLost` when the session is gone."""
        words = attachment(next(self._sequence), time.time_ns(), self._sender)
        try:
            self._declared.put(data, attachment=words)
        except zenoh.ZError as error:
            raise LinkLost(f"Zenoh does not publish any more: {error}") from error

    @property
    def matched(self) -> bool:
        """Whether what is published reaches somebody; always for latched topics, which wait."""
        return bool(getattr(self._declared, "matching_status", True))


class ServiceClient:
    """A client of one service."""

    def __init__(self, session: zenoh.Session, key: str, sender: bytes) -> None:
        self._session = session
        self._key = key
        self._sender = sender
        self._sequence = itertools.count(1)

    def call(
        self, request: bytes, timeout: float, answered: Callable[[bytes | None], object]
    ) -> None:
        """Ask; ``answered`` is called exactly once: with CDR, or ``None`` when there was none.

        ``None`` comes at once while there is no server, else after ``timeout`` [s].
        """
        heard = False

        def take(reply: zenoh.Reply) -> None:
            nonlocal heard
            # Not at the end of replies: a server may hold on to a request it has answered.
            if reply.ok is not None and not heard:
                heard = True
                answered(reply.ok.payload.to_bytes())

        def end() -> None:
            if not heard:
                answered(None)

        try:
            self._session.get(
                self._key,
                zenoh.handlers.Callback(take, end, indirect=False),
                payload=request,
                attachment=attachment(next(self._sequence), time.time_ns(), self._sender),
                target=zenoh.QueryTarget.ALL_COMPLETE,
                consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.BLOCK,
                express=True,
                timeout=timeout,
            )
        except zenoh.ZError as error:
            raise LinkLost(f"Zenoh does not ask any more: {error}") from error


class RosNode:
    """A node in the graph of ``domain``; ``name`` is absolute."""

    def __init__(
        self, session: zenoh.Session, domain: int, name: str, interfaces: Interfaces
    ) -> None:
        self.session = session
        self.domain = domain
        self.name = name
        self.interfaces = interfaces
        self.zid = str(session.zid())
        self._ids = itertools.count(1)
        # Undeclared when dropped: held as long as this node.
        self._declared: list[Any] = []
        self._stand(Token(domain, self.zid, 0, 0, "node", name))

    def publisher(self, name: str, kind: str, qos: QosProfile) -> Publisher:
        """Make a publisher; a transient local one keeps its last messages for who comes late."""
        key = self.key(name, kind)
        declared: zenoh.Publisher | ext.AdvancedPublisher
        if qos.transient_local:
            declared = ext.declare_advanced_publisher(
                self.session,
                key,
                congestion_control=zenoh.CongestionControl.BLOCK,
                express=True,
                cache=ext.CacheConfig(max_samples=qos.depth),
                publisher_detection=True,
                sample_miss_detection=ext.MissDetectionConfig(
                    heartbeat=None, sporadic_heartbeat=_HEARTBEAT
                ),
            )
        else:
            declared = self.session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.BLOCK, express=True
            )
        self._declared.append(declared)
        return Publisher(declared, gid(self.announce("publisher", name, kind, qos)))

    def subscribe(
        self,
        name: str,
        kind: str,
        qos: QosProfile,
        heard: Callable[[bytes], object],
        *,
        announced: bool = True,
    ) -> None:
        """Have ``heard`` called with the CDR of every message of others than this session.

        Not ``announced``: not in the graph until :meth:`announce` is called.
        """
        key = self.key(name, kind)
        handler: zenoh.handlers.Callback[zenoh.Sample] = zenoh.handlers.Callback(
            lambda sample: heard(sample.payload.to_bytes()), indirect=False
        )
        declared: zenoh.Subscriber[None] | ext.AdvancedSubscriber[None]
        if qos.transient_local:
            history = ext.HistoryConfig(detect_late_publishers=True, max_samples=qos.depth)
            declared = ext.declare_advanced_subscriber(
                self.session,
                key,
                handler,
                allowed_origin=zenoh.Locality.REMOTE,
                history=history,
                recovery=ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
                subscriber_detection=True,
            )
        else:
            declared = self.session.declare_subscriber(
                key, handler, allowed_origin=zenoh.Locality.REMOTE
            )
        self._declared.append(declared)
        if announced:
            self.announce("subscription", name, kind, qos)

    def client(self, name: str, kind: str) -> ServiceClient:
        """Make a client of a service."""
        sender = gid(self.announce("client", name, kind, _SERVICES))
        return ServiceClient(self.session, self.key(name, kind), sender)

    def announce(self, role: Role, name: str, kind: str, qos: QosProfile) -> str:
        """Put an endpoint into the graph and return the key of its token."""
        return self._stand(
            Token(
                self.domain,
                self.zid,
                0,
                next(self._ids),
                role,
                self.name,
                name,
                kind,
                self.interfaces.hash(kind),
                qos,
            )
        )

    def watch(self, changed: Callable[[Token, bool], object]) -> None:
        """Have ``changed`` called for every endpoint and node that comes (true) or goes.

        Those of other domains too, its own left out.
        """

        def take(sample: zenoh.Sample) -> None:
            token = read_token(str(sample.key_expr))
            if token is not None and token.session != self.zid:
                changed(token, sample.kind == zenoh.SampleKind.PUT)

        self._declared.append(
            self.session.liveliness().declare_subscriber(f"{GRAPH}/**", take, history=True)
        )

    def close(self) -> None:
        """Leave the graph; what is heard by then may still be told."""
        self._declared.clear()

    def key(self, name: str, kind: str) -> str:
        """Return the key of a topic or service of a loaded type."""
        return topic_key(self.domain, name, kind, self.interfaces.hash(kind))

    def _stand(self, token: Token) -> str:
        key = token_key(token)
        self._declared.append(self.session.liveliness().declare_token(key))
        return key
