"""The nodes that know where the robot is and drive it straight to its goal."""

import json
import math
import threading
from collections import deque

from geometry_msgs.msg import (
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
    Twist,
    TwistStamped,
)
from nav2_msgs import msg as nav2_messages
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from standin_nodes.lifecycle import StandinNode
from standin_nodes.poses import (
    compose,
    fill_pose,
    fill_stamp,
    fill_transform,
    from_pose,
    from_transform,
    inverse,
    nanoseconds,
    wrap,
)
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

MAP, ODOM, BASE = "map", "odom", "base_link"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TF_QOS = QoSProfile(depth=100)
CLOCK_QOS = QoSProfile(depth=1000)
"""Every tick of the clock counts, so none may be dropped while another is worked on."""

GOAL, STATE = "bt_navigator/goal", "controller_server/state"
"""Topics between the nodes: a pose with the time to begin (none stops), and JSON."""
ALIGNMENT = 500_000_000
"""Goals begin and end at multiples of this [ns], so that runs do not depend on how long a message
takes from process to process."""

_FUTURE = 1_000_000_000
"""amcl stamps its transform this far ahead [ns] (`transform_tolerance` of Nav2)."""
_STANDING = 500_000_000
"""Time [ns] for which a robot is told to stand before it drives: a client that waits for nothing
until the first command has heard it by then."""
_LAG = 100_000_000
"""Age [ns] of the odometry that a command depends on: a tick waits until it has come."""
_POSITION_TOLERANCE, _YAW_TOLERANCE = 0.12, 0.25
_SPEED, _TURN_RATE = 0.5, 1.0
_ACCELERATION_PER_TICK = 0.05


class LocatedNode(StandinNode):
    """A node that listens to tf for where the robot is."""

    def __init__(self, name, options):
        super().__init__(name, options)
        self.odometry = deque(maxlen=50)
        self.correction = None
        self.is_located = threading.Event()
        self.create_subscription(TFMessage, "/tf", self._on_transforms, TF_QOS)

    def _on_transforms(self, message):
        for each in message.transforms:
            link = (each.header.frame_id, each.child_frame_id)
            if link == (ODOM, BASE):
                stamp = nanoseconds(each.header.stamp)
                self.odometry.append((stamp, from_transform(each.transform)))
                self.on_odometry()
            elif link == (MAP, ODOM):
                self.correction = from_transform(each.transform)
                self.is_located.set()

    def on_odometry(self):
        """Use what is new."""

    def pose(self, now):
        """Return the pose of the robot in the map at a time [ns], None when it is unknown."""
        known = [pose for stamp, pose in self.odometry if stamp <= now]
        return compose(self.correction, known[-1]) if known and self.correction else None


class Localization(LocatedNode):
    """amcl: a map->odom that follows from the initial pose, with every scan."""

    def __init__(self, options):
        super().__init__("amcl", options)
        self._initial = None
        self._transforms = self.create_publisher(TFMessage, "/tf", TF_QOS)
        self._poses = self.create_publisher(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
        self.create_subscription(LaserScan, "scan", self._on_scan, qos_profile_sensor_data)
        self.create_subscription(
            PoseWithCovarianceStamped, "initialpose", self._on_initial_pose, 10
        )

    def _on_initial_pose(self, message):
        pose = from_pose(message.pose.pose)
        if self.odometry and pose != self._initial:
            self.get_logger().info(f"Setting pose: {pose[0]:.3f} {pose[1]:.3f} {pose[2]:.3f}")
            self._initial = pose
            self._found = compose(pose, inverse(self.odometry[-1][1]))

    def _on_scan(self, scan):
        if self._initial is None or not self.is_active:
            return
        stamp = nanoseconds(scan.header.stamp)
        message = TransformStamped(child_frame_id=ODOM)
        message.header.frame_id = MAP
        fill_stamp(message.header.stamp, stamp + _FUTURE)
        fill_transform(message.transform, self._found)
        self._transforms.publish(TFMessage(transforms=[message]))
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id, pose.header.stamp = MAP, scan.header.stamp
        fill_pose(pose.pose.pose, compose(self._found, self.odometry[-1][1]))
        pose.pose.covariance[0] = pose.pose.covariance[7] = 0.01
        pose.pose.covariance[35] = 0.005
        self._poses.publish(pose)


class PlannerServer(LocatedNode):
    """The straight line to a goal on `plan`, and a costmap without obstacles."""

    def __init__(self, options):
        super().__init__("planner_server", options)
        self._paths = self.create_publisher(Path, "plan", 10)
        self._costmaps = self.create_publisher(OccupancyGrid, "global_costmap/costmap", LATCHED)
        self.create_subscription(PoseStamped, GOAL, self._on_goal, 10)

    def on_activate(self, state):
        """Wait until the robot is on the map, as the global costmap of Nav2 does."""
        while not self.is_located.wait(1.0) and self.context.ok():
            self.get_logger().info(
                f"Timed out waiting for transform from {BASE} to {MAP} to"
                " become available, tf error: frame does not exist"
            )
        costmap = OccupancyGrid(data=[0] * 400)
        costmap.header.frame_id = MAP
        costmap.info.width = costmap.info.height = 20
        costmap.info.resolution = 0.5
        costmap.info.origin.position.x = costmap.info.origin.position.y = -5.0
        self._costmaps.publish(costmap)
        return super().on_activate(state)

    def _on_goal(self, goal):
        start = self.pose(nanoseconds(goal.header.stamp))
        if start is None or not goal.header.frame_id:
            return
        end = from_pose(goal.pose)
        dx, dy = end[0] - start[0], end[1] - start[1]
        count = max(1, round(math.hypot(dx, dy) / 0.1))
        path = Path(header=goal.header)
        for share in (index / count for index in range(count + 1)):
            path.poses.append(PoseStamped(header=goal.header))
            point = (start[0] + share * dx, start[1] + share * dy, math.atan2(dy, dx))
            fill_pose(path.poses[-1].pose, end if share == 1.0 else point)
        self._paths.publish(path)


class ControllerServer(LocatedNode):
    """A turn on the spot, the way, the last turn; a command for every tick of the clock.

    A command depends on stamps and contents of messages alone, so runs repeat.
    """

    def __init__(self, options):
        super().__init__("controller_server", options)
        # Kilted has the message, and commands with a stamp.
        self._stamped = hasattr(nav2_messages, "WaypointStatus")
        self._goal = None
        self._begin = 0
        self._speed = 0.0
        self._arrived = self._done = False
        self._ticks = deque()
        kind = TwistStamped if self._stamped else Twist
        self._commands = self.create_publisher(kind, "cmd_vel", 10)
        self._states = self.create_publisher(String, STATE, 100)
        self.create_subscription(PoseStamped, GOAL, self._on_goal, 10)
        self.create_subscription(Clock, "/clock", self._on_clock, CLOCK_QOS)

    def _on_goal(self, goal):
        self._goal = from_pose(goal.pose) if goal.header.frame_id else None
        self._begin = nanoseconds(goal.header.stamp)
        self._arrived = self._done = False

    def _on_clock(self, clock):
        self._ticks.append(nanoseconds(clock.clock))
        self.on_odometry()

    def on_odometry(self):
        """Answer the ticks for which the odometry has come."""
        while self._ticks and self.odometry and self.odometry[-1][0] >= self._ticks[0] - _LAG:
            self._answer(self._ticks.popleft())

    def _answer(self, now):
        pose = self.pose(now - _LAG)
        if self._goal is None or now < self._begin or pose is None or not self.is_active:
            return
        x, y, _ = compose(inverse(pose), self._goal)
        speed, turn_rate = self._follow(now, math.hypot(x, y), math.atan2(y, x), pose[2])
        self._publish(now, speed, turn_rate)
        is_end = self._done and now % ALIGNMENT == 0
        state = {"of": self._begin, "now": now, "done": is_end, "rest": math.hypot(x, y)}
        self._states.publish(String(data=json.dumps(state)))
        if is_end:
            self._goal = None

    def _follow(self, now, rest, bearing, yaw):
        """Return the velocities of a tick."""
        if now < self._begin + _STANDING or self._done:
            return 0.0, 0.0
        # Kept while turning, as Nav2's stateful goal checker does: the turn may move the robot.
        self._arrived = self._arrived or rest < _POSITION_TOLERANCE
        if self._arrived:
            off = wrap(self._goal[2] - yaw)
            self._done = abs(off) < _YAW_TOLERANCE
            return 0.0, 0.0 if self._done else self._limit(2.0 * off)
        if abs(bearing) > 0.7:
            return 0.0, self._limit(2.0 * bearing)
        speed = min(_SPEED, 0.1 + 0.8 * rest, self._speed + _ACCELERATION_PER_TICK)
        return speed, self._limit(2.0 * bearing)

    def _limit(self, turn_rate):
        return max(-_TURN_RATE, min(_TURN_RATE, turn_rate))

    def _publish(self, now, speed, turn_rate):
        self._speed = speed
        twist = Twist()
        twist.linear.x, twist.angular.z = float(speed), float(turn_rate)
        if not self._stamped:
            self._commands.publish(twist)
            return
        message = TwistStamped(twist=twist)
        message.header.frame_id = BASE
        fill_stamp(message.header.stamp, now)
        self._commands.publish(message)
