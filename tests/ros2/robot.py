"""A robot and its world on ROS topics, in lock step with whatever drives it.

    <python of a ROS 2 environment> robot.py map.yaml '{"poses": [[2.0, 0.0, 0.0]]}'

A point robot with perfect odometry, a laser that looks into the map, and the clock: enough to try
the stand-in without the simulator. Prints one JSON document: how the goal ended, every command.
The request: `poses` (x, y, yaw), `start`, `action` (navigate_to_pose, navigate_through_poses,
follow_waypoints), `frame` of the goal, `first_clock` [s], `limit` [cycles], `patience` [s].
"""

import json
import math
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import (
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
    Twist,
    TwistStamped,
)
from lifecycle_msgs.srv import GetState
from nav2_msgs import action as actions
from nav2_msgs import msg as nav2_messages
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from standin_nodes.grid import read_map
from standin_nodes.localization import LATCHED, TF_QOS
from standin_nodes.options import NODES
from standin_nodes.poses import (
    compose,
    fill_pose,
    fill_stamp,
    fill_transform,
    from_transform,
    inverse,
    nanoseconds,
)
from tf2_msgs.msg import TFMessage

_PERIOD = 50_000_000
_RAYS = 181
_RANGE = 8.0
_IDLE = 0.02


class Robot(Node):
    """The robot, its laser, and the client of the navigation stack."""

    def __init__(self, grid, request):
        super().__init__("robot")
        self._solid = grid.cells == 100
        self._grid = grid
        self.request = request
        self.start = tuple(request.get("start", (0.0, 0.0, 0.0)))
        self.pose = self.start
        self.time = round(request.get("first_clock", 1.0) * 1e9) - _PERIOD
        self.velocity = (0.0, 0.0)
        self.commands = []
        self.answered = -1
        self.located = False
        self.feedback = []
        self.outcome = {}
        self._clock_publisher = self.create_publisher(Clock, "/clock", 10)
        self._transforms = self.create_publisher(TFMessage, "/tf", TF_QOS)
        self._fixed = self.create_publisher(TFMessage, "/tf_static", LATCHED)
        self._odometry = self.create_publisher(Odometry, "odom", qos_profile_sensor_data)
        self._scans = self.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self._initial = self.create_publisher(PoseWithCovarianceStamped, "initialpose", 10)
        self.create_subscription(TFMessage, "/tf", self._on_transforms, TF_QOS)
        kind = TwistStamped if hasattr(nav2_messages, "WaypointStatus") else Twist
        self.create_subscription(kind, "cmd_vel", self._on_command, QoSProfile(depth=100))
        name = request.get("action", "navigate_to_pose")
        self._kind = getattr(actions, "".join(word.capitalize() for word in name.split("_")))
        self.client = ActionClient(self, self._kind, name)
        self.states = {name: self.create_client(GetState, f"{name}/get_state") for name in NODES}
        laser = TransformStamped()
        laser.header.frame_id, laser.child_frame_id = "base_link", "laser"
        fill_transform(laser.transform, (0.0, 0.0, 0.0))
        self._fixed.publish(TFMessage(transforms=[laser]))

    def _on_transforms(self, message):
        for each in message.transforms:
            if each.child_frame_id == "odom" and each.header.frame_id == "map":
                self.located = True
                self.estimate = compose(from_transform(each.transform), self.odometry())

    def _on_command(self, message):
        stamp = self.time
        if hasattr(message, "header"):
            stamp, message = nanoseconds(message.header.stamp), message.twist
        self.answered = max(self.answered, stamp)
        self.velocity = (message.linear.x, message.angular.z)
        self.commands.append((stamp, *self.velocity))

    def odometry(self):
        """Pose of the robot in odom, which is where it began."""
        return compose(inverse(self.start), self.pose)

    def advance(self):
        """Move for one period and publish what is new, the clock last."""
        middle = self.pose[2] + self.velocity[1] * 0.025
        step = self.velocity[0] * 0.05
        self.pose = (
            self.pose[0] + step * math.cos(middle),
            self.pose[1] + step * math.sin(middle),
            self.pose[2] + self.velocity[1] * 0.05,
        )
        self.time += _PERIOD
        transform = TransformStamped()
        transform.header.frame_id, transform.child_frame_id = "odom", "base_link"
        fill_stamp(transform.header.stamp, self.time)
        fill_transform(transform.transform, self.odometry())
        self._transforms.publish(TFMessage(transforms=[transform]))
        odometry = Odometry(header=transform.header, child_frame_id="base_link")
        fill_pose(odometry.pose.pose, self.odometry())
        self._odometry.publish(odometry)
        if self.time % 100_000_000 == 0:
            self._scans.publish(self._scan())
        clock = Clock()
        fill_stamp(clock.clock, self.time)
        self._clock_publisher.publish(clock)

    def _scan(self):
        """What a laser at the robot's centre sees of the map's occupied cells."""
        scan = LaserScan(angle_min=-math.pi, angle_increment=math.tau / (_RAYS - 1))
        scan.header.frame_id = "laser"
        fill_stamp(scan.header.stamp, self.time)
        scan.angle_max, scan.range_min, scan.range_max = math.pi, 0.05, _RANGE
        angles = scan.angle_min + scan.angle_increment * np.arange(_RAYS) + self.pose[2]
        along = np.arange(0.0, _RANGE, self._grid.resolution / 2)
        column = self.pose[0] + np.outer(np.cos(angles), along) - self._grid.x
        row = self.pose[1] + np.outer(np.sin(angles), along) - self._grid.y
        column = np.clip(column / self._grid.resolution, 0, self._solid.shape[1] - 1).astype(int)
        row = np.clip(row / self._grid.resolution, 0, self._solid.shape[0] - 1).astype(int)
        hit = self._solid[row, column]
        ranges = np.where(hit.any(axis=1), along[hit.argmax(axis=1)], np.inf)
        scan.ranges = ranges.astype(np.float32).tolist()
        return scan

    def tell_start(self):
        """Publish the initial pose."""
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        fill_stamp(message.header.stamp, self.time)
        fill_pose(message.pose.pose, self.start)
        self._initial.publish(message)

    def send_goal(self):
        """Send the goal of the request; what comes of it goes into `outcome`."""
        goal = self._kind.Goal()
        poses = []
        for pose in self.request["poses"]:
            message = PoseStamped()
            message.header.frame_id = self.request.get("frame", "map")
            fill_stamp(message.header.stamp, self.time)
            fill_pose(message.pose, pose)
            poses.append(message)
        if hasattr(goal, "pose"):
            goal.pose = poses[0]
        elif hasattr(goal.poses, "goals"):
            goal.poses.goals = poses
        else:
            goal.poses = poses
        future = self.client.send_goal_async(goal, feedback_callback=self._on_feedback)
        future.add_done_callback(self._on_answer)

    def _on_feedback(self, message):
        names = ("distance_remaining", "number_of_poses_remaining", "current_waypoint")
        given = {n: getattr(message.feedback, n) for n in names if hasattr(message.feedback, n)}
        self.feedback.append(given)

    def _on_answer(self, future):
        handle = future.result()
        if not handle.accepted:
            self.outcome = {"status": "rejected"}
            return
        handle.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, future):
        answer = future.result()
        self.outcome = {
            "status": answer.status,
            "error_code": answer.result.error_code,
            "error_msg": answer.result.error_msg,
        }


def main(arguments):
    """Bring the stack up, drive one goal in lock step, print what happened."""
    request = json.loads(arguments[1])
    rclpy.init()
    robot = Robot(read_map(Path(arguments[0])), request)
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(robot)
    if not _bring_up(robot, executor):
        print(json.dumps({"status": "never ready"}))
        return 0
    while robot.time % 5_000_000_000:
        robot.advance()
        executor.spin_once(timeout_sec=0)
    robot.send_goal()
    late, taken = 0, []
    for _ in range(request.get("limit", 4000)):
        robot.advance()
        begin = time.monotonic()
        # A stack is silent until it drives, and between the poses of a goal.
        expected = robot.answered >= robot.time - _PERIOD
        limit = begin + (request.get("patience", 2.0) if expected else _IDLE)
        while time.monotonic() < limit and not robot.outcome and robot.answered < robot.time:
            executor.spin_once(timeout_sec=max(0.0, limit - time.monotonic()))
        if robot.outcome:
            break
        if expected:
            late += robot.answered < robot.time
            taken.append(time.monotonic() - begin)
    print(
        json.dumps(
            {
                **(robot.outcome or {"status": "unfinished"}),
                "pose": robot.pose,
                "estimate": getattr(robot, "estimate", None),
                "late": late,
                "cycles": len(taken),
                "latency": float(np.median(taken)) if taken else None,
                "feedback": [robot.feedback[0], robot.feedback[-1]] if robot.feedback else [],
                "commands": robot.commands,
            }
        )
    )
    return 0


def _bring_up(robot, executor):
    """Let the clock run until all nodes are active and the robot is located."""
    end = time.monotonic() + robot.request.get("start_up", 60.0)
    asked = {}
    active = set()
    while time.monotonic() < end:
        robot.advance()
        pause = time.monotonic() + 0.05
        while time.monotonic() < pause:
            executor.spin_once(timeout_sec=max(0.0, pause - time.monotonic()))
        if not robot.located and robot.time % 1_000_000_000 == 0:
            robot.tell_start()
        for name, client in robot.states.items():
            if name in asked and asked[name].done():
                if asked.pop(name).result().current_state.label == "active":
                    active.add(name)
            elif name not in active and name not in asked and client.service_is_ready():
                asked[name] = client.call_async(GetState.Request())
        if active == set(NODES) and robot.located and robot.client.server_is_ready():
            return True
    return False


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
