"""A stack of a few lines for tests of the relay: deterministic, and awkward where it is told to be.

Run by the python of a ROS 2, with options as words:

stamped, unstamped   a command for every clock, as TwistStamped or as Twist
stale                every fifth answer is not sent before the next clock has come
best-effort          commands are sent best effort
actions              servers of the three actions, a lifecycle node, parameters
words                one for each of these topics that has come: /tf_static, and 500 lines in the
                     log for /flood
"""

import math
import sys
import threading
import time

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav2_msgs.action import FollowWaypoints, NavigateThroughPoses, NavigateToPose
from rclpy.action import ActionServer, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage


class Controller(Node):
    """Answers every clock with a command that depends on how many there were since 100 s."""

    def __init__(self, words):
        super().__init__(f"controller_{'un' if 'unstamped' in words else ''}stamped")
        self._stamped = "unstamped" not in words
        self._stale = "stale" in words
        self._held = None
        self._count = 0
        policy = ReliabilityPolicy
        reliability = policy.BEST_EFFORT if "best-effort" in words else policy.RELIABLE
        kind = TwistStamped if self._stamped else Twist
        profile = QoSProfile(depth=10, reliability=reliability)
        self._publisher = self.create_publisher(kind, "/cmd_vel", profile)
        self.create_subscription(Clock, "/clock", self._hear, 10)

    def _hear(self, clock):
        # The count begins anew where a test begins, whenever the stack came up.
        self._count = 1 if clock.clock.sec % 100 == clock.clock.nanosec == 0 else self._count + 1
        command = TwistStamped()
        command.header.stamp = clock.clock
        command.twist.linear.x = math.sin(self._count)
        if self._held is not None:
            self._publisher.publish(self._held)
            self._held = None
            time.sleep(0.1)
        if self._stale and self._count % 5 == 0:
            self._held = command
            return
        self._publisher.publish(command if self._stamped else command.twist)


class Talker(Node):
    """Says on /words what it has heard, and transforms and lines for the log when told."""

    def __init__(self):
        super().__init__("talker")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._words = self.create_publisher(String, "/words", latched)
        best_effort = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._transforms = self.create_publisher(TFMessage, "/tf", best_effort)
        self.create_subscription(TFMessage, "/tf_static", self._hear_static, latched)
        self.create_subscription(String, "/flood", self._flood, 10)

    def _hear_static(self, message):
        self._words.publish(String(data=message.transforms[0].child_frame_id))

    def _flood(self, message):
        for number in range(500):
            self.get_logger().info(f"{message.data} {number}")
        self._transforms.publish(TFMessage())
        self._words.publish(String(data="done"))


class Navigator(LifecycleNode):
    """Takes goals: rejected beyond 100 m, aborted beyond 50 m, pursued without end below 0.

    An abort takes it out of the active state, or back.
    """

    def __init__(self):
        super().__init__("navigator")
        self.declare_parameter("max_speed", 0.5)
        self.declare_parameter("plugin", "a")
        self.declare_parameter("stateful", True)
        for kind, name in (
            (NavigateToPose, "/navigate_to_pose"),
            (NavigateThroughPoses, "/navigate_through_poses"),
            (FollowWaypoints, "/follow_waypoints"),
        ):
            ActionServer(
                self,
                kind,
                name,
                lambda goal, kind=kind: self._pursue(kind, goal),
                goal_callback=self._judge,
                callback_group=ReentrantCallbackGroup(),
            )
        self.trigger_configure()
        self.trigger_activate()
        self._active = True

    def _judge(self, goal):
        return GoalResponse.REJECT if _poses(goal)[0].pose.position.x > 100 else GoalResponse.ACCEPT

    def _pursue(self, kind, goal):
        poses = _poses(goal.request)
        where = poses[0].pose.position.x
        feedback = kind.Feedback()
        if kind is FollowWaypoints:
            feedback.current_waypoint = 1
        else:
            feedback.distance_remaining = poses[-1].pose.position.y
            feedback.number_of_recoveries = poses[-1].header.stamp.sec
        if kind is NavigateThroughPoses:
            feedback.number_of_poses_remaining = len(poses)
        goal.publish_feedback(feedback)
        result = kind.Result()
        while where < 0:
            time.sleep(0.01)
        if where > 50:
            self.trigger_deactivate() if self._active else self.trigger_activate()
            self._active = not self._active
            result.error_code = 104
            result.error_msg = "beyond the map"
            goal.abort()
        else:
            goal.succeed()
        if kind is FollowWaypoints:
            result.missed_waypoints = [_missed(1), _missed(3)]
        return result


def _poses(goal):
    if hasattr(goal, "pose"):
        return [goal.pose]
    return goal.poses.goals if hasattr(goal.poses, "goals") else goal.poses


def _missed(index):
    import nav2_msgs.msg

    if hasattr(nav2_msgs.msg, "WaypointStatus"):
        status = nav2_msgs.msg.WaypointStatus
        return status(waypoint_index=index, waypoint_status=status.FAILED)
    return nav2_msgs.msg.MissedWaypoint(index=index)


def main(words):
    """Run until killed."""
    rclpy.init(args=[])
    nodes = []
    if "stamped" in words or "unstamped" in words:
        nodes.append(Controller(words))
    if "words" in words:
        nodes.append(Talker())
    if "actions" in words:
        others = MultiThreadedExecutor(4)
        others.add_node(Navigator())
        threading.Thread(target=others.spin, daemon=True).start()
    executor = rclpy.executors.SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    executor.spin()


if __name__ == "__main__":
    main(sys.argv[1:])
