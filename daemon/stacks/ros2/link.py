"""The values that pass between lock step and the relay: requests to a stack and its answers.

A link (:mod:`daemon.stacks.ros2.relay_link`) makes publishers, subscriptions and action clients
as a :class:`LinkSetup` says, and then only answers. Message contents are CDR, little-endian with
its four bytes of encapsulation, made and read on this side; times are ROS time [ns] of the clock
that the link publishes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

Qos: TypeAlias = Literal["reliable", "best effort", "latched"]
"""``latched`` is reliable and transient local, for topics that are published once."""

COMMAND_KINDS: Final = ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist")
ACTION_KINDS: Final = {
    "navigate_to_pose": "nav2_msgs/action/NavigateToPose",
    "navigate_through_poses": "nav2_msgs/action/NavigateThroughPoses",
    "follow_waypoints": "nav2_msgs/action/FollowWaypoints",
}


class LinkLost(Exception):  # noqa: N818  (says what happened)
    """The other side is gone, refuses or cannot be understood; the message is for people."""


class LinkRefused(LinkLost):
    """The other side cannot do what was asked of it, and says why."""


@dataclass(frozen=True, slots=True)
class TopicSetup:
    """A topic that is published or subscribed: absolute name, type, quality of service, depth.

    ``keep`` of a subscription: only the ``last`` message of a cycle is handed over, or ``all``.
    """

    name: str
    kind: str
    qos: Qos = "reliable"
    depth: int = 10
    keep: Literal["last", "all"] = "last"


@dataclass(frozen=True, slots=True)
class LinkSetup:
    """Everything a link makes before the first cycle.

    ``command`` is the topic the robot listens to: of which of the :data:`COMMAND_KINDS` it is,
    the graph says. ``action`` is the absolute name of the action a mission is sent to,
    ``action_kind`` one of the keys of :data:`ACTION_KINDS`. ``nodes`` are the absolute names of
    the lifecycle nodes that must be active. Every link publishes ``/clock`` besides.
    """

    publish: tuple[TopicSetup, ...]
    subscribe: tuple[TopicSetup, ...]
    command: str
    action: str
    action_kind: str
    nodes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class StackIdentity:
    """The ROS 2 of a stack: ``distribution`` (``jazzy``; empty when unknown) and ``rmw``."""

    distribution: str
    rmw: str


@dataclass(frozen=True, slots=True)
class Cycle:
    """One step of the clock: messages to publish in this order, then the clock at ``time`` [ns].

    ``until``: wait for a ``command`` that answers this cycle, or for nothing, the whole of
    ``wait`` [s of wall clock]. The wait for a command also ends when a goal does: nothing is
    owed then. A stamped command answers when its stamp is not before
    ``time - tolerance``; one without a stamp when it came after the clock went out.
    """

    time: int
    messages: tuple[tuple[str, bytes], ...] = ()
    until: Literal["command", "nothing"] = "nothing"
    wait: float = 0.0
    tolerance: int = 0


@dataclass(frozen=True, slots=True)
class ReceivedMessage:
    """A message of the stack: topic, type (a command's differs), CDR."""

    topic: str
    kind: str
    data: bytes


@dataclass(frozen=True, slots=True)
class GoalUpdate:
    """News of a goal: ``goal`` is the number it was sent with.

    ``state`` is ``unanswered`` when no answer came to the request within ten seconds of wall
    clock, ``feedback`` for feedback (the latest of a cycle). The other fields are those of the
    result or feedback, as far as it has them; ``missed_waypoints`` are indices.
    """

    goal: int
    state: Literal[
        "accepted", "rejected", "unanswered", "feedback", "succeeded", "canceled", "aborted"
    ]
    error_code: int = 0
    error_text: str = ""
    current_waypoint: int = 0
    number_of_poses_remaining: int = 0
    number_of_recoveries: int = 0
    missed_waypoints: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class CycleAnswer:
    """Everything that came since the cycle before, oldest first.

    ``latency`` [s of wall clock] from the clock to the command that answered, ``None`` when none
    did within ``wait``. ``commands`` counts all of this cycle; the last one is among the
    ``messages``. ``heard``: anything at all came from the stack. ``server``: the action server is
    in the graph (looked at now and then, so up to a second old). ``dropped`` names the topics with
    too many messages for one cycle; the oldest are lost. ``inactive``: the nodes of the setup that
    were active and no longer are, with their state as in :class:`Readiness` (checked twice a
    second).
    """

    latency: float | None
    commands: int
    heard: bool
    server: bool
    messages: tuple[ReceivedMessage, ...] = ()
    goals: tuple[GoalUpdate, ...] = ()
    dropped: tuple[str, ...] = ()
    inactive: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Readiness:
    """State of a stack that comes up: ``nodes`` with their lifecycle state.

    The state is empty for a node that is not in the graph or has not answered yet, and
    ``not answering`` for one that is in the graph and has not answered for two seconds.
    ``listeners`` counts subscribers of each published topic.
    """

    nodes: Mapping[str, str]
    server: bool
    listeners: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class GraphEndpoint:
    """A publisher or subscription in the graph."""

    topic: str
    kind: str
    node: str
    role: Literal["publisher", "subscription"]
    reliable: bool
    transient_local: bool


@dataclass(frozen=True, slots=True)
class Graph:
    """A view of the graph: endpoints except those of the link, nodes, names of served services."""

    endpoints: tuple[GraphEndpoint, ...]
    nodes: tuple[str, ...]
    services: tuple[str, ...]
