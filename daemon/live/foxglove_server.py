"""A live world for Foxglove: its WebSocket server, with the topics of a trace.

Uses the official SDK (subprotocol ``foxglove.sdk.v1``), the extra ``foxglove``. Clients receive
all topics; late clients also get the latched ones. They may publish velocity commands, set the
parameters ``paused`` and ``speed``, and call the service ``/reset_world``.
"""

from __future__ import annotations

import json
import logging
import threading
from collections import defaultdict
from typing import Any, Final

import foxglove
from foxglove import Channel, Context, MessageSchema, Parameter, Schema, Service, ServiceSchema
from foxglove.websocket import (
    Capability,
    ChannelView,
    Client,
    ClientChannel,
    ServerListener,
    StatusLevel,
    WebSocketServer,
)

from daemon.live.simulation import LiveSimulation, LiveStatus
from daemon.model import ros_messages as ros
from daemon.stacks.ros2.link import COMMAND_KINDS
from daemon.stacks.ros2.sensors import read_command
from daemon.trace import topics_of
from grammars.model.geometry import Twist2

PORT: Final = 8765
"""Default port of Foxglove."""
LOOPBACK: Final = "127.0.0.1"
COMMAND_TOPIC: Final = "/cmd_vel"
SOURCE: Final = "Foxglove"
"""Source of these commands."""

_ENCODINGS: Final = ("json", "cdr")
"""Encodings for clients: json first, since it needs no type definition at their end."""
_TIME_STEP: Final = 20_000_000
"""Least step between two broadcasts of the world's time [ns, simulated]."""
_BACKLOG: Final = 256
"""Messages latched for a slow client; older ones are dropped, and the world never waits."""


class OutletError(Exception):
    """The address cannot be served; the message gives the reason."""


def read_twist(data: bytes, encoding: str, kind: str) -> Twist2:
    """Read a velocity command: a Twist or a TwistStamped, as CDR or JSON.

    Raises ``ValueError`` for anything else.
    """
    if encoding == "cdr":
        return read_command(data, kind)[0]
    try:
        twist = json.loads(data)
    except ValueError as error:
        raise ValueError(f"no JSON: {error}") from error
    if isinstance(twist, dict) and isinstance(twist.get("twist"), dict):
        twist = twist["twist"]
    return Twist2(
        _number(twist, "linear", "x"), _number(twist, "linear", "y"), _number(twist, "angular", "z")
    )


def _number(twist: Any, vector: str, axis: str) -> float:
    part = twist.get(vector) if isinstance(twist, dict) else None
    value = part.get(axis, 0.0) if isinstance(part, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"a velocity command has no {vector}.{axis}")
    return float(value)


class FoxgloveServer:
    """Serves a simulation until it is closed; an outlet of its messages.

    Raises :class:`OutletError` when ``host`` and ``port`` (0: any) cannot be listened at.
    """

    def __init__(
        self, simulation: LiveSimulation, *, host: str = LOOPBACK, port: int = PORT
    ) -> None:
        # The SDK logs about clients; keep that out of the terminal that shows the world.
        logging.getLogger("foxglove").addHandler(logging.NullHandler())
        self._simulation = simulation
        self._published = simulation.status
        self._time_due = 0
        # Keep a reference: channels do not, and without the context no client finds them.
        self._context = Context()
        topics = topics_of(simulation.spec.robot)
        self._channels = {
            topic.name: Channel(
                topic.name,
                message_encoding="cdr",
                schema=Schema(
                    name=topic.kind, encoding="ros2msg", data=ros.schema(topic.kind).encode()
                ),
                context=self._context,
            )
            for topic in topics
            if not topic.external
        }
        latched = {topic.name for topic in topics if topic.latched}
        self._listener = _ClientListener(simulation, self._channels, latched)
        try:
            self._server: WebSocketServer = foxglove.start_server(
                name=f"scenario {simulation.spec.label}",
                host=host,
                port=port,
                context=self._context,
                server_listener=self._listener,
                capabilities=[
                    Capability.ClientPublish,
                    Capability.Time,
                    Capability.Parameters,
                    Capability.Services,
                ],
                supported_encodings=list(_ENCODINGS),
                services=[_reset_service(simulation)],
                message_backlog_size=_BACKLOG,
            )
        except RuntimeError as error:
            raise OutletError(f"Foxglove cannot be served at {host}:{port}: {error}") from error
        self._listener.server = self._server
        self.host, self.port = host, self._server.port
        simulation.add_outlet(self)

    @property
    def clients(self) -> int:
        """Number of clients with a subscription."""
        return self._listener.clients

    def send(self, topic: str, now: int, payload: bytes) -> None:
        """Send a message of ``now`` [ns] to its subscribers; keep it if it is latched."""
        channel = self._channels.get(topic)
        if channel is not None:
            self._listener.keep(topic, payload)
            channel.log(payload, log_time=now)

    def has_listeners(self, topic: str) -> bool:
        """Return whether a topic has a subscriber."""
        channel = self._channels.get(topic)
        return channel is not None and channel.has_sinks()

    def begin(self) -> None:
        """Clear the session of clients: time jumps back."""
        self._time_due = 0
        self._server.clear_session()

    def status(self, status: LiveStatus) -> None:
        """Publish the time and changed parameters."""
        now = self._listener.now = int(status.time * 1e9 + 0.5)
        if now >= self._time_due:
            self._time_due = now + _TIME_STEP
            self._server.broadcast_time(now)
        if (status.speed, status.paused) != (self._published.speed, self._published.paused):
            self._published = status
            self._server.publish_parameter_values(_parameters(status))

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()


class _ClientListener(ServerListener):
    """Handler of clients' requests and messages; called by threads of the SDK only."""

    def __init__(
        self, simulation: LiveSimulation, channels: dict[str, Channel], latched: set[str]
    ) -> None:
        self._simulation, self._channels, self._latched = simulation, channels, latched
        self._lock = threading.Lock()
        self._latched_messages: dict[str, bytes] = {}
        self._subscribed: defaultdict[int, set[int]] = defaultdict(set)
        self._commanding: dict[tuple[int, int], ClientChannel] = {}
        self.server: WebSocketServer | None = None
        self.now = 0

    @property
    def clients(self) -> int:
        with self._lock:
            return sum(bool(channels) for channels in self._subscribed.values())

    def keep(self, topic: str, payload: bytes) -> None:
        """Keep a latched message for late clients."""
        if topic in self._latched:
            with self._lock:
                self._latched_messages[topic] = payload

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Send the latched message of a topic to a new client."""
        with self._lock:
            self._subscribed[client.id].add(channel.id)
            latched = self._latched_messages.get(channel.topic)
        if latched is not None:
            # To all subscribers: the SDK does not identify a client's sink, and repeating a
            # message is harmless.
            self._channels[channel.topic].log(latched, log_time=self.now)

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """Note that a client has unsubscribed or gone."""
        with self._lock:
            self._subscribed[client.id].discard(channel.id)

    def on_client_advertise(self, client: Client, channel: ClientChannel) -> None:
        """Note a topic that a client will publish; only commands are accepted."""
        kind = ros_kind(channel.schema_name)
        if channel.topic != COMMAND_TOPIC:
            # Pose estimates and goals are for a navigation stack; no stack listens here.
            self._complain(channel.topic, f"{channel.topic} is ignored: only {COMMAND_TOPIC} is")
        elif kind not in COMMAND_KINDS or channel.encoding not in _ENCODINGS:
            kinds = " or ".join(COMMAND_KINDS)
            actual = f"{channel.schema_name} as {channel.encoding}"
            self._complain(channel.topic, f"{channel.topic} must be {kinds}, not {actual}")
        else:
            self._commanding[client.id, channel.id] = channel

    def on_client_unadvertise(self, client: Client, client_channel_id: int) -> None:
        """Forget a channel of a client."""
        self._commanding.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Client, client_channel_id: int, data: bytes) -> None:
        """Carry out a command."""
        channel = self._commanding.get((client.id, client_channel_id))
        if channel is None:
            return
        try:
            twist = read_twist(data, channel.encoding, ros_kind(channel.schema_name))
            self._simulation.command(twist, SOURCE)
        except ValueError as error:
            self._complain(channel.topic, f"{channel.topic}: {error}")

    def on_get_parameters(
        self, client: Client, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        """Return ``speed`` and ``paused``."""
        parameters = _parameters(self._simulation.status)
        return [one for one in parameters if not param_names or one.name in param_names]

    def on_set_parameters(
        self, client: Client, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        """Change ``speed`` or ``paused``; return their new values."""
        current = {one.name: one for one in _parameters(self._simulation.status)}
        for one in parameters:
            value = one.get_value()
            try:
                if one.name == "paused" and isinstance(value, bool):
                    self._simulation.pause(value)
                elif one.name == "speed" and type(value) in (int, float):
                    self._simulation.set_speed(float(value))  # type: ignore[arg-type]
                else:
                    raise ValueError("the parameters are paused (a boolean) and speed (a number)")
                current[one.name] = one
            except ValueError as error:
                self._complain(one.name, f"parameter {one.name}: {error}")
        return [current[one.name] for one in parameters if one.name in current]

    def _complain(self, subject: str, message: str) -> None:
        """Show a message in the clients, replacing the last one on this subject."""
        if self.server is not None:
            self.server.publish_status(message, StatusLevel.Warning, f"scenario {subject}")


def ros_kind(name: str) -> str:
    """Return a type name with its ``msg``: clients also write ``geometry_msgs/Twist``."""
    package, _, rest = name.partition("/")
    return name if rest.startswith("msg/") else f"{package}/msg/{rest}"


def _parameters(status: LiveStatus) -> list[Parameter]:
    return [Parameter("paused", value=status.paused), Parameter("speed", value=status.speed)]


def _reset_service(simulation: LiveSimulation) -> Service:
    """Return ``/reset_world``, named as in Gazebo."""

    def reset(_: object) -> bytes:
        simulation.reset()
        return b"{}"

    kind, empty = "std_srvs/srv/Empty", b'{"type": "object", "properties": {}}'
    request, response = (
        MessageSchema(encoding="json", schema=Schema(name=name, encoding="jsonschema", data=empty))
        for name in (f"{kind}_Request", f"{kind}_Response")
    )
    described = ServiceSchema(kind, request=request, response=response)
    return Service("/reset_world", schema=described, handler=reset)
