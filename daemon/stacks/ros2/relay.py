#!/usr/bin/env python3
"""Connects a simulation to a ROS 2 navigation stack: publishes, subscribes, sends goals for it.

Run by the python3 of the ROS 2 that the stack uses; SCENARIO_SOCKET says where the simulation is.
"""

# This one file is handed to the user's own ROS 2: Python 3.10 or later, the standard library, rclpy
# and, when they are needed, the message packages that are installed there. It imports nothing else.
#
# The conversation, over a stream socket: frames of two little-endian uint32 (length of a JSON head,
# length of a blob), head, blob. The relay says hello first; then it answers one request after the
# other, with `{"answer": ...}` or `{"refused": "a sentence"}`. Contents of messages are CDR that
# is passed on as it is; only goals, results, feedback, parameters and states are converted.
#
# Environment: SCENARIO_SOCKET (path of a Unix socket, or tcp://127.0.0.1:PORT), SCENARIO_NONCE
# (said in the hello), SCENARIO_KEEP=1 (when the simulation has gone, wait for the next one).

from __future__ import annotations

import contextlib
import importlib
import importlib.metadata
import json
import math
import os
import re
import select
import socket
import stat
import struct
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple

VERSION = 1
MAX_HEAD = 4 << 20
MAX_BLOB = 256 << 20
HEADER = struct.Struct("<II")

# Of a subscription that hands over all its messages, in one cycle; what is older is dropped.
MAX_MESSAGES = 200
MAX_BYTES = 1 << 20

COMMAND_KINDS = ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist")
NODE_NAME = "scenario_relay"

_GOAL_RESPONSE = 10.0
_STATE_PERIOD = 0.25
_STATE_PATIENCE = 2.0
_WATCH_PERIOD = 1.0
_TRANSITION_PATIENCE = 60.0
_PARAMETER_PATIENCE = 2.0
_SERVER_PERIOD = 1.0
_LOOK_PERIOD = 0.25
_SLICE = 0.01
_CONNECT_PATIENCE = 60.0
_MAX_WAIT = 600.0
_INTERFACE = re.compile(r"([a-z][a-z0-9_]*)/(msg|srv|action)/([A-Z][A-Za-z0-9]*)")
_ABSOLUTE = re.compile(r"(/[A-Za-z0-9_]+)+")
_TRANSITIONS = {"configure": 1, "cleanup": 2, "activate": 3, "deactivate": 4}
_TERMINAL = {4: "succeeded", 5: "canceled", 6: "aborted"}
_ENDED = (*_TERMINAL.values(), "rejected", "unanswered")
_MISSED_STATES = ("SKIPPED", "FAILED")
_CONTENT = (
    "current_waypoint",
    "number_of_poses_remaining",
    "distance_remaining",
    "number_of_recoveries",
)
_PARAMETER_FIELDS = {
    1: "bool_value",
    2: "integer_value",
    3: "double_value",
    4: "string_value",
    5: "byte_array_value",
    6: "bool_array_value",
    7: "integer_array_value",
    8: "double_array_value",
    9: "string_array_value",
}
# What comes of reaching into an rclpy that has changed inside; RCLError is a RuntimeError.
_UNKNOWN_INSIDE = (ImportError, AttributeError, TypeError, RuntimeError)
_RCLPY_VERSIONS = {"3": "humble", "4": "iron", "7": "jazzy", "9": "kilted"}


class ProtocolError(Exception):
    """What came over the socket is not what this side speaks; the message says what was wrong."""


class RefusedRequest(Exception):  # noqa: N818  (an answer, said in a sentence)
    """A request cannot be done in this ROS 2; the message is for whoever reads the run."""


class Gone(Exception):  # noqa: N818  (not an error: how a conversation ends)
    """The other side has closed the connection, or whoever started this process is no more."""


def encode_frame(head: Any, blob: bytes = b"") -> bytes:
    """Return a frame: lengths, JSON head, blob. Raises ProtocolError when it would be too large."""
    text = json.dumps(head, separators=(",", ":"), allow_nan=False).encode()
    check_lengths(len(text), len(blob))
    return HEADER.pack(len(text), len(blob)) + text + blob


def check_lengths(head: int, blob: int) -> None:
    """Raise ProtocolError when a head or a blob [bytes] is longer than is allowed."""
    if not 2 <= head <= MAX_HEAD:
        raise ProtocolError(f"a frame with a head of {head} bytes (allowed are 2 to {MAX_HEAD})")
    if blob > MAX_BLOB:
        raise ProtocolError(f"a frame with {blob} bytes of data (allowed are {MAX_BLOB})")


def decode_head(data: bytes) -> dict[str, Any]:
    """Read the head of a frame; raises ProtocolError unless it is a JSON object."""
    try:
        head = json.loads(data.decode("utf-8"), parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"a frame whose head is not JSON ({error})") from None
    if not isinstance(head, dict):
        raise ProtocolError("a frame whose head is not a JSON object")
    return head


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")


def _need(head: dict[str, Any], name: str, *kinds: type) -> Any:
    value = head.get(name)
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        wanted = " or ".join(kind.__name__ for kind in kinds)
        raise ProtocolError(f"a request whose {name} is {value!r:.60} (a {wanted} was expected)")
    return value


def _need_name(head: dict[str, Any], name: str) -> str:
    value: str = _need(head, name, str)
    if not _ABSOLUTE.fullmatch(value):
        raise ProtocolError(f"a request whose {name} is {value!r:.60}: not an absolute name")
    return value


class _Conversation:
    """One connection: whole frames in and out; waiting watches whoever started this process."""

    def __init__(self, connected: socket.socket, guard: _ParentGuard) -> None:
        self._socket = connected
        self._guard = guard
        self._buffer = bytearray()

    def send(self, head: Any, blob: bytes = b"") -> None:
        try:
            self._socket.sendall(encode_frame(head, blob))
        except OSError as error:
            raise Gone(f"the simulation has gone ({error})") from None

    def receive(self) -> tuple[dict[str, Any], bytes]:
        sizes = HEADER.unpack(self._read(HEADER.size))
        check_lengths(*sizes)
        return decode_head(self._read(sizes[0])), self._read(sizes[1])

    def close(self) -> None:
        self._socket.close()

    def _read(self, count: int) -> bytes:
        while len(self._buffer) < count:
            self._guard.wait(self._socket)
            try:
                data = self._socket.recv(max(65536, count - len(self._buffer)))
            except OSError as error:
                raise Gone(f"the simulation has gone ({error})") from None
            if not data:
                raise Gone("the simulation has closed the connection")
            self._buffer += data
        data = bytes(self._buffer[:count])
        del self._buffer[:count]
        return data


class _ParentGuard:
    """Notices that whoever started this process is gone: its stdin is closed, or its parent is.

    Only a pipe or a socket as stdin says anything: /dev/null and terminals are always readable.
    """

    def __init__(self) -> None:
        self._parent = os.getppid()
        self._stdin: int | None = None
        try:
            mode = os.fstat(0).st_mode
        except OSError:
            return
        if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode):
            self._stdin = 0

    def wait(self, connected: socket.socket | None, timeout: float | None = None) -> None:
        """Wait until the socket can be read, or ``timeout`` [s]; raises ParentGone."""
        end = math.inf if timeout is None else time.monotonic() + timeout
        while True:
            watched: list[Any] = [] if connected is None else [connected]
            if self._stdin is not None:
                watched.append(self._stdin)
            ready = select.select(watched, [], [], max(0.0, min(1.0, end - time.monotonic())))[0]
            if self._stdin in ready and not os.read(0, 65536):
                raise ParentGone("stdin was closed")
            if os.getppid() != self._parent:
                raise ParentGone("the process that started the relay has ended")
            if (connected is not None and connected in ready) or time.monotonic() >= end:
                return


class ParentGone(Exception):  # noqa: N818  (not an error: how this process ends)
    """Whoever started this process is no more."""


def _interface(kind: str) -> Any:
    """Import a message, service or action by name, such as ``nav_msgs/msg/Odometry``."""
    match = _INTERFACE.fullmatch(kind)
    if not match:
        raise ProtocolError(f"{kind!r:.80} is not the name of a ROS 2 type")
    package, sort, name = match.groups()
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
    """Import rclpy; raises RefusedRequest with what to do where there is none."""
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
        )
    except ImportError as error:
        raise RefusedRequest(
            f"{sys.executable} (Python {sys.version.split()[0]}) cannot import rclpy: {error};"
            " name the setup file of your ROS 2 in the environment of the SUT file, or its"
            " interpreter with python:"
        ) from None


def _distribution() -> str:
    """Name the distribution: ROS_DISTRO, else by what rclpy and nav2_msgs are; empty: unknown."""
    if named := os.environ.get("ROS_DISTRO", ""):
        return named
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


class _Wanted(NamedTuple):
    """A topic as it is wanted; two that are equal are the same publisher or subscription."""

    name: str
    kind: str
    qos: str
    depth: int
    keep: str = "last"


class _Taken(NamedTuple):
    """A raw message: when the middleware received it [ns of wall clock, 0: unknown], its CDR."""

    received: int
    topic: str
    kind: str
    data: bytes


class _Ears:
    """A raw subscription, and what came since the last answer."""

    def __init__(self, wanted: _Wanted, subscription: Any, queue: deque[_Taken]) -> None:
        self.wanted = wanted
        self.subscription = subscription
        self.queue = queue
        self.direct = False
        self.dropped = 0
        self._kept: deque[_Taken] = deque()
        self._size = 0

    def take(self) -> list[_Taken]:
        """Take everything that is there, oldest first."""
        taken = list(self.queue)
        self.queue.clear()
        while self.direct and len(taken) < 10_000:
            message = self.subscription.handle.take_message(self.subscription.msg_type, True)
            if message is None:
                break
            data, info = message
            received = info.get("received_timestamp", 0) if isinstance(info, dict) else 0
            taken.append(_Taken(received, self.wanted.name, self.wanted.kind, data))
        return taken

    def keep(self, message: _Taken) -> None:
        """Keep a message for the answer; the oldest go when there are too many."""
        if self.wanted.keep == "last":
            self._kept.clear()
            self._size = 0
        self._kept.append(message)
        self._size += len(message.data)
        while len(self._kept) > 1 and (len(self._kept) > MAX_MESSAGES or self._size > MAX_BYTES):
            self._size -= len(self._kept.popleft().data)
            self.dropped += 1

    def hand_over(self) -> list[_Taken]:
        """Return what was kept and begin anew."""
        result = list(self._kept)
        self._kept.clear()
        self._size = 0
        return result


class _Participant:
    """A context with one node: publishers and raw subscriptions.

    Subscriptions are read directly, for an executor needs 0.1 to 0.2 ms for each look at ten of
    them. Where a future rclpy has changed inside, its executor does it after all.
    """

    def __init__(self, ros: SimpleNamespace, name: str) -> None:
        self._ros = ros
        self.context = ros.context()
        # No handlers: SIGINT goes to the whole group when a stack is ended, and a context that is
        # shut down in the middle of a cycle would fail with words that explain nothing.
        ros.init(args=[], context=self.context, signal_handler_options=ros.signals.NO)
        self.node = self.make_node(name)
        self._executor: Any = None
        self._wait_set: Any = None
        self._watched: list[Any] = []
        self._direct: bool | None = None

    def make_node(self, name: str) -> Any:
        """Make a node without anything of its own that would have to be waited for."""
        without = self._ros.parameter("start_type_description_service", value=False)
        return self._ros.node(
            name,
            context=self.context,
            cli_args=[],
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[without],
        )

    def make_executor(self, node: Any) -> Any:
        """Make an executor for a node of this context."""
        executor = self._ros.executor(context=self.context)
        executor.add_node(node)
        return executor

    def make_wait_set(self, subscriptions: int, others: tuple[int, ...] = (0, 0, 0, 0, 0)) -> Any:
        """Make a wait set of rclpy's inside; ``others`` as its constructor wants them."""
        inside = importlib.import_module("rclpy.impl.implementation_singleton")
        with self.context.handle:
            make = inside.rclpy_implementation.WaitSet
            return make(subscriptions, *others, self.context.handle)

    def advertise(self, wanted: _Wanted) -> Any:
        """Make a publisher; its ``publish`` takes CDR as bytes."""
        profile = self._profile(wanted.qos, wanted.depth)
        return self.node.create_publisher(_interface(wanted.kind), wanted.name, profile)

    def listen(self, wanted: _Wanted, qos: str) -> _Ears:
        """Subscribe to raw messages, with a quality of service that may differ from the wanted."""
        queue: deque[_Taken] = deque()

        def hear(data: bytes) -> None:
            queue.append(_Taken(time.time_ns(), wanted.name, wanted.kind, data))

        profile = self._profile(qos, wanted.depth)
        subscription = self.node.create_subscription(
            _interface(wanted.kind), wanted.name, hear, profile, raw=True
        )
        if self._direct is None:
            self._direct = self._can_read(subscription)
            if not self._direct:
                self._executor = self.make_executor(self.node)
                print("relay: reading through the executor of rclpy", file=sys.stderr)
        ears = _Ears(wanted, subscription, queue)
        ears.direct = self._direct
        return ears

    def forget(self, ears: _Ears) -> None:
        """End a subscription."""
        self._wait_set = None
        self.node.destroy_subscription(ears.subscription)

    def wait(self, ears: list[_Ears], timeout: float) -> None:
        """Wait until there is something to take from one of ``ears``, at most ``timeout`` [s]."""
        if not self._direct:
            self._executor.spin_once(timeout_sec=max(0.0, timeout))
            return
        subscriptions = [one.subscription for one in ears]
        if self._wait_set is None or self._watched != subscriptions:
            self._watched = subscriptions
            self._wait_set = self.make_wait_set(len(subscriptions))
        self._wait_set.clear_entities()
        for subscription in subscriptions:
            self._wait_set.add_subscription(subscription.handle)
        self._wait_set.wait(max(0, int(timeout * 1e9)))

    def spin(self, ears: Iterable[_Ears]) -> None:
        """Let the executor fill the queues, where it is the executor that does."""
        if self._direct is not False:
            return
        before = -1
        while before != (before := sum(len(one.queue) for one in ears)) and before < 10_000:
            # Twice: after the last callback of a look the next call only ends that look.
            self._executor.spin_once(timeout_sec=0.0)
            self._executor.spin_once(timeout_sec=0.0)

    def close(self) -> None:
        """Leave the graph."""
        self._wait_set = None
        self.node.destroy_node()
        self.context.try_shutdown()

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

    def _can_read(self, subscription: Any) -> bool:
        if _is_executor_wanted():
            return False
        try:
            wait_set = self.make_wait_set(1)
            wait_set.clear_entities()
            wait_set.add_subscription(subscription.handle)
            wait_set.wait(0)
            return callable(subscription.handle.take_message) and bool(subscription.msg_type)
        except _UNKNOWN_INSIDE:
            return False


def _is_executor_wanted() -> bool:
    """Whether rclpy shall be taken for one that is unknown inside; for tests of that."""
    return os.environ.get("SCENARIO_RELAY_EXECUTOR") == "1"


class _Command:
    """The command topic, listened to as the types that its publishers have.

    A stamped command says which cycle it answers. One without a stamp is a guess: it counts for a
    cycle when it was taken after the clock of that cycle had gone out, so one that was meant for a
    cycle before and came late is taken for an answer.
    """

    def __init__(self, ros: SimpleNamespace, participant: _Participant, topic: str) -> None:
        self._ros = ros
        self._topic = topic
        self._participants = [participant]
        self._ears: dict[str, tuple[_Participant, _Ears]] = {}
        self._looked = -math.inf

    def kind(self) -> str:
        """Return the type of the publisher that is there; stamped before unstamped."""
        found = self._published()
        return next((kind for kind in COMMAND_KINDS if kind in found), "")

    def look(self) -> None:
        """Subscribe to what is published now, looked at a few times a second."""
        now = time.monotonic()
        if now - self._looked < _LOOK_PERIOD:
            return
        self._looked = now
        for kind, reliable in self._published().items():
            # Reliable loses nothing but is not given anything by a best effort publisher.
            qos = "reliable" if reliable else "best effort"
            if kind in self._ears:
                participant, ears = self._ears[kind]
                if ears.wanted.qos == "reliable" and not reliable:
                    participant.forget(ears)
                    participant, ears = self._listen(participant, kind, qos)
                    self._ears[kind] = participant, ears
                continue
            # Another context for another type: Fast DDS refuses two types of a topic in one.
            if len(self._ears) == len(self._participants):
                name = f"{NODE_NAME}_{len(self._participants)}"
                self._participants.append(_Participant(self._ros, name))
            self._ears[kind] = self._listen(self._participants[len(self._ears)], kind, qos)

    def take(self) -> list[_Taken]:
        """Take the commands that are there, in the order in which they were received."""
        taken: list[_Taken] = []
        for participant, ears in self._ears.values():
            participant.spin([ears])
            taken += ears.take()
        if len(self._ears) > 1:
            taken.sort(key=lambda message: message.received)
        return taken

    def wait(self, timeout: float) -> None:
        """Wait for a command, at most ``timeout`` [s], or less."""
        if not self._ears:
            time.sleep(min(timeout, _SLICE))
            return
        if len(self._ears) > 1:
            timeout = min(timeout, 0.001)
        participant, ears = next(iter(self._ears.values()))
        participant.wait([ears], timeout)

    def close(self) -> None:
        """End the subscriptions and the contexts that were made for them."""
        for participant, ears in self._ears.values():
            participant.forget(ears)
        self._ears.clear()
        for participant in self._participants[1:]:
            participant.close()

    def _listen(self, participant: _Participant, kind: str, qos: str) -> tuple[_Participant, _Ears]:
        return participant, participant.listen(_Wanted(self._topic, kind, qos, 50), qos)

    def _published(self) -> dict[str, bool]:
        """Return the types that are published, and whether all publishers of it are reliable."""
        found: dict[str, bool] = {}
        reliable = self._ros.qos.ReliabilityPolicy.RELIABLE
        for info in self._participants[0].node.get_publishers_info_by_topic(self._topic):
            if info.topic_type in COMMAND_KINDS:
                is_reliable = info.qos_profile.reliability == reliable
                found[info.topic_type] = found.get(info.topic_type, True) and is_reliable
        return found


def read_stamp(data: bytes) -> int:
    """Return the stamp [ns] of a message that begins with a header, -1 when it is cut short."""
    if len(data) < 12:
        return -1
    seconds, rest = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
    return int(seconds) * 1_000_000_000 + int(rest)


class _Goal:
    """A goal on its way: what was asked for and what came of it."""

    def __init__(self, number: int, response: Any) -> None:
        self.number = number
        self.response = response
        self.asked = time.monotonic()
        self.handle: Any = None
        self.result: Any = None
        self.cancel = False
        self.silent = False
        self.feedback: Any = None


class _Mission:
    """The action that a mission is sent to."""

    def __init__(
        self, ros: SimpleNamespace, participant: _Participant, kind: str, name: str
    ) -> None:
        self.kind = kind
        self.name = name
        self._type = _interface(kind)
        self._node = participant.make_node(f"{NODE_NAME}_mission")
        self._client = ros.action_client(self._node, self._type, name)
        self._executor: Any = None
        self._wait_set: Any = None
        self._goals: list[_Goal] = []
        self._server = False
        self._looked = -math.inf
        if not self._can_poll(participant):
            self._executor = participant.make_executor(self._node)
            print("relay: following goals through the executor of rclpy", file=sys.stderr)

    def server(self, period: float = _SERVER_PERIOD) -> bool:
        """Return whether the server is there, as it was ``period`` [s] ago at most."""
        now = time.monotonic()
        if now - self._looked >= period:
            self._looked = now
            self._server = bool(self._client.server_is_ready())
        return self._server

    def send(self, number: int, poses: list[Any], frame: str, stamp: int) -> None:
        """Send a goal; what its fields are is seen at the class, not at the distribution."""
        made = [_pose(frame, stamp, *pose) for pose in poses]
        goal = self._type.Goal()
        fields = goal.get_fields_and_field_types()
        if "pose" in fields:
            if len(made) != 1:
                raise ProtocolError(f"a goal of {len(made)} poses for {self.kind}")
            goal.pose = made[0]
        elif fields.get("poses") == "nav_msgs/Goals":
            goal.poses.header = made[0].header
            goal.poses.goals = made
        elif "poses" in fields:
            goal.poses = made
        else:
            raise RefusedRequest(f"a goal of {self.kind} has no poses here: {', '.join(fields)}")
        sent: list[_Goal] = []

        def hear(message: Any) -> None:
            sent[0].feedback = message.feedback

        response = self._client.send_goal_async(goal, feedback_callback=hear)
        sent.append(_Goal(number, response))
        self._goals.append(sent[0])

    def cancel(self, *, silent: bool = False) -> None:
        """Ask for every goal to be cancelled, also those that are accepted later."""
        for goal in self._goals:
            goal.silent = goal.silent or silent
            if not goal.cancel:
                goal.cancel = True
                if goal.handle is not None:
                    goal.handle.cancel_goal_async()

    def poll(self) -> list[dict[str, Any]]:
        """Take what came and return what became of goals; never waits."""
        if not self._goals:
            return []
        if self._executor is None:
            self._poll_client()
        else:
            for _ in range(2):
                self._executor.spin_once(timeout_sec=0.0)
        updates: list[dict[str, Any]] = []
        for goal in list(self._goals):
            silent = goal.silent
            news = self._follow(goal)
            if not silent:
                updates += news
        return updates

    def close(self) -> None:
        """Leave the graph."""
        self._wait_set = None
        if self._executor is not None:
            self._executor.shutdown()
        self._client.destroy()
        self._node.destroy_node()

    def _can_poll(self, participant: _Participant) -> bool:
        if _is_executor_wanted():
            return False
        try:
            count = self._client.get_num_entities()
            others = (
                count.num_guard_conditions,
                count.num_timers,
                count.num_clients,
                count.num_services,
                count.num_events,
            )
            self._wait_set = participant.make_wait_set(count.num_subscriptions, others)
            self._poll_client()
        except _UNKNOWN_INSIDE:
            return False
        return True

    def _poll_client(self) -> None:
        """Do what an executor does for an action client, in a tenth of the time."""
        self._wait_set.clear_entities()
        self._client.add_to_wait_set(self._wait_set)
        self._wait_set.wait(0)
        if self._client.is_ready(self._wait_set):
            # Nothing in it waits for anything: it calls what is to be called and ends.
            with contextlib.suppress(StopIteration):
                self._client.execute(self._client.take_data()).send(None)

    def _follow(self, goal: _Goal) -> list[dict[str, Any]]:
        updates: list[dict[str, Any]] = []
        if goal.handle is None:
            if goal.response.done():
                goal.handle = goal.response.result()
                updates.append(_update(goal, "accepted" if goal.handle.accepted else "rejected"))
                if not goal.handle.accepted:
                    self._goals.remove(goal)
                    return updates
                goal.result = goal.handle.get_result_async()
                if goal.cancel:
                    goal.handle.cancel_goal_async()
            elif not goal.silent and time.monotonic() - goal.asked > _GOAL_RESPONSE:
                updates.append(_update(goal, "unanswered"))
                # Kept: if it is accepted after all, nobody waits for it any more.
                goal.silent = goal.cancel = True
                return updates
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
    pose.header.stamp.sec, pose.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
    pose.pose.position.x = float(x)
    pose.pose.position.y = float(y)
    pose.pose.orientation.z = math.sin(yaw / 2.0)
    pose.pose.orientation.w = math.cos(yaw / 2.0)
    return pose


def _update(goal: _Goal, state: str, message: Any = None) -> dict[str, Any]:
    update: dict[str, Any] = {"goal": goal.number, "state": state}
    if message is None:
        return update
    if state != "feedback":
        update["error_code"] = int(getattr(message, "error_code", 0))
        update["error_text"] = str(getattr(message, "error_msg", ""))[:1000]
    content = {name: getattr(message, name) for name in _CONTENT if hasattr(message, name)}
    if state != "feedback" and (missed := _missed(message)) is not None:
        content["missed_waypoints"] = missed
    update["content"] = {
        name: value
        for name, value in content.items()
        if not isinstance(value, float) or math.isfinite(value)
    }
    return update


def _missed(message: Any) -> list[int] | None:
    """Return indices of missed waypoints: int32[], MissedWaypoint[] or WaypointStatus[]."""
    for name in ("missed_waypoints", "waypoint_statuses"):
        if hasattr(message, name):
            return [index for one in getattr(message, name) for index in _missed_index(one)]
    return None


def _missed_index(waypoint: Any) -> list[int]:
    if hasattr(waypoint, "waypoint_status"):
        missed = {getattr(type(waypoint), state, None) for state in _MISSED_STATES}
        return [int(waypoint.waypoint_index)] if waypoint.waypoint_status in missed else []
    return [int(getattr(waypoint, "index", waypoint))]


class _Services:
    """Requests to services of the stack; asked in the background, except for parameters."""

    def __init__(self, participant: _Participant) -> None:
        self._node = participant.make_node(f"{NODE_NAME}_services")
        self._executor = participant.make_executor(self._node)
        self._clients: dict[tuple[str, str], Any] = {}
        self._pending: list[tuple[Any, Any, float, Callable[[Any], None]]] = []
        self._states: dict[str, str] = {}
        self._asked: dict[str, float] = {}
        self._activated: set[str] = set()
        self._wanted: list[tuple[str, int, float]] = []

    def watch(self, nodes: Iterable[str]) -> None:
        """Say whose lifecycle states are asked for."""
        self._states = dict.fromkeys(nodes, "")
        self._asked = dict.fromkeys(self._states, -math.inf)
        self._activated.clear()
        self._wanted.clear()

    def inactive(self) -> dict[str, str]:
        """Return the state of each node that was active and no longer is; asks once a second."""
        states = self.states(_WATCH_PERIOD)
        return {node: states[node] for node in self._activated if states[node] != "active"}

    def states(self, period: float = _STATE_PERIOD) -> dict[str, str]:
        """Return the last known states, and ask for those that are older than ``period`` [s]."""
        now = time.monotonic()
        for node, asked in self._asked.items():
            if now - asked < period:
                continue
            client = self._client("lifecycle_msgs/srv/GetState", f"{node}/get_state")
            if client.service_is_ready():
                # Not before this answer is there, or is not to be expected any more.
                self._asked[node] = now + _STATE_PATIENCE
                request = client.srv_type.Request()
                self._ask(client, request, _STATE_PATIENCE, partial(self._know, node))
            else:
                self._states[node] = ""
        self.poll()
        return dict(self._states)

    def change_state(self, node: str, transition: str) -> None:
        """Ask for a transition as soon as the service is there."""
        self._client("lifecycle_msgs/srv/ChangeState", f"{node}/change_state")
        end = time.monotonic() + _TRANSITION_PATIENCE
        self._wanted.append((node, _TRANSITIONS[transition], end))
        self.poll()

    def parameters(self, node: str, names: list[str]) -> dict[str, Any]:
        """Return the values of parameters that are there; waits two seconds at most."""
        values: dict[str, Any] = {}
        client = self._client("rcl_interfaces/srv/GetParameters", f"{node}/get_parameters")
        end = time.monotonic() + _PARAMETER_PATIENCE
        while not client.service_is_ready():
            if time.monotonic() >= end:
                return values
            time.sleep(_SLICE)
        waiting = set(names)

        def know(name: str, answer: Any) -> None:
            waiting.discard(name)
            # One name a request: a node that does not know one of several answers with none.
            if answer is not None and answer.values and answer.values[0].type:
                values[name] = _parameter(answer.values[0])

        for name in names:
            request = client.srv_type.Request()
            request.names = [name]
            self._ask(client, request, _PARAMETER_PATIENCE, partial(know, name))
        while waiting and time.monotonic() < end:
            self._executor.spin_once(timeout_sec=_SLICE)
            self.poll()
        return values

    def poll(self) -> None:
        """Take answers, send what could not be sent before."""
        now = time.monotonic()
        for wanted in list(self._wanted):
            node, transition, end = wanted
            client = self._client("lifecycle_msgs/srv/ChangeState", f"{node}/change_state")
            if client.service_is_ready():
                request = client.srv_type.Request()
                request.transition.id = transition
                self._ask(client, request, _TRANSITION_PATIENCE, lambda _answer: None)
            if client.service_is_ready() or now > end:
                self._wanted.remove(wanted)
        if not self._pending:
            return
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

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()

    def _ask(self, client: Any, request: Any, patience: float, done: Callable[[Any], None]) -> None:
        future = client.call_async(request)
        self._pending.append((client, future, time.monotonic() + patience, done))

    def _know(self, node: str, answer: Any) -> None:
        if node in self._states:
            label = "not answering" if answer is None else str(answer.current_state.label)[:100]
            self._states[node] = label
            self._asked[node] = time.monotonic()
            if label == "active":
                self._activated.add(node)

    def _client(self, kind: str, name: str) -> Any:
        if (kind, name) not in self._clients:
            self._clients[kind, name] = self._node.create_client(_interface(kind), name)
        return self._clients[kind, name]


def _parameter(value: Any) -> Any:
    """Return a parameter's value as JSON can say it; numbers that it cannot say as text."""
    content = getattr(value, _PARAMETER_FIELDS.get(value.type, ""), None)
    if isinstance(content, (bool, int, str)):
        return content
    if isinstance(content, float):
        return content if math.isfinite(content) else str(content)
    if content is None:
        return None
    return [int.from_bytes(one, "little") if isinstance(one, bytes) else
            str(one) if isinstance(one, float) and not math.isfinite(one) else one
            for one in content]  # fmt: skip


class _Relay:
    """What one process has in the graph, and the requests that are answered with it."""

    def __init__(self, ros: SimpleNamespace) -> None:
        self._ros = ros
        self._participant = _Participant(ros, NODE_NAME)
        self._services = _Services(self._participant)
        self._publishers: dict[_Wanted, Any] = {}
        self._by_name: dict[str, Any] = {}
        self._ears: dict[_Wanted, _Ears] = {}
        self._command: _Command | None = None
        self._command_topic = ""
        self._last_command: _Taken | None = None
        self._commands = 0
        # Of the commands since the last answer: the newest stamp [ns], and whether one has none.
        self._newest_stamp = -1
        self._unstamped = False
        self._mission: _Mission | None = None
        # What was published on topics that are listened to as well: it comes back.
        self._echoes: dict[str, deque[bytes]] = {}
        self._goals: list[dict[str, Any]] = []
        self._heard = False
        self._clock = self._participant.advertise(
            _Wanted("/clock", "rosgraph_msgs/msg/Clock", "reliable", 10)
        )
        self._requests: dict[str, Callable[[dict[str, Any], bytes], tuple[Any, bytes]]] = {
            "set_up": self._set_up,
            "cycle": self._cycle,
            "readiness": self._readiness,
            "goal": self._send_goal,
            "cancel": self._cancel,
            "graph": self._graph,
            "parameters": self._parameters,
            "state": self._change_state,
        }

    def answer(self, head: dict[str, Any], blob: bytes) -> tuple[Any, bytes]:
        """Do what is asked; raises ProtocolError, RefusedRequest."""
        name = _need(head, "do", str)
        if name not in self._requests:
            raise ProtocolError(f"an unknown request {name!r:.60}")
        if name != "set_up" and self._mission is None:
            raise ProtocolError(f"{name} before set_up")
        return self._requests[name](head, blob)

    def let_go(self) -> None:
        """Cancel what a former simulation has asked for."""
        if self._mission is not None:
            self._mission.cancel(silent=True)

    def idle(self) -> None:
        """Keep up with the stack while nobody asks."""
        if self._mission is not None:
            self._mission.poll()

    def close(self) -> None:
        """Leave the graph."""
        if self._command is not None:
            self._command.close()
        if self._mission is not None:
            self._mission.close()
        self._services.close()
        self._participant.close()

    def _set_up(self, head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        publish = [_read_topic(one) for one in _need(head, "publish", list)]
        subscribe = [_read_topic(one) for one in _need(head, "subscribe", list)]
        nodes = [_need_name({"node": node}, "node") for node in _need(head, "nodes", list)]
        kind, action = _need(head, "action_kind", str), _need_name(head, "action")
        command = _need_name(head, "command")
        if self._mission is not None:
            # Of the run before; what is made below keeps what comes from its first moment on.
            self._hear()
            self._forget()
        for wanted in [one for one in self._publishers if one not in publish]:
            self._participant.node.destroy_publisher(self._publishers.pop(wanted))
        for wanted in list(self._ears):
            # What is latched is given to new subscriptions only.
            if wanted not in subscribe or wanted.qos == "latched":
                self._participant.forget(self._ears.pop(wanted))
        if self._command is not None and self._command_topic != command:
            self._command.close()
            self._command = None
        if self._mission is not None and (self._mission.kind, self._mission.name) != (kind, action):
            self._mission.close()
            self._mission = None
        for wanted in publish:
            if wanted not in self._publishers:
                self._publishers[wanted] = self._participant.advertise(wanted)
        self._by_name = {one.name: publisher for one, publisher in self._publishers.items()}
        for wanted in subscribe:
            if wanted not in self._ears:
                # Best effort hears publishers of either kind, reliable only the reliable ones.
                qos = "latched" if wanted.qos == "latched" else "best effort"
                self._ears[wanted] = self._participant.listen(wanted, qos)
        self._echoes = {
            one.name: deque(maxlen=100) for one in subscribe if one.name in self._by_name
        }
        if self._command is None:
            self._command = _Command(self._ros, self._participant, command)
            self._command_topic = command
        self._services.watch(nodes)
        if self._mission is None:
            self._mission = _Mission(self._ros, self._participant, kind, action)
        self._command.look()
        return {}, b""

    def _cycle(self, head: dict[str, Any], blob: bytes) -> tuple[Any, bytes]:
        assert self._command is not None
        stamp, tolerance = _need(head, "time", int), _need(head, "tolerance", int)
        wait = float(_need(head, "wait", int, float))
        until = _need(head, "until", str)
        if until not in ("command", "nothing") or not 0.0 <= wait <= _MAX_WAIT or stamp < 0:
            raise ProtocolError(f"a cycle at {stamp} ns that waits {wait} s for {until!r:.60}")
        clock = struct.pack("<4siI", b"\0\1\0\0", *_seconds(stamp))
        messages = self._read_messages(head, blob)
        self._hear()
        for name, data in messages:
            self._by_name[name].publish(data)
            if name in self._echoes:
                self._echoes[name].append(_without_padding(data))
        # A command without a stamp that is there now was sent before the clock went out.
        self._take_commands()
        self._unstamped = False
        self._clock.publish(clock)
        sent = time.perf_counter()
        latency: float | None = None
        while (left := sent + wait - time.perf_counter()) > 0.0:
            if until == "command":
                self._command.wait(min(left, _SLICE))
                self._take_commands()
            else:
                time.sleep(min(left, _SLICE / 2.0))
            in_time = time.perf_counter() - sent < _SLICE
            if not in_time:
                self._hear()
            if until == "command":
                if self._unstamped or self._newest_stamp >= stamp - tolerance:
                    latency = time.perf_counter() - sent
                    break
                # Once a goal has ended no command is owed any more. One that comes all the same
                # mostly comes at once: runs are more alike when it belongs to its own cycle.
                if not in_time and self._has_ended():
                    break
        self._hear()
        return self._hand_over(latency)

    def _has_ended(self) -> bool:
        return any(update["state"] in _ENDED for update in self._goals)

    def _take_commands(self) -> None:
        assert self._command is not None
        for message in self._command.take():
            self._heard = True
            self._commands += 1
            self._last_command = message
            if message.kind == COMMAND_KINDS[0]:
                self._newest_stamp = max(self._newest_stamp, read_stamp(message.data))
            else:
                self._unstamped = True

    def _hear(self) -> None:
        """Take everything that came from the stack; never waits."""
        assert self._command is not None
        assert self._mission is not None
        self._command.look()
        self._take_commands()
        self._participant.spin(self._ears.values())
        for ears in self._ears.values():
            echoes = self._echoes.get(ears.wanted.name)
            for message in ears.take():
                if echoes and _without_padding(message.data) in echoes:
                    continue
                self._heard = True
                ears.keep(message)
        self._goals += self._mission.poll()
        # Answers about lifecycle states come from a stack that hangs as well.
        self._services.poll()
        if self._goals:
            self._heard = True

    def _forget(self) -> None:
        """Drop what came from the stack before it was asked for."""
        for ears in self._ears.values():
            ears.hand_over()
            ears.dropped = 0
        self._goals.clear()
        self._commands, self._last_command, self._heard = 0, None, False
        self._newest_stamp, self._unstamped = -1, False

    def _hand_over(self, latency: float | None) -> tuple[Any, bytes]:
        assert self._mission is not None
        messages = [message for ears in self._ears.values() for message in ears.hand_over()]
        if self._last_command is not None:
            messages.append(self._last_command)
        messages.sort(key=lambda message: message.received)
        dropped = {ears.wanted.name: ears.dropped for ears in self._ears.values() if ears.dropped}
        size = sum(len(one.data) for one in messages)
        while size > MAX_BLOB:
            largest = max(messages, key=lambda one: len(one.data))
            messages.remove(largest)
            size -= len(largest.data)
            dropped[largest.topic] = dropped.get(largest.topic, 0) + 1
        answer = {
            "latency": latency,
            "commands": self._commands,
            "heard": self._heard,
            "server": self._mission.server(),
            "messages": [[one.topic, one.kind, len(one.data)] for one in messages],
            "goals": _latest_feedback(self._goals),
            "dropped": dropped,
            "inactive": self._services.inactive(),
        }
        self._forget()
        return answer, b"".join(one.data for one in messages)

    def _read_messages(self, head: dict[str, Any], blob: bytes) -> list[tuple[str, bytes]]:
        messages: list[tuple[str, bytes]] = []
        begin = 0
        for one in _need(head, "messages", list):
            if not (isinstance(one, list) and len(one) == 2 and isinstance(one[1], int)):
                raise ProtocolError("a cycle whose messages are not pairs of topic and length")
            name, size = one
            if name not in self._by_name or size < 4 or begin + size > len(blob):
                raise ProtocolError(f"a message of {size} bytes for {name!r:.60}")
            messages.append((name, blob[begin : begin + size]))
            begin += size
        if begin != len(blob):
            raise ProtocolError("a cycle with more data than its messages have")
        return messages

    def _readiness(self, _head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        assert self._command is not None
        assert self._mission is not None
        self._command.look()
        node = self._participant.node
        listened = {wanted.name for wanted in self._ears}
        listeners = {name: node.count_subscribers(name) - (name in listened)
                     for name in self._by_name}  # fmt: skip
        answer = {
            "nodes": self._services.states(),
            "server": self._mission.server(_STATE_PERIOD),
            "command": self._command.kind(),
            "listeners": {name: max(0, count) for name, count in listeners.items()},
        }
        return answer, b""

    def _send_goal(self, head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        assert self._mission is not None
        poses = _need(head, "poses", list)
        if not all(_is_pose(pose) for pose in poses):
            raise ProtocolError("a goal whose poses are not x, y, yaw")
        if not 1 <= len(poses) <= 10_000:
            raise ProtocolError(f"a goal of {len(poses)} poses")
        stamp = _need(head, "time", int)
        _seconds(stamp)
        self._mission.send(_need(head, "goal", int), poses, _need(head, "frame", str), stamp)
        return {}, b""

    def _cancel(self, _head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        assert self._mission is not None
        self._mission.cancel()
        return {}, b""

    def _parameters(self, head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        names = _need(head, "names", list)
        if not all(isinstance(name, str) for name in names) or len(names) > 1000:
            raise ProtocolError("a request for parameters whose names are not texts")
        return self._services.parameters(_need_name(head, "node"), names), b""

    def _change_state(self, head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        transition = _need(head, "transition", str)
        if transition not in _TRANSITIONS:
            raise ProtocolError(f"a request for the transition {transition!r:.60}")
        self._services.change_state(_need_name(head, "node"), transition)
        return {}, b""

    def _graph(self, _head: dict[str, Any], _blob: bytes) -> tuple[Any, bytes]:
        node = self._participant.node
        endpoints: list[Any] = []
        for topic, _kinds in node.get_topic_names_and_types():
            for role, infos in (
                ("publisher", node.get_publishers_info_by_topic(topic)),
                ("subscription", node.get_subscriptions_info_by_topic(topic)),
            ):
                endpoints += [
                    [topic, info.topic_type, role, *self._endpoint(info)]
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
                # Of each node: in the list of all, DDS has services that only have clients.
                offered = node.get_service_names_and_types_by_node(name, namespace)
            except RuntimeError:  # It has just ended; that of rclpy is one of these.
                continue
            services.update(service for service, _kinds in offered)
        answer = {"endpoints": endpoints, "nodes": sorted(nodes), "services": sorted(services)}
        return answer, b""

    def _endpoint(self, info: Any) -> tuple[str, bool, bool, int]:
        names = self._ros.qos
        return (
            _absolute(info.node_namespace, info.node_name),
            info.qos_profile.reliability == names.ReliabilityPolicy.RELIABLE,
            info.qos_profile.durability == names.DurabilityPolicy.TRANSIENT_LOCAL,
            int(info.qos_profile.depth),
        )


def _read_topic(data: Any) -> _Wanted:
    if not isinstance(data, dict):
        raise ProtocolError("a topic that is not an object")
    wanted = _Wanted(
        _need_name(data, "name"),
        _need(data, "kind", str),
        _need(data, "qos", str),
        _need(data, "depth", int),
        _need(data, "keep", str),
    )
    if wanted.qos not in ("reliable", "best effort", "latched") or not 1 <= wanted.depth <= 10_000:
        raise ProtocolError(
            f"a topic {wanted.name} that is {wanted.qos!r:.60}, {wanted.depth} deep"
        )
    return wanted


def _is_pose(data: Any) -> bool:
    return (
        isinstance(data, list)
        and len(data) == 3
        and all(type(one) in (int, float) and math.isfinite(one) for one in data)
    )


def _seconds(nanoseconds: int) -> tuple[int, int]:
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    if not 0 <= seconds < 1 << 31:
        raise ProtocolError(f"a time of {nanoseconds} ns")
    return seconds, rest


def _without_padding(data: bytes) -> bytes:
    """Return CDR without encapsulation and padding, which a middleware may change."""
    return data[4:].rstrip(b"\0")


def _latest_feedback(updates: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Leave out feedback that is followed by newer feedback to the same goal."""
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


def _connect(
    address: str, guard: _ParentGuard, relay: _Relay | None, *, keep: bool
) -> socket.socket:
    """Connect as soon as the simulation listens; raises Gone when it does not within a minute."""
    end = math.inf if keep else time.monotonic() + _CONNECT_PATIENCE
    while True:
        if address.startswith("tcp://"):
            host, _, port = address[6:].rpartition(":")
            made = socket.socket(socket.AF_INET)
            target: Any = (host, int(port))
        else:
            made, target = socket.socket(socket.AF_UNIX), address
        try:
            made.connect(target)
        except OSError as error:
            made.close()
            if time.monotonic() >= end:
                raise Gone(f"nobody listens at {address} ({error})") from None
            guard.wait(None, 0.05)
            if relay is not None:
                relay.idle()
            continue
        if made.family == socket.AF_INET:
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return made


def _converse(conversation: _Conversation, relay: _Relay) -> None:
    """Answer requests until the other side goes; raises Gone, ProtocolError."""
    while True:
        head, blob = conversation.receive()
        try:
            answer, data = relay.answer(head, blob)
        except RefusedRequest as refusal:
            conversation.send({"refused": str(refusal)})
        except (ProtocolError, ParentGone):
            raise
        except Exception as error:  # whatever rclpy raises is said, and told in full in the log
            traceback.print_exc()
            conversation.send({"refused": f"rclpy: {type(error).__name__}: {error}"[:2000]})
        else:
            conversation.send({"answer": answer}, data)


def _enter_graph(hello: dict[str, Any]) -> _Relay:
    """Join the graph and add to ``hello`` in what; raises RefusedRequest."""
    ros = _ros()
    try:
        relay = _Relay(ros)
    except (RefusedRequest, ProtocolError):
        raise
    except Exception as error:  # whatever rclpy and a middleware raise is said
        traceback.print_exc()
        raise RefusedRequest(f"the stack's ROS 2 cannot be used: {error}"[:2000]) from error
    hello["distribution"] = _distribution()
    hello["rmw"] = ros.rmw()
    hello["python"] = sys.version.split()[0]
    return relay


def _serve(address: str, nonce: str, *, keep: bool) -> int:
    """Converse with one simulation, or with one after the other; returns the exit code."""
    guard = _ParentGuard()
    relay: _Relay | None = None
    hello: dict[str, Any] = {"hello": "scenario relay", "version": VERSION, "nonce": nonce}
    try:
        while True:
            conversation = _Conversation(_connect(address, guard, relay, keep=keep), guard)
            try:
                relay = relay or _enter_graph(hello)
                conversation.send(hello)
                head, _blob = conversation.receive()
                if head.get("version") != VERSION:
                    raise ProtocolError(f"version {head.get('version')!r:.20}, not {VERSION}")
                _converse(conversation, relay)
            except RefusedRequest as refusal:
                print(f"relay: {refusal}", file=sys.stderr)
                conversation.send(hello | {"problem": str(refusal)})
                return 1
            except Gone as gone:
                if not keep:
                    return 0
                print(f"relay: {gone}; waiting for the next one", file=sys.stderr)
            finally:
                conversation.close()
            if relay is not None:
                relay.let_go()
    except ProtocolError as error:
        print(f"relay: the simulation sent {error}", file=sys.stderr)
        return 3
    except Gone as gone:
        print(f"relay: {gone}", file=sys.stderr)
        return 1
    except ParentGone as gone:
        print(f"relay: {gone}", file=sys.stderr)
        return 0
    finally:
        if relay is not None:
            relay.close()


def main(arguments: list[str]) -> int:
    """Run until the simulation, or whoever started this process, is gone; return the exit code."""
    if arguments:
        print((__doc__ or "").strip().replace("\n\n", "\n"))
        return 0 if arguments == ["--help"] or arguments == ["-h"] else 2
    address = os.environ.get("SCENARIO_SOCKET", "")
    if not address:
        print(
            "relay: SCENARIO_SOCKET is not set; it names the simulation's socket", file=sys.stderr
        )
        return 2
    try:
        return _serve(
            address,
            os.environ.get("SCENARIO_NONCE", ""),
            keep=os.environ.get("SCENARIO_KEEP") == "1",
        )
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
