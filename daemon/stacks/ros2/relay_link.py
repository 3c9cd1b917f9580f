"""The simulation's end of the relay: requests out, answers in, nothing believed unseen.

The relay (:mod:`daemon.stacks.ros2.relay`) runs in the user's ROS 2 and is a peer like any other:
everything it says is checked for form, size and for being about what was asked.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from daemon.stacks.ros2 import relay
from daemon.stacks.ros2.link import (
    ACTION_KINDS,
    COMMAND_KINDS,
    Cycle,
    CycleAnswer,
    GoalUpdate,
    Graph,
    GraphEndpoint,
    LinkLost,
    LinkSetup,
    Readiness,
    ReceivedMessage,
    StackIdentity,
)
from grammars.text.documents import plain_message

_SILENCE: Final = 30.0
_STRICT: Final = ConfigDict(extra="forbid", strict=True)
_CLOSED: Final = "the connection to the stack is closed"

_Text = Annotated[str, Field(max_length=4096)]
_Name = Annotated[str, Field(max_length=1024)]
_Count = Annotated[int, Field(ge=0, le=2**63)]
_Parameter = bool | int | float | str | list[bool | int | float | str] | None
_GoalContent = Literal[
    "current_waypoint",
    "number_of_poses_remaining",
    "distance_remaining",
    "number_of_recoveries",
    "missed_waypoints",
]


@dataclass(frozen=True, slots=True)
class _Hello:
    __pydantic_config__ = _STRICT
    hello: _Name
    version: int
    nonce: _Name
    distribution: _Name = ""
    rmw: _Name = ""
    python: _Name = ""
    problem: _Text = ""


@dataclass(frozen=True, slots=True)
class _GoalRow:
    __pydantic_config__ = _STRICT
    goal: int
    state: Literal[
        "accepted", "rejected", "unanswered", "feedback", "succeeded", "canceled", "aborted"
    ]
    error_code: int = 0
    error_text: _Text = ""
    content: dict[_GoalContent, int | float | list[int]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _CycleReply:
    __pydantic_config__ = _STRICT
    latency: Annotated[float, Field(ge=0.0)] | None
    commands: _Count
    heard: bool
    server: bool
    messages: Annotated[list[tuple[_Name, _Name, _Count]], Field(max_length=100_000)]
    goals: Annotated[list[_GoalRow], Field(max_length=10_000)]
    dropped: dict[_Name, _Count] = field(default_factory=dict)
    inactive: dict[_Name, _Name] = field(default_factory=dict)


_EndpointRow = tuple[_Name, _Name, Literal["publisher", "subscription"], _Name, bool, bool, int]


@dataclass(frozen=True, slots=True)
class _GraphReply:
    __pydantic_config__ = _STRICT
    endpoints: Annotated[list[_EndpointRow], Field(max_length=100_000)]
    nodes: Annotated[list[_Name], Field(max_length=10_000)]
    services: Annotated[list[_Name], Field(max_length=100_000)]


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def relay_path() -> Path:
    """Return the file that the user's ``python3`` runs."""
    return Path(relay.__file__).resolve()


class RelayLink:
    """A connection to a relay: a :class:`~daemon.stacks.ros2.link.StackLink`.

    :meth:`listen`, then :meth:`accept` until it is there, then the methods of the protocol.
    """

    def __init__(self, listener: socket.socket, address: str, nonce: str) -> None:
        self._listener = listener
        self._nonce = nonce
        self._peer: socket.socket | None = None
        self._buffer = bytearray()
        self._identity: StackIdentity | None = None
        self._setup: LinkSetup | None = None
        self._goals: set[int] = set()
        self.address = address
        """What ``SCENARIO_SOCKET`` has to be: a path, or ``tcp://127.0.0.1:PORT``."""

    @classmethod
    def listen(cls, path: Path | str, nonce: str) -> RelayLink:
        """Listen at a path, for this user only, or at ``tcp://127.0.0.1:0``.

        Raises:
            LinkLost: nothing can listen there; the message says why.
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
            raise LinkLost(f"the relay cannot be listened for at {address}: {error}") from None
        return cls(listener, address, nonce)

    def accept(self, timeout: float = 0.1) -> bool:
        """Return whether the relay has said hello, waiting ``timeout`` [s] at most.

        Raises:
            LinkLost: it ended, cannot do its work, or something else than a relay came.
        """
        if self._identity is not None:
            return True
        end = time.monotonic() + timeout
        try:
            if self._peer is None:
                self._listener.settimeout(max(timeout, 0.001))
                self._peer = self._listener.accept()[0]
                if self._peer.family == socket.AF_INET:
                    self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            frame = self._receive(end)
        except TimeoutError:
            return False
        except OSError as error:
            raise self._lost(f"the relay has ended before it said anything: {error}") from None
        except relay.ProtocolError as error:
            raise self._lost(f"something that is not the relay connected: {error}") from None
        self._welcome(self._check(_Hello, frame[0], "hello"))
        return True

    @property
    def identity(self) -> StackIdentity:
        """What the stack runs on; raises LinkLost before the relay has connected."""
        if self._identity is None:
            raise LinkLost("the relay has not connected yet")
        return self._identity

    def set_up(self, setup: LinkSetup) -> None:
        """Make publishers, subscriptions and clients; once, before the first cycle."""
        request = asdict(setup) | {"do": "set_up", "action_kind": ACTION_KINDS[setup.action_kind]}
        self._empty(self._ask(request, b"", _SILENCE))
        self._setup = setup

    def cycle(self, cycle: Cycle) -> CycleAnswer:
        """Publish, move the clock on, wait for the answer."""
        request = {
            "do": "cycle",
            "time": cycle.time,
            "messages": [[topic, len(data)] for topic, data in cycle.messages],
            "until": cycle.until,
            "wait": cycle.wait,
            "tolerance": cycle.tolerance,
        }
        blob = b"".join(data for _topic, data in cycle.messages)
        head, data = self._ask(request, blob, cycle.wait + _SILENCE)
        reply: _CycleReply = self._check(_CycleReply, head, "answer to a cycle")
        return CycleAnswer(
            latency=reply.latency,
            commands=reply.commands,
            heard=reply.heard,
            server=reply.server,
            messages=self._read_messages(reply.messages, data),
            goals=self._read_goals(reply.goals),
            dropped=reply.dropped,
            inactive=reply.inactive,
        )

    def readiness(self) -> Readiness:
        """Return how far the stack has come up; asks nodes in the background, never waits."""
        head, blob = self._ask({"do": "readiness"}, b"", _SILENCE)
        reply: Readiness = self._check(Readiness, head, "readiness", blob)
        setup = self._needed_setup()
        if (
            set(reply.nodes) != set(setup.nodes)
            or set(reply.listeners) != {one.name for one in setup.publish}
            or reply.command not in ("", *COMMAND_KINDS)
        ):
            raise self._lost("the relay told a readiness of something that was not asked about")
        return reply

    def send_goal(
        self, goal: int, poses: tuple[tuple[float, float, float], ...], frame: str, time: int
    ) -> None:
        """Send a goal of one or more poses (x, y, yaw) stamped ``time`` [ns]; updates follow."""
        self._goals.add(goal)
        request = {"do": "goal", "goal": goal, "poses": [list(pose) for pose in poses],
                   "frame": frame, "time": time}  # fmt: skip
        self._empty(self._ask(request, b"", _SILENCE))

    def cancel_goals(self) -> None:
        """Ask for every goal of this link to be cancelled; updates follow."""
        self._empty(self._ask({"do": "cancel"}, b"", _SILENCE))

    def graph(self) -> Graph:
        """Return everything in sight."""
        head, blob = self._ask({"do": "graph"}, b"", _SILENCE)
        reply: _GraphReply = self._check(_GraphReply, head, "graph", blob)
        endpoints = [
            GraphEndpoint(topic, kind, node, role, reliable, transient_local, depth)
            for topic, kind, role, node, reliable, transient_local, depth in reply.endpoints
        ]
        return Graph(tuple(endpoints), tuple(reply.nodes), tuple(reply.services))

    def parameters(self, node: str, names: tuple[str, ...]) -> Mapping[str, Any]:
        """Return values of parameters that are there; at most two seconds of wall clock."""
        request = {"do": "parameters", "node": node, "names": list(names)}
        head, blob = self._ask(request, b"", _SILENCE)
        reply: dict[str, Any] = self._check(dict[str, _Parameter], head, "parameters", blob)
        if not set(reply) <= set(names):
            raise self._lost("the relay told parameters that were not asked for")
        return reply

    def request_state(self, node: str, transition: str) -> None:
        """Ask a lifecycle node to ``configure``, ``activate``, ``deactivate`` or ``cleanup``."""
        request = {"do": "state", "node": node, "transition": transition}
        self._empty(self._ask(request, b"", _SILENCE))

    def close(self) -> None:
        """Let go; never raises."""
        for one in (self._peer, self._listener):
            if one is not None:
                with contextlib.suppress(OSError):
                    one.close()
        self._peer = None
        if not self.address.startswith("tcp://"):
            with contextlib.suppress(OSError):
                os.unlink(self.address)  # noqa: PTH108  (a socket, maybe gone)

    def _welcome(self, hello: _Hello) -> None:
        if hello.nonce != self._nonce:
            raise self._lost(
                "something that does not belong to this run connected in place of the relay"
            )
        if hello.version != relay.VERSION:
            raise self._lost(
                f"the relay speaks version {hello.version} of its protocol and this is version"
                f" {relay.VERSION}: take the relay that comes with this installation"
                " (scenario sut relay prints it)"
            )
        if hello.problem:
            raise self._lost(hello.problem)
        self._send({"welcome": "scenario", "version": relay.VERSION}, b"", _SILENCE)
        self._identity = StackIdentity(hello.distribution, hello.rmw, hello.python)

    def _ask(self, request: Mapping[str, Any], blob: bytes, patience: float) -> tuple[Any, bytes]:
        """Return head and blob of the answer; ``patience`` [s] is how long it may take."""
        if self._peer is None or self._identity is None:
            raise LinkLost(_CLOSED)
        self._send(request, blob, patience)
        try:
            head, data = self._receive(time.monotonic() + patience)
        except TimeoutError:
            raise self._lost(
                f"the relay did not answer within {patience:.0f} s: it hangs, or has no CPU"
            ) from None
        except OSError as error:
            raise self._lost(f"the relay is gone: {error}") from None
        except relay.ProtocolError as error:
            raise self._lost(f"the relay sent {error}") from None
        if set(head) == {"refused"} and isinstance(head["refused"], str):
            raise self._lost(head["refused"][:4096])
        if set(head) != {"answer"}:
            raise self._lost("the relay sent a frame that is neither an answer nor a refusal")
        return head["answer"], data

    def _send(self, head: Mapping[str, Any], blob: bytes, patience: float) -> None:
        assert self._peer is not None
        try:
            self._peer.settimeout(patience)
            self._peer.sendall(relay.encode_frame(head, blob))
        except relay.ProtocolError as error:
            raise self._lost(f"the relay cannot be sent {error}") from None
        except TimeoutError:
            raise self._lost(f"the relay has read nothing for {patience:.0f} s") from None
        except OSError as error:
            raise self._lost(f"the relay is gone: {error}") from None

    def _receive(self, end: float) -> tuple[dict[str, Any], bytes]:
        """Return the next frame; what has come of it stays when TimeoutError is raised."""
        self._fill(relay.HEADER.size, end)
        sizes = relay.HEADER.unpack_from(self._buffer)
        relay.check_lengths(*sizes)
        begin = relay.HEADER.size + sizes[0]
        self._fill(begin + sizes[1], end)
        head = relay.decode_head(bytes(self._buffer[relay.HEADER.size : begin]))
        blob = bytes(self._buffer[begin : begin + sizes[1]])
        del self._buffer[: begin + sizes[1]]
        return head, blob

    def _fill(self, count: int, end: float) -> None:
        assert self._peer is not None
        while len(self._buffer) < count:
            self._peer.settimeout(max(0.001, end - time.monotonic()))
            data = self._peer.recv(max(65536, min(count - len(self._buffer), 1 << 24)))
            if not data:
                raise ConnectionResetError("it has ended")
            self._buffer += data

    def _check(self, kind: Any, data: Any, what: str, blob: bytes = b"") -> Any:
        try:
            # As JSON, of which a strict tuple may be made.
            value = _adapter(kind).validate_json(json.dumps(data), strict=True)
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            place = ".".join(str(part) for part in first["loc"])
            raise self._lost(
                f"the relay's {what} is not what it must be: {place} {plain_message(first)}"
            ) from None
        if blob:
            raise self._lost(f"the relay's {what} came with data that belongs to nothing")
        return value

    def _empty(self, reply: tuple[Any, bytes]) -> None:
        if reply != ({}, b""):
            raise self._lost("the relay answered something to what has no answer")

    def _needed_setup(self) -> LinkSetup:
        if self._setup is None:
            raise LinkLost("the stack was asked something before anything was set up")
        return self._setup

    def _read_messages(
        self, rows: list[tuple[str, str, int]], data: bytes
    ) -> tuple[ReceivedMessage, ...]:
        setup = self._needed_setup()
        kinds = {(one.name, one.kind) for one in setup.subscribe}
        kinds |= {(setup.command, kind) for kind in COMMAND_KINDS}
        messages: list[ReceivedMessage] = []
        begin = 0
        for topic, kind, size in rows:
            if (topic, kind) not in kinds:
                raise self._lost(
                    f"the relay handed over a {kind[:100]} of {topic[:100]}: not subscribed to"
                )
            if size < 4 or begin + size > len(data):
                raise self._lost(f"the relay handed over a message of {topic} that is cut short")
            messages.append(ReceivedMessage(topic, kind, data[begin : begin + size]))
            begin += size
        if begin != len(data):
            raise self._lost("the relay's answer to a cycle came with data that belongs to nothing")
        return tuple(messages)

    def _read_goals(self, rows: list[_GoalRow]) -> tuple[GoalUpdate, ...]:
        for row in rows:
            if row.goal not in self._goals:
                raise self._lost(f"the relay told of a goal {row.goal} that was never sent")
        return tuple(
            GoalUpdate(
                row.goal,
                row.state,
                row.error_code,
                row.error_text,
                {str(name): value for name, value in row.content.items()},
            )
            for row in rows
        )

    def _lost(self, text: str) -> LinkLost:
        """Close the connection: after the first thing that is wrong nothing else is believed."""
        self.close()
        return LinkLost(text)
