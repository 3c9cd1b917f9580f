"""controller_server: follows a path with 20 Hz of simulated time; and planner_server."""

import itertools
import json
import math
import time
from collections import deque

from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav2_msgs import msg as nav2_messages
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from standin_nodes.buffer import Sensed
from standin_nodes.grid import Planner, from_message
from standin_nodes.lifecycle import LifecycleNode
from standin_nodes.localization import LATCHED, TF_QOS, TF_STATIC_TOPIC, TF_TOPIC
from standin_nodes.poses import (
    compose,
    fill_pose,
    fill_stamp,
    from_pose,
    inverse,
    nanoseconds,
    wrap,
)
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

CLOCK_QOS = QoSProfile(depth=1000)
"""Every tick of the clock counts, so none may be dropped while another is worked on."""

ALIGNMENT = 500_000_000
"""Goals begin and end at multiples of this [ns], so that runs do not depend on how long a message
takes from process to process."""

_STANDING = 500_000_000
"""Time [ns] for which a robot is told to stand before it drives: who waits for nothing until the
first command has heard it by then, so that the first one that moves is not applied late."""

_PATIENCE = 0.5
"""Wall time [s] that a tick waits for the data of its instant."""
_POSITION_TOLERANCE = 0.12
_YAW_TOLERANCE = 0.25
_HALF_WIDTH = 0.22
_FRONT = 0.3
"""Of what has to be free ahead of the robot's centre [m]."""
_BEFORE_RECOVERY = 3_000_000_000
_ACCELERATION = 1.0
_LOOKAHEAD = 0.3


class SensingNode(LifecycleNode):
    """A lifecycle node that listens to transforms and scans."""

    def __init__(self, name, options):
        super().__init__(name, options)
        self.sensed = Sensed(options)
        self.create_subscription(TFMessage, TF_TOPIC, self._on_transforms, TF_QOS)
        self.create_subscription(TFMessage, TF_STATIC_TOPIC, self._on_transforms, LATCHED)
        self.create_subscription(LaserScan, "scan", self._on_scan, qos_profile_sensor_data)

    def on_deactivate(self):
        """Forget where the robot was."""
        self.sensed = Sensed(self.options)

    def on_sensed(self):
        """Something new is known."""

    def _on_transforms(self, message):
        self.sensed.on_transforms(message)
        self.on_sensed()

    def _on_scan(self, message):
        self.sensed.on_scan(message)
        self.on_sensed()


class PlannerServer(SensingNode):
    """Answers a goal on `planner_server/goal` with a path on `planner_server/path`.

    The path begins where the robot was at the stamp of the goal, and is empty if there is none.
    """

    def __init__(self, options):
        super().__init__("planner_server", options)
        self._planner = None
        self._first_clock = None
        self._goal = None
        self._answers = self.create_publisher(Path, "planner_server/path", 10)
        self._paths = self.create_publisher(Path, "plan", 10)
        self.create_subscription(OccupancyGrid, "map", self._on_map, LATCHED)
        self.create_subscription(Clock, "/clock", self._on_clock, 10)
        self.create_subscription(PoseStamped, "planner_server/goal", self._on_goal, 10)

    async def on_activate(self):
        """Wait until the robot is on the map, as the global costmap of Nav2 does."""
        if self.options.has("clock-start") and (self._first_clock or 0) >= 100_000_000_000:
            self.get_logger().error("Timed out waiting for transform from base_link to map")
            return False
        while not (self.sensed.connected and self._planner):
            self.get_logger().info(
                "Timed out waiting for transform from"
                f" {self.options.base_frame} to {self.options.global_frame} to become available",
                throttle_duration_sec=1.0,
            )
            await self.pause(0.1)
        return True

    def _on_map(self, message):
        self._planner = Planner(from_message(message), self.options.radius)

    def _on_clock(self, message):
        if self._first_clock is None:
            self._first_clock = nanoseconds(message.clock)
        # What the stamp of the goal calls for comes before its clock, or soon after it.
        if self._goal and nanoseconds(message.clock) > nanoseconds(self._goal.header.stamp):
            self.on_sensed(patient=False)

    def _on_goal(self, message):
        self._goal = message
        self.on_sensed()

    def on_sensed(self, *, patient=True):
        """Plan as soon as it is known where the robot is at the stamp of the goal."""
        if self._goal is None or self._planner is None or not self.active:
            return
        goal, stamp = self._goal, nanoseconds(self._goal.header.stamp)
        start = self.sensed.pose(stamp)
        if patient and not (self.sensed.complete(stamp) and self.sensed.reaches(stamp)):
            return
        self._goal = None
        points = self._planner.plan(start, from_pose(goal.pose)) if start else None
        path = Path(header=goal.header)
        for i, (x, y) in enumerate(points or ()):
            after = points[min(i + 1, len(points) - 1)]
            last = i == len(points) - 1
            yaw = from_pose(goal.pose)[2] if last else math.atan2(after[1] - y, after[0] - x)
            pose = PoseStamped(header=path.header)
            fill_pose(pose.pose, (x, y, yaw))
            path.poses.append(pose)
        if points:
            self._paths.publish(path)
        else:
            self.get_logger().warning("Failed to create a plan: no valid path found")
        self._answers.publish(path)


class ControllerServer(SensingNode):
    """Pure pursuit with turns on the spot; every tick uses what was stamped up to its instant.

    The path comes on `controller_server/path`: it is followed from its stamp on, an empty one
    stops. What becomes of it is told on `controller_server/state` as JSON.
    """

    def __init__(self, options):
        super().__init__("controller_server", options)
        stamped = options.stamped
        if stamped == "auto":
            # From Kilted on commands are stamped unless a parameter says otherwise.
            stamped = str(hasattr(nav2_messages, "WaypointStatus"))
        self._stamped = stamped.lower() == "true"
        kind = TwistStamped if self._stamped else Twist
        self._commands = self.create_publisher(kind, "cmd_vel", 10)
        self._states = self.create_publisher(String, "controller_server/state", 100)
        self.create_subscription(Path, "controller_server/path", self._on_path, 10)
        self.create_subscription(Odometry, "odom", lambda _: None, qos_profile_sensor_data)
        self.create_subscription(Clock, "/clock", self._on_clock, CLOCK_QOS)
        self.create_timer(0.05, self.on_sensed, clock=self.wall)
        self._period = round(options.period * 1e9)
        self._ticks = deque()
        self._last_clock = 0
        self._path = []
        self._begin = 0
        self._closest = 0
        self._speed = 0.0
        self._turn_rate = 0.0
        self._there = False
        self._moved_at = self._free_at = 0
        self._outcome = ""
        self.cycles = 0

    def on_deactivate(self):
        """Forget the path too."""
        super().on_deactivate()
        self._path, self._outcome = [], ""

    def _on_path(self, message):
        self._path = [from_pose(each.pose) for each in message.poses]
        self._begin = self._moved_at = nanoseconds(message.header.stamp)
        self._closest, self._outcome, self._there = 0, "", False
        if not self._path and self._speed + abs(self._turn_rate) > 0:
            self._publish(self._last_clock, 0.0, 0.0)

    def _on_clock(self, message):
        now = nanoseconds(message.clock)
        due = now // self._period != self._last_clock // self._period
        self._last_clock = now
        if due and self.active and self._path and now >= self._begin:
            self._ticks.append((now, time.monotonic() + _PATIENCE))
            self.on_sensed()

    def on_sensed(self):
        """Work on the ticks whose data is there, or has been waited for long enough."""
        while self._ticks:
            now, deadline = self._ticks[0]
            if not self.sensed.complete(now) and time.monotonic() < deadline:
                return
            self._ticks.popleft()
            if self._path:
                self._tick(now)

    def _tick(self, now):
        pose = self.sensed.pose(now)
        if pose is None:
            return
        self._fail_at_cycle()
        speed, turn_rate = self._follow(now, pose) if not self._outcome else (0.0, 0.0)
        self._publish(now, speed, turn_rate)
        if self._outcome and now % ALIGNMENT == 0:
            self._path = []
            self._tell(now, pose, self._outcome)
        elif self.cycles % 2 == 0:
            self._tell(now, pose, "following")

    def _follow(self, now, pose):
        """Velocities of a tick; sets the outcome when the path ends or nothing moves."""
        if now < self._begin + _STANDING:
            self._moved_at = self._free_at = now
            return 0.0, 0.0
        if now - self._moved_at > self.options.blocked_for * 1e9:
            self._outcome = "blocked"
            return 0.0, 0.0
        goal = self._path[-1]
        rest = math.hypot(goal[0] - pose[0], goal[1] - pose[1])
        if rest < _POSITION_TOLERANCE and self._closest >= len(self._path) - 8:
            # Kept while turning, as Nav2's stateful goal checker does: the turn may move the robot.
            self._there = True
        if self._there:
            off = wrap(goal[2] - pose[2])
            if abs(off) < _YAW_TOLERANCE:
                self._outcome = "reached"
                return 0.0, 0.0
            return self._limited(now, 0.0, 2.0 * off)
        target = self._target(pose)
        bearing = math.atan2(target[1], target[0])
        if abs(bearing) > 0.7:
            return self._limited(now, 0.0, 2.0 * bearing)
        curvature = 2.0 * target[1] / max(0.01, target[0] ** 2 + target[1] ** 2)
        speed = self.options.speed * max(0.2, 1.0 - abs(bearing))
        speed = min(speed, 0.1 + 0.8 * rest)
        room = self.sensed.room_ahead(now, _HALF_WIDTH) - _FRONT
        if room > 0.0:
            self._free_at = now
        elif now - self._free_at > _BEFORE_RECOVERY:
            # Back up for a second, then try again, as Nav2's behaviours do.
            if now - self._free_at > _BEFORE_RECOVERY + 1_000_000_000:
                self._free_at = now
            return -0.15, 0.0
        speed = max(0.0, min(speed, math.sqrt(max(0.0, room))))
        return self._limited(now, speed, speed * curvature)

    def _target(self, pose):
        """The point to drive to, in the frame of the robot."""
        ahead = range(self._closest, min(self._closest + 10, len(self._path)))
        self._closest = min(
            ahead,
            key=lambda i: math.hypot(self._path[i][0] - pose[0], self._path[i][1] - pose[1]),
        )
        for point in self._path[self._closest :]:
            target = compose(inverse(pose), point)
            if math.hypot(target[0], target[1]) >= _LOOKAHEAD:
                break
        return target

    def _limited(self, now, speed, turn_rate):
        change = _ACCELERATION * self.options.period
        speed = min(speed, max(0.0, self._speed) + change)
        limit = self.options.turn_rate
        turn_rate = max(-limit, min(limit, turn_rate))
        if speed > 0.01 or abs(turn_rate) > 0.05:
            self._moved_at = now
        return speed, turn_rate

    def _publish(self, now, speed, turn_rate):
        self._speed, self._turn_rate = speed, turn_rate
        twist = Twist()
        twist.linear.x, twist.angular.z = float(speed), float(turn_rate)
        if self._stamped:
            message = TwistStamped(twist=twist)
            message.header.frame_id = self.options.base_frame
            fill_stamp(message.header.stamp, now)
            self._commands.publish(message)
        else:
            self._commands.publish(twist)
        self.cycles += 1

    def _tell(self, now, pose, state):
        ahead = [pose, *self._path[self._closest :]]
        rest = sum(math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(ahead))
        word = {"stamp": now, "of": self._begin, "state": state, "rest": rest, "pose": pose}
        self._states.publish(String(data=json.dumps(word)))

    def _fail_at_cycle(self):
        options = self.options
        if options.has("late") and self.cycles % options.every == options.every - 1:
            time.sleep(options.seconds)
        if self.cycles != options.after:
            return
        if options.has("crash"):
            options.end_process()
        while options.has("hang"):
            time.sleep(1.0)
