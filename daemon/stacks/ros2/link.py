"""Link to a stack through a relay: requests out, answers in.

The relay (:mod:`daemon.stacks.ros2.relay`) runs in the user's ROS 2. It makes the publishers,
subscriptions and action clients of a :class:`LinkSetup`, and then only answers. Frames are those of
:mod:`multiprocessing.connection`, but without pickles: their content is JSON and CDR, little-endian
with its four bytes of encapsulation. An answer that does not fit the types here ends the
connection. Times are ROS time [ns] of the clock that the link publishes.
"""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias, TypeVar

from pydantic import TypeAdapter

from daemon.stacks.ros2 import relay

_SILENCE: Final = 30.0
"""Wall clock after which a relay that writes and reads nothing hangs [s]."""
_LOOK_PERIOD: Final = 0.1
_REMEDY: Final = "take the relay of this installation (scenario sut relay prints it)"
_LARGEST: Final = 256 << 20
"""Largest answer [bytes]."""
_LONGEST_REASON: Final = 4096
"""Longest reason of a refusal [characters]."""

Qos: TypeAlias = Literal["reliable", "best effort", "latched"]
"""``latched`` is reliable and transient local, for topics that are published once."""

COMMAND_KINDS: Final = relay.COMMAND_KINDS
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


_CYCLE: Final = TypeAdapter(CycleAnswer)
_READINESS: Final = TypeAdapter(Readiness)
_GRAPH: Final = TypeAdapter(Graph)
_Parameter: TypeAlias = bool | int | float | str
_PARAMETERS: Final = TypeAdapter(dict[str, _Parameter])

_Answer = TypeVar("_Answer")


def relay_path() -> Path:
    """Return the file that the user's ``python3`` runs."""
    return Path(relay.__file__).resolve()


class RelayLink:
    """A connection to a stack through a relay.

    :meth:`listen`, then :meth:`accept` until the relay is there, then :meth:`set_up`, then the
    other methods. All raise :class:`LinkLost`.
    """

    def __init__(self, listener: socket.socket, address: str, nonce: str) -> None:
        self._listener = listener
        self._nonce = nonce
        self._peer: Connection | None = None
        self._identity: StackIdentity | None = None
        self.address = address
        """The value of ``SCENARIO_SOCKET``: a path, or ``tcp://127.0.0.1:PORT``."""
        self.is_interrupted: Callable[[], bool] = lambda: False
        """Tell whether to stop waiting; a wait calls this ten times a second."""

    @classmethod
    def listen(cls, path: Path | str, nonce: str) -> RelayLink:
        """Listen at a path, for this user only, or at ``tcp://127.0.0.1:0``.

        Raises:
            LinkLost: listening there is impossible; the message is the reason.
        """
        address = str(path)
        tcp = address.startswith("tcp://")
        listener = socket.socket(socket.AF_INET if tcp else socket.AF_UNIX)
        try:
            if tcp:
                host, _, port = address.removeprefix("tcp://").rpartition(":")
                listener.bind((host, int(port)))
                address = f"tcp://{host}:{listener.getsockname()[1]}"
            else:
                with contextlib.suppress(FileNotFoundError):
                    Path(address).unlink()
                listener.bind(address)
                Path(address).chmod(0o600)
            listener.listen(1)
        except (OSError, ValueError, OverflowError) as error:
            listener.close()
            raise LinkLost(f"cannot listen for the relay at {address}: {error}") from None
        return cls(listener, address, nonce)

    def accept(self, timeout: float = 0.1) -> bool:
        """Wait at most ``timeout`` [s] for the relay; return whether it is connected.

        Raises:
            LinkLost: it ended or cannot work, or another program connected.
        """
        if self._identity is not None:
            return True
        try:
            if self._peer is None:
                self._listener.settimeout(max(timeout, 0.001))
                self._peer = _connection(self._listener.accept()[0])
            if not self._peer.poll(timeout):
                return False
            hello, _ = relay.decode_frame(self._peer.recv_bytes(_LARGEST))
        except TimeoutError:
            return False
        except (EOFError, ConnectionError):
            raise self._lost("the relay has ended before its first message") from None
        except (OSError, ValueError, RecursionError) as error:
            raise self._lost(
                f"a program other than the relay of this version connected ({error}): {_REMEDY}"
            ) from None
        self._welcome(hello)
        return True

    @property
    def identity(self) -> StackIdentity:
        """ROS 2 of the stack; raises LinkLost before the relay has connected."""
        if self._identity is None:
            raise LinkLost("the relay has not connected yet")
        return self._identity

    def set_up(self, setup: LinkSetup) -> None:
        """Make publishers, subscriptions and clients, once before the first cycle."""
        request = asdict(setup) | {"action_kind": ACTION_KINDS[setup.action_kind]}
        self._ask(request, _nothing)

    def cycle(self, cycle: Cycle) -> CycleAnswer:
        """Publish, advance the clock, and wait for the answer."""
        request = {
            "do": "cycle",
            "time": cycle.time,
            "messages": [[topic, len(data)] for topic, data in cycle.messages],
            "until": cycle.until,
            "wait": cycle.wait,
            "tolerance": cycle.tolerance,
        }
        blob = b"".join(data for _topic, data in cycle.messages)
        return self._ask(request, _read_cycle, blob, cycle.wait + _SILENCE)

    def readiness(self) -> Readiness:
        """Return the state of the stack's nodes; queries them in the background, never waits."""
        return self._ask({"do": "readiness"}, lambda head, _: _READINESS.validate_python(head))

    def send_goal(
        self, goal: int, poses: tuple[tuple[float, float, float], ...], frame: str, time: int
    ) -> None:
        """Send a goal of one or more poses (x, y, yaw) stamped ``time`` [ns]; updates follow."""
        request = {"do": "goal", "goal": goal, "poses": poses, "frame": frame, "time": time}
        self._ask(request, _nothing)

    def graph(self) -> Graph:
        """Return the graph."""
        return self._ask({"do": "graph"}, lambda head, _: _GRAPH.validate_python(head))

    def parameters(self, node: str, names: tuple[str, ...]) -> dict[str, _Parameter]:
        """Return the existing parameters except arrays; takes two seconds at most."""
        request = {"do": "parameters", "node": node, "names": names}
        return self._ask(request, lambda head, _: _PARAMETERS.validate_python(head))

    def close(self) -> None:
        """Close the connection; never raises."""
        for one in (self._peer, self._listener):
            if one is not None:
                with contextlib.suppress(OSError):
                    one.close()
        self._peer = None
        if not self.address.startswith("tcp://"):
            with contextlib.suppress(OSError):
                os.unlink(self.address)  # noqa: PTH108  (a socket, maybe gone)

    def _welcome(self, hello: dict[str, Any]) -> None:
        if hello.get("nonce") != self._nonce:
            raise self._lost(
                "a program that does not belong to this run connected in place of the relay"
            )
        if hello.get("version") != relay.VERSION:
            raise self._lost(
                f"the relay has version {hello.get('version')} of its protocol, not"
                f" version {relay.VERSION}: {_REMEDY}"
            )
        if "problem" in hello:
            raise self._lost(str(hello["problem"]))
        self._identity = StackIdentity(str(hello.get("distribution")), str(hello.get("rmw")))

    def _ask(
        self,
        request: Mapping[str, Any],
        read: Callable[[Any, bytes], _Answer],
        blob: bytes = b"",
        patience: float = _SILENCE,
    ) -> _Answer:
        """Send a request, wait at most ``patience`` [s], and return the answer through ``read``."""
        if self._peer is None or self._identity is None:
            raise LinkLost("the connection to the stack is closed")
        try:
            self._peer.send_bytes(relay.encode_frame(request, blob))
            until = time.monotonic() + patience
            while not self._peer.poll(min(_LOOK_PERIOD, max(0.0, until - time.monotonic()))):
                if self.is_interrupted():
                    raise EOFError("the stack has died")
                if time.monotonic() >= until:
                    raise BlockingIOError
            head, data = relay.decode_frame(self._peer.recv_bytes(_LARGEST))
            if "refused" not in head:
                return read(head["answer"], data)
        except BlockingIOError:
            raise self._lost(
                f"the relay did not answer within {patience:.0f} s: it hangs, or has no CPU"
            ) from None
        except (EOFError, OSError) as error:
            raise self._lost(f"the relay is gone: {str(error) or 'it has ended'}") from None
        except (LookupError, TypeError, ValueError, RecursionError) as error:
            words = " ".join(f"{type(error).__name__}: {error}".split())
            raise self._lost(f"an answer of the relay cannot be understood: {words}") from None
        self.close()
        raise LinkRefused(str(head["refused"])[:_LONGEST_REASON])

    def _lost(self, text: str) -> LinkLost:
        """Close the connection, whose state is unknown after a fault, and return the error."""
        self.close()
        return LinkLost(text[:_LONGEST_REASON])


def _connection(peer: socket.socket) -> Connection:
    """Wrap a socket; a frame that stops halfway raises BlockingIOError after ``_SILENCE``."""
    patience = struct.pack("ll", int(_SILENCE), int(_SILENCE % 1.0 * 1e6))
    for direction in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
        peer.setsockopt(socket.SOL_SOCKET, direction, patience)
    if peer.family == socket.AF_INET:
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return Connection(peer.detach())


def _nothing(_head: Any, _data: bytes) -> None:
    """Ignore an empty answer."""


def _read_cycle(head: Any, data: bytes) -> CycleAnswer:
    """Split ``data`` into the messages of a cycle; raises ValueError if they do not fit."""
    messages: list[dict[str, Any]] = []
    begin = 0
    for topic, kind, size in head["messages"]:
        messages.append({"topic": topic, "kind": kind, "data": data[begin : begin + size]})
        begin += size
    if begin != len(data):
        raise ValueError(f"{len(data)} bytes of messages in place of {begin}")
    return _CYCLE.validate_python(head | {"messages": messages})
