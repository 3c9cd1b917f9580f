"""Mission as goals of Nav2's actions, with the progress from their results.

Progress comes from results and feedback alone, never from the true pose of the robot. Sources:
nav2_msgs of Humble to Lyrical (NavigateToPose, NavigateThroughPoses, FollowWaypoints).
"""

from __future__ import annotations

import math
from typing import Final

from daemon.model.sut import Progress, SutEvent, SutFailure
from daemon.stacks.ros2.keys import MissionMode
from daemon.stacks.ros2.link import GoalUpdate, RelayLink
from grammars.model.mission import Mission, Waypoint

_ACKNOWLEDGEMENT: Final = "Timed out while waiting for action server to acknowledge goal request"
"""Log text of bt_navigator if a server has not acknowledged within ``default_server_timeout``. This
is wall time, so a loaded machine aborts missions without any fault of the robot."""


class GoalSequence:
    """Sender of the waypoints of a mission, with its progress.

    ``waypoints``: one goal after the other; ``follow`` and ``through``: all in one goal.
    """

    def __init__(self, mission: Mission, mode: MissionMode, link: RelayLink, frame: str) -> None:
        self._poses = tuple(_goal_poses(mission))
        self._names = tuple(waypoint.id for waypoint in mission.waypoints)
        self._mode: MissionMode = mode
        self._link, self._frame = link, frame
        self._waits = tuple(waypoint.wait for waypoint in mission.waypoints)
        self._stay, self._stays_until = 0.0, 0
        """Stay at a waypoint that begins now [s], and the end of the latest [ns]."""
        self._goal = -1
        self._accepted = False
        self._recoveries = 0
        self._acknowledgement_lost = False
        self.progress = Progress(0, 0, "active" if self._poses else "succeeded")

    @property
    def active(self) -> bool:
        """True while an accepted goal has no result."""
        return self._accepted

    def send_next(self, time: int) -> None:
        """Send the next goal, stamped with ROS ``time`` [ns], unless one is under way."""
        due = self.progress.reached if self._mode == "waypoints" else 0
        if self.progress.state != "active" or self._goal >= due:
            return
        if self._stay:
            self._stays_until, self._stay = time + round(self._stay * 1e9), 0.0
        if time < self._stays_until:
            return
        if due == len(self._poses):
            self.progress = Progress(due, due, "succeeded")
            return
        self._goal = due
        self._recoveries = 0
        self._acknowledgement_lost = False
        poses = self._poses[due : due + 1] if self._mode == "waypoints" else self._poses
        self._link.send_goal(due, poses, self._frame, time)

    def hear_log(self, text: str) -> None:
        """Take a line of the stack's log, the only place where some aborts are explained."""
        if _ACKNOWLEDGEMENT in text:
            self._acknowledgement_lost = True

    def take(self, update: GoalUpdate) -> tuple[SutEvent, ...]:
        """Take news of a goal; return events.

        Raises :class:`SutFailure` for failures that are not the robot's: a goal that is refused or
        not answered, an abort because the machine was too slow for the stack.
        """
        # Late news of an ended goal.
        if update.goal != self._goal:
            return ()
        if update.state == "feedback":
            return self._take_feedback(update)
        name = self._goal_name()
        if update.state == "accepted":
            self._accepted = True
            return (SutEvent(f"goal {name} accepted"),)
        self._accepted = False
        if update.state == "rejected":
            raise SutFailure(
                f"the stack rejected the goal {name} (frame {self._frame}): it must be ready, and "
                "the goal in a frame it knows; its log says why"
            )
        if update.state == "unanswered":
            raise SutFailure(
                f"the stack did not answer the request for the goal {name} within ten seconds"
            )
        if update.state == "succeeded":
            return self._take_success(update, name)
        return self._take_end(update, name)

    def _take_feedback(self, update: GoalUpdate) -> tuple[SutEvent, ...]:
        total = len(self._poses)
        # Never backwards, and never to the end: only the result ends a mission.
        if self._mode == "follow":
            self._advance(min(update.current_waypoint, total - 1))
        elif self._mode == "through" and update.number_of_poses_remaining:
            self._advance(min(total - update.number_of_poses_remaining, total - 1))
        recoveries = update.number_of_recoveries
        if recoveries > self._recoveries:
            self._recoveries = recoveries
            return (SutEvent(f"recovery {recoveries} of goal {self._goal_name()}", "warn"),)
        return ()

    def _advance(self, reached: int) -> None:
        if reached > self.progress.reached:
            self.progress = Progress(reached, reached, "active")

    def _take_success(self, update: GoalUpdate, name: str) -> tuple[SutEvent, ...]:
        indices = update.missed_waypoints
        if indices:
            first = max(0, min(*indices, len(self._names) - 1))
            self.progress = Progress(first, first, "aborted")
            names = ", ".join(self._names[i] for i in indices if 0 <= i < len(self._names))
            return (SutEvent(f"goal {name} ended with missed waypoints: {names}", "error"),)
        total = len(self._poses)
        reached = self.progress.reached + 1 if self._mode == "waypoints" else total
        self._stay = self._waits[reached - 1] if self._mode == "waypoints" else 0.0
        is_over = reached == total and not self._stay
        self.progress = Progress(reached, reached, "succeeded" if is_over else "active")
        return (SutEvent(f"goal {name} succeeded"),)

    def _take_end(self, update: GoalUpdate, name: str) -> tuple[SutEvent, ...]:
        code = f", error code {update.error_code}" if update.error_code else ""
        text = f": {update.error_text}" if update.error_text else ""
        outcome = f"goal {name} {update.state}{code}{text}"
        if self._acknowledgement_lost or _ACKNOWLEDGEMENT in update.error_text:
            raise SutFailure(
                f"{outcome}, after a server of the stack had not acknowledged a request in time: "
                "that time is on the wall clock, so the machine was too slow, not the robot; set "
                "default_server_timeout of bt_navigator to 1000 ms or more"
            )
        self.progress = Progress(self.progress.current, self.progress.reached, "aborted")
        return (SutEvent(outcome, "error"),)

    def _goal_name(self) -> str:
        if self._mode == "waypoints":
            return self._names[self._goal]
        return f"of {len(self._names)} waypoints"


def _goal_poses(mission: Mission) -> list[tuple[float, float, float]]:
    """Return (x, y, yaw) of each waypoint; without a heading, yaw is that of the way there."""
    previous: Waypoint | None = None
    poses = []
    for waypoint in mission.waypoints:
        x, y = (previous.x, previous.y) if previous else (mission.start.x, mission.start.y)
        yaw = waypoint.yaw
        if yaw is None:
            yaw = math.atan2(waypoint.y - y, waypoint.x - x)
        poses.append((waypoint.x, waypoint.y, yaw))
        previous = waypoint
    return poses
