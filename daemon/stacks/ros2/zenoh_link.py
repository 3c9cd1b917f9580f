"""A link that speaks ``rmw_zenoh``: no relay, the session of the run is the stack's router.

Experimental: the wire is that of ``rmw_zenoh_cpp`` as its sources describe it, tried against two
independent implementations, not against the real one. Keys contain types and their hashes, so the
distribution has to be named, or definitions given; what differs ends the run with a sentence.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
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
from daemon.stacks.ros2.zenoh_action import ActionClient
from daemon.stacks.ros2.zenoh_graph import ZenohGraph
from daemon.stacks.ros2.zenoh_inbox import Inbox
from daemon.stacks.ros2.zenoh_lifecycle import LifecycleClients
from daemon.stacks.ros2.zenoh_node import Publisher, RosNode
from daemon.stacks.ros2.zenoh_router import ZenohRouter
from daemon.stacks.ros2.zenoh_types import InterfaceError
from daemon.stacks.ros2.zenoh_wire import QosProfile, Role, Token

NODE: Final = "/scenario"
CLOCK: Final = "/clock"
CLOCK_KIND: Final = "rosgraph_msgs/msg/Clock"

_PROBLEMS_TOLD: Final = 3
"""A stack of another distribution differs in everything; three sentences say as much as thirty."""


class ZenohLink:
    """A node ``/scenario`` in the graph of a stack under ``rmw_zenoh_cpp``; see ``StackLink``.

    ``domain`` must be the stack's. The router is closed with the link.
    """

    def __init__(self, router: ZenohRouter, domain: int) -> None:
        self.router = router
        self._node = node = RosNode(router.session, domain, NODE, router.interfaces)
        self._setup: LinkSetup | None = None
        self._publishers: dict[str, Publisher] = {}
        self._action: ActionClient | None = None
        self._command = ""
        self._closed = False
        self._inbox = Inbox()
        # Changed by a thread of Zenoh's, under this lock.
        self._lock = Lock()
        self._graph = ZenohGraph(node.domain, node.interfaces.distribution)
        self._changed = False
        self._problems: tuple[str, ...] = ()
        self._lifecycle = LifecycleClients(
            node, partial(self._want, "server"), partial(self._stands, "server")
        )
        node.watch(self._take_token)

    @property
    def identity(self) -> StackIdentity:
        """What the stack is taken to run on: it is not asked."""
        return StackIdentity(self._node.interfaces.distribution, "rmw_zenoh_cpp")

    @property
    def problems(self) -> tuple[str, ...]:
        """Endpoints that should be talked to and cannot: sentences, raised by a cycle as well."""
        with self._lock:
            if self._changed:
                self._changed = False
                self._problems = self._graph.problems()
            return self._problems

    def set_up(self, setup: LinkSetup) -> None:
        """Make publishers, subscriptions and clients; once, before the first cycle."""
        self._check_open()
        interfaces = self._node.interfaces
        try:
            # Subscriptions first: what hears must be there before something makes others speak.
            for kind in COMMAND_KINDS:
                interfaces.load(kind)
                self._want("publisher", setup.command, kind)
                hear = partial(self._inbox.put_command, setup.command, kind)
                # Not in the graph until it is known which of the two it is.
                self._node.subscribe(setup.command, kind, QosProfile(), hear, announced=False)
            for topic in setup.subscribe:
                interfaces.load(topic.kind)
                self._want("publisher", topic.name, topic.kind)
                hear = partial(self._inbox.put, topic.name, topic.kind, topic.keep == "all")
                self._node.subscribe(topic.name, topic.kind, _profile(topic), hear)
            for topic in (*setup.publish, TopicSetup(CLOCK, CLOCK_KIND)):
                interfaces.load(topic.kind)
                self._want("subscription", topic.name, topic.kind)
                publisher = self._node.publisher(topic.name, topic.kind, _profile(topic))
                self._publishers[topic.name] = publisher
            self._action = ActionClient(
                self._node, setup.action, setup.action_kind, self._inbox.wake
            )
            for role, name, kind in self._action.endpoints:
                self._want(role, name, kind)
            self._lifecycle.watch(setup.nodes)
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
        with self._lock:
            listeners = {
                topic.name: len(self._graph.kinds("subscription", topic.name))
                if topic.name in matched
                else 0
                for topic in setup.publish
            }
        return Readiness(
            nodes=self._lifecycle.states(setup.nodes),
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
        with self._lock:
            return self._graph.graph()

    def parameters(self, node: str, names: tuple[str, ...]) -> Mapping[str, Any]:
        """Return values of parameters that are there; at most two seconds of wall clock."""
        self._check_open()
        return self._lifecycle.parameters(node, names)

    def request_state(self, node: str, transition: str) -> None:
        """Ask a lifecycle node to ``configure``, ``activate``, ``deactivate`` or ``cleanup``."""
        self._check_open()
        self._lifecycle.change(node, transition)

    def close(self) -> None:
        """Let go; never raises."""
        self._closed = True
        self._node.close()
        self.router.close()

    def _ready(self) -> tuple[LinkSetup, ActionClient]:
        self._check()
        if self._setup is None or self._action is None:
            raise LinkLost("this link was not set up yet")
        return self._setup, self._action

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
        with self._lock:
            kinds = self._graph.kinds("publisher", topic)
        self._command, before = (kinds[0] if kinds else ""), self._command
        if self._command and not before:
            self._node.announce("subscription", topic, self._command, QosProfile())

    def _want(self, role: Role, name: str, kind: str) -> None:
        with self._lock:
            self._graph.want(role, name, kind, self._node.interfaces.hash(kind))
            self._changed = True

    def _stands(self, role: Role, name: str, kind: str) -> bool:
        with self._lock:
            return kind in self._graph.kinds(role, name)

    def _take_token(self, token: Token, here: bool) -> None:
        with self._lock:
            self._graph.change(token, here)
            self._changed = True


def _profile(topic: TopicSetup) -> QosProfile:
    return QosProfile(
        reliable=topic.qos != "best effort",
        transient_local=topic.qos == "latched",
        depth=topic.depth,
    )
