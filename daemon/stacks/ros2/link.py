"""Values between lock step and the relay: requests to a stack and its answers.

A link (:mod:`daemon.stacks.ros2.relay_link`) makes the publishers, subscriptions and action clients
of a :class:`LinkSetup`, and then only answers. Message contents are CDR, little-endian with its
four bytes of encapsulation; this side writes and reads them. Times are ROS time [ns] of the clock
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


class LinkLost(Exception):  # noqa: N818  (names the event)
    """The other side is gone, refuses or is incomprehensible; the message is for people."""


class LinkRefused(LinkLost):
    """The other side refuses a request; the message is its reason."""


@dataclass(frozen=True, slots=True)
class TopicSetup:
    """A topic to publish or subscribe to: absolute name, type, quality of service, depth.

    ``keep`` of a subscription: only the ``last`` message of a cycle is passed on, or ``all``.
    """

    name: str
    kind: str
    qos: Qos = "reliable"
    depth: int = 10
    keep: Literal["last", "all"] = "last"


@dataclass(frozen=True, slots=True)
class LinkSetup:
    """Everything that a link makes before the first cycle.

    ``command`` is the topic of the robot's commands; the graph tells which of the
    :data:`COMMAND_KINDS` it has. ``action`` is the absolute name of the action for the mission,
    ``action_kind`` one of the keys of :data:`ACTION_KINDS`. ``nodes`` are the absolute names of
    the lifecycle nodes that must be active. Every link also publishes ``/clock``.
    """

    publish: tuple[TopicSetup, ...]
    subscribe: tuple[TopicSetup, ...]
    command: str
    action: str
    action_kind: str
    nodes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class StackIdentity:
    """The ROS 2 of a stack: ``distribution`` (``jazzy``; empty if unknown) and ``rmw``."""

    distribution: str
    rmw: str


@dataclass(frozen=True, slots=True)
class Cycle:
    """One step of the clock: messages to publish in this order, then the clock at ``time`` [ns].

    ``until``: wait for a ``command`` that answers this cycle, at most ``wait`` [s of wall clock];
    or for ``nothing``, exactly that long. The wait for a command also ends with the goal. A stamped
    command answers if its stamp is not before ``time - tolerance``, an unstamped one if it came
    after the clock was sent.
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
    """News of a goal: ``goal`` is the number of its request.

    ``state`` is ``unanswered`` after ten seconds of wall clock without an answer to the request,
    ``feedback`` for feedback (the latest of a cycle). The other fields are those of the result or
    feedback, if it has them; ``missed_waypoints`` are indices.
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
    """Everything that came since the previous cycle, oldest first.

    ``latency`` [s of wall clock] is the time from the clock to the answering command, ``None``
    without an answer within ``wait``. ``commands`` counts all of this cycle; the last one is among
    the ``messages``. ``heard``: the stack sent anything at all. ``server``: the action server is
    in the graph (up to a second ago). ``dropped`` names the topics with too many messages for one
    cycle; the oldest are lost. ``inactive`` are the nodes of the setup that are no longer active,
    with their state as in :class:`Readiness` (checked twice a second).
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
    """State of a starting stack: ``nodes`` with their lifecycle state.

    The state is empty for a node that is not in the graph or has not answered yet. It is ``not
    answering`` for a node in the graph without an answer for two seconds. ``listeners`` counts
    the subscribers of each published topic.
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
    """View of the graph: endpoints except those of the link, nodes, names of served services."""

    endpoints: tuple[GraphEndpoint, ...]
    nodes: tuple[str, ...]
    services: tuple[str, ...]
