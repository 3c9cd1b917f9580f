"""bt_navigator: the action of Nav2 that drives to a pose, with its genuine type."""

import json

from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import NavigateToPose
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


class Navigator(StandinNode):
    """Takes goals one at a time: a new one ends the old one, as Nav2's action servers do.

    A goal is executed, in the sense of rclpy, when it has ended: so nothing waits in a thread.
    """

    def __init__(self, options):
        super().__init__("bt_navigator", options)
        self._handle, self._begun = None, 0
        self._logs = self.create_publisher(BehaviorTreeLog, "behavior_tree_log", 10)
        self._goals = self.create_publisher(PoseStamped, GOAL, 10)
        self.create_subscription(String, STATE, self._on_state, 100)
        self._server = ActionServer(
            self,
            NavigateToPose,
            "navigate_to_pose",
            lambda _: None,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._begin,
        )

    def _on_goal(self, goal):
        frame = goal.pose.header.frame_id
        if not self.is_active:
            self.get_logger().error("Action server is inactive. Rejecting the goal.")
            return GoalResponse.REJECT
        if self.options.has("goal-rejected") or frame != MAP:
            self.get_logger().error(f"Goal in frame {frame} was rejected")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _begin(self, handle):
        if self._handle is not None:
            self._end("abort", _UNKNOWN, "a newer goal has taken over")
        pose = handle.request.pose
        now = nanoseconds(pose.header.stamp)
        begin = -(-(now + _MARGIN) // ALIGNMENT) * ALIGNMENT + _DELAY
        self._handle, self._begun = handle, begin
        place = pose.pose.position
        self.get_logger().info(f"Begin navigating to ({place.x:.2f}, {place.y:.2f})")
        goal = PoseStamped(pose=pose.pose)
        goal.header.frame_id = MAP
        fill_stamp(goal.header.stamp, begin)
        self._goals.publish(goal)
        self._log("IDLE", "RUNNING")

    def _on_state(self, message):
        state = json.loads(message.data)
        if self._handle is None or state["of"] != self._begun:
            return
        is_due = state["now"] - self._begun >= self.options.after * 1e9
        if is_due and self.options.has("goal-aborted"):
            self._end("abort", self.options.error_code, self.options.error_msg)
        elif is_due and self.options.has("no-server"):
            self.get_logger().warning(FAULT_BEGINS, once=True)
            if self._server is not None:
                self._server.destroy()
                self._server = None
        elif state["done"]:
            self._end("succeed")
        else:
            feedback = NavigateToPose.Feedback(distance_remaining=state["rest"])
            self._handle.publish_feedback(feedback)

    def _log(self, previous, current):
        change = BehaviorTreeStatusChange(
            node_name="FollowPath", previous_status=previous, current_status=current
        )
        self._logs.publish(BehaviorTreeLog(event_log=[change]))

    def _end(self, ending, code=0, text=""):
        """Hand in the result of the current goal; stop, unless the robot has arrived."""
        handle, self._handle = self._handle, None
        if ending != "succeed":
            self._goals.publish(PoseStamped())
        self._log("RUNNING", "SUCCESS" if ending == "succeed" else "FAILURE")
        self.get_logger().info(f"Goal ended: {ending} {text}".rstrip())

        def finish(handle):
            getattr(handle, ending)()
            return NavigateToPose.Result(error_code=code, error_msg=text)

        handle.execute(finish)
