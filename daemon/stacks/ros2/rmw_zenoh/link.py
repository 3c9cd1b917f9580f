"""A link that speaks ``rmw_zenoh``: no relay, the session of the run is the stack's router.

Experimental: the wire is that of ``rmw_zenoh_cpp`` as its sources describe it, tried against two
independent implementations, not against the real one. Keys contain types and their hashes, so the
distribution has to be named, or definitions given; what differs ends the run with a sentence.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from threading import Lock
from typing import Any, Final

from daemon.stacks.ros2.link import (
    COMMAND_KINDS,
    Cycle,
    CycleAnswer,
    Graph,
    LinkLost,
    LinkSetup,
    Readiness,
    StackIdentity,
    TopicSetup,
)
from daemon.stacks.ros2.rmw_zenoh.action import ActionClient
from daemon.stacks.ros2.rmw_zenoh.graph import ZenohGraph
from daemon.stacks.ros2.rmw_zenoh.inbox import Inbox
from daemon.stacks.ros2.rmw_zenoh.interfaces import InterfaceError
from daemon.stacks.ros2.rmw_zenoh.lifecycle import LifecycleClients
from daemon.stacks.ros2.rmw_zenoh.node import Publisher, RosNode
from daemon.stacks.ros2.rmw_zenoh.router import ZenohRouter
from daemon.stacks.ros2.rmw_zenoh.wire import QosProfile, Role, Token

NODE: Final = "/scenario"
CLOCK: Final = "/clock"
CLOCK_KIND: Final = "rosgraph_msgs/msg/Clock"

_PROBLEMS_TOLD: Final = 3
"""A stack of another distribution differs in everything; three sentences say as much as thirty."""


@dataclass(frozen=True, eq=False)
class _Membership:
    """What a link has in a domain; ``graph`` is changed by a thread of Zenoh's, under a lock."""

    node: RosNode
    graph: ZenohGraph
    lifecycle: LifecycleClients


class ZenohLink:
    """A node ``/scenario`` in the graph of a stack under ``rmw_zenoh_cpp``; see ``StackLink``.

    The stack is started with the environment of ``router``; :meth:`join` comes when its domain is
    known, before anything else. The router is closed with the link.
    """

    def __init__(self, router: ZenohRouter) -> None:
        self.router = router
        self._membership: _Membership | None = None
        self._setup: LinkSetup | None = None
        self._publishers: dict[str, Publisher] = {}
        self._action: ActionClient | None = None
        self._command = ""
        self._closed = False
        self._inbox = Inbox()
        self._lock = Lock()
        self._changed = False
        self._problems: tuple[str, ...] = ()

    def join(self, domain: int) -> None:
        """Stand in the graph of ``domain``, which must be the stack's; once."""
        node = RosNode(self.router.session, domain, NODE, self.router.interfaces)
        graph = ZenohGraph(domain, self.router.interfaces.distribution)
        want, stands = partial(self._want, "server"), partial(self._stands, "server")
        self._membership = _Membership(node, graph, LifecycleClients(node, want, stands))
        node.watch(self._take_token)

    @property
    def identity(self) -> StackIdentity:
        """What the stack is taken to run on: it is not asked."""
        return StackIdentity(self.router.interfaces.distribution, "rmw_zenoh_cpp")

    @property
    def problems(self) -> tuple[str, ...]:
        """Endpoints that should be talked to and cannot: sentences, raised by a cycle as well."""
        graph = self._member().graph
        with self._lock:
            if self._changed:
                self._changed = False
                self._problems = graph.problems()
            return self._problems

    def set_up(self, setup: LinkSetup) -> None:
        """Make publishers, subscriptions and clients; once, before the first cycle."""
        self._check_open()
        node, interfaces = self._member().node, self.router.interfaces
        try:
            # Subscriptions first: what hears must be there before something makes others speak.
            for kind in COMMAND_KINDS:
                interfaces.load(kind)
                self._want("publisher", setup.command, kind)
                hear = partial(self._inbox.put_command, setup.command, kind)
                # Not in the graph until it is known which of the two it is.
                node.subscribe(setup.command, kind, QosProfile(), hear, announced=False)
            for topic in setup.subscribe:
                interfaces.load(topic.kind)
                self._want("publisher", topic.name, topic.kind)
                hear = partial(self._inbox.put, topic.name, topic.kind, topic.keep == "all")
                node.subscribe(topic.name, topic.kind, _profile(topic), hear)
            for topic in (*setup.publish, TopicSetup(CLOCK, CLOCK_KIND)):
                interfaces.load(topic.kind)
                self._want("subscription", topic.name, topic.kind)
                publisher = node.publisher(topic.name, topic.kind, _profile(topic))
                self._publishers[topic.name] = publisher
            self._action = ActionClient(node, setup.action, setup.action_kind, self._inbox.wake)
            for role, name, kind in self._action.endpoints:
                self._want(role, name, kind)
            self._member().lifecycle.watch(setup.nodes)
        except InterfaceError as error:
            raise LinkLost(str(error)) from error
        self._setup = setup

    def cycle(self, cycle: Cycle) -> CycleAnswer:
        """Publish, move the clock on, wait for the answer."""
        _, action = self._ready()
        for topic, data in cycle.messages:
            self._publishers[topic].publish(data)
        seconds, rest = divmod(cycle.time, 1_000_000_000)
        self._inbox.expect(cycle.time - cycle.tolerance)
        self._publishers[CLOCK].publish(b"\x00\x01\x00\x00" + struct.pack("<iI", seconds, rest))
        self._inbox.wait(cycle.wait, for_command=cycle.until == "command", attend=action.attend)
        latency = self._inbox.latency()
        action.attend()
        self._check()
        taken = self._inbox.take()
        return CycleAnswer(
            latency=latency,
            commands=taken.commands,
            heard=taken.heard,
            server=self._stands(*action.endpoints[0]),
            messages=taken.messages,
            goals=action.take(),
        )

    def readiness(self) -> Readiness:
        """Return how far the stack has come up; asks nodes in the background, never waits."""
        setup, action = self._ready()
        # A token in the graph does not prove that the way of the data is open: matched does.
        matched = [topic.name for topic in setup.publish if self._publishers[topic.name].matched]
        member = self._member()
        with self._lock:
            listeners = {
                topic.name: len(member.graph.kinds("subscription", topic.name))
                if topic.name in matched
                else 0
                for topic in setup.publish
            }
        return Readiness(
            nodes=member.lifecycle.states(setup.nodes),
            server=self._stands(*action.endpoints[0]),
            command=self._command,
            listeners=listeners,
        )

    def send_goal(self, goal: int, poses: tuple[tuple[float, float, float], ...], frame: str,
                  time: int) -> None:  # fmt: skip
        """Send a goal of one or more poses (x, y, yaw) stamped ``time`` [ns]; updates follow."""
        _, action = self._ready()
        action.send(goal, poses, frame, time)

    def cancel_goals(self) -> None:
        """Ask for every goal of this link to be cancelled; updates follow."""
        _, action = self._ready()
        action.cancel_all()

    def graph(self) -> Graph:
        """Return everything in sight; what is wrong with it stands in :attr:`problems`."""
        self._check_open()
        graph = self._member().graph
        with self._lock:
            return graph.graph()

    def parameters(self, node: str, names: tuple[str, ...]) -> Mapping[str, Any]:
        """Return values of parameters that are there; at most two seconds of wall clock."""
        self._check_open()
        return self._member().lifecycle.parameters(node, names)

    def request_state(self, node: str, transition: str) -> None:
        """Ask a lifecycle node to ``configure``, ``activate``, ``deactivate`` or ``cleanup``."""
        self._check_open()
        self._member().lifecycle.change(node, transition)

    def close(self) -> None:
        """Let go; never raises."""
        self._closed = True
        if self._membership is not None:
            self._membership.node.close()
        self.router.close()

    def _ready(self) -> tuple[LinkSetup, ActionClient]:
        self._check()
        if self._setup is None or self._action is None:
            raise LinkLost("this link was not set up yet")
        return self._setup, self._action

    def _member(self) -> _Membership:
        if self._membership is None:
            raise LinkLost("this link is in no ROS domain yet")
        return self._membership

    def _check(self) -> None:
        self._check_open()
        problems = self.problems
        if problems:
            told = problems[:_PROBLEMS_TOLD]
            more = len(problems) - len(told)
            raise LinkLost("\n".join([*told, *([f"and {more} more of this kind"] if more else [])]))
        if self._setup is not None:
            self._announce_command(self._setup.command)

    def _check_open(self) -> None:
        if self._closed or self.router.session.is_closed():
            raise LinkLost("this link to the stack is closed")

    def _announce_command(self, topic: str) -> None:
        member = self._member()
        with self._lock:
            kinds = member.graph.kinds("publisher", topic)
        self._command, before = (kinds[0] if kinds else ""), self._command
        if self._command and not before:
            member.node.announce("subscription", topic, self._command, QosProfile())

    def _want(self, role: Role, name: str, kind: str) -> None:
        graph = self._member().graph
        with self._lock:
            graph.want(role, name, kind, self.router.interfaces.hash(kind))
            self._changed = True

    def _stands(self, role: Role, name: str, kind: str) -> bool:
        graph = self._member().graph
        with self._lock:
            return kind in graph.kinds(role, name)

    def _take_token(self, token: Token, here: bool) -> None:
        graph = self._member().graph
        with self._lock:
            graph.change(token, here)
            self._changed = True


def _profile(topic: TopicSetup) -> QosProfile:
    return QosProfile(
        reliable=topic.qos != "best effort",
        transient_local=topic.qos == "latched",
        depth=topic.depth,
    )
