"""bt_navigator: the actions of Nav2 with their real feedback and results."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav2_msgs import msg as nav2_messages
from nav2_msgs.action import FollowWaypoints, NavigateThroughPoses, NavigateToPose
from nav_msgs.msg import Path
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.impl.implementation_singleton import rclpy_implementation
from standin_nodes.controller import ALIGNMENT
from standin_nodes.lifecycle import LifecycleNode
from standin_nodes.poses import fill_pose, fill_stamp, nanoseconds
from std_msgs.msg import String

_MARGIN = 200_000_000
"""A goal this close [ns] before a multiple of the alignment waits for the next one."""
_PLANNING = 1_000_000_000
"""Between planning and driving [ns]: enough for a plan to be made on a busy machine."""
_NO_VALID_PATH = 208
_FAILED_TO_MAKE_PROGRESS = 105
_UNKNOWN = 9000


class GoalAbortedError(Exception):
    """A goal cannot be fulfilled: error code and message of its result."""


class GoalCanceledError(Exception):
    """Somebody asked for a goal to be given up."""


@dataclass(frozen=True)
class _Leg:
    """The way to one pose of a goal: `accepted` and `begin` are simulated times [ns]."""

    handle: Any
    accepted: int
    begin: int
    index: int
    poses: list[PoseStamped]


class _Suspend:
    """Awaited by a goal's coroutine until it is stepped again."""

    def __await__(self):
        yield


class Navigator(LifecycleNode):
    """Takes goals one at a time: a new one ends the old one, as Nav2's action servers do."""

    def __init__(self, options):
        super().__init__("bt_navigator", options)
        self._goals = self.create_publisher(PoseStamped, "planner_server/goal", 10)
        self.create_subscription(Path, "planner_server/path", self._on_plan, 10)
        self._paths = self.create_publisher(Path, "controller_server/path", 10)
        self.create_subscription(String, "controller_server/state", self._on_state, 100)
        self._goal = None
        self._states = []
        self._plans = {}
        self._jobs = []
        self._cycles = 0
        actions = {
            "navigate_to_pose": NavigateToPose,
            "navigate_through_poses": NavigateThroughPoses,
            "follow_waypoints": FollowWaypoints,
        }
        self._kinds = {kind.Goal: kind for kind in actions.values()}
        self._servers = [
            ActionServer(
                self,
                kind,
                name,
                lambda handle: None,
                goal_callback=self._on_goal,
                handle_accepted_callback=self._on_accepted,
                cancel_callback=lambda _: CancelResponse.ACCEPT,
            )
            for name, kind in actions.items()
        ]
        # Cancel requests come without a callback of ours.
        self.create_timer(0.1, self._step, clock=self.wall)

    def on_deactivate(self):
        """End the current goal."""
        self._goal = None
        self._step()

    def _on_goal(self, goal):
        if self.options.has("late-acknowledge"):
            time.sleep(self.options.seconds)
        frames = {pose.header.frame_id for pose in _poses_of(goal)}
        if not self.active:
            self.get_logger().error("Action server is inactive. Rejecting the goal.")
            return GoalResponse.REJECT
        if self.options.has("goal-rejected") or frames - {self.options.global_frame}:
            self.get_logger().error(f"Goal in frame {', '.join(sorted(frames))} was rejected")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle):
        """Begin with a goal: a coroutine of ours, which goes on whenever there is news.

        It is not run by rclpy, which would spend a core on a waiting coroutine. The state of the
        goal is set as `ServerGoalHandle.execute` does, whose other half follows in `_step`.
        """
        handle._update_state(rclpy_implementation.GoalEvent.EXECUTE)
        self._goal = handle
        self._cycles = 0
        self._jobs.append((handle, self._execute(handle)))
        self._step()

    def _step(self):
        """Let every goal look at what is new; hand in the results of those that ended."""
        for handle, job in list(self._jobs):
            try:
                job.send(None)
            except StopIteration as done:
                self._jobs.remove((handle, job))
                result, ending = done.value
                handle._action_server.notify_execute(handle, _finisher(result, ending))
        self._states.clear()

    async def _execute(self, handle):
        """Drive to one pose after the other; the result, and the method that ends the goal."""
        kind = self._kinds[type(handle.request)]
        result, follows = kind.Result(), kind is FollowWaypoints
        poses = _poses_of(handle.request)
        if follows:
            poses = poses[handle.request.goal_index :] * (handle.request.number_of_loops + 1)
        accepted = now = (nanoseconds(poses[0].header.stamp) if poses else 0) or self.now
        ending = "succeed"
        try:
            for index in range(len(poses)):
                try:
                    now = await self._drive(_Leg(handle, accepted, now, index, poses))
                except GoalAbortedError as error:
                    if not follows or self._goal is not handle or self.options.has("goal-aborted"):
                        raise
                    result.missed_waypoints.append(_missed(index, poses[index], error.args))
                    now = self.now
        except GoalAbortedError as error:
            result.error_code, result.error_msg = error.args
            ending = "abort"
        except GoalCanceledError:
            ending = "canceled"
        if self._goal is handle:
            self._goal = None
            if ending != "succeed":
                self._paths.publish(Path())
        self.get_logger().info(f"Goal ended: {ending} {result.error_msg}".rstrip())
        return result, ending

    async def _drive(self, leg):
        """Plan, follow, wait; return the simulated time of arrival [ns]."""
        plan_at = -(-(leg.begin + _MARGIN) // ALIGNMENT) * ALIGNMENT
        pose = leg.poses[leg.index]
        self.get_logger().info(
            f"Begin navigating to ({pose.pose.position.x:.2f}, {pose.pose.position.y:.2f})"
        )
        request = PoseStamped(header=pose.header, pose=pose.pose)
        fill_stamp(request.header.stamp, plan_at)
        self._goals.publish(request)
        while (path := self._plans.pop(plan_at, None)) is None:
            await self._news(leg)
        if not path.poses:
            raise GoalAbortedError(_NO_VALID_PATH, "no valid path found")
        begin = plan_at + _PLANNING
        fill_stamp(path.header.stamp, begin)
        self._paths.publish(path)
        while True:
            await self._news(leg)
            for state in self._states:
                if state["of"] != begin:
                    continue
                self._fail_at_cycle()
                if state["state"] == "reached":
                    return state["stamp"]
                if state["state"] == "blocked":
                    raise GoalAbortedError(_FAILED_TO_MAKE_PROGRESS, "Failed to make progress")
                leg.handle.publish_feedback(self._feedback(leg, state))

    async def _news(self, leg):
        """Wait for anything new; raise when the goal is to end."""
        await _Suspend()
        if leg.handle.is_cancel_requested:
            raise GoalCanceledError
        if self._goal is not leg.handle:
            raise GoalAbortedError(_UNKNOWN, "a newer goal has taken over")

    def _on_plan(self, message):
        self._plans[nanoseconds(message.header.stamp)] = message
        self._step()

    def _on_state(self, message):
        self._states.append(json.loads(message.data))
        self._step()

    def _fail_at_cycle(self):
        options = self.options
        self._cycles += 2
        if self._cycles < options.after:
            return
        if options.has("goal-aborted"):
            raise GoalAbortedError(options.error_code, options.error_msg)
        if options.has("no-server"):
            while self._servers:
                self._servers.pop().destroy()

    def _feedback(self, leg, state):
        """The feedback of the action at hand, as much of it as its distribution has."""
        feedback = self._kinds[type(leg.handle.request)].Feedback()
        if isinstance(feedback, FollowWaypoints.Feedback):
            feedback.current_waypoint = leg.index
            return feedback
        feedback.current_pose.header.frame_id = self.options.global_frame
        fill_stamp(feedback.current_pose.header.stamp, state["stamp"])
        fill_pose(feedback.current_pose.pose, state["pose"])
        fill_stamp(feedback.navigation_time, max(0, state["stamp"] - leg.accepted))
        fill_stamp(
            feedback.estimated_time_remaining, round(state["rest"] / self.options.speed * 1e9)
        )
        feedback.distance_remaining = float(state["rest"])
        if isinstance(feedback, NavigateThroughPoses.Feedback):
            feedback.number_of_poses_remaining = len(leg.poses) - leg.index
        if hasattr(feedback, "waypoint_statuses"):
            feedback.waypoint_statuses = [
                nav2_messages.WaypointStatus(
                    waypoint_status=int(i < leg.index), waypoint_index=i, waypoint_pose=pose
                )
                for i, pose in enumerate(leg.poses)
            ]
        return feedback


def _finisher(result, ending):
    """What rclpy calls to end a goal: sets its last state, returns its result."""

    def finish(handle):
        getattr(handle, ending)()
        return result

    return finish


def _missed(index, pose, error):
    """An entry of `missed_waypoints`, whose type the distribution decides."""
    if hasattr(nav2_messages, "WaypointStatus"):
        entry = nav2_messages.WaypointStatus(waypoint_index=index, waypoint_pose=pose)
        entry.waypoint_status = entry.FAILED
        entry.error_msg = error[1]
    else:
        entry = nav2_messages.MissedWaypoint(index=index, goal=pose)
    entry.error_code = error[0]
    return entry


def _poses_of(goal):
    """The poses of a goal of any of the three actions, of any distribution."""
    if hasattr(goal, "pose"):
        return [goal.pose]
    return list(getattr(goal.poses, "goals", goal.poses))
