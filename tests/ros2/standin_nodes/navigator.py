"""bt_navigator: the actions of Nav2 with their genuine types."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import FollowWaypoints, NavigateThroughPoses, NavigateToPose
from nav2_msgs.msg import BehaviorTreeLog, BehaviorTreeStatusChange
from rclpy.action import ActionServer, GoalResponse
from standin_nodes.driving import ALIGNMENT, GOAL, MAP, STATE
from standin_nodes.lifecycle import StandinNode
from standin_nodes.options import FAULT_BEGINS
from standin_nodes.poses import fill_stamp, nanoseconds
from std_msgs.msg import String

_MARGIN = 200_000_000
"""A goal this close [ns] before a multiple of the alignment waits for the next one."""
_DELAY = 1_000_000_000
"""From a goal to its begin [ns]: enough for the controller to hear of it on a busy machine."""
_UNKNOWN = 9000


@dataclass
class _Task:
    """A goal under way: its action, its poses, when it began and the current leg did [ns]."""

    kind: Any
    handle: Any
    poses: list[PoseStamped]
    first: int = 0
    begin: int = 0
    index: int = 0


class Navigator(StandinNode):
    """Takes goals one at a time: a new one ends the old one, as Nav2's action servers do.

    A goal is executed, in the sense of rclpy, when it has ended: so nothing waits in a thread.
    """

    def __init__(self, options):
        super().__init__("bt_navigator", options)
        self._task = None
        self._logs = self.create_publisher(BehaviorTreeLog, "behavior_tree_log", 10)
        self._goals = self.create_publisher(PoseStamped, GOAL, 10)
        self.create_subscription(String, STATE, self._on_state, 100)
        self._servers = [
            ActionServer(
                self,
                kind,
                name,
                lambda _: None,
                goal_callback=self._on_goal,
                handle_accepted_callback=lambda handle, kind=kind: self._begin(kind, handle),
            )
            for name, kind in (
                ("navigate_to_pose", NavigateToPose),
                ("navigate_through_poses", NavigateThroughPoses),
                ("follow_waypoints", FollowWaypoints),
            )
        ]

    def _on_goal(self, goal):
        frames = {pose.header.frame_id for pose in _poses_of(goal)}
        if not self.is_active:
            self.get_logger().error("Action server is inactive. Rejecting the goal.")
            return GoalResponse.REJECT
        if self.options.has("goal-rejected") or frames != {MAP}:
            self.get_logger().error(f"Goal in frame {', '.join(sorted(frames))} was rejected")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _begin(self, kind, handle):
        if self._task is not None:
            self._end("abort", _UNKNOWN, "a newer goal has taken over")
        self._task = _Task(kind, handle, _poses_of(handle.request))
        self._drive(nanoseconds(self._task.poses[0].header.stamp))
        self._task.first = self._task.begin
        self._log("IDLE", "RUNNING")

    def _drive(self, now):
        """Let the robot drive to the current pose, from the next round time on."""
        task = self._task
        task.begin = -(-(now + _MARGIN) // ALIGNMENT) * ALIGNMENT + _DELAY
        pose = task.poses[task.index]
        place = pose.pose.position
        self.get_logger().info(f"Begin navigating to ({place.x:.2f}, {place.y:.2f})")
        goal = PoseStamped(pose=pose.pose)
        goal.header.frame_id = MAP
        fill_stamp(goal.header.stamp, task.begin)
        self._goals.publish(goal)

    def _on_state(self, message):
        state, task = json.loads(message.data), self._task
        if task is None or state["of"] != task.begin:
            return
        is_due = state["now"] - task.first >= self.options.after * 1e9
        if is_due and self.options.has("goal-aborted"):
            self._end("abort", self.options.error_code, self.options.error_msg)
        elif is_due and self.options.has("no-server"):
            self.get_logger().warning(FAULT_BEGINS, once=True)
            while self._servers:
                self._servers.pop().destroy()
        elif not state["done"]:
            task.handle.publish_feedback(_feedback(task, state["rest"]))
        elif task.index + 1 < len(task.poses):
            task.index += 1
            self._drive(state["now"])
        else:
            self._end("succeed")

    def _log(self, previous, current):
        change = BehaviorTreeStatusChange(
            node_name="FollowPath", previous_status=previous, current_status=current
        )
        self._logs.publish(BehaviorTreeLog(event_log=[change]))

    def _end(self, ending, code=0, text=""):
        """Hand in the result of the current goal; stop, unless the robot has arrived."""
        task, self._task = self._task, None
        if ending != "succeed":
            self._goals.publish(PoseStamped())
        self._log("RUNNING", "SUCCESS" if ending == "succeed" else "FAILURE")
        self.get_logger().info(f"Goal ended: {ending} {text}".rstrip())

        def finish(handle):
            getattr(handle, ending)()
            return task.kind.Result(error_code=code, error_msg=text)

        task.handle.execute(finish)


def _feedback(task, rest):
    """Return the feedback of the action at hand; ``rest`` is the way to the current pose [m]."""
    feedback = task.kind.Feedback()
    if isinstance(feedback, FollowWaypoints.Feedback):
        feedback.current_waypoint = task.index
        return feedback
    feedback.distance_remaining = rest
    if isinstance(feedback, NavigateThroughPoses.Feedback):
        feedback.number_of_poses_remaining = len(task.poses) - task.index
    return feedback


def _poses_of(goal):
    """Return the poses of a goal of any of the three actions, of any distribution."""
    if hasattr(goal, "pose"):
        return [goal.pose]
    return list(getattr(goal.poses, "goals", goal.poses))
