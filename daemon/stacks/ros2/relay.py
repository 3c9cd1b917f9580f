#!/usr/bin/env python3
"""Connect a simulation to a ROS 2 navigation stack: publish, subscribe and send goals for it.

Run it with the python3 of the stack's ROS 2; SCENARIO_SOCKET is the address of the simulation.
"""

# This one file runs in the user's own ROS 2. It needs Python 3.10 or later and imports only the
# standard library, rclpy and the message packages of that ROS 2.
#
# The conversation uses the frames of multiprocessing.connection over a stream socket. A frame is a
# JSON object, a line feed and binary data, without pickles. The relay says hello. The first
# request is the set-up; each request gets {"answer": ...} or {"refused": "a sentence"}. Contents of
# messages are CDR and pass unchanged; only goals, results, feedback, parameters and states are
# converted.
#
# Environment: SCENARIO_SOCKET (path of a Unix socket, or tcp://127.0.0.1:PORT), SCENARIO_NONCE
# (part of the hello).

from __future__ import annotations

import contextlib
import importlib
import importlib.metadata
import json
import math
import os
import socket
import stat
import struct
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_data
from types import SimpleNamespace
from typing import Any, NamedTuple

VERSION = 2

# The number of messages of a subscription in one cycle; older ones are dropped.
MAX_MESSAGES = 200

COMMAND_KINDS = ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist")
NODE_NAME = "scenario_relay"

_GOAL_RESPONSE = 10.0
_STATE_PERIOD = 0.25
_STATE_PATIENCE = 2.0
_WATCH_PERIOD = 0.5
_PARAMETER_PATIENCE = 2.0
_SERVER_PERIOD = 1.0
_REFRESH_PERIOD = 0.25
_SLICE = 0.01
_CONNECT_PATIENCE = 60.0
_NANO = 1_000_000_000
_TERMINAL = {4: "succeeded", 5: "canceled", 6: "aborted"}
_ENDED = (*_TERMINAL.values(), "rejected", "unanswered")
_MISSED_STATES = ("SKIPPED", "FAILED")
_PROGRESS = ("current_waypoint", "number_of_poses_remaining", "number_of_recoveries")
_PARAMETER_FIELDS = {1: "bool_value", 2: "integer_value", 3: "double_value", 4: "string_value"}
_RCLPY_VERSIONS = {"3": "humble", "4": "iron", "7": "jazzy", "9": "kilted"}


class RefusedRequest(Exception):  # noqa: N818  (a kind of answer)
    """This ROS 2 cannot fulfil a request; the message is for the reader of the run."""


class Ended(Exception):  # noqa: N818  (the regular end of this process)
    """The process that started the relay is gone; the message gives the sign of it."""


def encode_frame(head: Any, blob: bytes = b"") -> bytes:
    """Return the content of a frame: JSON head, line feed, blob."""
    return json.dumps(head, separators=(",", ":")).encode() + b"\n" + blob


def decode_frame(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Split a frame into head and blob; raises ValueError if the head is not a JSON object."""
    text, _, blob = data.partition(b"\n")
    head = json.loads(text)
    if not isinstance(head, dict):
        raise ValueError(f"not a JSON object: {text[:80]!r}")
    return head, blob


class _ParentGuard:
    """Notice the end of the parent process: stdin closes, or the parent changes.

    Only a pipe or a socket as stdin counts: /dev/null and terminals are always readable.
    """

    def __init__(self) -> None:
        self._parent = os.getppid()
        self._stdin: list[int] = []
        with contextlib.suppress(OSError):
            mode = os.fstat(0).st_mode
            if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode):
                self._stdin.append(0)

    def wait(self, connections: list[Connection], timeout: float = math.inf) -> None:
        """Wait for data, at most ``timeout`` [s]; raises Ended."""
        end = time.monotonic() + timeout
        while True:
            seconds = max(0.0, min(1.0, end - time.monotonic()))
            ready = wait_for_data([*connections, *self._stdin], seconds)
            if 0 in ready and not os.read(0, 65536):
                raise Ended("stdin was closed")
            if os.getppid() != self._parent:
                raise Ended("the process that started the relay has ended")
            if any(one in ready for one in connections) or time.monotonic() >= end:
                return


def _interface(kind: str) -> Any:
    """Import a message, service or action by name, such as ``nav_msgs/msg/Odometry``."""
    package, sort, name = kind.split("/")
    try:
        module = importlib.import_module(f"{package}.{sort}")
    except ImportError as error:
        if isinstance(error, ModuleNotFoundError) and error.name == package:
            raise RefusedRequest(
                f"the stack's ROS 2 has no package {package}: install it, or name the setup file"
                f" of the workspace that has it ({sys.executable} looked for {kind})"
            ) from None
        raise RefusedRequest(
            f"the stack's package {package} cannot be imported by {sys.executable}: {error}"
        ) from None
    if not hasattr(module, name):
        raise RefusedRequest(f"the stack's package {package} has no {sort} {name}")
    return getattr(module, name)


def _ros() -> SimpleNamespace:
    """Import the parts of rclpy; raises RefusedRequest with a remedy if that fails."""
    try:
        return SimpleNamespace(
            init=importlib.import_module("rclpy").init,
            rmw=importlib.import_module("rclpy").get_rmw_implementation_identifier,
            qos=importlib.import_module("rclpy.qos"),
            node=importlib.import_module("rclpy.node").Node,
            parameter=importlib.import_module("rclpy.parameter").Parameter,
            executor=importlib.import_module("rclpy.executors").SingleThreadedExecutor,
            action_client=importlib.import_module("rclpy.action").ActionClient,
            context=importlib.import_module("rclpy.context").Context,
            signals=importlib.import_module("rclpy.signals").SignalHandlerOptions,
            inside=importlib.import_module("rclpy.impl.implementation_singleton"),
        )
    except ImportError as error:
        raise RefusedRequest(
            f"{sys.executable} (Python {sys.version.split()[0]}) cannot import rclpy: {error};"
            " name the setup file of your ROS 2 in the environment of the SUT file, or its"
            " interpreter with python:"
        ) from None


def _distribution() -> str:
    """Return the distribution by ROS_DISTRO, rclpy or nav2_msgs, or an empty text."""
    if distribution := os.environ.get("ROS_DISTRO", ""):
        return distribution
    try:
        version = importlib.metadata.version("rclpy").split(".")[0]
    except importlib.metadata.PackageNotFoundError:
        return ""
    if version in _RCLPY_VERSIONS:
        return _RCLPY_VERSIONS[version]
    try:
        feedback = _interface("nav2_msgs/action/NavigateToPose").Feedback
    except RefusedRequest:
        return ""
    return "lyrical" if "position_tracking_error" in feedback.get_fields_and_field_types() else ""


class _Topic(NamedTuple):
    """A topic as the simulation describes it."""

    name: str
    kind: str
    qos: str
    depth: int
    keep: str = "last"


class _RawMessage(NamedTuple):
    """A raw message as CDR, with the time of its reception [ns of wall clock], topic and type."""

    received: int
    topic: str
    kind: str
    data: bytes


class _Listener:
    """A raw subscription, and its messages since the last answer."""

    def __init__(self, topic: _Topic, subscription: Any, make_wait_set: Callable[[], Any]) -> None:
        self.topic = topic
        self.subscription = subscription
        self.overflowed = False
        self._make_wait_set = make_wait_set
        self._wait_set: Any = None
        self._messages: deque[_RawMessage] = deque(
            maxlen=1 if topic.keep == "last" else MAX_MESSAGES
        )

    def wait(self, timeout: float) -> None:
        """Wait for a message, at most ``timeout`` [s]."""
        self._wait_set = self._wait_set or self._make_wait_set()
        self._wait_set.clear_entities()
        self._wait_set.add_subscription(self.subscription.handle)
        self._wait_set.wait(max(0, int(timeout * _NANO)))

    def take(self) -> list[_RawMessage]:
        """Take all messages that have arrived, oldest first."""
        messages = []
        handle, kind = self.subscription.handle, self.subscription.msg_type
        while (message := handle.take_message(kind, True)) is not None:
            data, info = message
            received = info["received_timestamp"]
            messages.append(_RawMessage(received, self.topic.name, self.topic.kind, data))
        return messages

    def keep(self, message: _RawMessage) -> None:
        """Keep a message for the answer, and drop the oldest one if there are too many."""
        if self.topic.keep == "all" and len(self._messages) == MAX_MESSAGES:
            self.overflowed = True
        self._messages.append(message)

    def drain(self) -> list[_RawMessage]:
        """Return the kept messages and forget them."""
        result = list(self._messages)
        self._messages.clear()
        self.overflowed = False
        return result


class _Participant:
    """A context with one node: publishers and raw subscriptions.

    Subscriptions are read without an executor of rclpy. One in a thread of its own took twice the
    CPU time (1.0 ms a cycle) and added 0.5 to 0.9 ms to the measured latency of an answer (medians,
    Kilted and Jazzy, two loaded cores).
    """

    def __init__(self, ros: SimpleNamespace, name: str, closing: ExitStack) -> None:
        self._ros = ros
        self._closing = closing
        self.context = ros.context()
        # No handlers: SIGINT goes to the whole group at the end of a stack, and a context that
        # shuts down in the middle of a cycle would fail with an unclear message.
        ros.init(args=[], context=self.context, signal_handler_options=ros.signals.NO)
        closing.callback(self.context.try_shutdown)
        self.node = self.make_node(name)

    def make_node(self, name: str) -> Any:
        """Make a node without services, parameters or a log of its own."""
        no_service = self._ros.parameter("start_type_description_service", value=False)
        node = self._ros.node(
            name,
            context=self.context,
            cli_args=[],
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[no_service],
        )
        self._closing.callback(node.destroy_node)
        return node

    def make_wait_set(self, *counts: int) -> Any:
        """Make a wait set for ``counts`` entities of each kind, in the order of its constructor."""
        with self.context.handle:
            return self._ros.inside.rclpy_implementation.WaitSet(*counts, self.context.handle)

    def advertise(self, topic: _Topic) -> Any:
        """Make a publisher; its ``publish`` takes CDR as bytes."""
        profile = self._profile(topic.qos, topic.depth)
        return self.node.create_publisher(_interface(topic.kind), topic.name, profile)

    def listen(self, topic: _Topic) -> _Listener:
        """Subscribe to raw messages."""
        profile = self._profile(topic.qos, topic.depth)
        subscription = self.node.create_subscription(
            _interface(topic.kind), topic.name, lambda _: None, profile, raw=True
        )
        return _Listener(topic, subscription, partial(self.make_wait_set, 1, 0, 0, 0, 0, 0))

    def _profile(self, qos: str, depth: int) -> Any:
        names = self._ros.qos
        best_effort, reliable = (
            names.ReliabilityPolicy.BEST_EFFORT,
            names.ReliabilityPolicy.RELIABLE,
        )
        volatile, transient_local = (
            names.DurabilityPolicy.VOLATILE,
            names.DurabilityPolicy.TRANSIENT_LOCAL,
        )
        return names.QoSProfile(
            history=names.HistoryPolicy.KEEP_LAST,
            depth=depth,
            reliability=best_effort if qos == "best effort" else reliable,
            durability=transient_local if qos == "latched" else volatile,
        )


class _Command:
    """Subscriptions of the command topic, one for each type that its publishers have.

    The stamp of a command tells which cycle it answers. A command without a stamp counts for a
    cycle if it arrives after the clock of that cycle went out, so a late command of the cycle
    before passes for an answer.
    """

    def __init__(
        self, ros: SimpleNamespace, participant: _Participant, topic: str, closing: ExitStack
    ) -> None:
        self._ros = ros
        self._topic = topic
        self._closing = closing
        self._participants = [participant]
        self._listeners: dict[str, tuple[_Participant, _Listener]] = {}
        self._refresh_time = -math.inf

    def refresh(self) -> None:
        """Subscribe to the types of the current publishers, a few times a second."""
        now = time.monotonic()
        if now - self._refresh_time < _REFRESH_PERIOD:
            return
        self._refresh_time = now
        for kind, reliable in self._reliable_types().items():
            # Reliable loses no message but gets none from a best effort publisher.
            topic = _Topic(self._topic, kind, "reliable" if reliable else "best effort", 50)
            if kind in self._listeners:
                participant, listener = self._listeners[kind]
                if listener.topic.qos == "reliable" and not reliable:
                    participant.node.destroy_subscription(listener.subscription)
                    self._listeners[kind] = participant, participant.listen(topic)
                continue
            # Another context for another type: Fast DDS refuses two types of a topic in one.
            if len(self._listeners) == len(self._participants):
                name = f"{NODE_NAME}_{len(self._participants)}"
                self._participants.append(_Participant(self._ros, name, self._closing))
            participant = self._participants[len(self._listeners)]
            self._listeners[kind] = participant, participant.listen(topic)

    def take(self) -> list[_RawMessage]:
        """Take the commands that have arrived, in the order of their reception."""
        commands = [one for _, listener in self._listeners.values() for one in listener.take()]
        if len(self._listeners) > 1:
            commands.sort(key=lambda command: command.received)
        return commands

    def wait(self, timeout: float) -> None:
        """Wait for a command, at most ``timeout`` [s]."""
        if not self._listeners:
            time.sleep(min(timeout, _SLICE))
            return
        if len(self._listeners) > 1:
            timeout = min(timeout, 0.001)
        _, listener = next(iter(self._listeners.values()))
        listener.wait(timeout)

    def _reliable_types(self) -> dict[str, bool]:
        """Return the types of the publishers, each with True if its publishers are all reliable."""
        types: dict[str, bool] = {}
        reliable = self._ros.qos.ReliabilityPolicy.RELIABLE
        for info in self._participants[0].node.get_publishers_info_by_topic(self._topic):
            if info.topic_type in COMMAND_KINDS:
                is_reliable = info.qos_profile.reliability == reliable
                types[info.topic_type] = types.get(info.topic_type, True) and is_reliable
        return types


def read_stamp(data: bytes) -> int:
    """Return the stamp [ns] of a message that begins with a header, -1 if it is too short."""
    if len(data) < 12:
        return -1
    seconds, rest = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
    return int(seconds) * _NANO + int(rest)


class _Goal:
    """A pending goal: its number, and the response, feedback and result of the server."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.sent_at = time.monotonic()
        self.response: Any = None
        self.result: Any = None
        self.feedback: Any = None

    def take_feedback(self, message: Any) -> None:
        """Store feedback of the server."""
        self.feedback = message.feedback


class _Mission:
    """Client of the action that drives the mission."""

    def __init__(
        self,
        ros: SimpleNamespace,
        participant: _Participant,
        kind: str,
        name: str,
        closing: ExitStack,
    ) -> None:
        self._kind = kind
        self._type = _interface(kind)
        self._client = ros.action_client(
            participant.make_node(f"{NODE_NAME}_mission"), self._type, name
        )
        closing.callback(self._client.destroy)
        self._goals: list[_Goal] = []
        self._server = False
        self._server_time = -math.inf
        count = self._client.get_num_entities()
        self._wait_set = participant.make_wait_set(
            count.num_subscriptions,
            count.num_guard_conditions,
            count.num_timers,
            count.num_clients,
            count.num_services,
            count.num_events,
        )

    def server(self, period: float = _SERVER_PERIOD) -> bool:
        """Return True if the server is there; the answer is at most ``period`` [s] old."""
        now = time.monotonic()
        if now - self._server_time >= period:
            self._server_time = now
            self._server = bool(self._client.server_is_ready())
        return self._server

    def send(self, number: int, poses: list[Any], frame: str, stamp: int) -> None:
        """Send a goal; its class tells which fields it has, whatever the distribution is."""
        goal_poses = [_pose(frame, stamp, *pose) for pose in poses]
        goal = self._type.Goal()
        fields = goal.get_fields_and_field_types()
        if "pose" in fields:
            (goal.pose,) = goal_poses
        elif fields.get("poses") == "nav_msgs/Goals":
            goal.poses.header = goal_poses[0].header
            goal.poses.goals = goal_poses
        elif "poses" in fields:
            goal.poses = goal_poses
        else:
            raise RefusedRequest(f"a goal of {self._kind} has no poses here: {', '.join(fields)}")
        pending = _Goal(number)
        pending.response = self._client.send_goal_async(
            goal, feedback_callback=pending.take_feedback
        )
        self._goals.append(pending)

    def poll(self) -> list[dict[str, Any]]:
        """Take answers of the server and return the updates of goals, without waiting."""
        if not self._goals:
            return []
        # The work of an executor for an action client, in a tenth of its time.
        self._wait_set.clear_entities()
        self._client.add_to_wait_set(self._wait_set)
        self._wait_set.wait(0)
        if self._client.is_ready(self._wait_set):
            # This coroutine calls the callbacks and ends without waiting.
            with contextlib.suppress(StopIteration):
                self._client.execute(self._client.take_data()).send(None)
        return [update for goal in list(self._goals) for update in self._follow(goal)]

    def _follow(self, goal: _Goal) -> list[dict[str, Any]]:
        updates: list[dict[str, Any]] = []
        if goal.result is None:
            if goal.response.done():
                handle = goal.response.result()
                updates.append(_update(goal, "accepted" if handle.accepted else "rejected"))
                if not handle.accepted:
                    self._goals.remove(goal)
                    return updates
                goal.result = handle.get_result_async()
            elif time.monotonic() - goal.sent_at > _GOAL_RESPONSE:
                self._goals.remove(goal)
                return [_update(goal, "unanswered")]
        if goal.feedback is not None:
            updates.append(_update(goal, "feedback", goal.feedback))
            goal.feedback = None
        if goal.result is not None and goal.result.done():
            response = goal.result.result()
            state = _TERMINAL.get(response.status)
            update = _update(goal, state or "aborted", response.result)
            if state is None:
                update["error_text"] = f"the server answered with status {response.status}"
            updates.append(update)
            self._goals.remove(goal)
        return updates


def _pose(frame: str, stamp: int, x: float, y: float, yaw: float) -> Any:
    pose = _interface("geometry_msgs/msg/PoseStamped")()
    pose.header.frame_id = frame
    pose.header.stamp.sec, pose.header.stamp.nanosec = divmod(stamp, _NANO)
    pose.pose.position.x = float(x)
    pose.pose.position.y = float(y)
    pose.pose.orientation.z = math.sin(yaw / 2.0)
    pose.pose.orientation.w = math.cos(yaw / 2.0)
    return pose


def _update(goal: _Goal, state: str, message: Any = None) -> dict[str, Any]:
    update: dict[str, Any] = {"goal": goal.number, "state": state}
    update |= {name: getattr(message, name) for name in _PROGRESS if hasattr(message, name)}
    if state in _TERMINAL.values():
        update["error_code"] = int(getattr(message, "error_code", 0))
        update["error_text"] = str(getattr(message, "error_msg", ""))[:1000]
        update["missed_waypoints"] = _missed(message)
    return update


def _missed(message: Any) -> list[int]:
    """Return the indices of missed waypoints: int32[], MissedWaypoint[] or WaypointStatus[]."""
    for name in ("missed_waypoints", "waypoint_statuses"):
        if hasattr(message, name):
            return [index for one in getattr(message, name) for index in _missed_index(one)]
    return []


def _missed_index(waypoint: Any) -> list[int]:
    if hasattr(waypoint, "waypoint_status"):
        failures = {getattr(type(waypoint), state, None) for state in _MISSED_STATES}
        return [int(waypoint.waypoint_index)] if waypoint.waypoint_status in failures else []
    return [int(getattr(waypoint, "index", waypoint))]


class _Services:
    """Requests to services of the stack, in the background except for parameters."""

    def __init__(
        self,
        ros: SimpleNamespace,
        participant: _Participant,
        nodes: Iterable[str],
        closing: ExitStack,
    ) -> None:
        self._node = participant.make_node(f"{NODE_NAME}_services")
        self._executor = ros.executor(context=participant.context)
        self._executor.add_node(self._node)
        closing.callback(self._executor.shutdown)
        self._clients: dict[tuple[str, str], Any] = {}
        self._pending: list[tuple[Any, Any, float, Callable[[Any], None]]] = []
        self._states = dict.fromkeys(nodes, "")
        self._request_times = dict.fromkeys(self._states, -math.inf)
        self._once_active: set[str] = set()

    def inactive(self) -> dict[str, str]:
        """Return the state of each node that is no longer active, from requests twice a second."""
        states = self.states(_WATCH_PERIOD).items()
        return {node: s for node, s in states if node in self._once_active and s != "active"}

    def states(self, period: float = _STATE_PERIOD) -> dict[str, str]:
        """Return the last known states, and request those that are older than ``period`` [s]."""
        now = time.monotonic()
        for node, last in self._request_times.items():
            if now - last < period:
                continue
            client = self._client("lifecycle_msgs/srv/GetState", f"{node}/get_state")
            if client.service_is_ready():
                # The next request waits for this answer or for the end of the patience.
                self._request_times[node] = now + _STATE_PATIENCE
                request = client.srv_type.Request()
                self._ask(client, request, _STATE_PATIENCE, partial(self._store_state, node))
            else:
                self._states[node] = ""
        self.poll()
        return dict(self._states)

    def parameters(self, node: str, names: list[str]) -> dict[str, Any]:
        """Return the values of the parameters that the node has; waits two seconds at most."""
        values: dict[str, Any] = {}
        client = self._client("rcl_interfaces/srv/GetParameters", f"{node}/get_parameters")
        end = time.monotonic() + _PARAMETER_PATIENCE
        while not client.service_is_ready():
            if time.monotonic() >= end:
                return values
            time.sleep(_SLICE)
        waiting = set(names)

        def store(name: str, answer: Any) -> None:
            waiting.discard(name)
            # One name a request: a node that lacks one of several parameters answers with none.
            if answer is not None and answer.values:
                (value,) = answer.values
                if value.type in _PARAMETER_FIELDS:
                    values[name] = getattr(value, _PARAMETER_FIELDS[value.type])

        for name in names:
            request = client.srv_type.Request()
            request.names = [name]
            self._ask(client, request, _PARAMETER_PATIENCE, partial(store, name))
        while waiting and time.monotonic() < end:
            self._executor.spin_once(timeout_sec=_SLICE)
            self.poll()
        return values

    def poll(self) -> None:
        """Take answers, without waiting."""
        if not self._pending:
            return
        now = time.monotonic()
        for _ in range(len(self._pending) + 1):
            self._executor.spin_once(timeout_sec=0.0)
        for pending in list(self._pending):
            client, future, end, done = pending
            if future.done():
                self._pending.remove(pending)
                done(future.result())
            elif now > end:
                self._pending.remove(pending)
                client.remove_pending_request(future)
                done(None)

    def _ask(self, client: Any, request: Any, patience: float, done: Callable[[Any], None]) -> None:
        future = client.call_async(request)
        self._pending.append((client, future, time.monotonic() + patience, done))

    def _store_state(self, node: str, answer: Any) -> None:
        label = "not answering" if answer is None else str(answer.current_state.label)[:100]
        self._states[node] = label
        self._request_times[node] = time.monotonic()
        if label == "active":
            self._once_active.add(node)

    def _client(self, kind: str, name: str) -> Any:
        if (kind, name) not in self._clients:
            self._clients[kind, name] = self._node.create_client(_interface(kind), name)
        return self._clients[kind, name]


class _Stack:
    """Publishers, subscriptions and clients of a set-up, and the requests that they answer."""

    def __init__(
        self,
        ros: SimpleNamespace,
        participant: _Participant,
        setup: dict[str, Any],
        closing: ExitStack,
    ) -> None:
        self._ros = ros
        self._participant = participant
        self._clock = participant.advertise(
            _Topic("/clock", "rosgraph_msgs/msg/Clock", "reliable", 10)
        )
        self._publishers = {
            one["name"]: participant.advertise(_Topic(**one)) for one in setup["publish"]
        }
        self._listeners: list[_Listener] = []
        # Messages published on topics with a subscription: they come back.
        self._echoes: dict[str, deque[bytes]] = {}
        for topic in (_Topic(**one) for one in setup["subscribe"]):
            # Best effort gets messages of any publisher, reliable only of reliable ones.
            qos = "latched" if topic.qos == "latched" else "best effort"
            self._listeners.append(participant.listen(topic._replace(qos=qos)))
            if topic.name in self._publishers:
                self._echoes[topic.name] = deque(maxlen=100)
        self._services = _Services(ros, participant, setup["nodes"], closing)
        self._mission = _Mission(ros, participant, setup["action_kind"], setup["action"], closing)
        self._goals: list[dict[str, Any]] = []
        self._command = _Command(ros, participant, setup["command"], closing)
        self._command.refresh()
        self._commands = 0
        self._last_command: _RawMessage | None = None
        # Newest stamp of the commands since the last answer [ns], and True if one had no stamp.
        self._newest_stamp = -1
        self._unstamped = False
        self._has_news = False
        self._requests: dict[str, Callable[[dict[str, Any], bytes], tuple[Any, bytes]]] = {
            "cycle": self._cycle,
            "readiness": self._readiness,
            "goal": self._send_goal,
            "graph": self._graph,
            "parameters": self._parameters,
        }

    def answer(self, head: dict[str, Any], blob: bytes) -> tuple[Any, bytes]:
        """Return the answer to a request; raises RefusedRequest."""
        return self._requests[head["do"]](head, blob)

    def _cycle(self, head: dict[str, Any], blob: bytes) -> tuple[Any, bytes]:
        stamp, wait, until = head["time"], head["wait"], head["until"]
        self._receive()
        begin = 0
        for name, size in head["messages"]:
            data = blob[begin : begin + size]
            begin += size
            self._publishers[name].publish(data)
            if name in self._echoes:
                self._echoes[name].append(_without_padding(data))
        # Commands without a stamp that are there by now do not answer this clock.
        self._take_commands()
        self._unstamped = False
        self._clock.publish(struct.pack("<4siI", b"\0\1\0\0", *divmod(stamp, _NANO)))
        start = time.perf_counter()
        latency: float | None = None
        while (remaining := start + wait - time.perf_counter()) > 0.0:
            if until == "command":
                self._command.wait(min(remaining, _SLICE))
                self._take_commands()
            else:
                time.sleep(min(remaining, _SLICE / 2.0))
            in_time = time.perf_counter() - start < _SLICE
            if not in_time:
                self._receive()
            if until == "command":
                if self._unstamped or self._newest_stamp >= stamp - head["tolerance"]:
                    latency = time.perf_counter() - start
                    break
                # After the end of a goal the stack owes no command. If one comes, it mostly comes
                # at once: runs repeat better when it belongs to its own cycle.
                if not in_time and any(update["state"] in _ENDED for update in self._goals):
                    break
        self._receive()
        return self._cycle_answer(latency)

    def _take_commands(self) -> None:
        for message in self._command.take():
            self._has_news = True
            self._commands += 1
            self._last_command = message
            if message.kind == COMMAND_KINDS[0]:
                self._newest_stamp = max(self._newest_stamp, read_stamp(message.data))
            else:
                self._unstamped = True

    def _receive(self) -> None:
        """Take all messages of the stack, without waiting."""
        self._command.refresh()
        self._take_commands()
        for listener in self._listeners:
            echoes = self._echoes.get(listener.topic.name)
            for message in listener.take():
                if echoes and _without_padding(message.data) in echoes:
                    continue
                self._has_news = True
                listener.keep(message)
        self._goals += self._mission.poll()
        # A stack that hangs still answers about lifecycle states, so they do not count.
        self._services.poll()
        if self._goals:
            self._has_news = True

    def _cycle_answer(self, latency: float | None) -> tuple[Any, bytes]:
        """Return the answer to a cycle and start the next one."""
        dropped = [listener.topic.name for listener in self._listeners if listener.overflowed]
        messages = [message for listener in self._listeners for message in listener.drain()]
        if self._last_command is not None:
            messages.append(self._last_command)
        messages.sort(key=lambda message: message.received)
        answer = {
            "latency": latency,
            "commands": self._commands,
            "heard": self._has_news,
            "server": self._mission.server(),
            "messages": [[one.topic, one.kind, len(one.data)] for one in messages],
            "goals": _latest_feedback(self._goals),
            "dropped": dropped,
            "inactive": self._services.inactive(),
        }
        self._goals.clear()
        self._commands, self._last_command, self._has_news = 0, None, False
        self._newest_stamp, self._unstamped = -1, False
        return answer, b"".join(one.data for one in messages)

    def _readiness(self, _head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        self._command.refresh()
        own = {listener.topic.name for listener in self._listeners}
        answer = {
            "nodes": self._services.states(),
            "server": self._mission.server(_STATE_PERIOD),
            "listeners": {
                name: self._participant.node.count_subscribers(name) - (name in own)
                for name in self._publishers
            },
        }
        return answer, b""

    def _send_goal(self, head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        self._mission.send(head["goal"], head["poses"], head["frame"], head["time"])
        return {}, b""

    def _parameters(self, head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        return self._services.parameters(head["node"], head["names"]), b""

    def _graph(self, _head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        node = self._participant.node
        endpoints: list[dict[str, Any]] = []
        for topic, _kinds in node.get_topic_names_and_types():
            for role, infos in (
                ("publisher", node.get_publishers_info_by_topic(topic)),
                ("subscription", node.get_subscriptions_info_by_topic(topic)),
            ):
                endpoints += [
                    self._endpoint(topic, role, info)
                    for info in infos
                    if not _is_own(info.node_name)
                ]
        nodes: list[str] = []
        services: set[str] = set()
        for name, namespace in node.get_node_names_and_namespaces():
            if _is_own(name):
                continue
            nodes.append(_absolute(namespace, name))
            try:
                # Node by node: the list of DDS for all nodes has services with only a client.
                offers = node.get_service_names_and_types_by_node(name, namespace)
            except RuntimeError:  # The node has just ended; rclpy's error is a RuntimeError.
                continue
            services.update(service for service, _kinds in offers)
        answer = {"endpoints": endpoints, "nodes": sorted(nodes), "services": sorted(services)}
        return answer, b""

    def _endpoint(self, topic: str, role: str, info: Any) -> dict[str, Any]:
        names, profile = self._ros.qos, info.qos_profile
        return {
            "topic": topic,
            "kind": info.topic_type,
            "node": _absolute(info.node_namespace, info.node_name),
            "role": role,
            "reliable": profile.reliability == names.ReliabilityPolicy.RELIABLE,
            "transient_local": profile.durability == names.DurabilityPolicy.TRANSIENT_LOCAL,
        }


def _without_padding(data: bytes) -> bytes:
    """Return CDR without encapsulation and padding, which a middleware may change."""
    return data[4:].rstrip(b"\0")


def _latest_feedback(updates: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return updates without feedback that newer feedback to the same goal replaces."""
    latest = {one["goal"]: index for index, one in enumerate(updates) if one["state"] == "feedback"}
    return [
        one
        for index, one in enumerate(updates)
        if one["state"] != "feedback" or latest[one["goal"]] == index
    ]


def _is_own(name: str) -> bool:
    return name.startswith(NODE_NAME)


def _absolute(namespace: str, name: str) -> str:
    return f"{namespace.rstrip('/')}/{name}"


def _connect(address: str, guard: _ParentGuard) -> Connection:
    """Connect as soon as the simulation listens, or end the process after a minute."""
    end = time.monotonic() + _CONNECT_PATIENCE
    while True:
        if address.startswith("tcp://"):
            host, _, port = address[6:].rpartition(":")
            stream = socket.socket(socket.AF_INET)
            stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            target: Any = (host, int(port))
        else:
            stream, target = socket.socket(socket.AF_UNIX), address
        try:
            stream.connect(target)
        except OSError as error:
            stream.close()
            if time.monotonic() >= end:
                sys.exit(f"relay: no simulation listens at {address} ({error})")
            guard.wait([], 0.05)
        else:
            return Connection(stream.detach())


def _converse(connection: Connection, guard: _ParentGuard, closing: ExitStack) -> int:
    """Say hello and answer requests until an exception; returns 1 without a usable ROS 2."""
    hello: dict[str, Any] = {"version": VERSION, "nonce": os.environ.get("SCENARIO_NONCE", "")}
    try:
        ros = _ros()
        participant = _Participant(ros, NODE_NAME, closing)
    except Exception as error:  # reports any failure of rclpy or a middleware
        problem = str(error)
        if not isinstance(error, RefusedRequest):
            traceback.print_exc()
            problem = f"the stack's ROS 2 cannot be used: {error}"
        print(f"relay: {problem}", file=sys.stderr)
        connection.send_bytes(encode_frame(hello | {"problem": problem}))
        return 1
    hello |= {"distribution": _distribution(), "rmw": ros.rmw()}
    connection.send_bytes(encode_frame(hello))
    stack: _Stack | None = None
    while True:
        guard.wait([connection])
        head, blob = decode_frame(connection.recv_bytes())
        answer: Any = {}
        data = b""
        try:
            if stack is None:
                stack = _Stack(ros, participant, head, closing)
            else:
                answer, data = stack.answer(head, blob)
        except RefusedRequest as refusal:
            reply: dict[str, Any] = {"refused": str(refusal)}
        except Exception as error:  # reports any failure of rclpy, with the traceback in the log
            traceback.print_exc()
            reply = {"refused": f"rclpy: {type(error).__name__}: {error}"}
        else:
            reply = {"answer": answer}
        connection.send_bytes(encode_frame(reply, data))


def main(arguments: list[str]) -> int:
    """Run until the simulation or the parent of this process is gone; return the exit code."""
    if arguments:
        print((__doc__ or "").strip().replace("\n\n", "\n"))
        return 0 if arguments == ["--help"] or arguments == ["-h"] else 2
    address = os.environ.get("SCENARIO_SOCKET", "")
    if not address:
        print(
            "relay: SCENARIO_SOCKET is not set; it is the address of the simulation",
            file=sys.stderr,
        )
        return 2
    guard = _ParentGuard()
    try:
        with _connect(address, guard) as connection, ExitStack() as closing:
            return _converse(connection, guard, closing)
    except Ended as ended:
        print(f"relay: {ended}", file=sys.stderr)
    except (EOFError, OSError) as error:
        print(f"relay: the simulation has gone ({error})", file=sys.stderr)
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
