"""Node that sends the waypoints of a mission to move_base, one after the other.

It follows argenos/waypoint_dispatcher: request a plan, whose side effects count but not its result;
send the goal; wait for the outcome; send at most one goal a second. A missed goal ends the mission.
There is no time-out and no second attempt. The robot may stay at a waypoint, which is ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, TypeAlias

from daemon.model.sut import Progress
from daemon.stacks.ros1.move_base._parameters import DispatcherParameters
from daemon.stacks.ros1.timers import TIME_TOLERANCE, RosRate
from grammars.model.geometry import Pose2
from grammars.model.mission import Waypoint

Outcome: TypeAlias = Literal["succeeded", "aborted"]


class WaypointDispatcher:
    """Source of goals; ``step`` is called once per instant, after move_base.

    ``make_plan`` is the service of that name, for a start and a goal in map.
    """

    def __init__(
        self,
        parameters: DispatcherParameters,
        waypoints: Sequence[Waypoint],
        make_plan: Callable[[Pose2, Pose2], None],
    ) -> None:
        self._parameters, self._make_plan = parameters, make_plan
        self._waits = tuple(waypoint.wait for waypoint in waypoints)
        self._goals = tuple(_goal(waypoint, parameters.default_yaw) for waypoint in waypoints)
        self._rate: RosRate | None = None
        self._sleeps_until = 0.0
        self._waiting = False
        self.progress = Progress(0, 0, "active")
        """Progress of the mission."""

    def step(self, now: float, result: Outcome | None, pose: Pose2) -> Pose2 | None:
        """Return a goal to send now, if any.

        ``result`` is the outcome of the last goal, ``pose`` the latest from AMCL.
        """
        if self._rate is None:
            self._rate = RosRate(1.0 / self._parameters.rate, now)
        if result is not None:
            self._handle_result(now, result, self._rate)
        over = self.progress.state != "active"
        if self._waiting or over or now < self._sleeps_until - TIME_TOLERANCE:
            return None
        if self.progress.reached == len(self._goals):
            self._note(self.progress.reached, "succeeded")
            return None
        goal = self._goals[self.progress.reached]
        if self._parameters.make_plan:
            self._make_plan(pose, goal)
        self._waiting = True
        return goal

    def _handle_result(self, now: float, result: Outcome, rate: RosRate) -> None:
        self._waiting = False
        if result == "aborted":
            self._note(self.progress.reached, "aborted")
            return
        stays_until = now + self._waits[self.progress.reached]
        self._note(self.progress.reached + 1, "active")
        self._sleeps_until = max(rate.sleep(now), stays_until)

    def _note(self, reached: int, state: Literal["active", "succeeded", "aborted"]) -> None:
        self.progress = Progress(min(reached, max(len(self._goals) - 1, 0)), reached, state)


def _goal(waypoint: Waypoint, default_yaw: float) -> Pose2:
    yaw = default_yaw if waypoint.yaw is None else waypoint.yaw
    return Pose2(waypoint.x, waypoint.y, yaw)
