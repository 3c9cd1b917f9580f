"""States and parameters of the nodes of a stack, asked for over Zenoh."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from threading import Condition
from time import monotonic
from typing import Any, Final

import numpy as np

from daemon.stacks.ros2.link import LinkLost
from daemon.stacks.ros2.rmw_zenoh.node import RosNode, ServiceClient

GET_STATE: Final = "lifecycle_msgs/srv/GetState"
CHANGE_STATE: Final = "lifecycle_msgs/srv/ChangeState"
GET_PARAMETERS: Final = "rcl_interfaces/srv/GetParameters"

TRANSITIONS: Final = {"configure": 1, "cleanup": 2, "activate": 3, "deactivate": 4}
"""Of ``lifecycle_msgs/msg/Transition``."""

_PERIOD: Final = 0.5
_PATIENCE: Final = 2.0
_CHANGE_PATIENCE: Final = 60.0

_PARAMETER_FIELDS: Final = {
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
"""Of ``rcl_interfaces/msg/ParameterValue``; 0 is a parameter that is not there."""


class LifecycleClients:
    """Clients of the services that nodes have; made when first needed.

    ``want`` is told of every service that is to be talked to (name, type), ``serves`` answers
    whether it is in the graph.
    """

    def __init__(
        self,
        node: RosNode,
        want: Callable[[str, str], object],
        serves: Callable[[str, str], bool],
    ) -> None:
        self._node = node
        self._want = want
        self._serves = serves
        self._clients: dict[tuple[str, str], ServiceClient] = {}
        self._states: dict[str, str] = {}
        self._due: dict[str, float] = {}
        self._asked: set[str] = set()
        self._answers: deque[tuple[str, bytes | None]] = deque()
        # Requests to change a state that nobody has taken yet, and until when they are made.
        self._changes: dict[str, tuple[bytes, float]] = {}

    def watch(self, nodes: tuple[str, ...]) -> None:
        """Have the services in mind that tell the states of ``nodes`` (absolute names)."""
        for name in nodes:
            self._client(name, "get_state", GET_STATE)

    def states(self, nodes: tuple[str, ...]) -> Mapping[str, str]:
        """Return the states of nodes as last heard, empty while unknown, and ask again.

        Raises :class:`LinkLost` for an answer that cannot be read.
        """
        while self._answers:
            name, data = self._answers.popleft()
            self._asked.discard(name)
            self._states[name] = "" if data is None else self._label(name, data)
        for name, (request, end) in list(self._changes.items()):
            if monotonic() > end:
                del self._changes[name]
            elif self._serves(f"{name}/change_state", CHANGE_STATE):
                del self._changes[name]
                self._ask_to_change(name, request, end)
        for name in nodes:
            if not self._serves(f"{name}/get_state", GET_STATE):
                # A node that went away is not what it was any more.
                self._states[name] = ""
                continue
            if name in self._asked or monotonic() < self._due.get(name, 0.0):
                continue
            client = self._client(name, "get_state", GET_STATE)
            self._asked.add(name)
            self._due[name] = monotonic() + _PERIOD
            request = self._node.interfaces.serialize(f"{GET_STATE}_Request")
            client.call(request, _PATIENCE, partial(self._hear, name))
        return {name: self._states.get(name, "") for name in nodes}

    def change(self, node: str, transition: str) -> None:
        """Ask a node to take a transition, again with :meth:`states` until it is there."""
        interfaces = self._node.interfaces
        interfaces.load(CHANGE_STATE)
        wanted = interfaces.make(
            "lifecycle_msgs/msg/Transition", id=TRANSITIONS[transition], label=transition
        )
        request = interfaces.serialize(f"{CHANGE_STATE}_Request", transition=wanted)
        self._ask_to_change(node, request, monotonic() + _CHANGE_PATIENCE)

    def _ask_to_change(self, node: str, request: bytes, end: float) -> None:
        def hear(data: bytes | None) -> None:
            self._due.pop(node, None)
            if data is None:
                # No server: a stack of the run before takes a moment to find this router.
                self._changes.setdefault(node, (request, end))

        # Configuring a costmap may take a while; what became of it says its state.
        client = self._client(node, "change_state", CHANGE_STATE)
        client.call(request, _CHANGE_PATIENCE, hear)

    def parameters(self, node: str, names: tuple[str, ...]) -> Mapping[str, Any]:
        """Return the values of those parameters that a node has; waits two seconds at most."""
        client = self._client(node, "get_parameters", GET_PARAMETERS)
        news = Condition()
        answers: dict[str, bytes | None] = {}

        def hear(name: str, data: bytes | None) -> None:
            with news:
                answers[name] = data
                news.notify()

        # One by one: where one is unknown, rclcpp answers with none of them.
        for name in names:
            request = self._node.interfaces.serialize(f"{GET_PARAMETERS}_Request", names=[name])
            client.call(request, _PATIENCE, partial(hear, name))
        with news:
            news.wait_for(lambda: len(answers) == len(set(names)), _PATIENCE)
            heard = dict(answers)
        found = {name: self._value(node, heard.get(name)) for name in names}
        return {name: value for name, value in found.items() if value is not None}

    def _client(self, node: str, service: str, kind: str) -> ServiceClient:
        known = self._clients.get((node, service))
        if known is None:
            self._node.interfaces.load(kind)
            name = f"{node}/{service}"
            self._want(name, kind)
            known = self._clients[node, service] = self._node.client(name, kind)
        return known

    def _hear(self, name: str, data: bytes | None) -> None:
        self._answers.append((name, data))

    def _label(self, name: str, data: bytes) -> str:
        return str(self._read(name, data, f"{GET_STATE}_Response").current_state.label)

    def _value(self, name: str, data: bytes | None) -> Any:
        if data is None:
            return None
        values = self._read(name, data, f"{GET_PARAMETERS}_Response").values
        if len(values) != 1 or values[0].type not in _PARAMETER_FIELDS:
            return None
        value = getattr(values[0], _PARAMETER_FIELDS[values[0].type])
        return value.tolist() if isinstance(value, np.ndarray) else value

    def _read(self, name: str, data: bytes, kind: str) -> Any:
        try:
            return self._node.interfaces.deserialize(data, kind)
        except ValueError as error:
            raise LinkLost(f"an answer of the node {name} cannot be read: {error}") from error
