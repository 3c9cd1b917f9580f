"""A client of one of Nav2's actions over Zenoh: three services and a topic.

Answers come in threads of Zenoh's and are only put aside there; what becomes of a goal is worked
out by :meth:`ActionClient.attend`, which whoever owns the client calls often.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from time import monotonic
from typing import Any, Final, Literal

import numpy as np

from daemon.model import ros_messages
from daemon.stacks.ros2.link import ACTION_KINDS, GoalUpdate, LinkLost
from daemon.stacks.ros2.rmw_zenoh.node import RosNode
from daemon.stacks.ros2.rmw_zenoh.wire import QosProfile, Role

CANCEL: Final = "action_msgs/srv/CancelGoal"

ANSWER_TIME: Final = 10.0
"""Seconds of wall clock after which a request for a goal counts as unanswered."""

_RESULT_TIME: Final = 7 * 24 * 3600.0
_PAUSE: Final = 0.2

_STATES: Final[dict[int, Literal["succeeded", "canceled", "aborted"]]] = {
    4: "succeeded",
    5: "canceled",
    6: "aborted",
}
"""Of ``action_msgs/msg/GoalStatus``."""

_CONTENT: Final = (
    "current_waypoint",
    "number_of_poses_remaining",
    "distance_remaining",
    "number_of_recoveries",
)

_What = Literal["goal", "result", "feedback", "cancel"]


@dataclass
class _SentGoal:
    number: int
    identifier: bytes
    request: bytes
    deadline: float
    waits_for: Literal["goal", "result", "nothing"] = "goal"
    ask_again: float | None = None
    cancel: bool = False
    feedback: bytes | None = None


class ActionClient:
    """Sends goals to ``name`` (absolute) of an action, a key of ``ACTION_KINDS``.

    ``woken`` is called when there is news, with whether it came from the stack. ``endpoints`` are
    those it talks to (role, name, type), first the one that says that there is a server.

    Raises :class:`~daemon.stacks.ros2.rmw_zenoh.interfaces.InterfaceError` when definitions are
    missing.
    """

    def __init__(
        self, node: RosNode, name: str, action: str, woken: Callable[[bool], object]
    ) -> None:
        self._interfaces = node.interfaces
        self._kind = ACTION_KINDS[action]
        self._woken = woken
        self._interfaces.load(self._kind)
        self._interfaces.load(CANCEL)
        self._send = node.client(f"{name}/_action/send_goal", f"{self._kind}_SendGoal")
        self._result = node.client(f"{name}/_action/get_result", f"{self._kind}_GetResult")
        self._cancel = node.client(f"{name}/_action/cancel_goal", CANCEL)
        heard = partial(self._hear, "feedback", -1)
        node.subscribe(
            f"{name}/_action/feedback", f"{self._kind}_FeedbackMessage", QosProfile(), heard
        )
        self.endpoints: tuple[tuple[Role, str, str], ...] = (
            ("server", f"{name}/_action/send_goal", f"{self._kind}_SendGoal"),
            ("server", f"{name}/_action/get_result", f"{self._kind}_GetResult"),
            ("server", f"{name}/_action/cancel_goal", CANCEL),
            ("publisher", f"{name}/_action/feedback", f"{self._kind}_FeedbackMessage"),
        )
        self._heard: deque[tuple[_What, int, bytes | None]] = deque()
        self._goals: dict[int, _SentGoal] = {}
        self._updates: list[GoalUpdate] = []

    def send(self, number: int, poses: tuple[tuple[float, float, float], ...], frame: str,
             time: int) -> None:  # fmt: skip
        """Send a goal; asked again until there is a server, at most for :data:`ANSWER_TIME`."""
        identifier = os.urandom(16)
        goal = self._interfaces.make(f"{self._kind}_Goal", **self._targets(poses, frame, time))
        request = self._interfaces.serialize(
            f"{self._kind}_SendGoal_Request", goal_id=self._identified(identifier), goal=goal
        )
        one = _SentGoal(number, identifier, request, monotonic() + ANSWER_TIME)
        self._goals[number] = one
        self._ask(one)

    def cancel_all(self) -> None:
        """Ask for every goal that has no result yet to be cancelled."""
        for goal in self._goals.values():
            if goal.waits_for != "nothing":
                goal.cancel = True
                if goal.waits_for == "result":
                    self._ask_to_cancel(goal)

    def attend(self) -> bool:
        """Work off what was heard and ask again where nobody answered; return whether a goal ended.

        Raises :class:`LinkLost` for an answer that is none.
        """
        under_way = self._under_way()
        while self._heard:
            what, number, data = self._heard.popleft()
            if what == "feedback":
                self._take_feedback(data)
            elif what == "goal":
                self._take_answer(self._goals[number], data)
            elif what == "result":
                self._take_result(self._goals[number], data)
        now = monotonic()
        for goal in self._goals.values():
            if goal.ask_again is None or goal.waits_for == "nothing":
                continue
            if goal.waits_for == "goal" and now >= goal.deadline:
                goal.waits_for = "nothing"
                self._updates.append(GoalUpdate(goal.number, "unanswered"))
            elif now >= goal.ask_again:
                self._ask(goal)
        return self._under_way() < under_way

    def take(self) -> tuple[GoalUpdate, ...]:
        """Return what became of goals since the last time, oldest first."""
        for goal in self._goals.values():
            self._tell_feedback(goal)
        updates, self._updates = tuple(self._updates), []
        return updates

    def _under_way(self) -> int:
        return sum(goal.waits_for != "nothing" for goal in self._goals.values())

    def _targets(self, poses: tuple[tuple[float, float, float], ...], frame: str,
                 time: int) -> Mapping[str, Any]:  # fmt: skip
        stamped = [self._pose(pose, frame, time) for pose in poses]
        # Goals of Kilted on are a message with a list; of others they are the list.
        nested = self._interfaces.field_types(f"{self._kind}_Goal").get("poses", "")
        many: Any = stamped
        if nested.endswith("/Goals"):
            header = self._header(frame, time)
            many = self._interfaces.make(nested, header=header, goals=stamped)
        return {"pose": stamped[0], "poses": many}

    def _pose(self, pose: tuple[float, float, float], frame: str, time: int) -> Any:
        x, y, yaw = pose
        z, w = ros_messages.yaw_quaternion(yaw)
        make = self._interfaces.make
        position = make("geometry_msgs/msg/Point", x=x, y=y)
        orientation = make("geometry_msgs/msg/Quaternion", z=z, w=w)
        content = make("geometry_msgs/msg/Pose", position=position, orientation=orientation)
        return make("geometry_msgs/msg/PoseStamped", header=self._header(frame, time), pose=content)

    def _header(self, frame: str, time: int) -> Any:
        seconds, rest = divmod(time, 1_000_000_000)
        stamp = self._interfaces.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)
        return self._interfaces.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def _identified(self, identifier: bytes) -> Any:
        return self._interfaces.make(
            "unique_identifier_msgs/msg/UUID", uuid=np.frombuffer(identifier, np.uint8)
        )

    def _ask(self, goal: _SentGoal) -> None:
        goal.ask_again = None
        if goal.waits_for == "goal":
            timeout = max(goal.deadline - monotonic(), _PAUSE)
            self._send.call(goal.request, timeout, partial(self._hear, "goal", goal.number))
        else:
            request = self._interfaces.serialize(
                f"{self._kind}_GetResult_Request", goal_id=self._identified(goal.identifier)
            )
            self._result.call(request, _RESULT_TIME, partial(self._hear, "result", goal.number))

    def _ask_to_cancel(self, goal: _SentGoal) -> None:
        info = self._interfaces.make(
            "action_msgs/msg/GoalInfo", goal_id=self._identified(goal.identifier)
        )
        request = self._interfaces.serialize(f"{CANCEL}_Request", goal_info=info)
        self._cancel.call(request, ANSWER_TIME, partial(self._hear, "cancel", goal.number))

    def _hear(self, what: _What, number: int, data: bytes | None) -> None:
        self._heard.append((what, number, data))
        self._woken(data is not None)

    def _take_answer(self, goal: _SentGoal, data: bytes | None) -> None:
        if goal.waits_for != "goal":
            return
        if data is None:
            # No server, or none any more: the time for an answer is not over yet.
            goal.ask_again = monotonic() + _PAUSE
            return
        answer = self._read(data, "SendGoal_Response")
        goal.waits_for = "result" if answer.accepted else "nothing"
        self._updates.append(GoalUpdate(goal.number, "accepted" if answer.accepted else "rejected"))
        if answer.accepted:
            self._ask(goal)
            if goal.cancel:
                self._ask_to_cancel(goal)

    def _take_result(self, goal: _SentGoal, data: bytes | None) -> None:
        if goal.waits_for != "result":
            return
        if data is None:
            goal.ask_again = monotonic() + _PAUSE
            return
        answer = self._read(data, "GetResult_Response")
        self._tell_feedback(goal)
        goal.waits_for = "nothing"
        state, result = _STATES.get(answer.status), answer.result
        text = str(getattr(result, "error_msg", ""))
        if state is None:
            text = text or f"the action server knows no such goal (status {answer.status})"
        self._updates.append(
            GoalUpdate(
                goal.number,
                state or "aborted",
                int(getattr(result, "error_code", 0)),
                text,
                _content(result),
            )
        )

    def _take_feedback(self, data: bytes | None) -> None:
        if data is None:
            return
        # The identifier comes first, behind the four bytes of encapsulation: others' goals have
        # feedback on the same topic, and only the last of a cycle is asked for.
        identifier = data[4:20]
        for goal in self._goals.values():
            if goal.identifier == identifier and goal.waits_for != "nothing":
                goal.feedback = data

    def _tell_feedback(self, goal: _SentGoal) -> None:
        if goal.feedback is not None:
            message = self._read(goal.feedback, "FeedbackMessage")
            goal.feedback = None
            content = _content(message.feedback)
            self._updates.append(GoalUpdate(goal.number, "feedback", content=content))

    def _read(self, data: bytes, part: str) -> Any:
        try:
            return self._interfaces.deserialize(data, f"{self._kind}_{part}")
        except ValueError as error:
            raise LinkLost(
                f"an answer of the action server cannot be read: {error}. Name the distribution of "
                "the stack (distribution:), or a folder with its interface definitions "
                "(definitions:)"
            ) from error


def _content(message: Any) -> dict[str, Any]:
    content: dict[str, Any] = {
        name: getattr(message, name).item()
        if isinstance(getattr(message, name), np.generic)
        else getattr(message, name)
        for name in _CONTENT
        if hasattr(message, name)
    }
    if hasattr(message, "missed_waypoints"):
        content["missed_waypoints"] = [_index(one) for one in message.missed_waypoints]
    return content


def _index(missed: Any) -> int:
    """Return the index of a missed waypoint: a number, ``MissedWaypoint``, ``WaypointStatus``."""
    for name in ("waypoint_index", "index"):
        if hasattr(missed, name):
            return int(getattr(missed, name))
    return int(missed)
